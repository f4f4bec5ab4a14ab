"""The job type for Flamenco, in a JavaScript engine with the manager's documented functions."""

from __future__ import annotations

import json

import pytest
from conftest import ROOT

from rosy_addon.worker.frame_workers import parse_frames

quickjs = pytest.importorskip("quickjs")

#: The functions that the manager offers to scripts, after its manual.
MANAGER = """
const author = {
    Task: (name, type) => ({name, type, commands: [], addCommand(c) { this.commands.push(c); }}),
    Command: (name, parameters) => ({name, parameters}),
};
function frameChunker(frames, size) {
    const all = [];
    for (const part of frames.split(",")) {
        const [first, last] = part.trim().split("-").map(Number);
        for (let frame = first; frame <= (last === undefined ? first : last); frame++) all.push(frame);
    }
    const chunks = [];
    for (let start = 0; start < all.length; start += size) {
        const some = all.slice(start, start + size);
        const whole = some[some.length - 1] - some[0] === some.length - 1;
        chunks.push(some.length > 1 && whole ? `${some[0]}-${some[some.length - 1]}` : some.join(","));
    }
    return chunks;
}
const tasks = [];
function compiled(settings) {
    compileJob({settings, addTask(task) { tasks.push(task); }});
    return JSON.stringify(tasks);
}
"""

DEFAULTS = {"folder": "/out", "blendfile": "/a b/scene.blend", "preset": "", "cameras": ""}


def compiled_tasks(**settings):
    engine = quickjs.Context()
    script = (ROOT / "farm" / "flamenco" / "rosy_bake.js").read_text()
    engine.eval(MANAGER + script.replace("const JOB_TYPE", "var JOB_TYPE"))
    return json.loads(engine.eval(f"compiled({json.dumps({**DEFAULTS, **settings})})"))


def command_args(tasks):
    for task in tasks:
        assert task["type"] == "blender" and len(task["commands"]) == 1
        (command,) = task["commands"]
        assert command["name"] == "exec" and command["parameters"]["exe"] == "{blender}"
        yield command["parameters"]["args"]


def test_each_chunk_is_one_command():
    args = list(command_args(compiled_tasks(frames="1-25", chunk_size=10)))
    start = ["-b", "/a b/scene.blend", "--command", "rosy", "bake", "--out", "/out"]
    assert args == [[*start, f"--frames={chunk}"] for chunk in ("1-10", "11-20", "21-25")]


def test_each_camera_has_its_own_sequence():
    tasks = compiled_tasks(frames="3, 5-8", chunk_size=3, cameras="Close, -Far ", preset="plaid")
    args = list(command_args(tasks))
    assert [each[-2:] for each in args] == [
        [f"--camera={name}", "--preset=plaid"] for name in ("Close", "Close", "-Far", "-Far")
    ]
    assert [each[7] for each in args] == ["--frames=3,5,6", "--frames=7-8"] * 2
    assert [task["name"] for task in tasks] == [
        "Close 3,5,6", "Close 7-8", "-Far 3,5,6", "-Far 7-8",
    ]  # fmt: skip
    # The command line accepts the frames in the form that the manager writes.
    assert list(parse_frames("3,5,6")) == [3, 5, 6] and list(parse_frames("7-8")) == [7, 8]


def test_settings_have_only_keys_that_the_manager_knows():
    engine = quickjs.Context()
    script = (ROOT / "farm" / "flamenco" / "rosy_bake.js").read_text()
    engine.eval(MANAGER + script.replace("const JOB_TYPE", "var JOB_TYPE"))
    job_type = json.loads(engine.eval("JSON.stringify(JOB_TYPE)"))
    known = {
        "key",
        "type",
        "subtype",
        "required",
        "eval",
        "evalInfo",
        "default",
        "description",
        "visible",
    }
    for setting in job_type["settings"]:
        assert set(setting) <= known and setting["type"] in ("string", "int32", "bool", "float")
        assert setting.get("required") or "default" in setting
    keys = [setting["key"] for setting in job_type["settings"]]
    assert keys == ["frames", "chunk_size", "cameras", "folder", "preset", "blendfile"]

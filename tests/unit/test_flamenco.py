"""The job type for Flamenco, in a JavaScript engine with the manager's documented functions."""

import json

import pytest
from conftest import ROOT

quickjs = pytest.importorskip("quickjs")

#: The functions that the manager offers to scripts, after its manual.
MANAGER = """
const author = {
    Task: (name, type) => ({name, type, commands: [], addCommand(c) { this.commands.push(c); }}),
    Command: (name, parameters) => ({name, parameters}),
};
const frameChunker = (frames, size) => [`${frames} by ${size}`, "7-8"];
const tasks = [];
function compiled(settings) {
    compileJob({settings, addTask(task) { tasks.push(task); }});
    return JSON.stringify(tasks);
}
"""

DEFAULTS = {"folder": "/out", "blendfile": "/a b/scene.blend", "preset": "", "cameras": ""}


def arguments_of(**settings):
    """Return the arguments of Blender in each task of a job."""
    engine = quickjs.Context()
    script = (ROOT / "farm" / "flamenco" / "rosy_bake.js").read_text()
    engine.eval(MANAGER + script.replace("const JOB_TYPE", "var JOB_TYPE"))
    tasks = json.loads(engine.eval(f"compiled({json.dumps({**DEFAULTS, **settings})})"))
    assert all(task["type"] == "blender" for task in tasks)
    commands = [command for task in tasks for command in task["commands"]]
    programs = {(each["name"], each["parameters"]["exe"]) for each in commands}
    assert programs == {("exec", "{blender}")}
    return [each["parameters"]["args"] for each in commands]


def test_each_chunk_is_one_command():
    start = ["-b", "/a b/scene.blend", "--command", "rosy", "bake", "--out", "/out"]
    expected = [[*start, f"--frames={chunk}"] for chunk in ("1-25 by 10", "7-8")]
    assert arguments_of(frames="1-25", chunk_size=10) == expected


def test_each_camera_has_its_own_sequence():
    jobs = arguments_of(frames="3, 5-8", chunk_size=3, cameras="Close, -Far ", preset="plaid")
    assert [each[7:] for each in jobs] == [
        [f"--frames={frames}", f"--camera={name}", "--preset=plaid"]
        for name in ("Close", "-Far")
        for frames in ("3, 5-8 by 3", "7-8")
    ]

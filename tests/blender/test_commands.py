"""Commands: ``blender -b SCENE --command rosy ...``, and the Python package, which runs this Blender."""

import os
import re
import signal
import subprocess
import sys
import uuid
from pathlib import Path

import bpy
import pytest
from conftest import baked_images, run_blender
from harness.processes import all_end

ROOT = Path(__file__).resolve().parents[2]


def command(*arguments, scene=None):
    """Run the command in a new Blender process, and return its exit status and its output."""
    files = [scene] if scene else []
    return run_blender(*map(str, (*files, "--command", "rosy", *arguments)))


def start(*arguments, **variables):
    """Start ``python -m rosy_addon`` in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "rosy_addon", *map(str, arguments)],
        cwd=ROOT,
        env=os.environ | {"ROSY_BLENDER": bpy.app.binary_path} | variables,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        start_new_session=True,
    )


def run(*arguments):
    """Run a command of the package, and return its exit status, its output and its errors."""
    process = start(*arguments)
    output, errors = process.communicate(timeout=240)
    return process.returncode, output, errors


@pytest.fixture
def saved(with_field, tmp_path):
    """A .blend file whose names have spaces, dashes and other letters than those of ASCII."""
    bpy.data.objects["Camera"].name = "-Seite \N{LATIN SMALL LETTER E WITH ACUTE}"
    folder = tmp_path / "a b \N{CYRILLIC SMALL LETTER ZHE}"
    folder.mkdir()
    path = folder / "suzanne.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_a_command_bakes_and_saves(saved, tmp_path):
    options = ("--size", "96x64", "--out", tmp_path / "out", "--save")
    status, output = command("bake", *options, scene=saved)
    assert status == 0, output
    assert list((tmp_path / "out").glob("*.png"))
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    (image,) = baked_images()
    assert tuple(image.size) == (96, 64)


def test_bad_input_of_a_command_is_one_line_and_status_2(saved, tmp_path):
    status, output = command("bake", "--object", "Nobody", "--out", tmp_path, scene=saved)
    assert status == 2
    (line,) = [line for line in output.splitlines() if line.startswith("rosy: ")]
    assert "Nobody" in line
    assert "Traceback" not in output
    assert not list(tmp_path.glob("*.png"))


def test_ctrl_c_stops_the_command(saved, tmp_path):
    """Blender alone would ignore it."""
    words = ["bake", "--frames", "1-90", "--out", str(tmp_path / "out")]
    words = [bpy.app.binary_path, "-b", str(saved), "--command", "rosy", *words]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    lines = []
    for line in process.stdout:
        if line.startswith(b"frame ") and not lines:
            os.kill(process.pid, signal.SIGINT)
        lines += [line] * (bool(lines) or line.startswith(b"frame "))
    assert process.wait(timeout=60) == 130 and b"rosy: stopped\n" in lines


def test_strokes_are_those_of_the_button_and_nothing_else_is_printed(saved):
    bpy.ops.rosy.strokes(kind="FILE", filepath=str(saved.with_name("button.svg")))
    out = saved.with_name("out.svg")
    camera = bpy.context.scene.camera.name
    assert run("strokes", saved, "-o", out) == (0, f"{camera}: {out}\n", "")
    assert out.read_bytes() == saved.with_name("button.svg").read_bytes()


def test_jobs_draw_frames_and_save(saved):
    out, camera = saved.with_name("-out"), bpy.context.scene.camera.name
    arguments = ["--out", out, f"--camera={camera}", "--frames", "1-3", "--jobs", "2", "--save"]
    status, output, errors = run("bake", saved, *arguments)
    assert (status, errors) == (0, "")
    *frames, last, file = output.splitlines()
    assert all(re.match(r"frame [123]\b|2 frames of ", line) for line in frames), output
    assert str(out) in last and file == str(saved)
    assert len(list(out.glob("*.png"))) == 3
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    assert [bake.frames for bake in bpy.context.scene.rosy.bakes] == ["1 to 3"]


def test_bad_input_is_one_line_and_status_2(saved, tmp_path):
    status, output, errors = run("bake", saved, "--out", tmp_path, "--object=-x")
    assert (status, output) == (2, "")
    assert errors == "rosy: there is no object '-x': check its name\n"


def test_ctrl_c_and_closed_pipes_end_blender_as_well(saved, tmp_path):
    arguments = ("bake", saved, "--frames", "1-90", "--size", "800x800", "--out")
    mark = uuid.uuid4().hex
    interrupted = start(*arguments, tmp_path / "interrupted", ROSY_TEST=mark)
    assert interrupted.stdout.readline().startswith("frame ")
    os.killpg(interrupted.pid, signal.SIGINT)
    closed = start(*arguments, tmp_path / "closed", ROSY_TEST=mark)
    assert closed.stdout.readline().startswith("frame ")
    closed.stdout.close()
    _, errors = interrupted.communicate(timeout=60)
    assert (interrupted.returncode, errors) == (130, "rosy: stopped\n")
    assert closed.wait(timeout=60) == 141
    assert closed.stderr.read() == ""
    assert all_end(mark)

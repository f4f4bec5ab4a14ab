"""``blender -b SCENE --command rosy ...``: what it writes and its exit status."""

from __future__ import annotations

import os
import signal
import subprocess

import bpy
import pytest
from conftest import baked_images, run_blender


def command(*arguments, scene=None):
    """Run the command in a new Blender process, and return its exit status and its output."""
    files = [scene] if scene else []
    return run_blender(*map(str, (*files, "--command", "rosy", *arguments)))


@pytest.fixture
def saved(with_field, tmp_path):
    path = tmp_path / "suzanne.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_bake_and_save(saved, tmp_path):
    options = ("--size", "96x64", "--out", tmp_path / "out", "--save")
    status, output = command("bake", *options, scene=saved)
    assert status == 0, output
    assert list((tmp_path / "out").glob("*.png"))
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    (image,) = baked_images()
    assert tuple(image.size) == (96, 64)


def test_bad_input_is_one_line_and_status_2(saved, tmp_path):
    status, output = command("bake", "--object", "Nobody", "--out", tmp_path, scene=saved)
    assert status == 2
    (line,) = [line for line in output.splitlines() if line.startswith("rosy: ")]
    assert "Nobody" in line
    assert "Traceback" not in output
    assert not list(tmp_path.glob("*.png"))


def test_ctrl_c_stops_the_command(saved, tmp_path):
    """Blender alone would ignore it."""
    words = [
        "-b",
        saved,
        "--command",
        "rosy",
        "bake",
        "--frames",
        "1-90",
        "--out",
        tmp_path / "out",
    ]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    process = subprocess.Popen([bpy.app.binary_path, *map(str, words)], **streams)
    lines = []
    for line in process.stdout:
        if line.startswith(b"frame ") and not lines:
            os.kill(process.pid, signal.SIGINT)
        lines += [line] * (bool(lines) or line.startswith(b"frame "))
    assert process.wait(timeout=60) == 130 and b"rosy: stopped\n" in lines

"""``bake`` on the command line, in Python with Blender's module and in processes of their own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from scenes import add_camera

ROOT = Path(__file__).resolve().parents[2]


def rosy(*words) -> subprocess.CompletedProcess:
    """Run ``python -m rosy_addon bake``."""
    command = [sys.executable, "-m", "rosy_addon", "bake", *map(str, words)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.fixture
def saved(monkey, camera, tmp_path):
    """A .blend file with Suzanne, her field and two cameras."""
    add_camera("Side", (5.0, 0.0, 0.0))
    path = tmp_path / "suzanne.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_bake_writes_the_picture_and_leaves_the_file(saved, tmp_path):
    before = saved.read_bytes()
    done = rosy(saved, "--out", tmp_path / "out", "--size", "96x64", "--set", "length=10")
    assert done.returncode == 0, done.stderr
    (picture,) = (tmp_path / "out").iterdir()
    assert str(picture) in done.stdout
    data = picture.read_bytes()
    assert data.startswith(b"\x89PNG")
    assert (int.from_bytes(data[16:20]), int.from_bytes(data[20:24])) == (96, 64)
    assert saved.read_bytes() == before


def test_bake_from_all_cameras_and_save(saved):
    done = rosy(saved, "--all-cameras", "--preset", "plaid", "--save", "--object", "Suzanne")
    assert done.returncode == 0, done.stderr
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    assert sorted(record.name for record in bpy.context.scene.rosy.bakes) == ["Camera", "Side"]
    assert [modifier.type for modifier in bpy.data.objects["Suzanne"].modifiers] == ["NODES"]
    assert all(image.packed_file for image in bpy.data.images if image.name.startswith("RoSy"))


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["--camera", "None"], "there is no camera 'None' in scene 'Scene', only 'Camera', 'Side'"),
        (["--camera", "Suzanne"], "object 'Suzanne' is a mesh, not a camera"),
        (["--object", "Nobody"], "there is no object 'Nobody'"),
        (["--size", "0x64"], "size 0x64: a side must be"),
        (["--preset", "none"], "no preset is named 'none'"),
        (["--out", "{saved}"], "suzanne.blend: is not a folder"),
    ],
)
def test_bad_input_is_one_line_and_changes_nothing(words, wanted, saved):
    before = saved.read_bytes()
    done = rosy(saved, "--save", *(word.format(saved=saved) for word in words))
    assert done.returncode == 2
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("rosy: ")]
    assert wanted in line
    assert "Traceback" not in done.stderr
    assert saved.read_bytes() == before


def test_files_that_are_not_there_or_not_blends(tmp_path):
    done = rosy(tmp_path / "none.blend", "--save")
    assert done.returncode == 2 and "none.blend: cannot be read: no such file" in done.stderr
    (tmp_path / "text.blend").write_text("no")
    done = rosy(tmp_path / "text.blend", "--save")
    assert done.returncode == 2 and "text.blend: cannot be read" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_was_never_saved_cannot_be_saved():
    done = rosy("--save")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr

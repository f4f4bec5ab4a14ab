"""``blender -b SCENE --command rosy ...``: what it writes and its exit status."""

from __future__ import annotations

import json
import subprocess

import bpy
import pytest


def command(*words, scene=None):
    """Run a Blender of its own with the command; its exit status and everything it said."""
    opened = [str(scene)] if scene else []
    done = subprocess.run(
        [bpy.app.binary_path, "-b", *opened, "--command", "rosy", *map(str, words)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def saved(with_field, tmp_path):
    path = tmp_path / "suzanne.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_bake_and_save(saved, tmp_path):
    status, said = command(
        "bake", "--size", "96x64", "--out", tmp_path / "out", "--save", scene=saved
    )
    assert status == 0, said
    assert list((tmp_path / "out").glob("*.png"))
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    (image,) = [image for image in bpy.data.images if image.name.lower().startswith("rosy")]
    assert tuple(image.size) == (96, 64)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--object", "Nobody"], "Nobody"),
        (["--camera", "Nothing"], "Nothing"),
        (["--preset", "nonsense"], "nonsense"),
        (["--size", "100000x10"], "100000x10"),
        (["--object", "Camera"], "Camera"),
    ],
)
def test_bad_input_is_one_line_and_status_2(saved, tmp_path, words, named):
    status, said = command("bake", *words, "--out", tmp_path, scene=saved)
    assert status == 2
    (line,) = [line for line in said.splitlines() if line.startswith("rosy: ")]
    assert named in line
    assert "Traceback" not in said
    assert not list(tmp_path.glob("*.png"))


def test_strokes_of_the_file(saved, tmp_path):
    bpy.context.scene.rosy.strokes.spacing = 9.0
    bpy.ops.wm.save_mainfile()
    bpy.ops.rosy.strokes(kind="SVG", filepath=str(tmp_path / "button.svg"))
    for words, scene in (([], saved), ([saved], None)):
        out = tmp_path / "out.svg"
        status, said = command("strokes", *words, "-o", out, scene=scene)
        assert status == 0, said
        assert out.read_bytes() == (tmp_path / "button.svg").read_bytes()
        out.unlink()


def test_an_unknown_verb_is_refused():
    status, said = command("paint")
    assert status == 2
    assert "paint" in said and "Traceback" not in said


def test_render_and_info(with_field, tmp_path):
    mesh = tmp_path / "suzanne.obj"
    bpy.ops.wm.obj_export(filepath=str(mesh), export_materials=False)
    picture = tmp_path / "suzanne.png"
    status, said = command(
        "render", mesh, "-o", picture, "--degree", 4, "--generate", "curvature", "--size", "64x64"
    )
    assert status == 0, said
    assert picture.read_bytes().startswith(b"\x89PNG")
    status, said = command("info", mesh, "--degree", 4, "--generate", "curvature", "--json")
    assert status == 0, said
    found = next(json.loads(line) for line in said.splitlines() if line.startswith("{"))
    assert found["degree"] == 4

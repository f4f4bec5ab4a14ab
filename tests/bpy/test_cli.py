"""``bake`` and ``strokes`` of Blender files on the command line, in Python with Blender's module and in processes of their own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from rosy.rosy_addon.draw_strokes import draw_strokes
from rosy.rosy_addon.strokes.svg import Pen
from scenes import add_camera

ROOT = Path(__file__).resolve().parents[2]


def rosy(*words, verb="bake") -> subprocess.CompletedProcess:
    """Run ``python -m rosy_addon bake``, or another verb."""
    command = [sys.executable, "-m", "rosy_addon", verb, *map(str, words)]
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
        (["--preset", "none"], "there is no preset 'none'"),
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


@pytest.fixture
def drawable(saved):
    """The same file, with settings of strokes that are not those of the command line."""
    settings = bpy.context.scene.rosy.strokes
    settings.spacing, settings.width, settings.tone, settings.light = 16.0, 1.7, True, "lamp"
    settings.inks, settings.outline, settings.overshoot = "FAMILIES", True, 6.0
    bpy.ops.wm.save_mainfile()
    return saved


def test_strokes_of_a_file_are_what_the_button_draws(drawable, tmp_path):
    scene = bpy.context.scene
    before = drawable.read_bytes()
    for words, more in (
        ([], {}),
        (["--camera", "Side", "--size", "120x90"], {"camera": "Side", "size": (120, 90)}),
    ):
        wanted = {**more, "camera": scene.objects[more.get("camera", "Camera")]}
        draw_strokes(scene, kind="SVG", path=tmp_path / "button.svg", **wanted)
        done = rosy(drawable, "-o", tmp_path / "out.svg", *words, verb="strokes")
        assert done.returncode == 0, done.stderr
        assert f"{more.get('camera', 'Camera')}: {tmp_path / 'out.svg'}" in done.stdout
        assert (tmp_path / "out.svg").read_bytes() == (tmp_path / "button.svg").read_bytes()
    assert drawable.read_bytes() == before


def test_options_come_before_the_settings_of_the_scene(drawable, tmp_path):
    scene = bpy.context.scene
    settings = scene.rosy.strokes
    words = ["--distance", "0.5", "--no-tone", "--taper", "0", "--overshoot", "0"]
    words += ["--plotter", "--colours", "red,blue"]
    done = rosy(drawable, "-o", tmp_path / "out.svg", *words, verb="strokes")
    assert done.returncode == 0, done.stderr
    settings.unit, settings.distance, settings.tone = "world", 0.5, False
    settings.taper, settings.overshoot = 0.0, 0.0
    pen = Pen(width=1.7, colours=["red", "blue"], paper=None, plotter=True)
    draw_strokes(scene, kind="SVG", path=tmp_path / "button.svg", pen=pen)
    assert (tmp_path / "out.svg").read_bytes() == (tmp_path / "button.svg").read_bytes()


def test_only_what_is_selected_is_drawn_on_if_the_scene_says_so(drawable, tmp_path):
    bpy.context.scene.rosy.strokes.selected = True
    bpy.ops.object.select_all(action="DESELECT")
    bpy.ops.wm.save_mainfile()
    done = rosy(drawable, "-o", tmp_path / "out.svg", verb="strokes")
    assert done.returncode == 2 and "no selected object has a field" in done.stderr
    done = rosy(drawable, "-o", tmp_path / "out.svg", "--object", "Suzanne", verb="strokes")
    assert done.returncode == 0, done.stderr


def test_strokes_of_frames(drawable, tmp_path):
    monkey = bpy.data.objects["Suzanne"]
    for frame, turn in ((1, 0.0), (3, 1.0)):
        monkey.rotation_euler.z = turn
        monkey.keyframe_insert("rotation_euler", frame=frame)
    bpy.ops.wm.save_mainfile()
    words = "--spacing", "20", "--frames", "1-3:2", "--size", "120x90"
    done = rosy(drawable, "-o", tmp_path / "out-###.svg", *words, verb="strokes")
    assert done.returncode == 0, done.stderr
    drawn = sorted(tmp_path.glob("out-*.svg"))
    assert [path.name for path in drawn] == ["out-001.svg", "out-003.svg"]
    assert drawn[0].read_bytes() != drawn[1].read_bytes()
    alone = rosy(
        drawable, "-o", tmp_path / "alone.svg", *words[:3], "3", *words[4:], verb="strokes"
    )
    assert alone.returncode == 0, alone.stderr
    assert (tmp_path / "alone.svg").read_bytes() == drawn[1].read_bytes()


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["--camera", "None"], "there is no camera 'None' in scene 'Scene', only 'Camera', 'Side'"),
        (["--object", "Nobody"], "there is no object 'Nobody'"),
        (["field.rosy"], "suzanne.blend: FIELD applies only to mesh files"),
        (["--field-mesh", "a.obj"], "suzanne.blend: --field-mesh applies only to mesh files"),
        (["--view", "0,90"], "suzanne.blend: --view applies only to mesh files"),
        (["--frames", "1-3"], "out.svg: several frames need #"),
        (
            ["--frames", "9", "--spacing", "9999", "--no-outline"],
            "frame 9: no stroke fits on the surface",
        ),
        (["-o", "a.png"], "a.png: the name of the file must end in .svg"),
        (["-o", "/nowhere/a.svg"], "the folder /nowhere does not exist"),
    ],
)
def test_bad_input_for_strokes_is_one_line(words, wanted, drawable, tmp_path):
    out = [] if "-o" in words else ["-o", tmp_path / "out.svg"]
    done = rosy(drawable, *words, *out, verb="strokes")
    assert done.returncode == 2
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("rosy: ")]
    assert wanted in line and "Traceback" not in done.stderr
    assert not (tmp_path / "out.svg").exists()


def test_strokes_of_files_that_are_not_there(tmp_path):
    done = rosy(tmp_path / "none.blend", "-o", tmp_path / "out.svg", verb="strokes")
    assert done.returncode == 2 and "none.blend: cannot be read: no such file" in done.stderr
    done = rosy("-o", tmp_path / "out.svg", verb="strokes")
    assert done.returncode == 2 and "give a mesh file, or SCENE.blend" in done.stderr

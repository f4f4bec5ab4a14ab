"""``bake`` and ``strokes`` of Blender files on the command line, with Blender's module."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from rosy.rosy_addon.cli.parser import main
from rosy.rosy_addon.jobs.draw_strokes import draw_strokes
from rosy.rosy_addon.line_drawing.svg import Pen
from scenes import add_camera

ROOT = Path(__file__).resolve().parents[2]


def rosy(*words, verb="bake") -> subprocess.CompletedProcess:
    """Run ``python -m rosy_addon bake``, or another verb."""
    command = [sys.executable, "-m", "rosy_addon", verb, *map(str, words)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def error_line(capsys) -> str:
    """Return the line of an error, which is the only one."""
    lines = capsys.readouterr().err.splitlines()
    (line,) = [line for line in lines if line.startswith("rosy: ")]
    return line


@pytest.fixture
def saved(monkey, camera, tmp_path):
    """A .blend file with Suzanne, her field and two cameras."""
    add_camera("Side", (5.0, 0.0, 0.0))
    path = tmp_path / "suzanne.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_bake_writes_the_picture_and_keeps_the_file(saved, tmp_path):
    before = saved.read_bytes()
    process = rosy(saved, "--out", tmp_path / "out", "--size", "96x64", "--set", "length=10")
    assert process.returncode == 0, process.stderr
    (picture,) = (tmp_path / "out").iterdir()
    assert str(picture) in process.stdout
    data = picture.read_bytes()
    assert data.startswith(b"\x89PNG")
    assert (int.from_bytes(data[16:20]), int.from_bytes(data[20:24])) == (96, 64)
    assert saved.read_bytes() == before


def test_bake_from_all_cameras_and_save(saved):
    process = rosy(saved, "--all-cameras", "--preset", "plaid", "--save", "--object", "Suzanne")
    assert process.returncode == 0, process.stderr
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    assert sorted(record.name for record in bpy.context.scene.rosy.bakes) == ["Camera", "Side"]
    assert [modifier.type for modifier in bpy.data.objects["Suzanne"].modifiers] == ["NODES"]
    assert all(image.packed_file for image in bpy.data.images if image.name.startswith("RoSy"))


@pytest.mark.parametrize("folder", ["//../elsewhere", "{}/elsewhere", "//link/elsewhere", ""])
def test_files_of_others_write_nothing_elsewhere(folder, monkey, camera, tmp_path, capsys):
    """The folder of pictures in a .blend file counts only below the folder of the file."""
    (tmp_path / "blend").mkdir()
    (tmp_path / "blend" / "link").symlink_to(tmp_path)
    scene, path = bpy.context.scene, tmp_path / "blend" / "suzanne.blend"
    scene.rosy.store, scene.rosy.directory = "SAVED", folder.format(tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    before = sorted(tmp_path.rglob("*"))
    assert main(["bake", str(path), "--save"]) == 2
    assert error_line(capsys).endswith(("give --out DIR", "choose one (Output)"))
    assert sorted(tmp_path.rglob("*")) == before


def test_pictures_below_the_folder_of_the_file(monkey, camera, tmp_path, capsys):
    scene, path = bpy.context.scene, tmp_path / "suzanne.blend"
    scene.rosy.store, scene.rosy.directory = "SAVED", "//pictures"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert main(["bake", str(path), "--save"]) == 0, capsys.readouterr().err
    assert (tmp_path / "pictures" / "RoSy_Camera.png").is_file()


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--camera", "None"], "there is no camera 'None' in scene 'Scene', only 'Camera', 'Side'"),
        (["--camera", "Suzanne"], "object 'Suzanne' is not a camera, but of type Mesh"),
        (["--object", "Nobody"], "there is no object 'Nobody'"),
        (["--size", "0x64"], "size 0x64: a side must be"),
        (["--preset", "none"], "there is no preset 'none'"),
        (["--out", "{saved}"], "suzanne.blend: is not a folder"),
    ],
)
def test_bad_input_is_one_line_and_changes_nothing(options, expected, saved, capsys):
    before = saved.read_bytes()
    options = [word.format(saved=saved) for word in options]
    assert main(["bake", str(saved), "--save", *options]) == 2
    assert expected in error_line(capsys)
    assert saved.read_bytes() == before


def test_missing_and_invalid_files(tmp_path, capsys):
    (tmp_path / "text.blend").write_text("no")
    for arguments, expected in (
        (["bake", str(tmp_path / "none.blend"), "--save"], "none.blend: cannot be read: no such"),
        (["bake", str(tmp_path / "text.blend"), "--save"], "text.blend: cannot be read"),
    ):
        assert main(arguments) == 2
        assert expected in error_line(capsys)
    process = rosy("-o", tmp_path / "out.svg", verb="strokes")
    assert process.returncode == 2 and "give a mesh file, or SCENE.blend" in process.stderr


@pytest.fixture
def with_stroke_settings(saved):
    """The same file, with stroke settings that differ from those of the command line."""
    settings = bpy.context.scene.rosy.strokes
    settings.spacing, settings.width, settings.light = 16.0, 1.7, "lamp"
    settings.inks, settings.outline, settings.overshoot = "FAMILIES", True, 6.0
    bpy.ops.wm.save_mainfile()
    return saved


def test_strokes_of_a_file_are_those_of_the_button(with_stroke_settings, tmp_path):
    scene = bpy.context.scene
    before = with_stroke_settings.read_bytes()
    for options, changes in (
        ([], {}),
        (["--camera", "Side", "--size", "120x90"], {"camera": "Side", "size": (120, 90)}),
    ):
        keywords = {**changes, "camera": scene.objects[changes.get("camera", "Camera")]}
        draw_strokes(scene, kind="FILE", path=tmp_path / "button.svg", **keywords)
        process = rosy(with_stroke_settings, "-o", tmp_path / "out.svg", *options, verb="strokes")
        assert process.returncode == 0, process.stderr
        assert f"{changes.get('camera', 'Camera')}: {tmp_path / 'out.svg'}" in process.stdout
        assert (tmp_path / "out.svg").read_bytes() == (tmp_path / "button.svg").read_bytes()
    assert with_stroke_settings.read_bytes() == before


def test_options_override_the_settings_of_the_scene(with_stroke_settings, tmp_path):
    scene = bpy.context.scene
    settings = scene.rosy.strokes
    changes = "distance=0.5", "light=none", "taper=0", "overshoot=0"
    options = [word for change in changes for word in ("--set", change)]
    options += ["--plotter", "--colors", "red,blue"]
    process = rosy(with_stroke_settings, "-o", tmp_path / "out.svg", *options, verb="strokes")
    assert process.returncode == 0, process.stderr
    settings.unit, settings.distance, settings.light = "world", 0.5, "none"
    settings.taper, settings.overshoot = 0.0, 0.0
    pen = Pen(width=1.7, colors=["red", "blue"], paper=None, plotter=True)
    draw_strokes(scene, kind="FILE", path=tmp_path / "button.svg", pen=pen)
    assert (tmp_path / "out.svg").read_bytes() == (tmp_path / "button.svg").read_bytes()


def test_strokes_on_selected_objects_only(with_stroke_settings, tmp_path):
    bpy.context.scene.rosy.strokes.selected = True
    bpy.ops.object.select_all(action="DESELECT")
    bpy.ops.wm.save_mainfile()
    process = rosy(with_stroke_settings, "-o", tmp_path / "out.svg", verb="strokes")
    assert process.returncode == 2 and "no selected object has a field" in process.stderr
    options = "-o", tmp_path / "out.svg", "--object", "Suzanne"
    process = rosy(with_stroke_settings, *options, verb="strokes")
    assert process.returncode == 0, process.stderr


def test_strokes_of_frames(with_stroke_settings, tmp_path):
    monkey = bpy.data.objects["Suzanne"]
    for frame, angle in ((1, 0.0), (3, 1.0)):
        monkey.rotation_euler.z = angle
        monkey.keyframe_insert("rotation_euler", frame=frame)
    bpy.ops.wm.save_mainfile()
    options = "--set", "spacing=20", "--frames", "1-3:2", "--size", "120x90"
    process = rosy(with_stroke_settings, "-o", tmp_path / "out-###.svg", *options, verb="strokes")
    assert process.returncode == 0, process.stderr
    drawn = sorted(tmp_path.glob("out-*.svg"))
    assert [path.name for path in drawn] == ["out-001.svg", "out-003.svg"]
    assert drawn[0].read_bytes() != drawn[1].read_bytes()
    options = "-o", tmp_path / "alone.svg", *options[:3], "3", *options[4:]
    alone = rosy(with_stroke_settings, *options, verb="strokes")
    assert alone.returncode == 0, alone.stderr
    assert (tmp_path / "alone.svg").read_bytes() == drawn[1].read_bytes()


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--camera", "None"], "there is no camera 'None' in scene 'Scene', only 'Camera', 'Side'"),
        (["--object", "Nobody"], "there is no object 'Nobody'"),
        (["field.rosy"], "suzanne.blend: FIELD applies only to mesh files"),
        (["--field-mesh", "a.obj"], "suzanne.blend: --field-mesh applies only to mesh files"),
        (["--view", "0,90"], "suzanne.blend: --view applies only to mesh files"),
        (["--frames", "1-3"], "out.svg: several frames need #"),
        (
            ["--frames", "9", "--set", "spacing=9999", "--set", "outline=off"],
            "frame 9: no stroke fits",
        ),
        (["-o", "a.png"], "a.png: the name of the file must end in .svg"),
        (["-o", "/nowhere/a.svg"], "the folder /nowhere does not exist"),
    ],
)
def test_bad_input_for_strokes_is_one_line(options, expected, saved, tmp_path, capsys):
    out = [] if "-o" in options else ["-o", str(tmp_path / "out.svg")]
    assert main(["strokes", str(saved), *options, *out]) == 2
    assert expected in error_line(capsys)
    assert not (tmp_path / "out.svg").exists()

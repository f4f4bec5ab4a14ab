"""``bake`` and ``strokes`` of Blender files on the command line, with Blender's module."""

import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from objects import add_camera, animate
from rosy.rosy_addon.cli.parser import main
from rosy.rosy_addon.jobs.draw_strokes import draw_strokes
from rosy.rosy_addon.line_drawing.svg import Pen

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def rosy(capsys):
    """A function that runs a command here, and returns its exit status, its output and its errors."""

    def run(*words) -> tuple[int, str, str]:
        status = main([str(word) for word in words])
        return status, *capsys.readouterr()

    return run


def succeed(rosy, *words) -> None:
    status, _, errors = rosy(*words)
    assert status == 0, errors


def error_line(errors: str) -> str:
    """Return the line of an error, which is the only one."""
    (line,) = [line for line in errors.splitlines() if line.startswith("rosy: ")]
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
    words = ("bake", saved, "--out", tmp_path / "out", "--size", "96x64", "--set", "length=10")
    command = [sys.executable, "-m", "rosy_addon", *map(str, words)]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
    (picture,) = (tmp_path / "out").iterdir()
    assert str(picture) in process.stdout
    data = picture.read_bytes()
    assert data.startswith(b"\x89PNG")
    assert (int.from_bytes(data[16:20]), int.from_bytes(data[20:24])) == (96, 64)
    assert saved.read_bytes() == before


def test_bake_from_all_cameras_and_save(saved, rosy):
    options = ("--all-cameras", "--preset", "plaid", "--save", "--object", "Suzanne")
    succeed(rosy, "bake", saved, *options)
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    assert sorted(record.name for record in bpy.context.scene.rosy.bakes) == ["Camera", "Side"]
    assert [modifier.type for modifier in bpy.data.objects["Suzanne"].modifiers] == ["NODES"]
    assert all(image.packed_file for image in bpy.data.images if image.name.startswith("RoSy"))


@pytest.mark.parametrize("folder", ["//../elsewhere", "{}/elsewhere", "//link/elsewhere", ""])
def test_files_of_others_write_nothing_elsewhere(folder, monkey, camera, tmp_path, rosy):
    """The folder of pictures in a .blend file counts only below the folder of the file."""
    (tmp_path / "blend").mkdir()
    (tmp_path / "blend" / "link").symlink_to(tmp_path)
    scene, path = bpy.context.scene, tmp_path / "blend" / "suzanne.blend"
    scene.rosy.store, scene.rosy.directory = "SAVED", folder.format(tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    before = sorted(tmp_path.rglob("*"))
    status, _, errors = rosy("bake", path, "--save")
    assert status == 2 and error_line(errors).endswith(("give --out DIR", "choose one (Output)"))
    assert sorted(tmp_path.rglob("*")) == before


def test_scripts_and_drivers_of_a_file_do_not_run(saved, tmp_path):
    marks = [tmp_path / name for name in ("script", "driver")]
    text = bpy.data.texts.new("run.py")
    text.write(f"open({str(marks[0])!r}, 'w')\n")
    text.use_module = True  # is run when the file is opened
    driver = bpy.data.objects["Suzanne"].driver_add("location", 0).driver
    driver.expression = f"bool(open({str(marks[1])!r}, 'w'))"
    bpy.ops.wm.save_as_mainfile(filepath=str(saved))
    for mark in marks:
        mark.unlink(missing_ok=True)
    words = ("bake", str(saved), "--size", "32x32", "--out", str(tmp_path))
    command = [sys.executable, "-m", "rosy_addon", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    ran = [mark.exists() for mark in marks]
    bpy.ops.wm.open_mainfile(filepath=str(saved), use_scripts=True)
    could_run = [mark.exists() for mark in marks]
    # Blender 4.2 crashes at its end if the open file has such a driver.
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert ran == [False, False] and could_run == [True, True]
    assert done.returncode == 0 and (tmp_path / "RoSy_Camera.png").exists()


def test_pictures_below_the_folder_of_the_file(monkey, camera, tmp_path, rosy):
    scene, path = bpy.context.scene, tmp_path / "suzanne.blend"
    scene.rosy.store, scene.rosy.directory = "SAVED", "//pictures"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    succeed(rosy, "bake", path, "--save")
    assert (tmp_path / "pictures" / "RoSy_Camera.png").is_file()


#: Of bakes that save the file.
BAKE_ERRORS = [
    (["--camera", "None"], "there is no camera 'None' in scene 'Scene', only 'Camera', 'Side'"),
    (["--camera", "Suzanne"], "object 'Suzanne' is not a camera, but of type Mesh"),
    (["--object", "Nobody"], "there is no object 'Nobody'"),
    (["--preset", "none"], "there is no preset 'none'"),
    (["--out", "{saved}"], "suzanne.blend: is not a folder"),
]

STROKE_ERRORS = [
    (["field.rosy"], "suzanne.blend: FIELD applies only to mesh files"),
    (["--field-mesh", "a.obj"], "suzanne.blend: --field-mesh applies only to mesh files"),
    (["--view", "0,90"], "suzanne.blend: --view applies only to mesh files"),
    (["--frames", "1-3"], "out.svg: several frames need #"),
    (["--frames", "9", "--set", "spacing=9999", "--set", "outline=0"], "frame 9: no stroke fits"),
]


@pytest.mark.parametrize(
    ("verb", "options", "expected"),
    [*(("bake", *row) for row in BAKE_ERRORS), *(("strokes", *row) for row in STROKE_ERRORS)],
)
def test_bad_input_is_one_line_and_changes_nothing(verb, options, expected, saved, rosy, tmp_path):
    before = saved.read_bytes()
    options = [word.format(saved=saved) for word in options]
    first = ["--save"] if verb == "bake" else ["-o", tmp_path / "out.svg"]
    status, _, errors = rosy(verb, *first, saved, *options)
    assert status == 2 and expected in error_line(errors)
    assert saved.read_bytes() == before and not (tmp_path / "out.svg").exists()


def test_missing_and_invalid_files(tmp_path, rosy):
    (tmp_path / "text.blend").write_text("no")
    for name, expected in (("none", "cannot be read: no such"), ("text", "cannot be read")):
        status, _, errors = rosy("bake", tmp_path / f"{name}.blend", "--save")
        assert status == 2 and f"{name}.blend: {expected}" in error_line(errors)


@pytest.fixture
def with_stroke_settings(saved):
    """The same file, with stroke settings that differ from those of the command line."""
    settings = bpy.context.scene.rosy.strokes
    settings.from_look, settings.spacing, settings.width, settings.light = False, 16.0, 1.7, "lamp"
    settings.inks, settings.outline, settings.overshoot = "FAMILIES", 1.0, 6.0
    bpy.ops.wm.save_mainfile()
    return saved


def test_strokes_of_a_file_are_those_of_the_button(with_stroke_settings, rosy, tmp_path):
    before, out = with_stroke_settings.read_bytes(), tmp_path / "out.svg"
    choice = {"camera": bpy.data.objects["Side"], "size": (120, 90)}
    draw_strokes(bpy.context.scene, kind="FILE", path=tmp_path / "button.svg", **choice)
    options = "--camera", "Side", "--size", "120x90"
    result = rosy("strokes", with_stroke_settings, "-o", out, *options)
    assert result == (0, f"Side: {out}\n", "")
    assert out.read_bytes() == (tmp_path / "button.svg").read_bytes()
    assert with_stroke_settings.read_bytes() == before


def test_options_override_the_settings_of_the_scene(with_stroke_settings, rosy, tmp_path):
    changes = "distance=0.5", "light=none", "taper=0", "overshoot=0"
    options = [word for change in changes for word in ("--set", change)]
    options += ["--plotter", "--colors", "red,blue"]
    succeed(rosy, "strokes", with_stroke_settings, "-o", tmp_path / "out.svg", *options)
    settings = bpy.context.scene.rosy.strokes
    settings.unit, settings.distance, settings.light = "world", 0.5, "none"
    settings.taper, settings.overshoot = 0.0, 0.0
    pen = Pen(width=1.7, colors=["red", "blue"], paper=None, plotter=True)
    draw_strokes(bpy.context.scene, kind="FILE", path=tmp_path / "button.svg", pen=pen)
    assert (tmp_path / "out.svg").read_bytes() == (tmp_path / "button.svg").read_bytes()


def test_strokes_on_selected_objects_only(with_stroke_settings, rosy, tmp_path):
    bpy.context.scene.rosy.strokes.selected = True
    bpy.ops.object.select_all(action="DESELECT")
    bpy.ops.wm.save_mainfile()
    words = "strokes", with_stroke_settings, "-o", tmp_path / "out.svg"
    status, _, errors = rosy(*words)
    assert status == 2 and "no selected object has a field" in errors
    succeed(rosy, *words, "--object", "Suzanne")


def test_strokes_of_frames(with_stroke_settings, rosy, tmp_path):
    animate(bpy.data.objects["Suzanne"], "rotation_euler", {1: (0, 0, 0), 3: (0, 0, 1)})
    bpy.ops.wm.save_mainfile()
    options = "strokes", with_stroke_settings, "--set", "spacing=20", "--size", "120x90"
    succeed(rosy, *options, "--frames", "1-3:2", "-o", tmp_path / "out-###.svg")
    drawn = sorted(tmp_path.glob("out-*.svg"))
    assert [path.name for path in drawn] == ["out-001.svg", "out-003.svg"]
    assert drawn[0].read_bytes() != drawn[1].read_bytes()
    succeed(rosy, *options, "--frames", "3", "-o", tmp_path / "alone.svg")
    assert (tmp_path / "alone.svg").read_bytes() == drawn[1].read_bytes()

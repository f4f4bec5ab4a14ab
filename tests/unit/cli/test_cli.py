"""The command line, in this process and in its own processes."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest
from conftest import ROOT, long
from harness.forked import run_command
from shapes import cube, icosphere, torus

import rosy_addon as rf
from rosy_addon.cli import bake, parser
from rosy_addon.extras.command_line import main
from rosy_addon.field.surface import Surface
from rosy_addon.image_io.png import write_png
from rosy_addon.preset_files.store import preset_files


def rosy(*arguments) -> subprocess.CompletedProcess:
    """Run ``rosyfields``."""
    return run_command(list(map(str, arguments)), ROOT)


def write_off(path, surface: Surface):
    sizes = np.diff(surface.face_start)
    faces = np.split(surface.corner_vertex, surface.face_start[1:-1])
    rows = [f"OFF\n{len(surface.vertices)} {len(sizes)} 0"]
    rows += [" ".join(map(repr, row)) for row in surface.vertices.tolist()]
    rows += [" ".join(map(str, [len(face), *face])) for face in faces]
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    return write_off(tmp_path_factory.mktemp("meshes") / "sphere.off", icosphere(3))


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    return write_off(tmp_path_factory.mktemp("meshes") / "torus.off", torus(24, 12))


def size_of(path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n") and data.endswith(b"IEND\xaeB`\x82")
    return int.from_bytes(data[16:20]), int.from_bytes(data[20:24])


def pixels_of(path) -> np.ndarray:
    width, height = size_of(path)
    data = path.read_bytes()
    start = data.index(b"IDAT")
    length = int.from_bytes(data[start - 4 : start])
    rows = np.frombuffer(zlib.decompress(data[start + 4 : start + 4 + length]), np.uint8)
    return rows.reshape(height, 1 + 4 * width)[:, 1:].reshape(height, width, 4)


def assert_refused(completed: subprocess.CompletedProcess, *expected: str) -> None:
    """Check that a command has status 2 and prints one line with the expected texts."""
    assert completed.returncode == 2, completed.stderr
    assert completed.stderr.startswith("rosy: ") and completed.stderr.count("\n") == 1, (
        completed.stderr
    )
    assert completed.stdout == ""
    for text in expected:
        assert text in completed.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        [],
        ["--degree", "3", "--generate", "axis", "--axis", "-1,0.5,0"],
        ["--preset", "plaid", "--set", "supersampling=2", "--set", "view_plane=off"],
        ["--view", "-120,-30", "--ortho", "--set", "display=flat"],
    ],
    ids=["plain", "axis", "look", "view"],
)
def test_render_writes_a_picture(words, ring, tmp_path):
    done = rosy("render", ring, "-o", tmp_path / "a.png", "--size", "96x64", *words)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert size_of(tmp_path / "a.png") == (96, 64)
    covered = pixels_of(tmp_path / "a.png")[..., 3] == 255
    assert 0.1 < covered.mean() < 0.9


def test_same_command_same_bytes(ring, tmp_path):
    for name in ("a.png", "b.png"):
        assert main(["render", str(ring), "-o", str(tmp_path / name), "--size", "80x80"]) == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_the_default_preset_is_no_preset(ring, tmp_path):
    common = ["render", str(ring), "--size", "40x40", "-o"]
    assert main([*common, str(tmp_path / "a.png")]) == 0
    assert main([*common, str(tmp_path / "b.png"), "--preset", "default"]) == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    alpha = pixels_of(tmp_path / "a.png")[..., 3]
    assert ((alpha > 0) & (alpha < alpha.max())).any()


def test_y_is_up_in_off_files_by_default(tmp_path):
    tall = torus(24, 12)
    path = write_off(tmp_path / "a.off", tall)  # around z
    covered = {}
    for up in ("y", "z"):
        picture = tmp_path / f"{up}.png"
        options = ["--size", "64x64", "--up", up, "--view", "0,0", "--ortho"]
        assert main(["render", str(path), "-o", str(picture), *options]) == 0
        covered[up] = pixels_of(picture)[..., 3] > 0
    # From the front, a ring around the upward axis is seen edge on. A ring around y shows its hole.
    assert covered["z"].any(axis=1).mean() < 0.5
    assert covered["y"].any(axis=1).mean() > 0.8 and not covered["y"][32, 32]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["vase-7", "cheburashka", *long("vase-2", "vase-4", "dome-6")])
def test_render_fields_of_others(name, shared_data, tmp_path):
    mesh = shared_data / "meshes" / f"{name.partition('-')[0]}.off"
    field = shared_data / "fields" / f"{name}.rawfield"
    done = rosy("render", mesh, field, "-o", tmp_path / "a.png", "--size", "128x128")
    assert done.returncode == 0, done.stderr
    ink = pixels_of(tmp_path / "a.png")
    assert ink[ink[..., 3] == 255][:, :3].std() > 15


@pytest.mark.slow
def test_fields_that_are_no_rosy_are_drawn_but_not_written_as_one(shared_data, tmp_path):
    mesh = shared_data / "meshes" / "cheburashka.off"
    field = shared_data / "fields" / "cheburashka-cf.rawfield"
    done = rosy("render", mesh, field, "-o", tmp_path / "a.png", "--size", "64x64")
    assert done.returncode == 0, done.stderr
    done = rosy("field", mesh, field, "-o", tmp_path / "a.rosy")
    assert_refused(done, "a.rosy", "do not form a RoSy")
    assert not (tmp_path / "a.rosy").exists()


@pytest.mark.slow
def test_field_makes_converts_and_info_reads(sphere, tmp_path):
    raw, rosy_file, again = (tmp_path / name for name in ("a.rawfield", "a.rosy", "b.rawfield"))
    assert rosy("field", sphere, "-o", raw, "--degree", 6).returncode == 0
    assert rosy("field", sphere, raw, "-o", rosy_file).returncode == 0
    assert rosy("field", sphere, rosy_file, "-o", again).returncode == 0
    assert raw.read_bytes() == again.read_bytes()
    done = rosy("info", sphere, rosy_file, "--json")
    facts = json.loads(done.stdout)
    assert (facts["degree"], facts["faces"], facts["vertices"]) == (6, 1280, 642)
    assert facts["euler_characteristic"] == 2
    assert sum(index for _, index in facts["singularities"]) == 6 * 2
    assert all(isinstance(part, int) for pair in facts["singularities"] for part in pair)
    words = rosy("info", sphere, rosy_file)
    assert words.returncode == 0
    assert "degree 6" in words.stdout and "1,280 faces" in words.stdout


@pytest.mark.slow
def test_the_torus_has_no_singularities_in_sum(ring):
    facts = json.loads(rosy("info", ring, "--degree", 4, "--generate", "axis", "--json").stdout)
    assert facts["euler_characteristic"] == 0
    assert sum(index for _, index in facts["singularities"]) == 0


def test_the_default_generator_follows_the_form(ring, tmp_path):
    default, chosen = tmp_path / "a.rosy", tmp_path / "b.rosy"
    common = ["field", str(ring), "--degree", "4", "-o"]
    assert main([*common, str(default)]) == 0
    assert main([*common, str(chosen), "--generate", "form"]) == 0
    assert default.read_bytes() == chosen.read_bytes()


def test_a_kind_without_directions_is_noted(tmp_path, capsys):
    """A flat mesh has no direction of curvature. Other fields have one everywhere."""
    mesh = tmp_path / "flat.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    command = ["field", str(mesh), "-o", str(tmp_path / "a.rosy")]
    assert main([*command, "--generate", "curvature"]) == 0
    assert "curvature gives no direction on any face" in capsys.readouterr().err
    assert main(command) == 0
    assert capsys.readouterr().err == ""


REFUSED = {
    "no mesh": (["render", "none.off", "-o", "{out}"], "none.off: cannot be read"),
    "no field": (["render", "{mesh}", "none.rosy", "-o", "{out}"], "none.rosy: cannot be read"),
    "kind of mesh": (["info", "a.gltf"], "a.gltf: is not a mesh file"),
    "degree 0": (["render", "{mesh}", "-o", "{out}", "--degree", "0"], "degree 0 is not"),
    "degree -1": (["field", "{mesh}", "-o", "{out}", "--degree", "-1"], "degree -1 is not"),
    "degree 1000": (["info", "{mesh}", "--degree", "1000"], "degree 1000 is not"),
    "curvature 3": (
        ["info", "{mesh}", "--degree", "3", "--generate", "curvature"],
        "even degree, not 3",
    ),
    "axis": (["info", "{mesh}", "--generate", "axis", "--axis", "0,0,0"], "not a direction"),
    "both": (["info", "{mesh}", "a.rosy", "--generate", "axis"], "not both"),
    "size 0": (["render", "{mesh}", "-o", "{out}", "--size", "0x10"], "size 0x10: a side must be"),
    "size 100000": (["render", "{mesh}", "-o", "{out}", "--size", "100000x100000"], "size 100000x"),
    "preset": (
        ["render", "{mesh}", "-o", "{out}", "--preset", "none"],
        "there is no preset 'none'",
    ),
    "setting": (
        ["render", "{mesh}", "-o", "{out}", "--set", "lenght=3"],
        "unknown setting 'lenght'",
    ),
    "lights": (["render", "{mesh}", "-o", "{out}", "--set", "light=scene"], "has no lights"),
    "lights of a turntable": (
        ["turntable", "{mesh}", "-o", "{out}.gif", "--set", "light=scene"],
        "has no lights",
    ),
    "still without flow": (
        ["turntable", "{mesh}", "-o", "{out}.gif", "--still"],
        "nothing moves",
    ),
    "flow": (["turntable", "{mesh}", "-o", "{out}.gif", "--set", "flow=fast"], "expected a number"),
    "value": (
        ["render", "{mesh}", "-o", "{out}", "--set", "length=long"],
        "--set length=long: expected a whole",
    ),
    "numbers": (
        ["render", "{mesh}", "-o", "{out}", "--set", "color_range=0;1"],
        "--set color_range=0;1: expected numbers with commas",
    ),
    "range": (["render", "{mesh}", "-o", "{out}", "--set", "gain=-1"], "setting 'gain' is -1"),
    "switch": (
        ["render", "{mesh}", "-o", "{out}", "--set", "view_plane=2"],
        "expected true or false",
    ),
    "no value": (["render", "{mesh}", "-o", "{out}", "--set", "gain"], "expected NAME=VALUE"),
    "no folder": (
        ["render", "{mesh}", "-o", "no/folder/a.png"],
        "the folder no/folder does not exist",
    ),
    "a folder": (["render", "{mesh}", "-o", "tests"], "tests: cannot be written: it is a folder"),
    "format": (["field", "{mesh}", "-o", "{out}"], "cannot be written as a field"),
    "view": (["render", "{mesh}", "-o", "{out}", "--view", "nan,0"], "view nan,0"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_one_line_and_status_2(case, sphere, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    words, expected = REFUSED[case]
    out = tmp_path / "a.png"
    words = [word.format(mesh=sphere, out=out) for word in words]
    assert main(words) == 2
    output = capsys.readouterr()
    assert output.err.startswith("rosy: ") and output.err.count("\n") == 1
    assert expected in output.err
    assert output.out == ""
    assert not out.exists()


@pytest.mark.slow
def test_bad_input_in_a_process_of_its_own(sphere, tmp_path):
    done = rosy("render", sphere, "-o", tmp_path / "a.png", "--degree", 0)
    assert_refused(done, "degree 0 is not a whole number from 1 to 12")
    (tmp_path / "a.rosy").write_text("2 4\n1 0 0\n")
    assert_refused(rosy("info", sphere, tmp_path / "a.rosy"), "a.rosy: declares 2 rows")


@pytest.mark.slow
def test_conflicting_degrees(sphere, tmp_path):
    assert main(["field", str(sphere), "-o", str(tmp_path / "a.rosy"), "--degree", "6"]) == 0
    done = rosy("info", sphere, tmp_path / "a.rosy", "--degree", 4)
    assert_refused(done, "a.rosy: the field has degree 6, but degree 4 was requested")


@pytest.mark.slow
def test_undefined_vectors_on_request(sphere, tmp_path):
    path = tmp_path / "a.rosy"
    assert main(["field", str(sphere), "-o", str(path)]) == 0
    lines = path.read_text().splitlines()
    lines[2 + 7] = "nan nan nan"
    path.write_text("\n".join(lines))
    assert_refused(rosy("info", sphere, path), "1 of 1280 vectors are not finite", "face 7")
    facts = json.loads(rosy("info", sphere, path, "--undefined", "--json").stdout)
    assert facts["undefined_faces"] >= 1
    for option in ("--guides", "--against"):  # in every field file
        assert rosy("info", sphere, option, path, "--undefined").returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        [],
        ["paint"],
        ["render"],
        ["render", "a.off"],
        ["render", "a.off", "-o", "b", "--size", "big"],
        ["turntable", "a.off", "-o", "b.gif", "--rate", "1e300"],
        ["turntable", "a.off", "-o", "b.gif", "--pictures", "99999999999"],
    ],
)
def test_wrong_usage_is_status_2(words):
    done = rosy(*words)
    assert done.returncode == 2
    assert done.stderr.startswith("usage: python -m rosy_addon")
    assert "Traceback" not in done.stderr


def test_help_names_the_program_it_was_started_as(capsys):
    assert rosy("--help").stdout.startswith("usage: python -m rosy_addon [-h] VERB")
    assert parser.main(["--help"]) == 0
    assert capsys.readouterr().out.startswith("usage: blender -b --command rosy")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is no signal there")
def test_ctrl_c_is_status_130_without_a_traceback(sphere, tmp_path):
    command = [sys.executable, "-m", "rosy_addon", "render", str(sphere), "-o", "{}/a.png"]
    command[-1] = str(tmp_path / "a.png")
    command += ["--size", "1500x1500", "--set", "length=2000", "--set", "method=brute"]
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        # A shell makes its background processes and their children ignore SIGINT. Undo this.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        time.sleep(3)
        process.send_signal(signal.SIGINT)
        _, error_output = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    assert error_output == "rosy: stopped\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is no signal there")
def test_ctrl_c_while_python_ends_is_status_130_without_a_traceback():
    code = (
        "import atexit, os, signal, sys; from rosy_addon.__main__ import run;"
        "signal.signal(signal.SIGINT, signal.SIG_DFL);"
        "atexit.register(os.kill, os.getpid(), signal.SIGINT);"
        "sys.argv = ['rosy_addon', '--help']; sys.exit(run())"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 130
    assert done.stderr == "rosy: stopped\n"


def test_bake_without_blender_is_an_error(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "bpy", None)  # as if it were not installed
    assert parser.main(["bake", "--save"]) == 2
    assert "bake needs Blender: run `blender" in capsys.readouterr().err
    assert main(["bake", "--save"]) == 2
    assert "bake: no input: give SCENE.blend" in capsys.readouterr().err


def test_bake_without_an_output_is_refused(capsys):
    assert main(["bake"]) == 2
    assert "give --out DIR" in capsys.readouterr().err


def test_workers_get_the_options_as_they_are(tmp_path, monkeypatch):
    """Names may begin with a dash."""
    commands = []
    monkeypatch.setattr(bake, "run_local", lambda command, *_: commands.append(command) or iter(()))
    scene = tmp_path / "scene.blend"
    scene.touch()
    words = [f"--out={tmp_path}", "--object=-a", "--object=b", "--object=--save", "--camera=-x"]
    words += ["--size=8x8", "--preset=plaid", "--device=cpu", "--set=gain=2", "--set=-1=-1"]
    words += ["--blender=-no such program"]
    for arguments in (
        words,
        ["--object=-a", "--object", "b", "--object=--save", *words[:1], *words[4:]],
    ):
        assert main(["bake", str(scene), *arguments, "--frames", "1-2", "--jobs", "2"]) == 0
    command = [sys.executable, "-m", "rosy_addon", "bake", str(scene), *words, "--workers=1"]
    assert commands == [command, command]
    assert main([*command[3:], "--frames=1-2", "--jobs=2"]) == 0
    assert commands[2] == command


# --- fields made, converted and compared -----------------------------------------------------


def facts_of(*arguments) -> dict:
    done = rosy("info", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_field_converts(sphere, tmp_path):
    made = tmp_path / "a.rosy"
    assert rosy("field", sphere, "-o", made, "--generate", "smoothest").returncode == 0
    converted = tmp_path / "b.npy"
    done = rosy("field", sphere, made, "-o", converted, "--to-degree", 8, "--turn", 10,
                "--smooth", 0.05, "--magnitude", "unit")  # fmt: skip
    assert done.returncode == 0, done.stderr
    facts = facts_of(sphere, converted)
    assert facts["degree"] == 8 and np.allclose(facts["magnitude"], 1)
    done = rosy("field", sphere, made, "-o", converted, "--to-degree", 3)
    assert_refused(done, "neither a multiple")


@pytest.mark.slow
def test_info_compares(sphere, tmp_path):
    made, turned, sings = (tmp_path / name for name in ("a.rosy", "b.rawfield", "a.sings"))
    assert rosy("field", sphere, "-o", made, "--generate", "smoothest").returncode == 0
    assert rosy("field", sphere, made, "-o", turned, "--turn", 5).returncode == 0
    assert rosy("field", sphere, made, "-o", sings).returncode == 0
    facts = facts_of(sphere, made, "--against", turned)
    assert np.isclose(facts["against"]["mean"], 5) and np.isclose(facts["against"]["max"], 5)
    assert facts["is_rosy"] and facts["energy"] > 4 * np.pi * 4
    facts = facts_of(sphere, turned, "--against", sings)
    assert facts["against"] == {"same": 8, "only_here": [], "only_there": []}
    done = rosy("info", sphere, made, "--against", turned)
    assert "off by 5 degrees on average" in done.stdout


@pytest.mark.slow
def test_strokes_and_guides(sphere, tmp_path):
    angle = np.linspace(0, 1.0, 30)
    arc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    rows = "\n".join(" ".join(map(str, point)) for point in arc)
    (tmp_path / "strokes.txt").write_text(f"# one\n{rows}\n\n{rows}\n")
    out = tmp_path / "a.rosy"
    done = rosy("field", sphere, "-o", out, "--strokes", tmp_path / "strokes.txt", "--degree", 2)
    assert done.returncode == 0, done.stderr
    again = tmp_path / "b.rosy"
    done = rosy("field", sphere, "-o", again, "--guides", out, "--degree", 2, "--reach", 0.01)
    assert done.returncode == 0, done.stderr
    assert facts_of(sphere, again, "--against", out)["against"]["mean"] < 3
    firm = rosy("field", sphere, "-o", again, "--guides", out, "--degree", 2, "--firmness")
    assert firm.returncode == 0, firm.stderr
    (tmp_path / "none.txt").write_text("1 2 3\n\n4 5 6\n")
    assert_refused(
        rosy("field", sphere, "-o", out, "--strokes", tmp_path / "none.txt"), "contains no stroke"
    )
    assert_refused(rosy("field", sphere, "-o", out, "--generate", "uv"), "has no UV map")


@pytest.mark.slow
def test_the_uv_map_of_a_file(shared_data, tmp_path):
    mesh = shared_data / "meshes" / "spot.obj"
    out = tmp_path / "a.rosy"
    assert rosy("field", mesh, "-o", out, "--generate", "uv").returncode == 0
    assert facts_of(mesh, out)["undefined_faces"] == 0
    smooth = tmp_path / "b.rosy"
    done = rosy("field", mesh, "-o", smooth, "--generate", "guided", "--uv", "--reach", "0.02")
    assert done.returncode == 0, done.stderr
    facts, rough = facts_of(mesh, smooth, "--against", out), facts_of(mesh, out)
    assert facts["energy"] < rough["energy"] and facts["against"]["mean"] < 15


# --- tones ----------------------------------------------------------------------------------------


def write_ply(path, surface: Surface, **columns):
    """Write a .ply file with further columns of vertices, integers as bytes and others as floats."""
    kinds = {
        name: "uchar" if values.dtype.kind in "iu" else "float" for name, values in columns.items()
    }
    head = ["ply", "format ascii 1.0", f"element vertex {len(surface.vertices)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"property {kind} {name}" for name, kind in kinds.items()]
    head += [f"element face {surface.face_count}", "property list uchar int vertex_indices"]
    head.append("end_header")
    rows = zip(surface.vertices.tolist(), *(v.tolist() for v in columns.values()), strict=True)
    lines = [" ".join(map(repr, [*position, *values])) for position, *values in rows]
    faces = np.split(surface.corner_vertex, surface.face_start[1:-1])
    lines += [" ".join(map(str, [len(face), *face])) for face in faces]
    path.write_text("\n".join(head + lines) + "\n")
    return path


@pytest.fixture(scope="module")
def painted(tmp_path_factory):
    """A ball that is dark on the left and light on the right, in its colors and in a number."""
    ball = icosphere(4)
    right = ball.vertices[:, 0] > 0
    gray = np.where(right, 230, 60)
    colors = dict.fromkeys(("red", "green", "blue"), gray)
    path = tmp_path_factory.mktemp("painted") / "ball.ply"
    return write_ply(path, ball, **colors, cavity=np.where(right, 0.8, 0.1))


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("--preset cross-hatch --tone-attribute cavity", "tone_values"),
        ("--preset cross-hatch --tone-picture shot.png", "tone_picture"),
        ("--preset cross-hatch --tone-image shot.png", "tone_image"),
        ("--set color_map=gray --color-values cavity", "color_values"),
    ],
)
def test_sources_of_tones_and_colors(words, name, painted, tmp_path, monkeypatch):
    """The command draws what the function does, which is another picture than without the source."""
    monkeypatch.chdir(tmp_path)
    write_png("shot.png", np.linspace(0.2, 0.9, 64 * 64 * 4, dtype=np.float32).reshape(64, 64, 4))
    mesh = painted
    if name == "tone_image":
        mesh = tmp_path / "square.obj"
        corners = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        mesh.write_text(corners + "f 1/1 2/2 3/3 4/4\n")
    view = "--generate smoothest --size 64x64 --view 0,0 --up z --ortho"
    plain, out = [
        [*["render", "-o", "a.png"], str(mesh), *view.split(), *options.split()]
        for options in (words.rsplit(" ", 2)[0], words)
    ]
    assert main(plain) == 0
    before = pixels_of(tmp_path / "a.png")
    assert main(out) == 0
    drawn = pixels_of(tmp_path / "a.png")
    _, look, _, source = words.split()
    keywords = {"preset": look} if "=" not in look else dict([look.split("=")])
    surface = rf.Surface(mesh, up="z")
    frame = {"size": (64, 64), "view": (0, 0), "orthographic": True}
    expected = rf.render(surface, rf.smoothest(surface), **frame, **keywords, **{name: source})
    assert np.array_equal(drawn, np.asarray(expected)) and not np.array_equal(drawn, before)


@pytest.mark.slow
def test_tones_that_are_not_there(painted, sphere, tmp_path):
    write_png(tmp_path / "wide.png", np.ones((16, 64, 4), dtype=np.float32))
    out = ("-o", tmp_path / "a.png", "--size", "64x64")
    for mesh, words, expected in (
        (painted, ("--tone-attribute", "ink"), ("'ink'", "'cavity'", "ball.ply")),
        (painted, ("--color-values", "Cavity"), ("'Cavity'", "'cavity'", "ball.ply")),
        (sphere, ("--tone-attribute", "ink"), ("sphere.off", ".ply")),
        (sphere, ("--tone-image", "x.png"), ("sphere.off", "UV map")),
        (sphere, ("--tone-picture", tmp_path / "none.png"), ("none.png", "no such file")),
        (sphere, ("--tone-picture", tmp_path / "wide.png"), ("wide.png", "64 x 16")),
        (sphere, ("--set", "tone=picture"), ("picture", "none is given")),
        (
            painted,
            ("--tone-attribute", "red", "--tone-image", "x.png"),
            ("choose one source of the tone, attribute or image",),
        ),
    ):
        assert_refused(rosy("render", mesh, *out, *words), *expected)
        assert not (tmp_path / "a.png").exists()


@pytest.mark.slow
def test_a_transferred_field_is_reported(sphere, tmp_path):
    made = tmp_path / "sphere.rosy"
    assert rosy("field", sphere, "-o", made).returncode == 0
    cut = write_off(tmp_path / "cut.off", icosphere(4))
    done = rosy("render", cut, made, "-o", tmp_path / "a.png", "--size", "64x64",
                "--field-mesh", sphere)  # fmt: skip
    assert done.returncode == 0
    assert "transferred by position from sphere.off" in done.stderr


def write_cube(path):
    """Write a cube as an .obj file, and return its path."""
    surface = cube()
    quads = surface.corner_vertex.reshape(-1, 4) + 1
    rows = [f"v {x} {y} {z}\n" for x, y, z in surface.vertices]
    path.write_text("".join(rows + [f"f {a} {b} {c} {d}\n" for a, b, c, d in quads]))
    return path


@pytest.mark.slow
def test_unused_vertices_change_nothing(tmp_path):
    """Neither the frame nor what is relative to the size of the mesh."""
    (tmp_path / "stray").mkdir()
    obj = write_cube(tmp_path / "cube.obj").read_text()
    (tmp_path / "stray" / "cube.obj").write_text(obj + "v 1e6 0 0\n")
    for verb, suffix, *words in (
        ("render", "png", "--generate", "curvature", "--size", "48x48"),
        ("strokes", "svg", "--generate", "smoothest", "--size", "200x200"),
        ("turntable", "gif", "--generate", "axis", "--size", "32x32", "--pictures", "2"),
    ):
        outputs = [folder / f"out.{suffix}" for folder in (tmp_path, tmp_path / "stray")]
        for out in outputs:
            words = ["--degree", "4", *words]
            assert main([verb, str(out.with_name("cube.obj")), "-o", str(out), *words]) == 0
        assert outputs[0].read_bytes() == outputs[1].read_bytes(), verb


def test_outputs_replace_only_regular_files(tmp_path, capsys):
    mesh, link, elsewhere = (
        write_cube(tmp_path / "cube.obj"),
        tmp_path / "link.png",
        tmp_path / "to",
    )
    os.mkfifo(tmp_path / "pipe.png")
    elsewhere.mkdir()
    link.symlink_to(elsewhere / "real.png")
    (tmp_path / "loop.png").symlink_to("loop.png")
    render = ["render", "--generate", "axis", "--size", "16x16"]
    for words, message in (
        (["field", str(mesh), "-o", "/dev/null"], "/dev/null: cannot be written: it is not a reg"),
        ([*render, str(mesh), "-o", str(tmp_path / "pipe.png")], "not a regular file"),
        ([*render, str(tmp_path / "pipe.png"), "-o", str(tmp_path / "a.png")], "pipe.png"),
        ([*render, str(mesh), "-o", str(tmp_path / "loop.png")], "it is a link to itself"),
        ([*render, str(mesh), "-o", str(tmp_path / "a.svg")], "the file must end in .png"),
        (["field", str(mesh), "-o", str(mesh)], "cube.obj: is also an input"),
        ([*render, str(mesh), "-o", str(tmp_path / ("a" * 252 + ".png"))], "file name too long"),
    ):
        before = mesh.read_bytes()
        assert main(words) == 2
        error = capsys.readouterr().err
        assert message in error and error.count("\n") == 1
        assert mesh.read_bytes() == before
    longest = tmp_path / ("a" * 251 + ".png")
    for output in (link, longest):
        assert main([*render, str(mesh), "-o", str(output)]) == 0
    assert link.is_symlink() and (elsewhere / "real.png").read_bytes() == longest.read_bytes()
    assert not list(tmp_path.glob(".*")) and not list(elsewhere.glob(".*"))


def test_paths_that_cannot_be_opened(tmp_path, capsys, monkeypatch):
    name, path = tmp_path / ("a" * 252 + ".blend"), tmp_path / "/".join(["b" * 200] * 30)
    pipe, file = tmp_path / "pipe.blend", tmp_path / "file"
    os.mkfifo(pipe)
    file.touch()
    jobs = ["--out", str(tmp_path), "--frames", "1-2", "--jobs", "2"]
    for words, expected in (
        (["bake", str(name), *jobs], "cannot be read: file name too long"),
        (["bake", str(path), *jobs], "cannot be read: file name too long"),
        (["bake", str(pipe), *jobs], "cannot be read: it is not a regular file"),
        (["bake", str(tmp_path), *jobs], "cannot be read: is a directory"),
        (["bake", "--out", str(name)], "cannot be written: file name too long"),
        (["bake", "--out", str(file)], "file: is not a folder"),
        (["bake", "--out", str(file / "below")], "cannot be written: not a directory"),
    ):
        assert main(words) == 2
        error = capsys.readouterr().err
        assert expected in error and error.count("\n") == 1
    for folder, expected in ((file, "not a directory"), (name, "file name too long")):
        monkeypatch.setenv("ROSY_PRESETS", str(folder))
        for words in (["presets"], ["render", "a.off", "-o", "a.png", "--preset", "mine"]):
            assert main(words) == 2
            assert f"presets cannot be read: {expected}" in capsys.readouterr().err
        assert "plaid" in preset_files(folder)


@pytest.mark.slow
def test_output_streams_that_fail(sphere):
    command = [sys.executable, "-m", "rosy_addon", "info", str(sphere), "--generate", "axis"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    assert process.wait(60) == 141 and process.stderr.read() == b""
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, check=False)
    assert (
        done.returncode == 1 and done.stderr == b"rosy: standard output: no space left on device\n"
    )
    done = subprocess.run(
        [*command[:3], "presets"],
        cwd=ROOT,
        env={**os.environ, "PYTHONIOENCODING": "ascii", "ROSY_PRESETS": "/caf\xe9"},
        capture_output=True,
        check=True,
    )
    assert b"/caf\\xe9" in done.stdout


@pytest.mark.parametrize(
    "words",
    [
        ("render", "a\x1b[31m.obj", "-o", "a.png"),
        ("render", "a\nb\u202e.obj", "-o", "a.png"),
        ("render", "a.obj", "-o", "a.png", "--set", "gain=\x07"),
        ("render", "a.obj", "-o", "a.png", "--preset", "\x9b2J"),
        ("\x1b]0;title\x07",),
    ],
)
def test_control_characters_are_escaped(words, capsys):
    assert main(words) == 2
    error = capsys.readouterr().err.removesuffix("\n")
    assert error and not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e]", error)
    assert "\n" not in error or error.startswith("usage:")

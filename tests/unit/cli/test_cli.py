"""What the command line refuses, in this process and in its own processes, and how it ends."""

import os
import re
import subprocess
import sys
from functools import partial

import pytest
from command_helpers import finished, python, refusal, rosy, write_cube
from conftest import ROOT

from rosy_addon.cli import bake, parser
from rosy_addon.extras.command_line import main
from rosy_addon.preset_files.store import preset_files

COMMAND = [sys.executable, "-m", "rosy_addon"]

#: Commands and their errors. {render} is `render`, a mesh and an output.
REFUSED = {
    "no mesh": ("render none.off -o {out}", "none.off: cannot be read"),
    "no field": ("render {mesh} none.rosy -o {out}", "none.rosy: cannot be read"),
    "kind of mesh": ("info a.step", "a.step: is not a mesh file"),
    "degree 0": ("{render} --degree 0", "degree 0 is not"),
    "curvature 3": ("info {mesh} --degree 3 --generate curvature", "even degree, not 3"),
    "axis": ("info {mesh} --generate axis --axis 0,0,0", "not a direction"),
    "both": ("info {mesh} a.rosy --generate axis", "not both"),
    "size 0": ("{render} --size 0x10", "size 0x10: a side must be"),
    "preset": ("{render} --preset none", "there is no preset 'none'"),
    "setting": ("{render} --set lenght=3", "unknown setting 'lenght'"),
    "still without flow": ("turntable {mesh} -o {out}.gif --still", "nothing moves"),
    "value": ("{render} --set length=long", "--set length=long: expected a whole"),
    "numbers": ("{render} --set color_range=0;1", "color_range=0;1: expected numbers with commas"),
    "switch": ("{render} --set view_plane=2", "expected true or false"),
    "no value": ("{render} --set gain", "expected NAME=VALUE"),
    "no folder": ("render {mesh} -o no/folder/a.png", "the folder no/folder does not exist"),
    "a folder": ("render {mesh} -o tests", "tests: cannot be written: it is a folder"),
    "format": ("field {mesh} -o {out}", "cannot be written as a field"),
    "strokes": ("info {mesh} --singularities a.sings --strokes a", "--strokes applies only to"),
    "guides of a file": ("info {mesh} a.rosy --guides b.rosy", "--guides applies only to"),
    "uv of form": ("info {mesh} --uv", "--uv applies only to --generate guided"),
    "reach of form": ("{render} --reach 0.1", "--reach applies only to --generate curvature"),
    "no title": (f"compare {{mesh}} {'x' * 256}.rosy", ".rosy: cannot be read: file name too long"),
    "view": ("{render} --view nan,0", "view nan,0"),
    "jobs": ("bake a.blend --out {out} --jobs 2", "give --frames"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_one_line_and_status_2(case, sphere, tmp_path):
    words, expected = REFUSED[case]
    out = tmp_path / "a.png"
    words = words.format(mesh=sphere, out=out, render=f"render {sphere} -o {out}")
    assert expected in refusal(*words.split()) and not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        [],
        ["paint"],
        ["render", "a.off"],
        ["render", "a.off", "-o", "b", "--size", "big"],
        ["turntable", "a.off", "-o", "b.gif", "--rate", "1e300"],
        ["turntable", "a.off", "-o", "b.gif", "--pictures", "99999999999"],
        ["bake", "a.blend", "--save", "--frames", "1-3", "--jobs", "0"],
    ],
)
def test_wrong_usage_is_status_2(words):
    done = rosy(*words)
    assert done.returncode == 2 and done.stderr.startswith("usage: python -m rosy_addon")
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_files_may_be_named_after_options(sphere, tmp_path):
    field = tmp_path / "f.npy"
    finished("field", "-o", field, "--generate", "axis", sphere, "--degree", 1)
    first, second = tmp_path / "a.svg", tmp_path / "b.svg"
    size = "--size", "100x100"
    finished("strokes", sphere, field, "-o", first, *size, "--degree", 1)
    finished("strokes", sphere, "-o", second, *size, "--degree", 1, field)
    assert first.read_text() == second.read_text()


def test_help_names_the_program_it_was_started_as(capsys):
    assert rosy("--help").stdout.startswith("usage: python -m rosy_addon [-h] VERB")
    assert parser.main(["--help"]) == 0
    assert capsys.readouterr().out.startswith("usage: blender -b --command rosy")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is no signal there")
def test_ctrl_c_is_status_130_without_a_traceback(sphere, tmp_path):
    code = (
        "import os, signal, sys, rosy_addon.extras.command_line; from rosy_addon.__main__ import run;"
        "signal.signal(signal.SIGALRM, lambda *_: os.kill(os.getpid(), signal.SIGINT));"
        "signal.alarm(2); sys.exit(run())"
    )
    words = ["render", sphere, "-o", tmp_path / "a.png", "--size", "1500x1500"]
    slow = ["--set", "length=2000", "--set", "method=brute"]
    done = python("-c", code, *words, *slow, timeout=60)
    assert done.returncode == 130 and done.stderr == "rosy: stopped\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is no signal there")
def test_ctrl_c_while_python_ends_is_status_130_without_a_traceback():
    code = (
        "import atexit, os, signal, sys; from rosy_addon.__main__ import run;"
        "signal.signal(signal.SIGINT, signal.SIG_DFL);"
        "atexit.register(os.kill, os.getpid(), signal.SIGINT);"
        "sys.argv = ['rosy_addon', '--help']; sys.exit(run())"
    )
    done = python("-c", code)
    assert done.returncode == 130 and done.stderr == "rosy: stopped\n"


def test_bake_without_blender_is_an_error(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "bpy", None)  # as if it were not installed
    assert parser.main(["bake", "--save"]) == 2
    assert "bake needs Blender: run `blender" in capsys.readouterr().err
    assert main(["bake", "--save"]) == 2
    assert "bake: no input: give SCENE.blend" in capsys.readouterr().err


def test_bake_without_an_output_is_refused():
    assert "give --out DIR" in refusal("bake")


def test_workers_get_the_options_as_they_are(tmp_path, monkeypatch):
    """Names may begin with a dash."""
    commands = []
    monkeypatch.setattr(bake, "run_local", lambda command, *_: commands.append(command) or iter(()))
    scene = tmp_path / "scene.blend"
    scene.touch()
    words = [f"--out={tmp_path}", "--object=-a", "--object=b", "--object=--save", "--camera=-x"]
    words += ["--size=8x8", "--preset=plaid", "--device=cpu", "--set=gain=2", "--set=-1=-1"]
    words += ["--blender=-no such program"]
    in_two_words = ["--object=-a", "--object", "b", "--object=--save", *words[:1], *words[4:]]
    for arguments in (words, in_two_words):
        assert main(["bake", str(scene), *arguments, "--frames", "1-2", "--jobs", "2"]) == 0
    command = [*COMMAND, "bake", str(scene), *words, "--workers=1"]
    assert commands == [command, command] and main([*command[3:], "--frames=1-2", "--jobs=2"]) == 0
    assert commands[2] == command


def test_outputs_replace_only_regular_files(tmp_path):
    mesh = write_cube(tmp_path / "cube.obj")
    link, elsewhere = tmp_path / "link.png", tmp_path / "to"
    os.mkfifo(tmp_path / "pipe.png")
    elsewhere.mkdir()
    link.symlink_to(elsewhere / "real.png")
    (tmp_path / "loop.png").symlink_to("loop.png")
    render = ["render", "--generate", "axis", "--size", "16x16"]
    before = mesh.read_bytes()
    for words, output, message in (
        (["field", mesh], "/dev/null", "/dev/null: cannot be written: it is not a regular file"),
        ([*render, mesh], tmp_path / "pipe.png", "not a regular file"),
        ([*render, tmp_path / "pipe.png"], tmp_path / "a.png", "pipe.png"),
        ([*render, mesh], tmp_path / "loop.png", "it is a link to itself"),
        ([*render, mesh], tmp_path / "a.svg", "the file must end in .png"),
        ([*render, mesh], tmp_path / ("a" * 252 + ".png"), "file name too long"),
    ):
        assert message in refusal(*words, "-o", output) and mesh.read_bytes() == before
    longest = tmp_path / ("a" * 251 + ".png")
    for output in (link, longest):
        finished(*render, mesh, "-o", output)
    assert link.is_symlink() and (elsewhere / "real.png").read_bytes() == longest.read_bytes()
    assert not list(tmp_path.glob(".*")) and not list(elsewhere.glob(".*"))


def test_paths_that_cannot_be_opened(tmp_path, monkeypatch):
    name = tmp_path / ("a" * 252 + ".blend")
    pipe, file = tmp_path / "pipe.blend", tmp_path / "file"
    os.mkfifo(pipe)
    file.touch()
    jobs = ["--out", tmp_path, "--frames", "1-2", "--jobs", "2"]
    for words, expected in (
        ([name, *jobs], "cannot be read: file name too long"),
        ([pipe, *jobs], "cannot be read: it is not a regular file"),
        ([tmp_path, *jobs], "cannot be read: is a directory"),
        (["--out", name], "cannot be written: file name too long"),
        (["--out", file], "file: is not a folder"),
        (["--out", file / "below"], "cannot be written: not a directory"),
    ):
        assert expected in refusal("bake", *words)
    for folder, expected in ((file, "not a directory"), (name, "file name too long")):
        monkeypatch.setenv("ROSY_PRESETS", str(folder))
        for words in (["presets"], ["render", "a.off", "-o", "a.png", "--preset", "mine"]):
            assert f"presets cannot be read: {expected}" in refusal(*words)
        assert "plaid" in preset_files(folder)


def test_a_title_may_be_longer_than_the_name_of_a_file(sphere):
    printed = finished("compare", sphere, f"{'x' * 256}=form", "form").stdout
    assert printed.splitlines()[1].startswith(f"{'x' * 256}  ")


def test_an_error_is_the_last_line_after_notes(sphere, tmp_path, capsys):
    """What was assumed is said when it is assumed, also if there is an error later."""
    rows = tmp_path / "rows.txt"
    main(["field", str(sphere), "-o", str(rows), "--generate", "axis", "--degree", "1"])
    rows.write_text("".join(rows.read_text().splitlines(True)[-1280:]))
    assert main(["info", str(sphere), str(rows), "--against", "none.rosy"]) == 2
    note, error = capsys.readouterr().err.splitlines()
    assert "no degree is stated" in note and error.startswith("rosy: none.rosy: cannot be read")


@pytest.mark.slow
def test_commands_without_docstrings(sphere):
    """Python leaves them out if it is told to."""
    for words, expected in ((["info", str(sphere)], "degree 4"), (["--help"], "VERB")):
        assert expected in python("-OO", "-m", "rosy_addon", *words).stdout


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of the size of files")
def test_no_temporary_folder(sphere):
    """No file can be written, so Python finds no folder for temporary files."""
    import resource

    words = ["turntable", sphere, "-o", "film.mp4", "--size", "16x16", "--pictures", "2"]
    no_files = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (0, 0))
    done = python(*COMMAND[1:], *words, preexec_fn=no_files)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("rosy: no ") and "temporary" in done.stderr


@pytest.mark.slow
def test_output_streams_that_fail(sphere):
    command = [*COMMAND, "info", sphere, "--generate", "axis"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    assert process.wait(60) == 141 and process.stderr.read() == b""
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, check=False)
    assert done.returncode == 1
    assert done.stderr == b"rosy: standard output: no space left on device\n"
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "ROSY_PRESETS": "/caf\xe9"}
    assert "/caf\\xe9" in python(*COMMAND[1:], "presets", env=environment).stdout


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

"""Finding a Blender, with small programs in its place. tests/blender runs commands in a real one."""

import os
import subprocess
import sys

import pytest
from conftest import ROOT
from harness.processes import becomes_true

from rosy_addon.extras import blender
from rosy_addon.extras.command_line import main

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the programs are shell scripts")


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Return a function that installs a Blender of a version. At first there is none."""
    monkeypatch.setitem(sys.modules, "bpy", None)  # as if it were not installed
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.delenv("ROSY_BLENDER", raising=False)
    places = (f"{tmp_path}/opt/blender*/blender", f"{tmp_path}/Applications/Blender*.app")
    monkeypatch.setattr(blender, "USUAL_PLACES", {"linux": places, sys.platform: places})

    def install(path, version, rest="exit 1"):
        program = tmp_path / path
        program.parent.mkdir(parents=True, exist_ok=True)
        program.write_text(
            f'#!/bin/sh\n[ "$2" = --version ] && echo warning && echo "{version}" && exit\n{rest}\n'
        )
        program.chmod(0o755)
        return str(program)

    return install


def test_the_one_on_the_path_comes_first_and_then_the_newest(install, tmp_path, error_of):
    expected = f"no version 4.2 or later is on the PATH or in {tmp_path}/opt/bl"
    assert error_of(blender.find_blender).startswith(expected)
    install("opt/blender-4.9/blender", "Blender 4.9.0")
    newest = install("opt/blender-4.10/blender", "Blender 4.10.1 LTS")
    install("opt/blender-9/blender", "Not Blender 9.0")
    assert blender.find_blender() == newest
    bundled = install("Applications/Blender 5.app/Contents/MacOS/Blender", "Blender 5.0.0")
    assert blender.find_blender() == bundled
    on_path = install("bin/blender", "Blender 4.2.0")
    assert blender.find_blender() == on_path
    install("bin/blender", "Blender 4.1.9")
    assert blender.find_blender() == bundled


def test_old_ones_are_named(install, error_of):
    old = install("bin/blender", "Blender 3.6.12")
    assert f"; {old} is 3.6.12: install it" in error_of(blender.find_blender)


def test_the_user_names_one(install, tmp_path, monkeypatch, error_of):
    install("bin/blender", "Blender 4.3.0")
    named = install("an other/blender", "Blender 4.2.3")
    assert blender.find_blender(named) == blender.find_blender(f"{tmp_path}/an other") == named
    install("bin/blender-4.5", "Blender 4.5.0")
    assert blender.find_blender("blender-4.5") == f"{tmp_path}/bin/blender-4.5"
    monkeypatch.setenv("ROSY_BLENDER", named)
    assert blender.find_blender() == named
    assert blender.find_blender("blender").endswith("bin/blender")
    for version, reason in (
        ("Blender 4.1.1", "is Blender 4.1.1, but RoSy needs 4.2 or later"),
        ("Krita 5.2.2", "is not Blender, or does not start"),
    ):
        install("an other/blender", version)
        assert error_of(blender.find_blender) == f"ROSY_BLENDER={named}: {reason}"
    message = error_of(blender.find_blender, "/nowhere")
    assert message == "--blender /nowhere: there is no such program"


def test_a_blender_that_fails_is_one_line(install, tmp_path, capfd):
    program = install("bin/blender", "Blender 4.2.0", "echo hello; echo no library >&2; kill -9 $$")
    assert main(["bake", str(tmp_path / "a.blend"), "--save"]) == 2
    output, errors = capfd.readouterr()
    assert output == ""
    expected = f"rosy: {program}: Blender ended by signal 9 before the command did: no library\n"
    assert errors == expected


def test_ctrl_c_while_blender_is_imported(tmp_path):
    """The command stops after the import. Blender's module would go on, and print a traceback."""
    lines = "try:", "    os.kill(os.getpid(), signal.SIGINT)", "except KeyboardInterrupt:"
    (tmp_path / "bpy.py").write_text(
        "\n".join(("import os, signal", *lines, "    print('caught')"))
    )
    (tmp_path / "tmp").mkdir()
    variables = {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}", "TMPDIR": str(tmp_path / "tmp")}
    words = [sys.executable, "-m", "rosy_addon", "bake", "a.blend", "--save"]
    settings = {"cwd": tmp_path, "env": os.environ | variables, "check": False}
    done = subprocess.run(words, capture_output=True, **settings)
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"rosy: stopped\n")
    assert becomes_true(lambda: not list((tmp_path / "tmp").iterdir()))

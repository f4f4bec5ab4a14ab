"""Run the command line, read its pictures, and write meshes for it."""

import json
import subprocess
import sys

import numpy as np
from conftest import ROOT
from harness.forked import run_command
from PIL import Image
from shapes import cube


def python(*words, **options) -> subprocess.CompletedProcess:
    """Run Python in the folder of the repository, and return its status and its output as text."""
    options = {"cwd": ROOT, "capture_output": True, "text": True} | options
    return subprocess.run([sys.executable, *words], check=False, **options)


def rosy(*arguments) -> subprocess.CompletedProcess:
    """Run ``rosyfields``."""
    return run_command(list(map(str, arguments)), ROOT)


def finished(*arguments) -> subprocess.CompletedProcess:
    """Run a command that succeeds."""
    done = rosy(*arguments)
    assert done.returncode == 0, done.stderr
    return done


def refusal(*arguments) -> str:
    """Run a command that has status 2 and prints one line, and return this line."""
    done = rosy(*arguments)
    assert done.returncode == 2 and done.stdout == "", done.stderr
    assert done.stderr.startswith("rosy: ") and done.stderr.count("\n") == 1
    return done.stderr


def facts_of(*arguments) -> dict:
    """Return what ``rosyfields info`` prints."""
    return json.loads(finished("info", *arguments, "--json").stdout)


def pixels_of(path) -> np.ndarray:
    """Return the (H, W, 4) uint8 pixels of a picture."""
    return np.asarray(Image.open(path))


def write_obj(path, points, faces, uv=None):
    """Write a mesh as an .obj file, with texture coordinates of its vertices, and return its path."""
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(points, float).tolist()]
    rows += [] if uv is None else [f"vt {u!r} {v!r}" for u, v in np.asarray(uv, float).tolist()]
    corner = "{0}" if uv is None else "{0}/{0}"
    rows += ["f " + " ".join(corner.format(vertex + 1) for vertex in face) for face in faces]
    path.write_text("\n".join([*rows, ""]))
    return path


def write_cube(path):
    """Write a cube as an .obj file, and return its path."""
    return write_obj(path, cube().vertices, cube().faces)

"""Run the command line, read its pictures, and write meshes for it."""

from __future__ import annotations

import json
import subprocess

import numpy as np
from conftest import ROOT
from harness.forked import run_command
from PIL import Image
from shapes import cube


def rosy(*arguments) -> subprocess.CompletedProcess:
    """Run ``rosyfields``."""
    return run_command(list(map(str, arguments)), ROOT)


def facts_of(*arguments) -> dict:
    """Return what ``rosyfields info`` prints."""
    done = rosy("info", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def pixels_of(path) -> np.ndarray:
    """Return the (H, W, 4) uint8 pixels of a picture."""
    return np.asarray(Image.open(path))


def assert_refused(completed: subprocess.CompletedProcess, *expected: str) -> None:
    """Check that a command has status 2 and prints one line with the expected texts."""
    assert completed.returncode == 2, completed.stderr
    assert completed.stderr.startswith("rosy: ") and completed.stderr.count("\n") == 1, (
        completed.stderr
    )
    assert completed.stdout == ""
    for text in expected:
        assert text in completed.stderr


def write_cube(path):
    """Write a cube as an .obj file, and return its path."""
    surface = cube()
    quads = surface.corner_vertex.reshape(-1, 4) + 1
    rows = [f"v {x} {y} {z}\n" for x, y, z in surface.vertices]
    path.write_text("".join(rows + [f"f {a} {b} {c} {d}\n" for a, b, c, d in quads]))
    return path

"""Helpers for the tests of the installed wheel, which run without the tree on the path."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

TREE = Path(__file__).resolve().parents[2]

#: The wheels that `make test-wheel` builds from the tree and from the sdist.
WHEELS = TREE / "build" / "wheel"

#: The programs of the environment come first, as after `activate`; the tree is not on the path.
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | {
    "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
}


def run(*command, folder, env=ENVIRONMENT) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, and return its status and output."""
    words = list(map(str, command))
    return subprocess.run(words, cwd=folder, env=env, capture_output=True, text=True)


def write_torus(path: Path) -> None:
    """Write the torus of the examples: 24 x 12 quads around the z axis, with texture coordinates."""
    u, v = np.meshgrid(np.arange(24) / 24, np.arange(12) / 12, indexing="ij")
    ring, tube = 2 * np.pi * u, 2 * np.pi * v
    radius = 1 + 0.4 * np.cos(tube)
    points = np.stack([radius * np.cos(ring), radius * np.sin(ring), 0.4 * np.sin(tube)], axis=-1)
    corner = np.arange(1, 24 * 12 + 1).reshape(24, 12)
    right, up = np.roll(corner, -1, axis=0), np.roll(corner, -1, axis=1)
    quads = np.stack([corner, right, np.roll(right, -1, axis=1), up], axis=-1).reshape(-1, 4)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points.reshape(-1, 3)]
    lines += [f"vt {x:.6f} {y:.6f}" for x, y in zip(u.ravel(), v.ravel(), strict=True)]
    lines += ["f " + " ".join(f"{vertex}/{vertex}" for vertex in quad) for quad in quads]
    path.write_text("\n".join(lines) + "\n")

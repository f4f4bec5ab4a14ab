"""Draw the picture of docs/simulations.md: the stress at the boundary of a beam, from a .vtu file."""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv

from rosy_addon.extras.command_line import main

from .page import IMAGES

#: Path of the picture.
PICTURE = IMAGES / "simulations-beam.png"

#: Length, width and height of the beam, and number of cells along each of them.
SIZES, CELLS = (4.0, 1.0, 1.0), (40, 10, 10)

#: Stresses by bending at the clamped end, by the shear force, and by torsion, relative to the largest bending
#: stress.
BENDING, SHEAR, TORSION = 1.0, 0.17, 0.08


def write() -> None:
    """Draw the picture."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "beam.vtu"
        _beam().save(path)
        words = ["render", str(path), "-o", str(PICTURE)]
        words += ["--array", "stress", "--size", "640x360", "--set", "hue=magnitude"]
        assert main(words) == 0


def _beam() -> pv.UnstructuredGrid:
    """Return tetrahedra with the stress tensors of a beam that is clamped on the left, bent and twisted."""
    spacing = np.divide(SIZES, CELLS)
    mesh = pv.ImageData(dimensions=np.add(CELLS, 1), spacing=spacing).to_tetrahedra(5)
    mesh.clear_data()
    x, y, z = (np.asarray(mesh.points, dtype=np.float64) - [0.0, 0.5, 0.5]).T
    stress = np.zeros((len(x), 6))
    stress[:, 0] = BENDING * (1 - x / SIZES[0]) * 2 * z
    stress[:, 3] = -TORSION * 2 * z
    stress[:, 5] = TORSION * 2 * y + SHEAR / 2 * (1 - 4 * z**2)
    mesh.point_data["stress"] = stress
    return mesh

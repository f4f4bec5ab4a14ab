"""Meshes, fields and fixtures that the tests of the extras share."""

import numpy as np
import pytest
import pyvista as pv
from harness.errors import error_of as error_of

from rosy_addon.extras.command_line import main


@pytest.fixture
def rosy(capfd):
    """A function that runs a command and returns its status, output and errors."""

    def run(*words) -> tuple[int, str, str]:
        status = main([str(word) for word in words])
        output = capfd.readouterr()
        return status, output.out, output.err

    return run


@pytest.fixture
def sphere() -> pv.PolyData:
    """A unit sphere of triangles with the rotation about z at its points."""
    mesh = pv.Icosphere(nsub=3)
    mesh.clear_data()
    mesh.point_data["rotation"] = np.cross((0, 0, 1), mesh.points)
    return mesh


@pytest.fixture
def box() -> pv.UnstructuredGrid:
    """The unit cube as 5 x 3 x 3 x 3 tetrahedra, with the number of each cell."""
    mesh = pv.ImageData(dimensions=(4, 4, 4), spacing=(1 / 3,) * 3).to_tetrahedra(5)
    mesh.clear_data()
    mesh.cell_data["number"] = np.arange(mesh.n_cells)
    return mesh

"""MESH in the files of simulations, for the commands of mesh files."""

from __future__ import annotations

from pathlib import Path

from ..api import Field, Surface
from ..api.mesh_objects import MeshArrays
from ..cli.extras import LoadedSimulation
from ..external.simulation_files import SimulationMesh, make_field, read_simulation


def load_simulation(path: Path, step: int | None, up: str | None) -> LoadedSimulation:
    """Read the surface in a file.

    Parameters
    ----------
    path, step
        See `read_simulation`.
    up : {"y", "z"}, optional
        The axis that points up; "z" by default.

    Returns
    -------
    LoadedSimulation
    """
    mesh = read_simulation(path, step)
    surface = surface_of(mesh, up)

    def field_of(array: str | None, degree: int | None, nonfinite: str) -> Field:
        return Field(surface, make_field(mesh, surface.mesh, array, degree, nonfinite))

    return LoadedSimulation(surface, mesh.note, field_of)


def surface_of(mesh: SimulationMesh, up: str | None = None) -> Surface:
    """Return the surface of a mesh, with its arrays."""
    arrays = MeshArrays(*mesh.polygons, vertex_data=mesh.point_arrays, face_data=mesh.cell_arrays)
    return Surface(arrays, name=mesh.name, up=up)

"""Arrays of the mesh objects of other libraries, none of which is imported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import RosyError
from ..field.formats.polygons import offsets_from_sizes

#: Corners of the surface cells of meshio, by their type. Cells of second order have further points,
#: which are left out.
MESHIO_CORNERS = {
    "triangle": 3, "triangle6": 3, "triangle7": 3,
    "quad": 4, "quad8": 4, "quad9": 4,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """The arrays of a mesh.

    Attributes
    ----------
    vertices : (V, 3) or (V, 2) array_like
    corner_vertex : (C,) int ndarray
        Vertices of the corners, face by face.
    face_start : (F + 1,) int ndarray
        First corner of each face, and C.
    uv : (V, 2) ndarray or None
    vertex_data, face_data : mapping of str to ndarray
        Arrays of V and of F rows.
    """

    vertices: ArrayLike = ()
    corner_vertex: NDArray[Any] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    face_start: NDArray[Any] = field(default_factory=lambda: np.zeros(1, dtype=np.int64))
    uv: NDArray[Any] | None = None
    vertex_data: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    face_data: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def arrays_of(mesh: Any, name: str) -> MeshArrays:
    """Return the arrays of a mesh of meshio, PyVista, trimesh or Open3D. `MeshArrays` stay as they are.

    Raises
    ------
    RosyError
        If the object is no such mesh, or it has no surface.
    """
    if isinstance(mesh, MeshArrays):
        return mesh
    if hasattr(mesh, "points") and isinstance(getattr(mesh, "cells", None), list):
        return _from_meshio(mesh, name)
    if hasattr(mesh, "extract_surface"):
        return _from_pyvista(mesh, name)
    faces = getattr(mesh, "faces", getattr(mesh, "triangles", None))
    if hasattr(mesh, "vertices") and faces is not None:
        return _from_triangles(mesh, np.asarray(faces))
    raise RosyError(
        f"{name}: expected vertices and faces, the path of a file, or a mesh of meshio, PyVista, "
        f"trimesh or Open3D, not {type(mesh).__name__}"
    )


def _from_triangles(mesh: Any, faces: NDArray[Any]) -> MeshArrays:
    """Return the arrays of a mesh of trimesh or Open3D."""
    vertices = np.asarray(mesh.vertices)
    uv = getattr(getattr(mesh, "visual", None), "uv", None)
    if uv is not None and np.shape(uv) != (len(vertices), 2):
        uv = None
    return MeshArrays(
        vertices,
        faces.ravel(),
        np.arange(len(faces) + 1) * faces.shape[1],
        None if uv is None else np.asarray(uv),
        dict(getattr(mesh, "vertex_attributes", {})),
        dict(getattr(mesh, "face_attributes", {})),
    )


def _from_meshio(mesh: Any, name: str) -> MeshArrays:
    """Return the surface cells of a mesh of meshio."""
    corners, sizes, kept = [], [], []
    for index, block in enumerate(mesh.cells):
        count = MESHIO_CORNERS.get(block.type)
        if block.type == "polygon":
            count = np.shape(block.data)[1]
        if count is None or not len(block.data):
            continue
        kept.append(index)
        corners.append(np.asarray(block.data)[:, :count].ravel())
        sizes.append(np.full(len(block.data), count))
    if not kept:
        found = ", ".join(sorted({block.type for block in mesh.cells})) or "none"
        raise RosyError(f"{name}: has no triangles, quads or polygons, only these cells: {found}")
    face_data = {
        key: np.concatenate([np.asarray(blocks[index]) for index in kept])
        for key, blocks in mesh.cell_data.items()
    }
    return MeshArrays(
        mesh.points,
        np.concatenate(corners),
        offsets_from_sizes(np.concatenate(sizes)),
        None,
        {key: np.asarray(values) for key, values in mesh.point_data.items()},
        face_data,
    )


def _from_pyvista(mesh: Any, name: str) -> MeshArrays:
    """Return the surface of a data set of PyVista: of a volume, its boundary."""
    surface = mesh
    if not hasattr(mesh, "faces") or getattr(mesh, "n_strips", 0):
        surface = mesh.extract_surface()
    flat = np.asarray(surface.faces)
    sizes = _run_sizes(flat)
    if not len(sizes):
        raise RosyError(f"{name}: has no faces")
    is_size = np.zeros(len(flat), dtype=bool)
    is_size[np.cumsum(sizes + 1) - sizes - 1] = True
    face_count = len(sizes)
    return MeshArrays(
        np.asarray(surface.points),
        flat[~is_size],
        offsets_from_sizes(sizes),
        None,
        {key: np.asarray(surface.point_data[key]) for key in surface.point_data},
        {
            key: np.asarray(surface.cell_data[key])
            for key in surface.cell_data
            if len(surface.cell_data[key]) == face_count
        },
    )


def _run_sizes(flat: NDArray[Any]) -> NDArray[np.int64]:
    """Return the sizes of faces that are stored as a size and as many vertices, one after another."""
    if not len(flat):
        return np.empty(0, dtype=np.int64)
    step = int(flat[0]) + 1
    if len(flat) % step == 0 and (flat[::step] == step - 1).all():
        return np.full(len(flat) // step, step - 1)
    sizes, position = [], 0
    while position < len(flat):
        sizes.append(int(flat[position]))
        position += sizes[-1] + 1
    return np.array(sizes, dtype=np.int64)

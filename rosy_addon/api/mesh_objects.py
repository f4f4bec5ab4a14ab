"""Arrays of the mesh objects of other libraries, none of which is imported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RosyError
from ..field.formats.polygons import offsets_from_sizes

#: Corners of the surface cells of meshio, by their type. Cells of second order have further points,
#: which are left out.
MESHIO_CORNERS = {
    "triangle": 3, "triangle6": 3, "triangle7": 3,
    "quad": 4, "quad8": 4, "quad9": 4,
}  # fmt: skip

#: VTK's types of faces: triangle, polygon, quad.
VTK_FACES = (5, 7, 9)


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """The arrays of a mesh.

    Attributes
    ----------
    vertices : (V, 3) or (V, 2) array_like
        As it was given, not checked.
    corner_vertex : (C,) int ndarray
        Vertices of the corners, face by face.
    face_start : (F + 1,) int ndarray
        First corner of each face, and C.
    uv : (V, 2) or (C, 2) ndarray or None
    vertex_data, face_data : mapping of str to ndarray
        Arrays of V and of F rows.
    """

    vertices: Any = ()
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
    # A scene of trimesh, and a mesh of Open3D's tensors.
    for conversion in ("to_mesh", "to_legacy"):
        if hasattr(mesh, conversion):
            mesh = getattr(mesh, conversion)()
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
    faces = faces.reshape(-1, 3)
    visual = getattr(mesh, "visual", None)
    uv = np.asarray(getattr(mesh, "triangle_uvs", getattr(visual, "uv", None)))
    is_uv = uv.shape in ((len(vertices), 2), (faces.size, 2))
    vertex_data = dict(getattr(mesh, "vertex_attributes", {}))
    colors = _vertex_colors(mesh)
    if colors.shape[0] == len(vertices):
        vertex_data.update(zip(("red", "green", "blue"), colors.T, strict=False))
    return MeshArrays(
        vertices,
        faces.ravel(),
        np.arange(len(faces) + 1) * 3,
        uv if is_uv and len(uv) else None,
        vertex_data,
        dict(getattr(mesh, "face_attributes", {})),
    )


def _vertex_colors(mesh: Any) -> NDArray[np.float64]:
    """Return the (V, 3) or (V, 4) colors of vertices, 0 to 1; an empty array if there are none."""
    visual: Any = getattr(mesh, "visual", None)
    if getattr(visual, "kind", None) == "vertex":
        return np.asarray(visual.vertex_colors) / 255.0
    return np.asarray(getattr(mesh, "vertex_colors", np.empty((0, 3))), dtype=np.float64)


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
    surface = mesh if hasattr(mesh, "faces") else _extracted_surface(mesh)
    if surface.n_strips:
        surface = surface.triangulate()
    # The unstructured grid has the offsets of faces of different sizes, and says which cells are lines.
    cells = surface.cast_to_unstructured_grid()
    is_face = np.isin(cells.celltypes, VTK_FACES)
    if not is_face.any():
        raise RosyError(f"{name}: has no faces")
    sizes = np.diff(cells.cell_offsets if hasattr(cells, "cell_offsets") else cells.offset)
    return MeshArrays(
        np.asarray(surface.points),
        np.asarray(cells.cell_connectivity)[np.repeat(is_face, sizes)],
        offsets_from_sizes(sizes[is_face]),
        _pyvista_uv(surface),
        {key: np.asarray(values) for key, values in surface.point_data.items()},
        {key: np.asarray(values)[is_face] for key, values in surface.cell_data.items()},
    )


def _extracted_surface(mesh: Any) -> Any:
    """Return the faces of a grid, and the boundary of its volumes."""
    try:
        return mesh.extract_surface(algorithm="dataset_surface")
    except TypeError:  # before PyVista 0.47, there was no other algorithm
        return mesh.extract_surface()


def _pyvista_uv(surface: Any) -> NDArray[Any] | None:
    """Return the (V, 2) active texture coordinates of a mesh of PyVista, or None."""
    uv = getattr(surface, "active_texture_coordinates", None)
    return None if uv is None or uv.shape[1] != 2 else np.asarray(uv)

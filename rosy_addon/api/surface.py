"""`Surface`: a polygon mesh, from arrays, a file, or the mesh of another library."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import RosyError, RosyWarning, counted
from ..field.formats.obj import read_uv
from ..field.formats.ply import read_vertex_values
from ..field.formats.polygons import offsets_from_sizes
from ..field.mesh_io import READERS, SHARP_ANGLE, read_polygons
from ..field.representation import face_frames
from ..field.singularities import euler_characteristic
from ..field.surface import Surface as PolygonMesh
from ..field.surface import build_surface
from ..projection.up_axis import UP_AXIS_BY_SUFFIX, UP_AXIS_MATRIX

#: Corners of the surface cells of meshio, by their type. Cells of second order have further points,
#: which are left out.
MESHIO_CORNERS = {
    "triangle": 3, "triangle6": 3, "triangle7": 3,
    "quad": 4, "quad8": 4, "quad9": 4,
}  # fmt: skip

#: VTK's types of faces: triangle, polygon, quad.
VTK_FACES = (5, 7, 9)


class Surface:
    """A polygon mesh of V vertices and F faces, on which fields are made and drawn.

    Parameters
    ----------
    vertices : (V, 3) array_like, path-like or mesh
        Positions; (V, 2) for a flat mesh. Or, without `faces`, a file (``.obj``, ``.off``, ``.ply``,
        ``.stl``, or a file of a simulation, such as ``.vtu``), or a mesh of meshio, PyVista, trimesh
        (or its scene) or Open3D.
    faces : (F, k) array_like of int, or sequence of sequences of int, optional
        Vertices of each face, counter-clockwise about the outward normal.
    name : str, optional
        For messages; by default the path of the file, or "surface".
    up : {"y", "z"}, optional
        The axis that points up in pictures. By default "y" for ``.obj`` and ``.off`` files, otherwise
        "z".
    uv : (V, 2) or (C, 2) array_like, optional
        Texture coordinates of the vertices, or of the corners, face by face. Files in ``.obj`` format
        and meshes of trimesh, PyVista and Open3D can have their own.
    sharp_angle : float, optional
        Angle in radians between the normals of two faces above which their edge is sharp. Field values
        and normals do not mix across sharp edges. By default 60 degrees.
    sharp_edges : (E, 2) array_like of int, optional
        Pairs of vertices, further sharp edges.
    step : int, optional
        Number of the step in the file of a simulation with several, from 1. By default the last one.

    Attributes
    ----------
    mesh : rosyfields.field.surface.Surface
        The mesh as the other modules of the package use it.
    name : str
        For messages.
    up : {"y", "z"}
        The axis that points up in pictures.

    Warns
    -----
    RosyWarning
        If a file has several steps, and `step` is not given.

    Raises
    ------
    RosyError
        If there is no face, an index is out of range, a coordinate is not finite, or a file cannot be
        read. Files of simulations need ``pip install rosyfields[io]``.

    Examples
    --------
    >>> import rosyfields as rf
    >>> surface = rf.Surface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    >>> surface
    <Surface 'surface': 1 face, 4 vertices>
    >>> bunny = rf.Surface("bunny.obj")  # doctest: +SKIP
    >>> flow = rf.Surface("flow.vtu")  # doctest: +SKIP
    >>> grid = rf.Surface(pyvista.read("flow.vtu"))  # doctest: +SKIP
    """

    def __init__(
        self,
        vertices: ArrayLike | str | os.PathLike[str] | Any,
        faces: ArrayLike | Sequence[Sequence[int]] | None = None,
        *,
        name: str | None = None,
        up: str | None = None,
        uv: ArrayLike | None = None,
        sharp_angle: float | None = None,
        sharp_edges: ArrayLike | None = None,
        step: int | None = None,
    ) -> None:
        self._path: Path | None = None
        if faces is None and isinstance(vertices, (str, os.PathLike)):
            self._path = Path(vertices)
        suffix = "" if self._path is None else self._path.suffix.lower()
        self.name = name or ("surface" if self._path is None else str(self._path))
        self.up = up or UP_AXIS_BY_SUFFIX.get(suffix, "z")
        if self.up not in UP_AXIS_MATRIX:
            raise RosyError(f"{self.name}: up is {self.up!r}: choose 'y' or 'z'")
        if step is not None and suffix in ("", *READERS):
            raise RosyError(f"{self.name}: step applies only to files of simulations, such as .vtu")
        if self._path is not None:
            arrays = _read_arrays(self._path, step)
        elif faces is None:
            arrays = arrays_of(vertices, self.name)
        else:
            arrays = MeshArrays(vertices, *_flat(faces))
        self.mesh: PolygonMesh = build_surface(
            _positions(arrays.vertices, self.name),
            arrays.corner_vertex,
            arrays.face_start,
            name=self.name,
            sharp_angle=SHARP_ANGLE if sharp_angle is None else sharp_angle,
            sharp_edges=None if sharp_edges is None else np.asarray(sharp_edges),
        )
        uv = arrays.uv if uv is None else uv
        self._uv = None if uv is None else self._corner_uv(uv)
        self._vertex_data, self._face_data = arrays.vertex_data, arrays.face_data

    def __repr__(self) -> str:
        counts = (
            counted(self.face_count, "face"),
            counted(len(self.vertices), "vertex", "vertices"),
        )
        return f"<Surface {self.name!r}: {', '.join(counts)}>"

    @property
    def vertices(self) -> NDArray[np.float64]:
        """(V, 3): the positions."""
        return self.mesh.vertices

    @property
    def face_count(self) -> int:
        """F, the number of faces."""
        return self.mesh.face_count

    @cached_property
    def faces(self) -> NDArray[np.int32] | list[NDArray[np.int32]]:
        """(F, k): the vertices of each face; a list of arrays if faces have different sizes."""
        sizes = np.diff(self.mesh.face_start)
        if (sizes == sizes[0]).all():
            return self.mesh.corner_vertex.reshape(-1, sizes[0])
        return np.split(self.mesh.corner_vertex, self.mesh.face_start[1:-1])

    @property
    def face_normals(self) -> NDArray[np.float64]:
        """(F, 3): unit normals; zero for faces without area."""
        return self.mesh.face_normal

    @cached_property
    def face_frames(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The tangent frame of each face: x along its first edge, and y, a quarter turn from it.

        Both are (F, 3). `Field.angles` are measured from x. The frames are those of
        ``igl.local_basis``.
        """
        return face_frames(self.mesh)

    @cached_property
    def euler_characteristic(self) -> int:
        """V - E + F: 2 for a sphere, 0 for a torus. Vertices without a face do not count."""
        return euler_characteristic(self.mesh)

    @cached_property
    def uv(self) -> NDArray[np.float64] | None:
        """(C, 2): texture coordinates of the corners, face by face; None without a UV map."""
        if self._uv is None and self._path is not None and self._path.suffix.lower() == ".obj":
            return read_uv(self._path)
        return self._uv

    @cached_property
    def vertex_data(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of V rows by their names, from a file or from the mesh of a library.

        Those of ``.ply`` files and of files of simulations are read.
        """
        if self._path is not None and self._path.suffix.lower() == ".ply":
            return read_vertex_values(self._path)
        return self._vertex_data

    @property
    def face_data(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of F rows by their names, from the file of a simulation or the mesh of a library."""
        return self._face_data

    def _corner_uv(self, uv: ArrayLike) -> NDArray[np.float64]:
        """Return texture coordinates of the corners, given those of the vertices or of the corners."""
        array = np.asarray(uv, dtype=np.float64)
        counts = len(self.vertices), len(self.mesh.corner_vertex)
        if array.ndim != 2 or array.shape[1] != 2 or len(array) not in counts:
            raise RosyError(
                f"{self.name}: uv needs a row of 2 numbers for each of the {counts[0]:,} vertices or "
                f"{counts[1]:,} corners, not an array of shape {array.shape}"
            )
        if not np.isfinite(array).all():
            raise RosyError(f"{self.name}: uv has values that are not finite")
        return array[self.mesh.corner_vertex] if len(array) == counts[0] else array


def _read_arrays(path: Path, step: int | None) -> MeshArrays:
    """Read a mesh file or, in the Python package, the file of a simulation.

    If it is one step of several, issue a `RosyWarning` that says so.
    """
    if path.suffix.lower() in READERS:
        return MeshArrays(*read_polygons(path))
    known = (*READERS, *simulation_suffixes())
    if path.suffix.lower() not in known:
        *suffixes, last = known
        raise RosyError(
            f"{path}: is not a mesh file: its name must end in {', '.join(suffixes)} or {last}"
        )
    from ..external.simulation_files import read_simulation

    mesh = read_simulation(path, step)
    if mesh.note:
        warnings.warn(mesh.note, RosyWarning, stacklevel=3)
    return MeshArrays(*mesh.polygons, None, mesh.point_arrays, mesh.cell_arrays)


def simulation_suffixes() -> tuple[str, ...]:
    """Return the suffixes of the files of simulations: none in the extension for Blender."""
    try:
        from ..external.simulation_files import SUFFIXES
    except ImportError:
        return ()
    return SUFFIXES


def _flat(
    faces: ArrayLike | Sequence[Sequence[int]],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the vertices of all corners, and the first corner of each face."""
    if isinstance(faces, np.ndarray):
        rows: Sequence[Any] | NDArray[Any] = faces
    else:
        rows = [np.asarray(face) for face in faces]  # type: ignore[union-attr]
        sizes = {row.shape for row in rows}
        if len(sizes) == 1:
            rows = np.array(rows)
    if isinstance(rows, np.ndarray):
        if rows.ndim != 2 or not np.issubdtype(rows.dtype, np.integer):
            raise RosyError(
                f"faces must be whole numbers, one row for each face, not {rows.dtype} of shape "
                f"{rows.shape}"
            )
        return rows.ravel(), np.arange(len(rows) + 1) * rows.shape[1]
    if any(row.ndim != 1 or not np.issubdtype(row.dtype, np.integer) for row in rows):
        raise RosyError("faces must be whole numbers, one sequence for each face")
    return np.concatenate(rows), offsets_from_sizes([len(row) for row in rows])


def _positions(vertices: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return (V, 3) positions; those of a flat mesh, (V, 2), get z = 0."""
    try:
        array = np.asarray(vertices, dtype=np.float64)
    except (TypeError, ValueError):
        raise RosyError(f"{name}: vertices must be numbers, one row for each vertex") from None
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise RosyError(f"{name}: vertices must have the shape (V, 3), not {array.shape}")
    return array if array.shape[1] == 3 else np.pad(array, ((0, 0), (0, 1)))


# The meshes of other libraries, none of which is imported


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

    vertices: Any
    corner_vertex: NDArray[Any]
    face_start: NDArray[Any]
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
    uv = getattr(surface, "active_texture_coordinates", None)
    return MeshArrays(
        np.asarray(surface.points),
        np.asarray(cells.cell_connectivity)[np.repeat(is_face, sizes)],
        offsets_from_sizes(sizes[is_face]),
        None if uv is None or uv.shape[1] != 2 else np.asarray(uv),
        {key: np.asarray(values) for key, values in surface.point_data.items()},
        {key: np.asarray(values)[is_face] for key, values in surface.cell_data.items()},
    )


def _extracted_surface(mesh: Any) -> Any:
    """Return the faces of a grid, and the boundary of its volumes."""
    try:
        return mesh.extract_surface(algorithm="dataset_surface")
    except TypeError:  # before PyVista 0.47, there was no other algorithm
        return mesh.extract_surface()

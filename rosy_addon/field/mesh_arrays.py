"""`MeshArrays`: the arrays of a mesh, from a file or from a mesh object of another library.

Such libraries are meshio, PyVista, trimesh and Open3D. None of them is imported here.
"""

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import RosyError, RosyWarning, counted
from .copied_faces import copied_faces
from .formats.obj import read_uv
from .formats.polygons import Polygons, offsets_from_sizes
from .joining import coinciding_borders, without_repeats
from .mesh_io import READERS, read_polygons


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """The arrays of a mesh with V vertices, F faces and C corners, not yet checked.

    Attributes
    ----------
    vertices : (V, 3) or (V, 2) array_like
        Positions; a mesh with (V, 2) positions is flat.
    corner_vertex : (C,) int ndarray
        Vertices of the corners, face by face.
    face_start : (F + 1,) int ndarray
        First corner of each face, and C.
    uv : (V, 2) or (C, 2) array_like or None
        Texture coordinates of the vertices or of the corners.
    vertex_data, face_data : mapping of str to ndarray, or None
        Named arrays with V rows (`vertex_data`) and F rows (`face_data`). None if they are not read yet: the
        mesh file may have such arrays.
    note : str
        A warning about how the mesh was read; may be empty.
    """

    vertices: Any
    corner_vertex: NDArray[Any]
    face_start: NDArray[Any]
    uv: Any = None
    vertex_data: Mapping[str, NDArray[Any]] | None = None
    face_data: Mapping[str, NDArray[Any]] | None = None
    note: str = ""

    @property
    def polygons(self) -> Polygons:
        """The vertices and faces as `Polygons`."""
        return Polygons(self.vertices, self.corner_vertex, self.face_start)


#: Functions that read files of simulations, by file suffix. Their arguments are the path and the time step.
#: The Python package adds them; the Blender extension has none.
SIMULATION_READERS: dict[str, Callable[[Path, int | None], MeshArrays]] = {}

#: Functions that read mesh objects of other libraries, by an attribute that only these objects have. Their
#: arguments are the object and its name for messages. The Python package adds them.
OBJECT_READERS: dict[str, Callable[[Any, str], MeshArrays]] = {}


def mesh_arrays(
    vertices: ArrayLike | str | os.PathLike[str] | Any,
    faces: ArrayLike | Sequence[Sequence[int]] | None,
    name: str,
    uv: ArrayLike | None = None,
    step: int | None = None,
    join: bool | None = None,
) -> MeshArrays:
    """Return the arrays of a mesh that is given by arrays, by a file or by a mesh object of another library.

    A `RosyWarning` says how many vertices have been joined.

    Parameters
    ----------
    vertices : (V, 3) or (V, 2) array_like, path-like or object
        Positions or, if `faces` is None, a mesh file or a mesh object.
    faces : (F, k) array_like of int, or sequence of sequences of int, or None
        Vertices of each face.
    name : str
        Name of the mesh in messages.
    uv : (V, 2) or (C, 2) array_like, optional
        Texture coordinates of vertices or corners; by default read from the file or object.
    step : int, optional
        Time step to read from the file of a simulation, from 1; by default the last one.
    join : bool, optional
        Whether to join vertices on borders that coincide; by default only for some sources (see `Surface`).

    Returns
    -------
    MeshArrays
        Its `vertices` are (V, 3), and its `uv` is (C, 2) or None.

    Raises
    ------
    RosyError
        If the vertices are not numbers, the faces are not whole numbers, the number of texture coordinates
        does not fit, a file cannot be read, or an object is not a mesh.
    """
    is_path = faces is None and isinstance(vertices, (str, os.PathLike))
    suffix = Path(vertices).suffix.lower() if is_path else ""
    if step is not None and suffix in ("", *READERS):
        raise RosyError(f"{name}: step applies only to files of simulations, such as .vtu")
    if suffix in SIMULATION_READERS:
        arrays = SIMULATION_READERS[suffix](Path(vertices), step)
        if arrays.note:
            warnings.warn(arrays.note, RosyWarning, stacklevel=3)
    elif is_path:
        arrays = MeshArrays(*read_polygons(vertices, tuple(SIMULATION_READERS)))
    elif faces is None:
        arrays = _arrays_of(vertices, name)
    else:
        arrays = MeshArrays(vertices, *_flat_faces(faces))
    points = _positions(arrays.vertices, name)
    uv = arrays.uv if uv is None else uv
    if uv is not None:
        uv = _corner_uv(uv, len(points), arrays.corner_vertex, name)
    elif join and suffix == ".obj":
        uv = read_uv(Path(vertices))  # for the faces as they are in the file
    arrays = replace(arrays, vertices=points, uv=uv)
    is_grid = suffix in SIMULATION_READERS or (faces is None and not is_path)
    if join or (join is None and (is_grid or suffix == ".stl")):
        arrays, count, left_out = _with_joined_borders(arrays)
        if count and suffix != ".stl":
            text = f"{name}: {counted(count, 'vertex', 'vertices')} on borders coincided with others and "
            text += "were joined (join=False or --no-join keeps them apart)"
            warnings.warn(text, RosyWarning, stacklevel=3)
        if left_out:
            text = f"{name}: {counted(left_out, 'face')} with fewer than three different corners were left out"
            warnings.warn(text, RosyWarning, stacklevel=3)
    if join:
        arrays, count = _without_copied_faces(arrays)
        if count:
            text = f"{name}: {counted(count, 'face')} with the same corners as others were removed"
            warnings.warn(text, RosyWarning, stacklevel=3)
    return arrays


def _with_joined_borders(arrays: MeshArrays) -> tuple[MeshArrays, int, int]:
    """Join the vertices that `coinciding_borders` finds, and leave out faces that become an edge or a point.

    Parameters
    ----------
    arrays : MeshArrays
        With (V, 3) vertices, and texture coordinates of the corners, if any.

    Returns
    -------
    joined : MeshArrays
        Without the vertices that have been joined to others. A joined vertex has the data of the first one.
    count, left_out : int
        Numbers of vertices that have been joined to others, and of faces that have been left out.
    """
    target = coinciding_borders(arrays.polygons, arrays.vertex_data)
    kept = target == np.arange(len(target))
    count = int((~kept).sum())
    corner_vertex, face_start, corner, face = without_repeats(target, arrays.polygons)
    left_out = arrays.polygons.face_count - len(face)
    if not (count or left_out):
        return arrays, 0, 0
    number = np.cumsum(kept) - 1
    arrays = _with_faces(arrays, number[corner_vertex], face_start, corner, face)
    data = _selected_rows(arrays.vertex_data, kept, len(target))
    return replace(arrays, vertices=arrays.vertices[kept], vertex_data=data), count, left_out


def _with_faces(arrays: MeshArrays, vertex: Any, start: Any, corner: Any, face: Any) -> MeshArrays:
    """Return the arrays of a mesh with other faces, which take their data from the old faces.

    `vertex` and `start` are the new `corner_vertex` and `face_start`. `corner` holds, for each new corner,
    the old corner whose texture coordinates it gets, and `face`, for each new face, the old face whose data
    it gets.
    """
    uv = None if arrays.uv is None else arrays.uv[corner]
    data = _selected_rows(arrays.face_data, face, len(arrays.face_start) - 1)
    return replace(arrays, corner_vertex=vertex, face_start=start, uv=uv, face_data=data)


def _selected_rows(data: Mapping[str, Any] | None, index: Any, count: int) -> dict[str, Any] | None:
    """Return the rows of named arrays that `index` selects. Arrays without `count` rows do not change."""
    if data is None:
        return None
    return {key: np.asarray(v)[index] if len(v) == count else v for key, v in data.items()}


def _corner_uv(uv: Any, vertex_count: int, corner_vertex: NDArray[Any], name: str) -> NDArray[Any]:
    """Return (C, 2) texture coordinates of corners; `uv` has a row for each vertex or for each corner.

    `name` is the name of the mesh in messages.
    """
    array = np.asarray(uv, dtype=np.float64)
    if array.shape not in ((vertex_count, 2), (len(corner_vertex), 2)):
        raise RosyError(
            f"{name}: uv needs a row of 2 numbers for each of the {vertex_count:,} vertices or "
            f"{len(corner_vertex):,} corners, not an array of shape {array.shape}"
        )
    if not np.isfinite(array).all():
        raise RosyError(f"{name}: uv has values that are not finite")
    return array[corner_vertex] if len(array) == vertex_count else array


def _flat_faces(faces: ArrayLike | Sequence[Sequence[int]]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return `corner_vertex` and `face_start` (see `MeshArrays`) for faces as an array or as sequences."""
    rows: Any = faces if isinstance(faces, np.ndarray) else [np.asarray(face) for face in faces]
    if isinstance(rows, np.ndarray) or len({row.shape for row in rows}) == 1:
        rows = np.asarray(rows)
        if rows.ndim != 2 or not np.issubdtype(rows.dtype, np.integer):
            raise RosyError(
                f"faces must be whole numbers, one row for each face, not {rows.dtype} of shape {rows.shape}"
            )
        return rows.ravel(), np.arange(len(rows) + 1) * rows.shape[1]
    if any(row.ndim != 1 or not np.issubdtype(row.dtype, np.integer) for row in rows):
        raise RosyError("faces must be whole numbers, one sequence for each face")
    return np.concatenate(rows), offsets_from_sizes([len(row) for row in rows])


def _positions(vertices: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return positions as (V, 3) float64. The (V, 2) positions of a flat mesh get the coordinate z = 0."""
    try:
        array = np.asarray(vertices, dtype=np.float64)
    except (TypeError, ValueError):
        raise RosyError(f"{name}: vertices must be numbers, one row for each vertex") from None
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise RosyError(f"{name}: vertices must have the shape (V, 3), not {array.shape}")
    return array if array.shape[1] == 3 else np.pad(array, ((0, 0), (0, 1)))


def _arrays_of(mesh: Any, name: str) -> MeshArrays:
    """Return the arrays of a mesh object of meshio, PyVista, trimesh or Open3D.

    An object that is already `MeshArrays` is returned unchanged.

    Raises
    ------
    RosyError
        If the object is not such a mesh, or if the mesh has no surface.
    """
    if isinstance(mesh, MeshArrays):
        return mesh
    for attribute, read in OBJECT_READERS.items():
        if hasattr(mesh, attribute):
            return read(mesh, name)
    # Convert a scene of trimesh to a mesh, and a tensor mesh of Open3D to a legacy mesh.
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
    """Return the arrays of a triangle mesh of trimesh or Open3D, given its (F, 3) faces."""
    vertices = np.asarray(mesh.vertices)
    faces = faces.reshape(-1, 3)
    visual: Any = getattr(mesh, "visual", None)
    uv = np.asarray(getattr(mesh, "triangle_uvs", getattr(visual, "uv", None)))
    is_uv = uv.shape in ((len(vertices), 2), (faces.size, 2))
    vertex_data = dict(getattr(mesh, "vertex_attributes", {}))
    colors = getattr(mesh, "vertex_colors", ())
    if getattr(visual, "kind", None) == "vertex":
        colors = np.asarray(visual.vertex_colors) / 255.0
    colors = np.asarray(colors, dtype=np.float64)
    if len(colors) == len(vertices):
        vertex_data.update(zip(("red", "green", "blue"), colors.T, strict=False))
    face_start = np.arange(len(faces) + 1) * 3
    face_data = dict(getattr(mesh, "face_attributes", {}))
    uv = uv if is_uv and len(uv) else None
    return MeshArrays(vertices, faces.ravel(), face_start, uv, vertex_data, face_data)


def _without_copied_faces(arrays: MeshArrays) -> tuple[MeshArrays, int]:
    """Remove `copied_faces`. Return the other faces, with their data, and the number of removed ones."""
    is_kept = ~copied_faces(*arrays.polygons)
    size = np.diff(arrays.face_start)
    corner, face_start = np.repeat(is_kept, size), offsets_from_sizes(size[is_kept])
    kept = _with_faces(arrays, arrays.corner_vertex[corner], face_start, corner, is_kept)
    return kept, int((~is_kept).sum())

"""`Surface`: a polygon mesh as flat arrays, with its triangles, its normals and its smooth fans.

A *smooth fan* is a set of corners at a vertex that share a normal: no sharp edge lies between their faces.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.cache import content_hash
from ..core.errors import RosyError, RosyWarning, counted
from .blocks import bincount_rows, mask, row_blocks
from .connectivity import Edges, build_edges, smooth_fans
from .copied_faces import copies_note
from .formats.obj import read_uv
from .formats.ply import read_values
from .frames import dot, normalize
from .mesh_arrays import mesh_arrays
from .mesh_io import SHARP_ANGLE
from .polygon_arrays import (
    BLOCK_ELEMENTS,
    box_corners,
    corner_faces,
    face_area_vectors,
    face_blocks,
    fan_normals,
    mean_per_face,
    next_corners,
)
from .triangulate import delaunay_triangles, triangulate
from .up_axis import UP_AXIS_BY_SUFFIX, UP_AXIS_MATRIX

#: Largest coordinate and smallest extent of a mesh. Beyond them, squares and products of lengths
#: leave the range of floating-point numbers.
MAX_COORDINATE, MIN_EXTENT = 1e12, 1e-12

#: A corner normal counts as equal to the mean of its fan if no component differs by more than this.
NORMAL_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Surface:
    """A polygon mesh on which fields are made and drawn.

    It has V vertices, F faces, C corners (face-vertex pairs) and T triangles. The corners of face f are
    ``face_start[f] .. face_start[f + 1] - 1``, counter-clockwise about the outward normal, as in
    Blender. `build_surface` makes a surface from such flat arrays.

    Parameters
    ----------
    vertices : (V, 3) array_like, path-like or mesh
        Positions of the vertices; (V, 2) for a flat mesh. If `faces` is not given: the path of a file
        (``.obj``, ``.off``, ``.ply``, ``.stl``, ``.om``, or a file of a simulation, such as ``.vtu``), or a
        mesh object of meshio, PyVista, trimesh (or a scene of trimesh) or Open3D.
    faces : (F, k) array_like of int, or sequence of sequences of int, optional
        Vertices of each face, counter-clockwise about the outward normal.
    name : str, optional
        Name in messages; by default the path of the file, or "surface" if there is no file.
    up : {"y", "z"}, optional
        The axis that points up in pictures. By default "y" for ``.obj`` and ``.off`` files, otherwise
        "z".
    uv : (V, 2) or (C, 2) array_like, optional
        Texture coordinates of the vertices, or of the corners, face by face. By default they are read from
        the ``.obj`` file, or from the mesh object of trimesh, PyVista or Open3D, if it has texture
        coordinates.
    sharp_angle : float, optional
        Angle in radians between the normals of two faces above which their edge is sharp. Field values
        and normals do not mix across sharp edges. By default 60 degrees.
    sharp_edges : (E, 2) array_like of int, optional
        Pairs of vertices: edges that are sharp regardless of their angle.
    step : int, optional
        Number of the time step to read if the file of a simulation has several, counted from 1. By default
        the last step.
    join : bool, optional
        Whether to join vertices on borders that are at the same position (within 1e-6 of the longest side)
        and have the same data, such as at the seam and the poles of a grid of longitudes and latitudes. By
        default only for files of simulations, objects of other libraries and .stl files. Faces with fewer
        than three different corners are then left out, and a `RosyWarning` says so. If `join` is True, faces
        that have the same corners as others, as on a two-sided sheet, are removed; otherwise a `RosyWarning`
        says that there are some.

    Attributes
    ----------
    name : str
        Name for messages.
    vertices : (V, 3) float64 ndarray
        Positions in object space, after deformation.
    corner_vertex : (C,) int32 ndarray
        Vertex of each corner.
    face_start : (F + 1,) int32 ndarray
        First corner of each face, and C.
    triangles : (T, 3) int32 ndarray
        Corner indices (not vertices) of each triangle.
    triangle_face : (T,) int32 ndarray
        Face of each triangle.
    corner_normal : (C, 3) float64 ndarray
        Unit shading normals.
    corner_fan : (C,) int32 ndarray
        Index of the smooth fan of each corner. The corners of a fan share a vertex and a smooth normal,
        and field values are averaged over them. Sharp edges and faces with flat shading separate fans.
    rest_vertices : (V, 3) float64 ndarray or None
        Positions before deformation; None if the mesh is not deformed. The vectors of a field are tangent
        to this shape.
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

    name: str
    vertices: np.ndarray
    corner_vertex: np.ndarray
    face_start: np.ndarray
    triangles: np.ndarray
    triangle_face: np.ndarray
    corner_normal: np.ndarray
    corner_fan: np.ndarray
    rest_vertices: np.ndarray | None = None
    up: str = "z"

    #: Path of the file that the surface was read from; empty if there is none. Like `uv` and the arrays below,
    #: this is not a field of the dataclass, so it is not passed to other processes.
    _path = Path()

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
        join: bool | None = None,
    ) -> None:
        is_path = faces is None and isinstance(vertices, (str, os.PathLike))
        name = name or (str(vertices) if is_path else "surface")
        up = up or (UP_AXIS_BY_SUFFIX.get(Path(vertices).suffix.lower(), "z") if is_path else "z")
        if up not in UP_AXIS_MATRIX:
            raise RosyError(f"{name}: up is {up!r}: choose 'y' or 'z'")
        arrays = mesh_arrays(vertices, faces, name, uv, step, join)
        built = build_surface(
            *arrays.polygons,
            name=name,
            sharp_angle=SHARP_ANGLE if sharp_angle is None else sharp_angle,
            sharp_edges=None if sharp_edges is None else np.asarray(sharp_edges),
        )
        if note := copies_note(name, *arrays.polygons):
            text = f"{note} (join=True or --join keeps one of each)"
            warnings.warn(text, RosyWarning, stacklevel=2)
        own = vars(self)
        own.update(vars(built), up=up, _path=Path(vertices) if is_path else Path())
        given = {"uv": arrays.uv, "vertex_data": arrays.vertex_data, "face_data": arrays.face_data}
        own.update((key, value) for key, value in given.items() if value is not None)

    def __repr__(self) -> str:
        faces = counted(self.face_count, "face")
        vertices = counted(len(self.vertices), "vertex", "vertices")
        return f"<Surface {self.name!r}: {faces}, {vertices}>"

    def with_parts(self, **parts: Any) -> Surface:
        """Return a copy of the surface in which some attributes are replaced; they must fit the others."""
        own = {each.name: getattr(self, each.name) for each in fields(self)}
        return _surface_of_parts(**{**own, **parts})

    @property
    def face_count(self) -> int:
        """F, the number of faces."""
        return len(self.face_start) - 1

    @property
    def faces(self) -> np.ndarray | list[np.ndarray]:
        """The vertices of each face: (F, k) int32, or a list of F arrays if faces have different sizes."""
        sizes = np.diff(self.face_start)
        if (sizes == sizes[0]).all():
            return self.corner_vertex.reshape(-1, sizes[0])
        return np.split(self.corner_vertex, self.face_start[1:-1])

    @cached_property
    def uv(self) -> np.ndarray | None:
        """(C, 2) float64: texture coordinates of the corners, face by face; None if there is no UV map."""
        return read_uv(self._path) if self._path.suffix.lower() == ".obj" else None

    @cached_property
    def vertex_data(self) -> Mapping[str, np.ndarray]:
        """Named arrays with a row for each vertex.

        They come from a ``.ply`` file, from the file of a simulation, or from a mesh object of another
        library, such as PyVista.
        """
        return read_values(self._path) if self._path.suffix.lower() == ".ply" else {}

    @cached_property
    def face_data(self) -> Mapping[str, np.ndarray]:
        """Named arrays with a row for each face.

        They come from the same sources as `vertex_data`.
        """
        return read_values(self._path, "face") if self._path.suffix.lower() == ".ply" else {}

    @cached_property
    def edges(self) -> Edges:
        """The edges of the mesh, and the two halfedges of each interior edge."""
        return build_edges(self.corner_vertex, self.face_start)

    @cached_property
    def face_frames(self) -> tuple[np.ndarray, np.ndarray]:
        """The tangent frames x, y of the faces: x along the first edge of a face, y = normal cross x.

        Both are (F, 3) float64, and zero for faces without area, so that representations are zero there. An
        edge of length 0 is skipped. `Field.angles` are measured from x. The frames are the same as those of
        ``igl.local_basis``.
        """
        normal = self.face_normal
        x = np.empty_like(normal)
        for faces, corners, starts in face_blocks(self.face_start):
            points = self.vertices.take(self.corner_vertex[corners], axis=0)
            corner_normal = np.repeat(normal[faces], np.diff(starts), axis=0)
            edge = points[next_corners(starts)] - points
            edge -= dot(edge, corner_normal)[:, None] * corner_normal
            length = np.sqrt(dot(edge, edge))
            last_corner = np.repeat(starts[1:] - 1, np.diff(starts))
            candidate = np.where(length > 0, np.arange(len(length)), last_corner)
            x[faces] = normalize(edge[np.minimum.reduceat(candidate, starts[:-1])])
        x[~normal.any(axis=1)] = 0.0
        return x, np.cross(normal, x)

    @property
    def euler_characteristic(self) -> int:
        """Number of vertices - edges + faces: 2 for a sphere, 0 for a torus. Unused vertices do not count."""
        return len(self.used_vertices) - len(self.edges.ends) + self.face_count

    def in_rest_shape(self) -> Surface:
        """Return the surface before deformation, in the shape to which the vectors of a field are tangent."""
        rest = self.rest_vertices
        return self if rest is None else self.with_vertices(rest)

    def with_vertices(self, vertices: np.ndarray) -> Surface:
        """Return the surface with other (V, 3) positions, and without a rest shape.

        Shading normals do not change.
        """
        return self.with_parts(vertices=vertices, rest_vertices=None)

    @cached_property
    def rest_shape_key(self) -> bytes:
        """A hash of the rest shape and its triangles. It is the same for all deformations of a mesh."""
        rest = self.in_rest_shape().vertices
        return content_hash(rest, self.corner_vertex, self.face_start, self.triangles)

    @cached_property
    def content_key(self) -> bytes:
        """A hash of the vertices, the rest shape and the faces: the same for equal meshes."""
        mesh = self.vertices, self.corner_vertex, self.face_start
        return content_hash(*mesh, *([] if self.rest_vertices is None else [self.rest_vertices]))

    @cached_property
    def extent(self) -> float:
        """Length of the longest side of the bounding box in object space; see `box_corners`."""
        return float(np.ptp(self.box_corners, axis=0).max())

    @cached_property
    def mean_edge_length(self) -> float:
        """Mean length of the sides of all faces, in object space. An edge of two faces counts twice."""
        corners = self.vertices[self.corner_vertex]
        edge = corners[self.next_corner] - corners
        return float(np.sqrt(dot(edge, edge)).mean())

    @cached_property
    def used_vertices(self) -> np.ndarray:
        """(n,) intp: the vertices that belong to a face, in ascending order."""
        return np.flatnonzero(mask(len(self.vertices), self.corner_vertex))

    @cached_property
    def box_corners(self) -> np.ndarray:
        """(8, 3) float64: corners of the bounding box of all vertices that belong to a face."""
        return box_corners(self.vertices[self.used_vertices])

    @cached_property
    def corner_face(self) -> np.ndarray:
        """(C,) int32: the face of each corner."""
        return corner_faces(self.face_start)

    @cached_property
    def next_corner(self) -> np.ndarray:
        """(C,) int32: for each corner, the next corner of the same face, counter-clockwise."""
        return next_corners(self.face_start)

    @cached_property
    def triangle_vertex(self) -> np.ndarray:
        """(T, 3) int32: the three vertices of each triangle."""
        return self.corner_vertex.take(self.triangles)

    @cached_property
    def fan_normal(self) -> np.ndarray:
        """(K, 3) float64: normalized mean of the corner normals of each of the K smooth fans."""
        return normalize(bincount_rows(self.corner_fan, self.corner_normal))

    @cached_property
    def fans_share_normals(self) -> bool:
        """Whether all corner normals equal the mean normal of their fan; custom normals may differ."""
        for block in row_blocks(len(self.corner_fan), BLOCK_ELEMENTS):
            mean = self.fan_normal.take(self.corner_fan[block], axis=0)
            if np.abs(self.corner_normal[block] - mean).max() > NORMAL_TOLERANCE:
                return False
        return True

    @cached_property
    def face_normal(self) -> np.ndarray:
        """(F, 3) float64: unit normals of the faces by Newell's formula; zero for a face without area."""
        return normalize(face_area_vectors(self.vertices, self.corner_vertex, self.face_start))

    @cached_property
    def face_area(self) -> np.ndarray:
        """(F,) float64: areas of the faces, in object space, by Newell's formula."""
        area = face_area_vectors(self.vertices, self.corner_vertex, self.face_start)
        return np.linalg.norm(area, axis=1)

    @cached_property
    def face_center(self) -> np.ndarray:
        """(F, 3) float64: the mean of the corner positions of each face."""
        return mean_per_face(self.vertices[self.corner_vertex], self.face_start)


def build_surface(
    vertices: np.ndarray,
    corner_vertex: np.ndarray,
    face_start: np.ndarray,
    *,
    name: str = "mesh",
    sharp_edges: np.ndarray | None = None,
    sharp_angle: float | None = None,
    flat_faces: np.ndarray | None = None,
    corner_normal: np.ndarray | None = None,
    corner_fan: np.ndarray | None = None,
    triangles: np.ndarray | None = None,
    triangle_face: np.ndarray | None = None,
    rest_vertices: np.ndarray | None = None,
) -> Surface:
    """Make a `Surface` from arrays, and compute the attributes that are not given.

    Parameters
    ----------
    vertices : (V, 3) array_like
        Positions in object space, after deformation.
    corner_vertex : (C,) array_like of int
        Vertex of each corner, face by face.
    face_start : (F + 1,) array_like of int
        First corner of each face, and C.
    name : str
        Name for messages.
    sharp_edges : (n, 2) array_like of int, optional
        Vertex pairs across which normals and field values do not mix.
    sharp_angle : float, optional
        Edges with a larger angle between the normals of their faces, in radians, are also sharp.
    flat_faces : (F,) array_like of bool, optional
        Faces with flat shading, which do not share normals or field values with other faces.
    corner_normal : (C, 3) array_like, optional
        Shading normals. By default the face normals averaged over each smooth fan, weighted by corner angle.
    corner_fan : (C,) array_like of int, optional
        Index of the smooth fan of each corner; by default the result of `smooth_fans`.
    triangles, triangle_face : (T, 3) and (T,) array_like of int, optional
        Corners and face of each triangle; by default the result of `triangulate`.
    rest_vertices : (V, 3) array_like, optional
        Positions before deformation, if the mesh is deformed.

    Returns
    -------
    Surface

    Raises
    ------
    RosyError
        If there is no face, a face has fewer than three corners, an index is out of range, a
        coordinate is not finite or above `MAX_COORDINATE`, or the mesh is smaller than `MIN_EXTENT`.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3)
    corner_vertex = np.ascontiguousarray(corner_vertex, dtype=np.int32).ravel()
    face_start = np.ascontiguousarray(face_start, dtype=np.int32).ravel()
    polygons = vertices, corner_vertex, face_start
    _check_polygons(name, *polygons)
    if triangles is None:
        triangles, triangle_face = triangulate(*polygons)
    if corner_fan is None:
        corner_fan = smooth_fans(*polygons, sharp_edges, sharp_angle, flat_faces)
    if corner_normal is None:
        corner_normal = fan_normals(*polygons, corner_fan)
    if rest_vertices is not None:
        rest_vertices = np.ascontiguousarray(rest_vertices, dtype=np.float64)
    return _surface_of_parts(
        name=name,
        vertices=vertices,
        corner_vertex=corner_vertex,
        face_start=face_start,
        triangles=np.ascontiguousarray(triangles, dtype=np.int32).reshape(-1, 3),
        triangle_face=np.ascontiguousarray(triangle_face, dtype=np.int32).ravel(),
        corner_normal=np.ascontiguousarray(corner_normal, dtype=np.float64),
        corner_fan=corner_fan,
        rest_vertices=rest_vertices,
    )


def with_delaunay_triangles(surface: Surface) -> Surface:
    """Return the surface with Delaunay triangles, which do not depend on the first corners of its faces.

    They are for solvers. Pictures use triangles that stay the same when a mesh is deformed.
    """
    if len(surface.triangles) == surface.face_count:
        return surface
    points = surface.vertices[surface.corner_vertex]
    triangles = delaunay_triangles(points, surface.triangles, surface.triangle_face)
    return surface.with_parts(triangles=triangles)


def _surface_of_parts(**parts: Any) -> Surface:
    """Return a surface with the given attributes, without the work of `Surface.__init__`."""
    surface = object.__new__(Surface)
    vars(surface).update(parts)
    return surface


def _check_polygons(
    name: str, vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> None:
    """Raise a `RosyError` unless the arrays for `build_surface` describe a valid mesh with faces."""
    if len(face_start) < 2:
        raise RosyError(f"{name}: the mesh has no faces")
    corner_counts = np.diff(face_start)
    if corner_counts.min() < 3:
        face = int(np.argmin(corner_counts))
        raise RosyError(
            f"{name}: face {face} has {counted(corner_counts[face], 'corner')}, expected 3 or more"
        )
    if corner_vertex.min() < 0 or corner_vertex.max() >= len(vertices):
        raise RosyError(f"{name}: a face refers to a vertex that does not exist")
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        raise RosyError(
            f"{name}: vertex {int(np.argmin(finite))} has a coordinate that is not finite"
        )
    far = (np.abs(vertices) > MAX_COORDINATE).any(axis=1)
    if far.any():
        raise RosyError(
            f"{name}: vertex {int(np.argmax(far))} has a coordinate above {MAX_COORDINATE:g}: scale or "
            "move the mesh"
        )
    used = mask(len(vertices), corner_vertex)
    if 0 < np.ptp(vertices[used], axis=0).max() < MIN_EXTENT:
        raise RosyError(f"{name}: is smaller than {MIN_EXTENT:g}: scale the mesh")


def is_same_surface(first: Surface, second: Surface) -> bool:
    """Return whether two surfaces have the same vertices and faces, such as a file that is read twice."""
    return first is second or first.content_key == second.content_key


def have_same_polygons(first: Surface, second: Surface) -> bool:
    """Return whether two meshes have the same faces by vertex index. Positions may differ."""
    return (
        len(first.vertices) == len(second.vertices)
        and np.array_equal(first.corner_vertex, second.corner_vertex)
        and np.array_equal(first.face_start, second.face_start)
    )

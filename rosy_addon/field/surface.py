"""Polygon meshes as flat arrays, with their edges, smooth fans, normals and connectivity."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.cache import content_hash
from ..core.errors import RosyError, counted
from ..core.progress import progress, report
from .blocks import mask, row_blocks
from .frames import dot, normalize
from .mesh_arrays import mesh_arrays
from .mesh_io import SHARP_ANGLE, read_uv_map, read_vertex_data
from .triangulate import triangulate
from .up_axis import UP_AXIS_BY_SUFFIX, UP_AXIS_MATRIX

#: Largest coordinate and smallest extent of a mesh. Beyond them, squares and products of lengths
#: leave the range of floating-point numbers.
MAX_COORDINATE, MIN_EXTENT = 1e12, 1e-12

#: Largest difference, in each component, at which a corner normal equals the mean of its fan.
NORMAL_TOLERANCE = 1e-6

#: Faces or corners processed at once, to bound memory and fit in the CPU caches.
BLOCK_ELEMENTS = 1 << 14


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Surface:
    """A polygon mesh, on which fields are made and drawn.

    It has V vertices, F faces, C corners (face-vertex pairs) and T triangles. The corners of face f are
    ``face_start[f] .. face_start[f + 1] - 1``, counter-clockwise about the outward normal, as in
    Blender. `build_surface` makes a surface from such flat arrays.

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
        Smooth fan of each corner. The corners of a fan share a vertex and a smooth normal, and
        field values are averaged over them. Sharp edges and flat faces separate fans.
    rest_vertices : (V, 3) float64 ndarray or None
        Positions before deformation, which field vectors refer to; None if not deformed.
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

    #: The file that it was read from. Like `uv` and the arrays below, it is no field of the dataclass, so
    #: other processes do not get it.
    _path = None

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
        is_path = faces is None and isinstance(vertices, (str, os.PathLike))
        name = name or (str(vertices) if is_path else "surface")
        up = up or (UP_AXIS_BY_SUFFIX.get(Path(vertices).suffix.lower(), "z") if is_path else "z")
        if up not in UP_AXIS_MATRIX:
            raise RosyError(f"{name}: up is {up!r}: choose 'y' or 'z'")
        arrays = mesh_arrays(vertices, faces, name, uv, step)
        with progress(0.5, 1.0):
            built = build_surface(
                arrays.vertices,
                arrays.corner_vertex,
                arrays.face_start,
                name=name,
                sharp_angle=SHARP_ANGLE if sharp_angle is None else sharp_angle,
                sharp_edges=None if sharp_edges is None else np.asarray(sharp_edges),
            )
        own = vars(self)
        own.update(vars(built), up=up, _path=Path(vertices) if is_path else None)
        given = {"uv": arrays.uv, "vertex_data": arrays.vertex_data, "face_data": arrays.face_data}
        own.update((key, value) for key, value in given.items() if value is not None)

    def __repr__(self) -> str:
        faces = counted(self.face_count, "face")
        return (
            f"<Surface {self.name!r}: {faces}, {counted(len(self.vertices), 'vertex', 'vertices')}>"
        )

    def with_parts(self, **parts: Any) -> Surface:
        """Return the surface with other values of some attributes, which must fit the rest."""
        own = {each.name: getattr(self, each.name) for each in fields(self)}
        return _surface_of_parts(**{**own, **parts})

    @property
    def face_count(self) -> int:
        """F, the number of faces."""
        return len(self.face_start) - 1

    @property
    def faces(self) -> np.ndarray | list[np.ndarray]:
        """(F, k) int32: the vertices of each face; a list of arrays if faces have different sizes."""
        sizes = np.diff(self.face_start)
        if (sizes == sizes[0]).all():
            return self.corner_vertex.reshape(-1, sizes[0])
        return np.split(self.corner_vertex, self.face_start[1:-1])

    @cached_property
    def uv(self) -> np.ndarray | None:
        """(C, 2) float64: texture coordinates of the corners, face by face; None without a UV map."""
        return None if self._path is None else read_uv_map(self._path)

    @cached_property
    def vertex_data(self) -> Mapping[str, np.ndarray]:
        """Arrays of V rows by their names, from a ``.ply`` file, a simulation or the mesh of a library."""
        return {} if self._path is None else read_vertex_data(self._path)

    @cached_property
    def face_data(self) -> Mapping[str, np.ndarray]:
        """Arrays of F rows by their names, from the file of a simulation or the mesh of a library."""
        return {}

    @cached_property
    def face_frames(self) -> tuple[np.ndarray, np.ndarray]:
        """The tangent frame of each face: x along its first edge, and y, a quarter turn from it.

        Both are (F, 3) float64. `Field.angles` are measured from x. The frames are those of
        ``igl.local_basis``.
        """
        return face_frames(self)

    @property
    def euler_characteristic(self) -> int:
        """V - E + F: 2 for a sphere, 0 for a torus. Vertices without a face do not count."""
        edges = build_edges(self.corner_vertex, self.face_start)
        return len(self.used_vertices) - len(edges.face_count) + self.face_count

    def in_rest_shape(self) -> Surface:
        """Return the surface before deformation, to which field vectors refer."""
        if self.rest_vertices is None:
            return self
        return self.with_vertices(self.rest_vertices)

    def with_vertices(self, vertices: np.ndarray) -> Surface:
        """Return the surface with (V, 3) other positions, without a rest shape.

        The normals stay as they are.
        """
        return self.with_parts(vertices=vertices, rest_vertices=None)

    @cached_property
    def rest_shape_key(self) -> bytes:
        """A hash of the rest shape and its triangles, equal for all deformations of a mesh."""
        rest = self.in_rest_shape().vertices
        return content_hash(rest, self.corner_vertex, self.face_start, self.triangles)

    @cached_property
    def extent(self) -> float:
        """The longest side of the bounding box, in Blender units; see `box_corners`."""
        return float(np.ptp(self.box_corners, axis=0).max())

    @cached_property
    def mean_edge_length(self) -> float:
        """The mean length of the edges of the faces, in Blender units."""
        corners = self.vertices[self.corner_vertex]
        edge = corners[self.next_corner] - corners
        return float(np.sqrt(dot(edge, edge)).mean())

    @cached_property
    def used_vertices(self) -> np.ndarray:
        """(n,) intp: the vertices that have a face, in ascending order."""
        return _used_vertices(self.corner_vertex, len(self.vertices))

    @cached_property
    def box_corners(self) -> np.ndarray:
        """(8, 3) float64: corners of the bounding box; vertices without a face are ignored."""
        return box_corners(self.vertices[self.used_vertices])

    @cached_property
    def corner_face(self) -> np.ndarray:
        """(C,) int32: the face of each corner."""
        return corner_faces(self.face_start)

    @cached_property
    def next_corner(self) -> np.ndarray:
        """(C,) int32: the following corner around the same face."""
        return next_corners(self.face_start)

    @cached_property
    def triangle_vertex(self) -> np.ndarray:
        """(T, 3) int32: the vertex indices of the triangles."""
        return self.corner_vertex.take(self.triangles)

    @cached_property
    def fan_normal(self) -> np.ndarray:
        """(K, 3) float64: the unit mean of the corner normals of each of the K fans."""
        return normalize(sum_per_fan(self.corner_normal, self.corner_fan))

    @cached_property
    def fans_share_normals(self) -> bool:
        """Whether all corner normals equal that of their fan; custom normals may differ."""
        normals = self.fan_normal
        return all(
            np.abs(self.corner_normal[block] - normals.take(self.corner_fan[block], axis=0)).max()
            <= NORMAL_TOLERANCE
            for block in row_blocks(len(self.corner_fan), BLOCK_ELEMENTS)
        )

    @cached_property
    def face_normal(self) -> np.ndarray:
        """(F, 3) float64 unit normals by Newell's formula; zero for a face without area."""
        return normalize(face_area_vectors(self.vertices, self.corner_vertex, self.face_start))

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
    """Make a `Surface` from arrays, and compute the parts that are not given.

    Parameters
    ----------
    vertices : (V, 3) array_like
    corner_vertex : (C,) array_like of int
    face_start : (F + 1,) array_like of int
    name : str
    sharp_edges : (E, 2) array_like of int, optional
        Vertex pairs across which normals and field values do not mix.
    sharp_angle : float, optional
        Angle between face normals in radians. Edges with a larger angle are also sharp.
    flat_faces : (F,) array_like of bool, optional
        Faces with flat shading, which do not share normals or field values with other faces.
    corner_normal : (C, 3) array_like, optional
        Shading normals. If not given, the face normals averaged over each fan, weighted by angle.
    corner_fan : (C,) array_like of int, optional
        The result of `smooth_fans`, if it is known.
    triangles, triangle_face : (T, 3) and (T,) array_like of int, optional
        The result of `triangulate`, if it is known.
    rest_vertices : (V, 3) array_like, optional

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
    _check_polygons(name, vertices, corner_vertex, face_start)
    report(0.1, "reading the mesh")
    if triangles is None:
        with progress(0.1, 0.3):
            triangles, triangle_face = triangulate(vertices, corner_vertex, face_start)
    if corner_fan is None:
        report(0.3, "finding smooth edges")
        corner_fan = smooth_fans(
            vertices, corner_vertex, face_start, sharp_edges, sharp_angle, flat_faces
        )
    report(0.8, "computing normals")
    if corner_normal is None:
        corner_normal = _fan_normals(vertices, corner_vertex, face_start, corner_fan)
    return _surface_of_parts(
        name=name,
        vertices=vertices,
        corner_vertex=corner_vertex,
        face_start=face_start,
        triangles=np.ascontiguousarray(triangles, dtype=np.int32).reshape(-1, 3),
        triangle_face=np.ascontiguousarray(triangle_face, dtype=np.int32).ravel(),
        corner_normal=np.ascontiguousarray(corner_normal, dtype=np.float64),
        corner_fan=corner_fan,
        rest_vertices=None
        if rest_vertices is None
        else np.ascontiguousarray(rest_vertices, dtype=np.float64),
    )


def _surface_of_parts(**parts: Any) -> Surface:
    """Return a surface with these attributes."""
    surface = object.__new__(Surface)
    vars(surface).update(parts)
    return surface


def smooth_fans(
    vertices: np.ndarray,
    corner_vertex: np.ndarray,
    face_start: np.ndarray,
    sharp_edges: np.ndarray | None = None,
    sharp_angle: float | None = None,
    flat_faces: np.ndarray | None = None,
) -> np.ndarray:
    """(C,) int32: `Surface.corner_fan`; the parameters are those of `build_surface`.

    Without a sharp angle, the result does not depend on the vertex positions.
    """
    edges = build_edges(corner_vertex, face_start)
    corner_face, next_corner = corner_faces(face_start), next_corners(face_start)
    a, b = edges.halfedges[:, 0], edges.halfedges[:, 1]
    smooth = np.ones(len(a), dtype=bool)
    if flat_faces is not None:
        flat = np.asarray(flat_faces, dtype=bool)
        smooth &= ~(flat[corner_face[a]] | flat[corner_face[b]])
    if sharp_angle is not None:
        normal = normalize(face_area_vectors(vertices, corner_vertex, face_start))
        smooth &= dot(normal[corner_face[a]], normal[corner_face[b]]) >= np.cos(sharp_angle)
    if sharp_edges is not None and len(sharp_edges):
        stride = int(corner_vertex.max()) + 1
        sharp = np.sort(np.asarray(sharp_edges, dtype=np.int64).reshape(-1, 2), axis=1)
        ends = edges.ends[edges.interior].astype(np.int64)
        smooth &= ~np.isin(ends[:, 0] * stride + ends[:, 1], sharp[:, 0] * stride + sharp[:, 1])
    a, b = a[smooth], b[smooth]
    return connected_corners(a, b, next_corner)


def connected_corners(a: np.ndarray, b: np.ndarray, next_corner: np.ndarray) -> np.ndarray:
    """(C,) int32 components of corners that meet at the ends of edges.

    (I,) a and b are the corners where the edges start in the faces on both sides.
    """
    ends = np.stack([a, next_corner[b]], axis=1), np.stack([next_corner[a], b], axis=1)
    return connected_components(len(next_corner), np.concatenate(ends))


def corner_faces(face_start: np.ndarray) -> np.ndarray:
    """(C,) int32: the face of each corner."""
    return np.repeat(np.arange(len(face_start) - 1, dtype=np.int32), np.diff(face_start))


def next_corners(face_start: np.ndarray) -> np.ndarray:
    """(C,) int32: the following corner around the same face."""
    following = np.arange(1, face_start[-1] + 1, dtype=np.int32)
    following[face_start[1:] - 1] = face_start[:-1]
    return following


def box_corners(points: np.ndarray) -> np.ndarray:
    """(8, 3) corners of the bounding box of (n, 3) points."""
    limits = np.stack([points.min(axis=0), points.max(axis=0)])
    selector = np.indices((2, 2, 2)).reshape(3, 8)
    return np.stack([limits[selector[axis], axis] for axis in range(3)], axis=1)


def _used_vertices(corner_vertex: np.ndarray, vertex_count: int) -> np.ndarray:
    """(n,) intp: the vertices that a corner refers to, in ascending order."""
    return np.flatnonzero(mask(vertex_count, corner_vertex))


def sum_per_face(values: np.ndarray, face_start: np.ndarray) -> np.ndarray:
    """(F, ...) sums of (C, ...) corner values over each face."""
    return np.add.reduceat(values, face_start[:-1], axis=0)


def mean_per_face(values: np.ndarray, face_start: np.ndarray) -> np.ndarray:
    """(F, ...) means of (C, ...) corner values over each face."""
    count = np.diff(face_start).reshape((-1,) + (1,) * (values.ndim - 1))
    return sum_per_face(values, face_start) / count


def face_area_vectors(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> np.ndarray:
    """(F, 3) area vectors (normal times area) of polygons, by Newell's formula.

    Positions are relative to the first corner of each face, so that no precision is lost far from
    the origin.
    """
    area = np.empty((len(face_start) - 1, 3))
    for faces, corners, starts in face_blocks(face_start):
        points = _relative_to_first_corner(vertices, corner_vertex[corners], starts)
        twice = sum_per_face(np.cross(points, points[next_corners(starts)]), starts)
        np.multiply(twice, 0.5, out=area[faces])
    return area


def _relative_to_first_corner(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> np.ndarray:
    """(C, 3) positions of corners relative to the first corner of their face."""
    points = vertices[corner_vertex]
    return points - np.repeat(points[face_start[:-1]], np.diff(face_start), axis=0)


def face_blocks(face_start: np.ndarray) -> list[tuple[slice, slice, np.ndarray]]:
    """Split the faces into consecutive blocks, to bound memory.

    Returns
    -------
    faces, corners : slice
        The faces of the block and their corners.
    starts : (faces + 1,) ndarray
        `face_start` of the block, counted from its first corner.
    """
    count = len(face_start) - 1
    blocks = []
    for first in range(0, count, BLOCK_ELEMENTS):
        faces = slice(first, min(first + BLOCK_ELEMENTS, count))
        starts = face_start[faces.start : faces.stop + 1]
        blocks.append((faces, slice(int(starts[0]), int(starts[-1])), starts - starts[0]))
    return blocks


def face_frames(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Return the tangent frame x, y of each face.

    Returns
    -------
    x, y : (F, 3) ndarray
        Unit tangents. x runs along the first edge of nonzero length, y is the cross product of the
        normal and x. Both are zero for faces without area, so that representations are zero there.
    """
    normal = surface.face_normal
    x = np.empty_like(normal)
    for faces, corners, starts in face_blocks(surface.face_start):
        points = surface.vertices.take(surface.corner_vertex[corners], axis=0)
        corner_normal = np.repeat(normal[faces], np.diff(starts), axis=0)
        edge = points[next_corners(starts)] - points
        edge -= dot(edge, corner_normal)[:, None] * corner_normal
        length = np.sqrt(dot(edge, edge))
        last_corner = np.repeat(starts[1:] - 1, np.diff(starts))
        candidate = np.where(length > 0, np.arange(len(length)), last_corner)
        x[faces] = normalize(edge[np.minimum.reduceat(candidate, starts[:-1])])
    x[~normal.any(axis=1)] = 0.0
    return x, np.cross(normal, x)


@dataclass(frozen=True, eq=False)
class Edges:
    """The E edges of a surface, and the two halfedges of each of the I interior edges.

    Attributes
    ----------
    corner_edge : (C,) int32 ndarray
        The edge from each corner to the next corner of its face.
    ends : (E, 2) int32 ndarray
        Vertex pairs, the smaller first.
    face_count : (E,) int32 ndarray
        Number of faces at the edge: 1 at a boundary, 2 inside, more at nonmanifold edges.
    interior : (I,) int32 ndarray
        Edges with exactly two faces that are oriented consistently.
    halfedges : (I, 2) int32 ndarray
        For each interior edge, the corner in either face where the edge starts. Consistently
        oriented faces run along the edge in opposite directions. Edges whose faces run in the same
        direction are not `interior`, because fields do not continue across them.
    """

    corner_edge: np.ndarray
    ends: np.ndarray
    face_count: np.ndarray
    interior: np.ndarray
    halfedges: np.ndarray


def build_edges(corner_vertex: np.ndarray, face_start: np.ndarray) -> Edges:
    """Find the edges of a polygon mesh; the parameters are arrays of `Surface`."""
    tail = corner_vertex.astype(np.int64)
    head = tail[next_corners(face_start)]
    stride = int(corner_vertex.max(initial=0)) + 1
    key, corner_by_edge = sorted_with_order(
        np.minimum(tail, head) * stride + np.maximum(tail, head), stride * stride
    )
    is_first = np.ones(len(key), dtype=bool)
    np.not_equal(key[1:], key[:-1], out=is_first[1:])
    first = np.flatnonzero(is_first)
    edge_key, face_count = key[first], np.diff(first, append=len(key))
    corner_edge = np.empty(len(key), dtype=np.int32)
    corner_edge[corner_by_edge] = np.cumsum(is_first, dtype=np.int32) - 1
    interior = np.flatnonzero(face_count == 2)
    a, b = corner_by_edge[first[interior]], corner_by_edge[first[interior] + 1]
    opposite = tail[a] == head[b]
    return Edges(
        corner_edge=corner_edge,
        ends=np.stack([edge_key // stride, edge_key % stride], axis=1).astype(np.int32),
        face_count=face_count.astype(np.int32),
        interior=interior[opposite].astype(np.int32),
        halfedges=np.stack([a, b], axis=1)[opposite].astype(np.int32),
    )


def sorted_with_order(key: np.ndarray, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """Return keys from 0 to `limit` - 1 in ascending order, and the stable order that sorts them.

    Keys and indices are sorted as one number if they fit into it, which is faster than `argsort`.
    """
    index_bits = len(key).bit_length()
    if limit.bit_length() + index_bits > 63:
        order = np.argsort(key, kind="stable")
        return key[order], order
    packed = key << index_bits
    packed |= np.arange(len(key), dtype=np.int64)
    packed.sort()
    order = packed & ((1 << index_bits) - 1)
    packed >>= index_bits
    return packed, order


def count_inconsistent_edges(surface: Surface) -> int:
    """Count the edges between two faces that disagree on which side is out.

    Faces without area are ignored. Fields are cut along such edges. Flipping faces removes them,
    except on nonorientable surfaces such as a Möbius strip.
    """
    edges = build_edges(surface.corner_vertex, surface.face_start)
    degenerate = ~surface.face_normal.any(axis=1)
    degenerate_edge = edges.corner_edge[degenerate[surface.corner_face]]
    borders_degenerate = mask(len(edges.face_count), degenerate_edge)
    inconsistent = (edges.face_count == 2) & ~borders_degenerate
    inconsistent[edges.interior] = False
    return int(np.count_nonzero(inconsistent))


def orientation_warning(surface: Surface) -> str:
    """The warning to show for inconsistently oriented faces; empty if there are none."""
    count = count_inconsistent_edges(surface)
    if not count:
        return ""
    return (
        f"{surface.name}: the faces at {counted(count, 'edge')} are oriented inconsistently, so the "
        "field is cut there: recalculate the normals (not possible for one-sided surfaces such as "
        "a Möbius strip)"
    )


def _check_polygons(
    name: str, vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> None:
    """Raise an error unless the arrays of `build_surface` are a valid mesh with faces."""
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
    used = _used_vertices(corner_vertex, len(vertices))
    points = vertices if len(used) == len(vertices) else vertices[used]
    if 0 < np.ptp(points, axis=0).max() < MIN_EXTENT:
        raise RosyError(f"{name}: is smaller than {MIN_EXTENT:g}: scale the mesh")


def connected_components(count: int, pairs: np.ndarray) -> np.ndarray:
    """Label the connected components of a graph.

    Each node points to a root: the smallest node known to be in its component. Each round links the
    roots of connected nodes, then flattens the trees by pointer jumping.

    Parameters
    ----------
    count : int
        Number of nodes.
    pairs : (n, 2) int ndarray
        Edges of the graph.

    Returns
    -------
    (count,) int32 ndarray
        Component of each node, numbered from 0 without gaps.
    """
    root = np.arange(count, dtype=np.int32)
    a, b = pairs[:, 0], pairs[:, 1]
    while len(a):
        low, high = np.minimum(root[a], root[b]), np.maximum(root[a], root[b])
        _lower(root, high, low)
        while True:
            flattened = root[root]
            if np.array_equal(flattened, root):
                break
            root = flattened
        unmerged = root[a] != root[b]
        a, b = a[unmerged], b[unmerged]
    is_root = root == np.arange(count, dtype=np.int32)
    return (np.cumsum(is_root, dtype=np.int32) - 1)[root]


def _lower(values: np.ndarray, index: np.ndarray, limits: np.ndarray) -> None:
    """Do the same as ``np.minimum.at(values, index, limits)``, for limits below the values.

    Most indices occur once or twice, for which plain assignments are faster.
    """
    for _ in range(2):
        values[index] = limits
        remaining = limits < values[index]
        index, limits = index[remaining], limits[remaining]
    np.minimum.at(values, index, limits)


def _fan_normals(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray, corner_fan: np.ndarray
) -> np.ndarray:
    """(C, 3) unit corner normals: face normals averaged over each fan, weighted by corner angle.

    Where the mean is zero, the face normal; (0, 0, 1) if that is zero, too.
    """
    angle = np.empty(len(corner_vertex))
    for _, corners, starts in face_blocks(face_start):
        points = _relative_to_first_corner(vertices, corner_vertex[corners], starts)
        following = next_corners(starts)
        to_next = normalize(points[following] - points)
        to_previous = np.empty_like(to_next)
        to_previous[following] = -to_next
        angle[corners] = np.arccos(np.clip(dot(to_next, to_previous), -1, 1))
    face_normal = normalize(face_area_vectors(vertices, corner_vertex, face_start))
    face = corner_faces(face_start)
    fan_count = int(corner_fan.max()) + 1
    total = [np.bincount(corner_fan, angle * column[face], fan_count) for column in face_normal.T]
    normal = normalize(np.stack(total, axis=1))[corner_fan]
    undefined = ~normal.any(axis=1)
    normal[undefined] = face_normal[face[undefined]]
    normal[~normal.any(axis=1)] = (0.0, 0.0, 1.0)
    return normal


def sum_per_fan(values: np.ndarray, corner_fan: np.ndarray) -> np.ndarray:
    """(K, k) sums of (C, k) real corner values over the corners of each of the K fans."""
    fan_count = int(corner_fan.max()) + 1
    columns = [np.bincount(corner_fan, weights=column, minlength=fan_count) for column in values.T]
    return np.stack(columns, axis=1)


def have_same_polygons(first: Surface, second: Surface) -> bool:
    """Return whether the faces of two meshes have the same vertices, wherever these are."""
    return (
        len(first.vertices) == len(second.vertices)
        and np.array_equal(first.corner_vertex, second.corner_vertex)
        and np.array_equal(first.face_start, second.face_start)
    )

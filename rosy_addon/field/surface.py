"""`Surface`: a polygon mesh as flat arrays, with its triangles, normals and smooth fans."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..core.cache import content_hash
from ..core.errors import RosyError, counted
from .blocks import mask, row_blocks
from .connectivity import build_edges, smooth_fans
from .frames import dot, normalize
from .polygon_arrays import (
    BLOCK_ELEMENTS,
    box_corners,
    corner_faces,
    face_area_vectors,
    fan_normals,
    mean_per_face,
    next_corners,
    sum_per_fan,
)
from .triangulate import triangulate

#: Largest coordinate and smallest extent of a mesh. Beyond them, squares and products of lengths
#: leave the range of floating-point numbers.
MAX_COORDINATE, MIN_EXTENT = 1e12, 1e-12

#: Largest difference, in each component, at which a corner normal equals the mean of its fan.
NORMAL_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Surface:
    """A polygon mesh: V vertices, F faces, C corners (face-vertex pairs), T triangles.

    The corners of face f are ``face_start[f] .. face_start[f + 1] - 1``, counter-clockwise about
    the outward normal, as in Blender. Use `build_surface` to make a surface.

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

    @property
    def face_count(self) -> int:
        """F, the number of faces."""
        return len(self.face_start) - 1

    def in_rest_shape(self) -> Surface:
        """Return the surface before deformation, to which field vectors refer."""
        if self.rest_vertices is None:
            return self
        return self.with_vertices(self.rest_vertices)

    def with_vertices(self, vertices: np.ndarray) -> Surface:
        """Return the surface with (V, 3) other positions, without a rest shape.

        The normals stay as they are.
        """
        return replace(self, vertices=vertices, rest_vertices=None)

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
        """Whether all corner normals equal the normal of their fan; custom normals may differ."""
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
    if triangles is None:
        triangles, triangle_face = triangulate(vertices, corner_vertex, face_start)
    if corner_fan is None:
        corner_fan = smooth_fans(
            vertices, corner_vertex, face_start, sharp_edges, sharp_angle, flat_faces
        )
    if corner_normal is None:
        corner_normal = fan_normals(vertices, corner_vertex, face_start, corner_fan)
    return Surface(
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


def _used_vertices(corner_vertex: np.ndarray, vertex_count: int) -> np.ndarray:
    """Return (n,) intp, the vertices that a corner refers to, in ascending order."""
    return np.flatnonzero(mask(vertex_count, corner_vertex))


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
    """Return the warning to show for inconsistently oriented faces; empty if there are none."""
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


def have_same_polygons(first: Surface, second: Surface) -> bool:
    """Return whether the faces of two meshes have the same vertices, wherever these are."""
    return (
        len(first.vertices) == len(second.vertices)
        and np.array_equal(first.corner_vertex, second.corner_vertex)
        and np.array_equal(first.face_start, second.face_start)
    )

"""`TangentMesh`: triangles with tangent frames, the field at their corners, and transport at edges.

Streamlines are traced on this mesh. The field is the same as in pictures: `projection.corner_field`
computes it at the corners, and the representation z is interpolated linearly in the plane of each
triangle. Tangents are complex numbers in the frame of their triangle. At an edge, they are
transported by unfolding the two triangles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..core.cache import Cache
from ..core.errors import RosyError, counted
from ..core.progress import progress, report
from ..field.connectivity import build_edges
from ..field.directional_field import evaluate_harmonics, field_symmetry
from ..field.frames import dot, normalize, transport
from ..field.representation import power, signed_power
from ..field.surface import Surface
from ..projection.corner_field import cached_corner_field
from ..projection.field_channel import REPRESENTATION, rotation_order
from ..projection.gbuffer import MeshInstance

#: An edge across which normals are not interpolated is a crease if the normals of its triangles
#: differ by at least this angle, in radians.
CREASE_ANGLE = np.radians(30)

#: The area of a triangle is set to 0 if it is below this fraction of its squared longest edge; the
#: edges at the first corner are compared.
MIN_AREA_RATIO = 1e-9

#: The representation counts as zero where its magnitude is below this fraction of the largest one
#: at the corners of the triangle.
ZERO_FIELD_RATIO = 1e-4

#: Largest angle in radians between the normal of a triangle and the shading normals in it. If they
#: are steeper, strokes beside each other count as on different parts of a fold.
MAX_TILT = 0.6


@dataclass(frozen=True, eq=False)
class TangentMesh:
    """T triangles in world space and the field on them.

    Edge k of a triangle is opposite to its corner k. The frame of a triangle is x and
    y = normal cross x.

    Attributes
    ----------
    degree : int
        N of the field.
    family_count : int
        Number of lines M through a point: N, or N/2 if each direction has an opposite one.
    points : (T, 3, 3) float64 ndarray
        Corners.
    x, y, normal : (T, 3) float64 ndarray
        Unit tangent frames, and unit normals from the order of the corners.
    corner_normal : (T, 3, 3) float64 ndarray
        Shading normals at the corners.
    face : (T,) int32 ndarray
        Face of the surface.
    gradient : (T, 3) complex128 ndarray
        Gradients of the barycentric coordinates, in the frame.
    z : (T, 3) complex128 ndarray
        Representation of the field at the corners, in the frame.
    harmonics : tuple of (int, (T, 3) complex128 ndarray)
        For fields of free directions: pairs of j and C_j (see `field.directional_field`). Empty for
        a RoSy field.
    family_z : (T,) complex128 ndarray or None
        For fields whose stored member is on the same line everywhere: the representation of that
        line, of degree N / M. None for other fields.
    neighbor : (T, 3) int32 ndarray
        Triangle across edge k; -1 where strokes stop.
    neighbor_edge : (T, 3) int8 ndarray
        The number of that edge in the neighbor.
    edge_transport : (T, 3) complex128 ndarray
        Unit factors that transport tangents from the frame of the triangle to that of the neighbor.
    area : (T,) float64 ndarray
        World space; 0 for degenerate triangles.
    triangle_vertex : (T, 3) int32 ndarray
        Vertices of the surface.
    """

    degree: int
    family_count: int
    points: np.ndarray
    x: np.ndarray
    y: np.ndarray
    normal: np.ndarray
    corner_normal: np.ndarray
    face: np.ndarray
    gradient: np.ndarray
    z: np.ndarray
    harmonics: tuple[tuple[int, np.ndarray], ...]
    family_z: np.ndarray | None
    neighbor: np.ndarray
    neighbor_edge: np.ndarray
    edge_transport: np.ndarray
    area: np.ndarray
    triangle_vertex: np.ndarray

    @property
    def is_directed(self) -> bool:
        """Whether opposite members are on different lines, although N is even."""
        return self.degree % 2 == 0 and self.family_count == self.degree

    def points_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the (n, 3) points at (n, 3) barycentric coordinates."""
        return np.einsum("nk,nki->ni", weights, self.points[triangle])

    def weights_at(self, triangle: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the (n, 3) barycentric coordinates of points in triangles.

        Points outside their triangle get coordinates on its boundary.
        """
        delta = points - self.points[triangle, 0]
        planar = self.to_frame(triangle, delta)
        weights = (self.gradient[triangle] * planar.conj()[:, None]).real
        weights[:, 0] += 1
        weights = np.maximum(weights, 0)
        return weights / weights.sum(axis=1, keepdims=True)

    def shading_normals_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the (n, 3) interpolated unit normals."""
        return normalize(np.einsum("nk,nki->ni", weights, self.corner_normal[triangle]))

    def limited_normals_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the shading normals, but at most `MAX_TILT` off those of the triangles."""
        shading = self.shading_normals_at(triangle, weights)
        flat = self.normal[triangle]
        cosine = dot(shading, flat)
        steep = np.flatnonzero(cosine < np.cos(MAX_TILT))
        sideways = normalize(shading[steep] - cosine[steep, None] * flat[steep])
        shading[steep] = np.cos(MAX_TILT) * flat[steep] + np.sin(MAX_TILT) * sideways
        return shading

    def to_world(self, triangle: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """Convert (n,) complex tangents in the frames of triangles to (n, 3) vectors."""
        return tangent.real[:, None] * self.x[triangle] + tangent.imag[:, None] * self.y[triangle]

    def to_frame(self, triangle: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Return (n,) complex128: the tangential parts of (n, 3) vectors in the frames of triangles."""
        return dot(vectors, self.x[triangle]) + 1j * dot(vectors, self.y[triangle])

    def members_at(
        self, triangle: np.ndarray, weights: np.ndarray, reference: np.ndarray
    ) -> np.ndarray:
        """Return (n,) complex128: the unit member nearest to a unit tangent; 0 where z is 0."""
        z = np.einsum("nk,nk->n", weights, self.z[triangle])
        return nearest_member(reference, z, self.degree)

    def is_same_family(
        self,
        member_a: np.ndarray,
        normal_a: np.ndarray,
        member_b: np.ndarray,
        normal_b: np.ndarray,
        tolerance: float = 0.0,
    ) -> np.ndarray:
        """Return (n,) bool: whether members at two points belong to the same line.

        One member is transported to the normal of the other. They belong to the same line if the
        angle between them is less than half the angle between two lines, plus a tolerance.

        Parameters
        ----------
        member_a, member_b : (n, 3) ndarray
            Unit members.
        normal_a, normal_b : (n, 3) ndarray
            Unit normals, perpendicular to the members.
        tolerance : float
            In radians.
        """
        cosine = dot(member_a, member_b) - dot(member_a, normal_b) * dot(
            normal_a, member_b
        ) / np.maximum(1 + dot(normal_a, normal_b), 1e-12)
        if self.is_directed:
            return cosine > np.cos(np.pi / self.degree + tolerance)
        return np.abs(cosine) > np.cos(np.pi / (2 * self.family_count) + tolerance)

    def directions_at(
        self, triangle: np.ndarray, weights: np.ndarray, member: np.ndarray
    ) -> np.ndarray:
        """Return (n,) complex128: the unit direction of a member. For a RoSy it is the member."""
        if not self.harmonics:
            return member
        harmonics = [
            (j, np.einsum("nk,nk->n", weights, values[triangle])) for j, values in self.harmonics
        ]
        return unit(member * evaluate_harmonics(harmonics, member), member.copy())


class SharedEdges(NamedTuple):
    """Edges that two triangles share, each once.

    Attributes
    ----------
    triangle, neighbor : (n,) intp ndarray
        The two triangles.
    edge, neighbor_edge : (n,) intp ndarray
        The numbers of the edge in them.
    """

    triangle: np.ndarray
    neighbor: np.ndarray
    edge: np.ndarray
    neighbor_edge: np.ndarray

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Return, for each end of the edges, the (n, 2) corners 3 t + k of both triangles there."""
        first, second = (
            np.stack(
                [
                    3 * self.triangle + (self.edge + own) % 3,
                    3 * self.neighbor + (self.neighbor_edge + other) % 3,
                ],
                axis=1,
            )
            for own, other in ((1, 2), (2, 1))
        )
        return first, second


def shared_edges(mesh: TangentMesh) -> SharedEdges:
    """Return the edges that streamlines can cross."""
    triangle, edge = np.nonzero(mesh.neighbor > np.arange(len(mesh.neighbor))[:, None])
    neighbor = mesh.neighbor[triangle, edge].astype(np.intp)
    return SharedEdges(triangle, neighbor, edge, mesh.neighbor_edge[triangle, edge].astype(np.intp))


def unit(values: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Return (n,) complex numbers with the modulus 1; `out` holds those to return for zeros."""
    norm = np.abs(values)
    return np.divide(values, norm, out=out, where=norm > 0)


def nearest_member(reference: np.ndarray, z: np.ndarray, degree: int) -> np.ndarray:
    """Return (n,) complex128: the unit member of z nearest to a unit tangent; 0 where z is 0."""
    angle = np.angle(z * power(reference, degree).conj()) / degree
    return np.where(z != 0, reference * np.exp(1j * angle), 0)


def build_tangent_mesh(
    instance: MeshInstance,
    *,
    display: str = "smooth",
    cross_creases: bool = False,
    crease_angle: float = CREASE_ANGLE,
    cache: Cache | None = None,
) -> TangentMesh:
    """Build the tangent mesh of a mesh instance.

    Parameters
    ----------
    instance : MeshInstance
        With a field.
    display : {"smooth", "flat"}
        Whether the field is interpolated, or constant on each face.
    cross_creases : bool
        If true, strokes continue across creases along the nearest member. Otherwise they stop.
    crease_angle : float
        Smallest angle between the normals of the triangles at a crease, in radians.
    cache : Cache, optional
        Cache for corner fields.

    Returns
    -------
    TangentMesh

    Raises
    ------
    RosyError
        If there is no field, the field has another number of faces, or it is zero on all triangles
        with an area.
    """
    surface, field = instance.surface, instance.field
    if field is None:
        raise RosyError(f"{surface.name}: has no field")
    if len(field.vectors) != surface.face_count:
        raise RosyError(
            f"{surface.name}: the field has {counted(len(field.vectors), 'vector')}, but the mesh has "
            f"{counted(surface.face_count, 'face')}"
        )
    with progress(0.0, 0.3):
        corner_field = cached_corner_field(instance, display, cache)
    label = "preparing the surface"
    report(0.3, label)
    points = instance.world_points()[surface.triangle_vertex]
    normal, x, y, area = _triangle_frames(points)
    report(0.4, label)
    corner_normal = corner_field.corner_normals.astype(np.float64).transpose(2, 0, 1)
    rotations = _rotations_to_planes(
        corner_field.reference_tangent.astype(np.float64).T, corner_normal, normal, x, y
    )
    report(0.5, label)
    z = corner_field.representation.T.astype(np.complex128) * power(rotations, field.degree)
    z *= (area > 0)[:, None]
    if not z.any():
        raise RosyError(f"{surface.name}: the field is zero everywhere")
    harmonics, family_z = [], None
    for channel, values in corner_field.channels.items():
        values = values.T * signed_power(rotations, rotation_order(channel, field.degree))
        if channel[0] == "deviation":
            harmonics.append((channel[1], values))
        elif channel != REPRESENTATION:
            family_z = values.sum(axis=1)
    with progress(0.6, 1.0):
        neighbor, neighbor_edge, edge_transport = _adjacency(
            surface,
            points,
            x,
            y,
            normal,
            (z != 0).any(axis=1),
            None if cross_creases else crease_angle,
        )
    return TangentMesh(
        degree=field.degree,
        family_count=field_symmetry(field).line_count,
        points=points,
        x=x,
        y=y,
        normal=normal,
        corner_normal=corner_normal,
        face=surface.triangle_face,
        gradient=_barycentric_gradients(points, x, y, area),
        z=z,
        harmonics=tuple(harmonics),
        family_z=family_z,
        neighbor=neighbor,
        neighbor_edge=neighbor_edge,
        edge_transport=edge_transport,
        area=area,
        triangle_vertex=surface.triangle_vertex,
    )


def take_triangles(mesh: TangentMesh, kept: np.ndarray) -> TangentMesh:
    """Return some triangles of a mesh; `kept` is (T,) bool. Strokes stop where there is no other."""
    number = np.where(kept, np.cumsum(kept, dtype=np.int32) - np.int32(1), np.int32(-1))
    kept_arrays = {
        name: values[kept] for name, values in vars(mesh).items() if isinstance(values, np.ndarray)
    }
    taken = replace(
        mesh,
        harmonics=tuple((j, values[kept]) for j, values in mesh.harmonics),
        **kept_arrays,
    )
    neighbor = np.where(taken.neighbor >= 0, number[taken.neighbor], np.int32(-1))
    return replace(taken, neighbor=neighbor)


def with_corners(mesh: TangentMesh, points: np.ndarray) -> TangentMesh:
    """Return a mesh with other corners, (T, 3, 3), in the planes of its triangles.

    Strokes stop at triangles that have no area.
    """
    _, _, _, area = _triangle_frames(points)
    is_flat = area == 0
    return replace(
        mesh,
        points=points,
        area=area,
        gradient=_barycentric_gradients(points, mesh.x, mesh.y, area),
        z=np.where(is_flat[:, None], 0, mesh.z),
        neighbor=np.where(is_flat[:, None] | is_flat[mesh.neighbor], np.int32(-1), mesh.neighbor),
    )


def _triangle_frames(points: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the normals, x axes, y axes and areas of triangles.

    x points from the first corner to the second.
    """
    edge_a, edge_b = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    cross = np.cross(edge_a, edge_b)
    normal = normalize(cross)
    x = normalize(edge_a)
    area = np.sqrt(dot(cross, cross)) / 2
    longest_squared = np.maximum(dot(edge_a, edge_a), dot(edge_b, edge_b))
    area[area <= MIN_AREA_RATIO * longest_squared] = 0
    return normal, x, np.cross(normal, x), area


def _barycentric_gradients(
    points: np.ndarray, x: np.ndarray, y: np.ndarray, area: np.ndarray
) -> np.ndarray:
    """Return the (T, 3) complex gradients of barycentric coordinates; 0 if there is no area."""
    delta = points - points[:, :1]
    planar = dot(delta, x[:, None]) + 1j * dot(delta, y[:, None])
    # The edge opposite to corner k, rotated inward by 90 degrees, over twice the area.
    edge = planar[:, [2, 0, 1]] - planar[:, [1, 2, 0]]
    double_area = 2 * area[:, None]
    return np.divide(1j * edge, double_area, out=np.zeros_like(edge), where=double_area > 0)


def _rotations_to_planes(
    axis: np.ndarray, corner_normal: np.ndarray, normal: np.ndarray, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """Return (T, 3) complex128: the reference tangents of corner values, in the triangle's frame.

    `CornerField` stores the values of all corners relative to one tangent at the first corner, to
    which they were transported. This is undone: the tangent is transported from the first corner to
    the corner of the value, and from there directly to the plane of the triangle. Then the values
    along an edge depend only on its two ends.

    Parameters
    ----------
    axis : (T, 3) ndarray
        Unit reference tangent at the first corner.
    corner_normal : (T, 3, 3) ndarray
    normal, x, y : (T, 3) ndarray
        As in `TangentMesh`.
    """
    rotations = np.empty((len(axis), 3), dtype=np.complex128)
    for k in range(3):
        corner_axis = axis if k == 0 else transport(axis, corner_normal[:, 0], corner_normal[:, k])
        corner_axis = transport(corner_axis, corner_normal[:, k], normal)
        rotation = dot(corner_axis, x) + 1j * dot(corner_axis, y)
        rotations[:, k] = unit(rotation, np.zeros_like(rotation))
    return rotations


def _adjacency(
    surface: Surface,
    points: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    normal: np.ndarray,
    defined: np.ndarray,
    crease_angle: float | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `TangentMesh.neighbor`, `neighbor_edge` and `edge_transport`.

    Strokes stop at triangles that are not `defined` (T,) and, unless `crease_angle` is None, at
    creases.
    """
    count, label = len(points), "connecting triangles"
    with progress(0.0, 0.5, label):
        edges = build_edges(
            surface.triangle_vertex.ravel(), np.arange(0, 3 * count + 1, 3, dtype=np.int32)
        )
    a, b = edges.halfedges[:, 0], edges.halfedges[:, 1]
    triangle_a, triangle_b = a // 3, b // 3
    passable = defined[triangle_a] & defined[triangle_b]
    if crease_angle is not None:
        passable &= ~(
            is_sharp_edge(surface, a, b)
            & (dot(normal[triangle_a], normal[triangle_b]) < np.cos(crease_angle))
        )
    a, b, triangle_a, triangle_b = (values[passable] for values in (a, b, triangle_a, triangle_b))
    report(0.7, label)
    neighbor = np.full((count, 3), -1, dtype=np.int32)
    neighbor_edge = np.zeros((count, 3), dtype=np.int8)
    edge_transport = np.ones((count, 3), dtype=np.complex128)
    # The edge from corner c to the next is opposite to the corner before c.
    edge_a, edge_b = (a + 2) % 3, (b + 2) % 3
    edge_vector = points[triangle_a, (a + 1) % 3] - points[triangle_a, a % 3]
    edge_in_a = dot(edge_vector, x[triangle_a]) + 1j * dot(edge_vector, y[triangle_a])
    edge_in_b = dot(edge_vector, x[triangle_b]) + 1j * dot(edge_vector, y[triangle_b])
    factor = unit(edge_in_b * edge_in_a.conj(), np.ones_like(edge_in_a))
    neighbor[triangle_a, edge_a], neighbor[triangle_b, edge_b] = triangle_b, triangle_a
    neighbor_edge[triangle_a, edge_a], neighbor_edge[triangle_b, edge_b] = edge_b, edge_a
    edge_transport[triangle_a, edge_a], edge_transport[triangle_b, edge_b] = (
        factor,
        factor.conj(),
    )
    return neighbor, neighbor_edge, edge_transport


def is_sharp_edge(surface: Surface, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return (n,) bool: whether normals are not interpolated across edges between triangles.

    Parameters
    ----------
    surface : Surface
    a, b : (n,) ndarray of int
        The corners (3 t + k) at which the edge starts in the triangles on both sides.
    """
    fan = surface.corner_fan[surface.triangles].ravel()
    next_a, next_b = a - a % 3 + (a + 1) % 3, b - b % 3 + (b + 1) % 3
    return (fan[a] != fan[next_b]) | (fan[next_a] != fan[b])

"""`TangentMesh`: triangles with tangent frames, the field at their corners, and transport at edges.

Streamlines are traced on this mesh. The field is the same as in pictures: `projection.corner_field`
computes it at the corners, and the representation z is interpolated linearly in the plane of each
triangle. Tangents are complex numbers in the frame of their triangle. At an edge, they are
transported by unfolding the two triangles.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..core.cache import Cache
from ..core.errors import RosyError, counted
from ..core.progress import progress, report
from ..field.connectivity import build_edges
from ..field.directional_field import evaluate_harmonics, field_symmetry
from ..field.frames import dot, normalize, quotient, transport
from ..field.representation import power, signed_power, unit_complex
from ..field.surface import Surface
from ..projection.corner_field import cached_corner_field
from ..projection.field_channel import REPRESENTATION, rotation_order
from ..projection.gbuffer import MeshInstance
from ..projection.pixel_blocks import part_of

#: An edge across which normals are not interpolated counts as a crease if the normals of its two triangles
#: differ by at least this angle, in radians.
CREASE_ANGLE = np.radians(30)

#: The area of a triangle is set to 0 if it is at most this fraction of the squared length of the longer of
#: its two edges at the first corner.
MIN_AREA_RATIO = 1e-9

#: The representation counts as zero where its magnitude is below this fraction of the largest one
#: at the corners of the triangle.
ZERO_FIELD_RATIO = 1e-4

#: Largest angle in radians between the normal of a triangle and the shading normals in it. With a larger
#: angle, strokes beside each other would be taken for strokes on two different sides of a fold.
MAX_TILT = 0.6


@dataclass(frozen=True, eq=False)
class TangentMesh:
    """T triangles in world space and the field on them.

    Edge k of a triangle is opposite to its corner k. The frame of a triangle consists of the unit tangents
    x and y = normal cross x. Tangents are complex numbers in it.

    Attributes
    ----------
    degree : int
        N of the field.
    family_count : int
        Number M of different streamlines through a point: N, or N/2 if each direction of the field has an
        opposite one, which is on the same streamline.
    points : (T, 3, 3) float64 ndarray
        Corners of the triangles.
    x, y, normal : (T, 3) float64 ndarray
        Unit tangents of the frames, and unit normals; corners are counter-clockwise around the normal.
    corner_normal : (T, 3, 3) float64 ndarray
        Shading normals at the corners.
    face : (T,) int32 ndarray
        Face of the surface to which each triangle belongs.
    gradient : (T, 3) complex128 ndarray
        Gradients of the barycentric coordinates, in the frame of the triangle.
    z : (T, 3) complex128 ndarray
        Representation (N-th power of a direction) of the field at the corners, in the frame of the triangle.
    magnitude : (T, 3) float32 ndarray
        Length of the members at the corners; see `CornerField.magnitude`.
    harmonics : tuple of (int, (T, 3) complex128 ndarray)
        For fields whose directions are not at equal angles: pairs of j and C_j (see
        `field.directional_field`). Empty for a RoSy field.
    family_z : (T,) complex128 ndarray or None
        For fields that mark one of the M directions of streamlines consistently: the representation, of
        degree N / M, of this direction. None for other fields.
    neighbor : (T, 3) int32 ndarray
        Triangle on the other side of edge k; -1 where strokes stop at the edge.
    neighbor_edge : (T, 3) int8 ndarray
        Number k that the edge has in the neighbor.
    edge_transport : (T, 3) complex128 ndarray
        Unit factors that transport tangents from the frame of the triangle to the frame of the neighbor.
    area : (T,) float64 ndarray
        Areas in world space; 0 for degenerate triangles.
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
    magnitude: np.ndarray
    harmonics: tuple[tuple[int, np.ndarray], ...]
    family_z: np.ndarray | None
    neighbor: np.ndarray
    neighbor_edge: np.ndarray
    edge_transport: np.ndarray
    area: np.ndarray

    @property
    def is_directed(self) -> bool:
        """Whether opposite members of the field belong to different streamlines, although N is even."""
        return self.degree % 2 == 0 and self.family_count == self.degree

    def points_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the (n, 3) points at (n, 3) barycentric coordinates in triangles."""
        return np.einsum("nk,nki->ni", weights, self.points[triangle])

    def weights_at(self, triangle: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the (n, 3) barycentric coordinates of points in triangles.

        `points`, (n, 3), are in world space, one for each triangle. Points outside their triangle get
        coordinates on its boundary.
        """
        planar = self.to_frame(triangle, points - self.points[triangle, 0])
        weights = (self.gradient[triangle] * planar.conj()[:, None]).real
        weights[:, 0] += 1
        weights = np.maximum(weights, 0)
        return weights / weights.sum(axis=1, keepdims=True)

    def shading_normals_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the (n, 3) unit shading normals, interpolated at (n, 3) barycentric coordinates."""
        return normalize(np.einsum("nk,nki->ni", weights, self.corner_normal[triangle]))

    def limited_normals_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the (n, 3) unit shading normals, limited to an angle to the normal of the triangle.

        A shading normal whose angle is larger than `MAX_TILT` is rotated until the angle is `MAX_TILT`.
        """
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

    def z_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return (n,) complex128: the representation of the field, interpolated at points of triangles.

        It is in the frames of the triangles.
        """
        return np.einsum("nk,nk->n", weights, self.z[triangle])

    def members_at(
        self, triangle: np.ndarray, weights: np.ndarray, reference: np.ndarray
    ) -> np.ndarray:
        """Return (n,) complex128: the unit member of the field nearest to a unit tangent `reference`.

        Both are in the frames of the triangles. The result is 0 where the field is zero.
        """
        return nearest_member(reference, self.z_at(triangle, weights), self.degree)

    def is_same_family(
        self,
        member_a: np.ndarray,
        normal_a: np.ndarray,
        member_b: np.ndarray,
        normal_b: np.ndarray,
        tolerance: float = 0.0,
    ) -> np.ndarray:
        """Return (n,) bool: whether members of the field at two points belong to the same family.

        A family is one of the M directions of streamlines through a point. One member is transported to the
        normal of the other. They belong to the same family if the angle between them is less than half the
        angle between two families, plus a tolerance.

        Parameters
        ----------
        member_a, member_b : (n, 3) ndarray
            Unit members.
        normal_a, normal_b : (n, 3) ndarray
            Unit normals, perpendicular to the members.
        tolerance : float
            Tolerance in radians.
        """
        product = dot(member_a, normal_b) * dot(normal_a, member_b)
        cosine = dot(member_a, member_b) - product / np.maximum(1 + dot(normal_a, normal_b), 1e-12)
        if self.is_directed:
            return cosine > np.cos(np.pi / self.degree + tolerance)
        return np.abs(cosine) > np.cos(np.pi / (2 * self.family_count) + tolerance)

    def directions_at(
        self, triangle: np.ndarray, weights: np.ndarray, member: np.ndarray
    ) -> np.ndarray:
        """Return (n,) complex128: the unit direction of the field that corresponds to each member.

        `member` holds (n,) unit members. These and the result are in the frames of the triangles. The N
        members are at equal angles. In a RoSy field, they are the directions of the field. In other fields,
        the directions deviate from the members by the harmonics.
        """
        if not self.harmonics:
            return member
        corners = [(j, values[triangle]) for j, values in self.harmonics]
        harmonics = [(j, np.einsum("nk,nk->n", weights, values)) for j, values in corners]
        direction = unit_complex(member * evaluate_harmonics(harmonics, member))
        return np.where(direction == 0, member, direction)


class SharedEdges(NamedTuple):
    """The n edges that two triangles share; each edge is listed once.

    Attributes
    ----------
    triangle, neighbor : (n,) intp ndarray
        The two triangles of the edge.
    edge, neighbor_edge : (n,) intp ndarray
        Number, 0 to 2, of the edge in `triangle` and in `neighbor`.
    """

    triangle: np.ndarray
    neighbor: np.ndarray
    edge: np.ndarray
    neighbor_edge: np.ndarray

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners at the first ends of the edges and at the second ends: two (n, 2) arrays.

        Each row has the corners, as 3 t + k, in the two triangles t of the edge: `triangle`, then `neighbor`.
        """
        triangle = np.stack([self.triangle, self.neighbor], axis=1)
        edge = np.stack([self.edge, self.neighbor_edge], axis=1)
        return 3 * triangle + (edge + (1, 2)) % 3, 3 * triangle + (edge + (2, 1)) % 3


def shared_edges(mesh: TangentMesh) -> SharedEdges:
    """Return the edges that streamlines can cross."""
    triangle, edge = np.nonzero(mesh.neighbor > np.arange(len(mesh.neighbor))[:, None])
    neighbor = mesh.neighbor[triangle, edge].astype(np.intp)
    return SharedEdges(triangle, neighbor, edge, mesh.neighbor_edge[triangle, edge].astype(np.intp))


def nearest_member(reference: np.ndarray, z: np.ndarray, degree: int) -> np.ndarray:
    """Return (n,) complex128: the unit member of a field that is nearest to the unit tangent `reference`.

    Members are the N-th roots of z, where N is the degree. The result is 0 where z is 0.
    """
    angle = np.angle(z * power(reference, degree).conj()) / degree
    return np.where(z != 0, reference * np.exp(1j * angle), 0)


def build_tangent_mesh(
    instance: MeshInstance,
    *,
    display: str = "smooth",
    crease_angle: float | None = CREASE_ANGLE,
    cache: Cache | None = None,
) -> TangentMesh:
    """Build the tangent mesh of a mesh instance.

    Parameters
    ----------
    instance : MeshInstance
        Instance with a field.
    display : {"smooth", "flat"}
        Whether the field is interpolated, or constant on each face.
    crease_angle : float or None
        Angle between the normals of two triangles, in radians. Sharp edges with larger angles are creases, at
        which streamlines stop. If None, streamlines continue across all edges, along the nearest member.
    cache : Cache, optional
        Cache for corner fields.

    Returns
    -------
    TangentMesh

    Raises
    ------
    RosyError
        If there is no field, if it has vectors for another number of faces than the mesh has, or if it is
        zero on all triangles whose area is not zero.
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
    report(0.3, "preparing the surface")
    points = instance.world_points()[surface.triangle_vertex]
    normal, x, y, area = _triangle_frames(points)
    corner_normal = corner_field.corner_normals.astype(np.float64).transpose(2, 0, 1)
    axis = corner_field.reference_tangent.astype(np.float64).T
    rotations = _rotations_to_planes(axis, corner_normal, normal, x, y)
    z = corner_field.representation.T.astype(np.complex128) * power(rotations, field.degree)
    z *= (area > 0)[:, None]
    if not z.any():
        raise RosyError(f"{surface.name}: the field is zero everywhere")
    harmonics, family_z = [], None
    for channel, values in corner_field.channels.items():
        values = values.T * signed_power(rotations, rotation_order(channel, field.degree))
        if channel[0] == "deviation":
            harmonics.append((channel[1], values))
        elif channel != REPRESENTATION and values.any():
            family_z = values.sum(axis=1)
    mesh = TangentMesh(
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
        magnitude=corner_field.magnitude.T,
        harmonics=tuple(harmonics),
        family_z=family_z,
        neighbor=np.full((len(points), 3), -1, dtype=np.int32),
        neighbor_edge=np.zeros((len(points), 3), dtype=np.int8),
        edge_transport=np.ones((len(points), 3), dtype=np.complex128),
        area=area,
    )
    with progress(0.6, 1.0, "connecting triangles"):
        _connect(mesh, surface, crease_angle)
    return mesh


def take_triangles(mesh: TangentMesh, kept: np.ndarray) -> TangentMesh:
    """Return the mesh of the triangles for which `kept`, (T,) bool, is true.

    Strokes stop at edges to triangles that are not kept.
    """
    number = np.where(kept, np.cumsum(kept, dtype=np.int32) - np.int32(1), np.int32(-1))
    harmonics = tuple((j, values[kept]) for j, values in mesh.harmonics)
    neighbor = np.where(mesh.neighbor >= 0, number[mesh.neighbor], np.int32(-1))[kept]
    return replace(part_of(mesh, kept), harmonics=harmonics, neighbor=neighbor)


def with_corners(mesh: TangentMesh, points: np.ndarray) -> TangentMesh:
    """Return a copy of a mesh in which the corners of the triangles are moved to `points`, (T, 3, 3).

    The new corners must be in the planes of their triangles. Frames and the values of the field at the
    corners are kept. Where a new triangle has no area, the field is zero, and strokes stop at its edges.
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
    """Return the normals, x axes and y axes, (T, 3) unit vectors, and the (T,) areas of triangles.

    `points`, (T, 3, 3), holds the corners. x points from the first corner to the second.
    """
    edge_a, edge_b = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    cross = np.cross(edge_a, edge_b)
    normal = normalize(cross)
    x = normalize(edge_a)
    area = np.sqrt(dot(cross, cross)) / 2
    area[area <= MIN_AREA_RATIO * np.maximum(dot(edge_a, edge_a), dot(edge_b, edge_b))] = 0
    return normal, x, np.cross(normal, x), area


def _barycentric_gradients(
    points: np.ndarray, x: np.ndarray, y: np.ndarray, area: np.ndarray
) -> np.ndarray:
    """Return the (T, 3) complex gradients of the barycentric coordinates; 0 in triangles without area.

    They are in the frames with the unit axes x and y, (T, 3). `points`, (T, 3, 3), holds the corners.
    """
    delta = points - points[:, :1]
    planar = dot(delta, x[:, None]) + 1j * dot(delta, y[:, None])
    # The edge opposite to corner k, rotated inward by 90 degrees, over twice the area.
    edge = planar[:, [2, 0, 1]] - planar[:, [1, 2, 0]]
    return quotient(1j * edge, 2 * area[:, None])


def _rotations_to_planes(
    axis: np.ndarray, corner_normal: np.ndarray, normal: np.ndarray, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """Return (T, 3) complex128: rotations of the field values at corners to the frames of the triangles.

    `CornerField` stores the field at the three corners of a triangle relative to one reference tangent at the
    first corner. The result is this tangent after transport, by minimal rotations, from the normal at the
    first corner to the normal at each corner, and from there to the normal of the triangle. It is a unit
    number in the frame of the triangle. A member of the field at a corner is multiplied by it, so a
    representation of degree N is multiplied by its power N. Then two triangles that share an edge have
    the same interpolated field along it.

    Parameters
    ----------
    axis : (T, 3) ndarray
        Unit reference tangent at the first corner.
    corner_normal : (T, 3, 3) ndarray
    normal, x, y : (T, 3) ndarray
        Normals and frames, as in `TangentMesh`.
    """
    rotations = np.empty((len(axis), 3), dtype=np.complex128)
    for k in range(3):
        corner_axis = axis if k == 0 else transport(axis, corner_normal[:, 0], corner_normal[:, k])
        corner_axis = transport(corner_axis, corner_normal[:, k], normal)
        rotations[:, k] = unit_complex(dot(corner_axis, x) + 1j * dot(corner_axis, y))
    return rotations


def _connect(mesh: TangentMesh, surface: Surface, crease_angle: float | None) -> None:
    """Fill the arrays `neighbor`, `neighbor_edge` and `edge_transport` of a tangent mesh, in place.

    Strokes stop at triangles on which the field is zero and at creases: sharp edges at which the angle
    between the normals is larger than `crease_angle`, in radians. If it is None, there are no creases.
    """
    start = np.arange(0, mesh.neighbor.size + 1, 3, dtype=np.int32)
    with progress(0.0, 0.5):
        edges = build_edges(surface.triangle_vertex.ravel(), start)
    a, b = edges.halfedges[:, 0], edges.halfedges[:, 1]
    defined = (mesh.z != 0).any(axis=1)
    passable = defined[a // 3] & defined[b // 3]
    if crease_angle is not None:
        is_bent = dot(mesh.normal[a // 3], mesh.normal[b // 3]) < np.cos(crease_angle)
        passable &= ~(is_sharp_edge(surface, a, b) & is_bent)
    a, b = a[passable], b[passable]
    triangle_a, triangle_b = a // 3, b // 3
    # The edge from corner c to the next corner is opposite to the corner before c.
    edge_a, edge_b = (a + 2) % 3, (b + 2) % 3
    along = mesh.points[triangle_a, (a + 1) % 3] - mesh.points[triangle_a, a % 3]
    edge_in_a = mesh.to_frame(triangle_a, along)
    factor = unit_complex(mesh.to_frame(triangle_b, along) * edge_in_a.conj(), otherwise=1)
    for own, other, transported in (
        ((triangle_a, edge_a), (triangle_b, edge_b), factor),
        ((triangle_b, edge_b), (triangle_a, edge_a), factor.conj()),
    ):
        mesh.neighbor[own], mesh.neighbor_edge[own] = other
        mesh.edge_transport[own] = transported


def is_sharp_edge(surface: Surface, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return (n,) bool: whether edges between two triangles are sharp.

    Shading normals are not interpolated across a sharp edge.

    Parameters
    ----------
    surface : Surface
    a, b : (n,) ndarray of int
        Corners at which the edge starts, as 3 t + k: `a` in the triangle t on one side, `b` in the triangle
        on the other side.
    """
    fan = surface.corner_fan[surface.triangles].ravel()
    next_a, next_b = a - a % 3 + (a + 1) % 3, b - b % 3 + (b + 1) % 3
    return (fan[a] != fan[next_b]) | (fan[next_a] != fan[b])

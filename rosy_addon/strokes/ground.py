"""What strokes run on: triangles laid flat, the field at their corners, and who is across each edge.

The field is that which is drawn: `projection.carried` takes it to the corners, and inside a
triangle the representation z is interpolated linearly, in the triangle's plane. Tangents there are
complex numbers in a frame of the triangle; over an edge they are carried by unfolding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import RosyError
from ..field.directions import evaluate, is_paired
from ..field.frames import carry, dot, unit
from ..field.representation import power, signed_power
from ..field.surface import surface_edges
from ..progress import drain
from ..projection.carried import carrying, order_of
from ..projection.gbuffer import Body

#: Edges at which normals do not mix stop strokes if the surface bends there by so much.
CREASE_ANGLE = np.radians(30)

#: Triangles of less than this share of the square of their longer sides have no area.
SLIVER = 1e-9

#: Where the representation is smaller than this share of what it is at the corners, it is zero.
FAINT = 1e-4


@dataclass(frozen=True, eq=False)
class Ground:
    """T triangles in world space and the field on them.

    Corner k of a triangle is opposite to its edge k. Frames are x, y = normal cross x.

    Attributes
    ----------
    degree : int
        N of the field.
    lines : int
        Through a point: N, or N/2 if each direction has an opposite one.
    points : (T, 3, 3) float64 ndarray
        The corners.
    x, y, normal : (T, 3) float64 ndarray
        Unit; `normal` from the order of the corners.
    corner_normal : (T, 3, 3) float64 ndarray
        Shading normals.
    face : (T,) int32 ndarray
        Of the surface.
    gradient : (T, 3) complex128 ndarray
        Of the barycentric coordinates in the triangle's frame.
    z : (T, 3) complex128 ndarray
        The representation at the corners, in the triangle's frame.
    harmonics : tuple of (int, (T, 3) complex128 ndarray)
        Of free directions: j and C_j (see `field.directions`); empty for a RoSy.
    stored : (T,) complex128 ndarray or None
        Of a field whose stored member is on one line all over: z, of degree N / families, of that.
    across : (T, 3) int32 ndarray
        The triangle across edge k, -1 where strokes stop.
    back : (T, 3) int8 ndarray
        Which edge of that triangle it is.
    unfold : (T, 3) complex128 ndarray
        From this frame to that one.
    area : (T,) float64 ndarray
    triangle_vertex : (T, 3) int32 ndarray
    """

    degree: int
    lines: int
    points: np.ndarray
    x: np.ndarray
    y: np.ndarray
    normal: np.ndarray
    corner_normal: np.ndarray
    face: np.ndarray
    gradient: np.ndarray
    z: np.ndarray
    harmonics: tuple[tuple[int, np.ndarray], ...]
    stored: np.ndarray | None
    across: np.ndarray
    back: np.ndarray
    unfold: np.ndarray
    area: np.ndarray
    triangle_vertex: np.ndarray

    @property
    def directed(self) -> bool:
        """Whether opposite members are different lines, although N is even."""
        return self.degree % 2 == 0 and self.lines == self.degree

    def place(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(n, 3) points of barycentric coordinates."""
        return np.einsum("nk,nki->ni", weights, self.points[triangle])

    def weights(self, triangle: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(n, 3) barycentric coordinates of points in the planes of triangles."""
        delta = points - self.points[triangle, 0]
        flat = dot(delta, self.x[triangle]) + 1j * dot(delta, self.y[triangle])
        weights = (self.gradient[triangle] * flat.conj()[:, None]).real
        weights[:, 0] += 1
        weights = np.maximum(weights, 0)
        return weights / weights.sum(axis=1, keepdims=True)

    def shading_normal(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(n, 3) unit interpolated normals."""
        return unit(np.einsum("nk,nki->ni", weights, self.corner_normal[triangle]))

    def in_space(self, triangle: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """(n, 3) vectors of tangents that are complex numbers in the frames of triangles."""
        return tangent.real[:, None] * self.x[triangle] + tangent.imag[:, None] * self.y[triangle]

    def upright(self, triangle: np.ndarray, tangent: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """(n, 3) tangents of triangles, carried to shading normals."""
        return carry(tangent, self.normal[triangle], normal)

    def members(self, triangle: np.ndarray, weights: np.ndarray, near: np.ndarray) -> np.ndarray:
        """(n,) complex: the unit member nearest to a tangent; 0 where the field has none."""
        z = np.einsum("nk,nk->n", weights, self.z[triangle])
        return nearest_member(near, z, self.degree)

    def same_line(
        self,
        one: np.ndarray,
        here: np.ndarray,
        other: np.ndarray,
        there: np.ndarray,
        slack: float = 0.0,
    ) -> np.ndarray:
        """(n,) bool: whether unit members (n, 3) at two places are on the same of the lines.

        Given with the normals there, which they are perpendicular to; one is carried to the other.
        They may be apart by half of what is between two lines, and by `slack` radians.
        """
        carried = dot(one, other) - dot(one, there) * dot(here, other) / np.maximum(
            1 + dot(here, there), 1e-12
        )
        if self.directed:
            return carried > np.cos(np.pi / self.degree + slack)
        return np.abs(carried) > np.cos(np.pi / (2 * self.lines) + slack)

    def ways(self, triangle: np.ndarray, weights: np.ndarray, member: np.ndarray) -> np.ndarray:
        """(n,) complex: the unit direction that belongs to a member: itself, of a RoSy."""
        if not self.harmonics:
            return member
        found = [
            (j, np.einsum("nk,nk->n", weights, values[triangle])) for j, values in self.harmonics
        ]
        way = member * evaluate(found, member)
        size = np.abs(way)
        return np.divide(way, size, out=member.copy(), where=size > 0)


def nearest_member(near: np.ndarray, z: np.ndarray, degree: int) -> np.ndarray:
    """(n,) complex: of the N unit members of z that nearest to a unit tangent; 0 where z is 0."""
    turn = np.angle(z * power(near, degree).conj()) / degree
    return np.where(z != 0, near * np.exp(1j * turn), 0)


def lay_ground(
    body: Body,
    *,
    display: str = "smooth",
    cross_creases: bool = False,
    crease_angle: float = CREASE_ANGLE,
) -> Ground:
    """Prepare a body for strokes.

    Parameters
    ----------
    body : Body
        With a field. What is worked out of it for drawing is kept there.
    display : {"smooth", "flat"}
        As for drawing: the field interpolated, or each face's own.
    cross_creases : bool
        Whether strokes go on over sharp edges, into the nearest member.
    crease_angle : float
        Radians by which the surface bends there, at least.

    Raises
    ------
    RosyError
        If there is no field, or it does not fit, or no triangle has an area and a direction.
    """
    surface, field = body.surface, body.field
    if field is None:
        raise RosyError(f"{surface.name}: there is no field to draw strokes of")
    if len(field.vectors) != surface.face_count:
        raise RosyError(
            f"{surface.name}: its field has {len(field.vectors)} vectors for "
            f"{surface.face_count} faces"
        )
    if display not in body.carried:
        body.carried[display] = drain(carrying(surface, body.matrix, field, display))
    carried = body.carried[display]
    matrix = np.asarray(body.matrix, dtype=np.float64)
    vertices = surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    points = vertices[surface.triangle_vertex]
    normal, x, y, area = _frames(points)
    corner_normal = carried.normal.astype(np.float64).transpose(2, 0, 1)
    turns = _turns_to_planes(carried.axis.astype(np.float64).T, corner_normal, normal, x, y)
    z = carried.z.T.astype(np.complex128) * power(turns, field.degree)
    z *= (area > 0)[:, None]
    if not z.any():
        raise RosyError(f"{surface.name}: its field is zero all over")
    harmonics, stored = [], None
    for trait, values in carried.traits.items():
        values = values.T * signed_power(turns, order_of(trait, field.degree))
        if trait[0] == "deviation":
            harmonics.append((trait[1], values))
        else:
            stored = values.sum(axis=1)
    across, back, unfold = _neighbours(
        surface, points, x, y, normal, (z != 0).any(axis=1), None if cross_creases else crease_angle
    )
    return Ground(
        degree=field.degree,
        lines=field.degree // 2 if is_paired(field) else field.degree,
        points=points,
        x=x,
        y=y,
        normal=normal,
        corner_normal=corner_normal,
        face=surface.triangle_face,
        gradient=_gradients(points, x, y, area),
        z=z,
        harmonics=tuple(harmonics),
        stored=stored,
        across=across,
        back=back,
        unfold=unfold,
        area=area,
        triangle_vertex=surface.triangle_vertex,
    )


def on_corners(ground: Ground, values: np.ndarray | float, surface_name: str) -> np.ndarray:
    """(T, 3) float64 of a number, or of one for each vertex or face.

    Raises
    ------
    RosyError
        If there are as many as there are neither vertices nor faces.
    """
    values = np.asarray(values, dtype=np.float64)
    shape = ground.triangle_vertex.shape
    if values.ndim == 0:
        return np.full(shape, float(values))
    faces, vertices = int(ground.face.max()) + 1, int(ground.triangle_vertex.max()) + 1
    if values.shape == (faces,):
        return np.repeat(values[ground.face][:, None], 3, axis=1)
    if values.ndim == 1 and len(values) >= vertices:
        return values[ground.triangle_vertex]
    raise RosyError(
        f"{surface_name}: {values.shape} values are neither one for each of {vertices} vertices "
        f"nor for each of {faces} faces"
    )


def _frames(points: np.ndarray) -> tuple[np.ndarray, ...]:
    """Normals, frames and areas of triangles; x along the first edge."""
    first, second = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    cross = np.cross(first, second)
    normal = unit(cross)
    x = unit(first)
    area = np.sqrt(dot(cross, cross)) / 2
    longest = np.maximum(dot(first, first), dot(second, second))
    area[area <= SLIVER * longest] = 0
    return normal, x, np.cross(normal, x), area


def _gradients(points: np.ndarray, x: np.ndarray, y: np.ndarray, area: np.ndarray) -> np.ndarray:
    """(T, 3) complex gradients of barycentric coordinates; 0 for triangles without area."""
    flat = np.stack(
        [
            dot(points[:, k] - points[:, 0], x) + 1j * dot(points[:, k] - points[:, 0], y)
            for k in range(3)
        ],
        axis=1,
    )
    # The edge opposite to corner k, turned inward, over twice the area.
    edge = flat[:, [2, 0, 1]] - flat[:, [1, 2, 0]]
    twice = 2 * area[:, None]
    return np.divide(1j * edge, twice, out=np.zeros_like(edge), where=twice > 0)


def _turns_to_planes(
    axis: np.ndarray, corner_normal: np.ndarray, normal: np.ndarray, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """(T, 3) complex: the axis that corners' values are relative to, in the triangles' frames.

    `carried` has brought them along the arcs to the first corner; they go back there, and from
    their own corner straight to the plane, as then values on an edge depend on its ends alone.
    """
    turns = np.empty((len(axis), 3), dtype=np.complex128)
    for k in range(3):
        own = axis if k == 0 else carry(axis, corner_normal[:, 0], corner_normal[:, k])
        own = carry(own, corner_normal[:, k], normal)
        turn = dot(own, x) + 1j * dot(own, y)
        size = np.abs(turn)
        turns[:, k] = np.divide(turn, size, out=np.zeros_like(turn), where=size > 0)
    return turns


def _neighbours(
    surface,
    points: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    normal: np.ndarray,
    defined: np.ndarray,
    crease_angle: float | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`Ground.across`, `back` and `unfold`."""
    count = len(points)
    edges = surface_edges(
        surface.triangle_vertex.ravel(), np.arange(0, 3 * count + 1, 3, dtype=np.int32)
    )
    a, b = edges.sides[:, 0], edges.sides[:, 1]
    one, other = a // 3, b // 3
    open_way = defined[one] & defined[other]
    if crease_angle is not None:
        open_way &= ~(
            sharp_sides(surface, a, b) & (dot(normal[one], normal[other]) < np.cos(crease_angle))
        )
    a, b, one, other = (values[open_way] for values in (a, b, one, other))
    across = np.full((count, 3), -1, dtype=np.int32)
    back = np.zeros((count, 3), dtype=np.int8)
    unfold = np.ones((count, 3), dtype=np.complex128)
    # The edge from corner c to the next is opposite to the one before c.
    edge_a, edge_b = (a + 2) % 3, (b + 2) % 3
    along = points[one, (a + 1) % 3] - points[one, a % 3]
    here = dot(along, x[one]) + 1j * dot(along, y[one])
    there = dot(along, x[other]) + 1j * dot(along, y[other])
    turn = there * here.conj()
    size = np.abs(turn)
    turn = np.divide(turn, size, out=np.ones_like(turn), where=size > 0)
    across[one, edge_a], across[other, edge_b] = other, one
    back[one, edge_a], back[other, edge_b] = edge_b, edge_a
    unfold[one, edge_a], unfold[other, edge_b] = turn, turn.conj()
    return across, back, unfold


def sharp_sides(surface, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) bool: whether normals do not mix across edges between triangles.

    Given by the corners (3 t + k) that the edges start from, one on either side.
    """
    fan = surface.corner_fan[surface.triangles].ravel()
    ahead_a, ahead_b = a - a % 3 + (a + 1) % 3, b - b % 3 + (b + 1) % 3
    return (fan[a] != fan[ahead_b]) | (fan[ahead_a] != fan[b])

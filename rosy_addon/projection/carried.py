"""A body's field at the corners of its triangles, in world space: the same for every camera.

A field is given on faces at rest. Each face's member is carried to where the face is now, and from
the faces to the corners, where it is averaged over each smooth fan. Everything but the first step
is done on the representation z = rho exp(i N t), so that nothing depends on which of the N members
is stored. What a field has besides, the deviations of free directions and the line that the stored
member is on, goes the same way, as complex numbers that turn with the frame as other powers.

Vectors are kept and worked on by their components, which lie in a row each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..field.directions import harmonics
from ..field.frames import dot_components, transformed
from ..field.representation import power, signed_power
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..progress import Progress, Work
from ..trigonometry import angle_of

#: Faces, corners and triangles that are worked on at once: bounds memory, and fits the caches.
BLOCK = 1 << 14

#: A matrix that turns and scales is one within the rounding of Blender's single precision.
SIMILAR = 2e-6

Vectors = Sequence[np.ndarray]

#: What a field may have besides z: ("deviation", j) is the harmonic C_j of `field.directions`,
#: ("family", m) the representation, of degree N / m, of the line that the stored member is on.
Trait = tuple[str, int]


def order_of(trait: Trait, degree: int) -> int:
    """To which power of a turn of the frame a trait turns; z does to the power N."""
    kind, number = trait
    return -number if kind == "deviation" else degree // number


@dataclass(frozen=True, eq=False)
class Carried:
    """What the pixels of T triangles are computed from, single precision.

    Attributes
    ----------
    normal : (3, 3, T) ndarray
        Components of n_0, n_1, n_2.
    axis : (3, T) ndarray
        A unit tangent e at n_0: values are relative to it.
    z : (3, T) complex ndarray
        The corners' values, those of corners 1 and 2 carried along the arc to n_0.
    dots : (3, T) ndarray
        n_0.n_1, n_0.n_2, n_1.n_2.
    volume : (T,) ndarray
        n_0 . (n_1 x n_2).
    plane_normal : (3, T) ndarray
        Of the triangles themselves, from the order of their corners.
    traits : dict of Trait to (3, T) complex ndarray
        As z.
    """

    normal: np.ndarray
    axis: np.ndarray
    z: np.ndarray
    dots: np.ndarray
    volume: np.ndarray
    plane_normal: np.ndarray
    traits: dict[Trait, np.ndarray]

    def turned(self, rotation: np.ndarray) -> Carried:
        """The same in another space, given the (3, 3) rotation to there."""
        return replace(
            self,
            normal=np.stack([transformed(corner, rotation) for corner in self.normal]),
            axis=transformed(self.axis, rotation),
            plane_normal=transformed(self.plane_normal, rotation),
        )


def carrying(surface: Surface, matrix: np.ndarray, field: RosyField, display: str) -> Work[Carried]:
    """Carry a field from the faces at rest to the corners of the triangles as they are now.

    Parameters
    ----------
    surface : Surface
    matrix : (4, 4) float64 ndarray
        Object to world space.
    field : RosyField
    display : {"smooth", "flat"}
        Whether values and normals are averaged at the corners, or each face keeps its own.

    Returns
    -------
    Carried
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    now = transformed(np.ascontiguousarray(surface.vertices.T), linear)
    yield Progress(0.0, "carrying the field")
    faces = _faces(surface, linear, now, field, angles=display == "smooth")
    yield Progress(0.4, "carrying the field")
    fans = _fans(surface, linear, faces, field.degree) if display == "smooth" else None
    yield Progress(0.7, "carrying the field")
    count = len(surface.triangles)
    carried = Carried(
        normal=np.empty((3, 3, count), dtype=np.float32),
        axis=np.empty((3, count), dtype=np.float32),
        z=np.empty((3, count), dtype=np.complex64),
        dots=np.empty((3, count), dtype=np.float32),
        volume=np.empty(count, dtype=np.float32),
        plane_normal=np.empty((3, count), dtype=np.float32),
        traits={trait: np.empty((3, count), dtype=np.complex64) for trait in faces.traits},
    )
    custom = None
    if fans is not None and not surface.fans_share_normals:
        custom = transformed(surface.corner_normal.T, _cofactors(linear))
    for start in range(0, count, BLOCK):
        part = slice(start, min(start + BLOCK, count))
        _fill_triangles(carried, part, surface, now, faces, fans, custom, field.degree)
    return carried


# --- faces ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Faces:
    """Faces as they are now, and their values.

    Attributes
    ----------
    normal : (3, F) float32 ndarray
        Unit; zero for a face without area.
    z : (F,) complex64 ndarray
        In the `_frame` of that normal.
    angle : (C,) float32 ndarray or None
        Of each face at each of its corners.
    traits : dict of Trait to (F,) complex64 ndarray
        As z.
    """

    normal: np.ndarray
    z: np.ndarray
    angle: np.ndarray | None
    traits: dict[Trait, np.ndarray]


def _faces(
    surface: Surface, linear: np.ndarray, now: np.ndarray, field: RosyField, angles: bool
) -> _Faces:
    """Carry members from faces at rest to the same faces as they are now.

    `now` are the (3, V) vertices in world space, but for the shift.
    """
    count = surface.face_count
    relative: dict[Trait, np.ndarray] = {
        ("deviation", j): values for j, values in harmonics(field).items()
    }
    if field.families > 1:
        relative["family", field.families] = np.ones(count)
    found = _Faces(
        normal=np.empty((3, count), dtype=np.float32),
        z=np.empty(count, dtype=np.complex64),
        angle=np.empty(len(surface.corner_vertex), dtype=np.float32) if angles else None,
        traits={trait: np.empty(count, dtype=np.complex64) for trait in relative},
    )
    scale = _similarity(linear) if surface.rest is None else None
    rest = None
    if scale is None:
        rest = np.ascontiguousarray((surface.vertices if surface.rest is None else surface.rest).T)
    for size, block in _faces_by_size(surface.face_start):
        first = surface.face_start[:-1][block]
        corner_vertex = [surface.corner_vertex.take(first + corner) for corner in range(size)]
        points = _from_first(now, corner_vertex)
        normal = _normal(points)
        for part, out in zip(normal, found.normal, strict=True):
            out[block] = part
        x, y = _frame([part[block].astype(np.float64) for part in found.normal])
        vectors = [np.ascontiguousarray(part) for part in field.vectors[block].T]
        if rest is None:
            vectors = transformed(vectors, linear * (1 / scale))
            member = dot_components(vectors, x) + 1j * dot_components(vectors, y)
        else:
            member = _carried_member(_from_first(rest, corner_vertex), points, vectors, x, y)
        size = np.abs(member)
        member /= np.maximum(size, np.finfo(np.float64).tiny)
        exists = np.logical_or.reduce(normal)
        found.z[block] = power(member, field.degree) * (size * exists)
        for trait, values in relative.items():
            turn = signed_power(member, order_of(trait, field.degree))
            found.traits[trait][block] = values[block] * turn * exists
        if angles:
            for corner, angle in enumerate(_angles(points)):
                found.angle[first + corner] = angle
    return found


def _faces_by_size(face_start: np.ndarray) -> Iterator[tuple[int, slice | np.ndarray]]:
    """Blocks of faces with equally many corners."""
    size = np.diff(face_start)
    if (size == size[0]).all():
        for start in range(0, len(size), BLOCK):
            yield int(size[0]), slice(start, start + BLOCK)
        return
    for corners in np.unique(size).tolist():
        alike = np.flatnonzero(size == corners)
        # Faces with very many corners are few; their blocks are to stay as small.
        block = max(4 * BLOCK // max(corners, 4), 1)
        for start in range(0, len(alike), block):
            yield corners, alike[start : start + block]


def _similarity(linear: np.ndarray) -> float | None:
    """By how much a linear map scales, if that is all it does but turning and mirroring."""
    square = linear.T @ linear
    scale = np.trace(square) / 3
    if not scale > 0 or np.abs(square - scale * np.eye(3)).max() > SIMILAR * scale:
        return None
    return float(np.sqrt(scale))


def _from_first(points: np.ndarray, corner_vertex: Sequence[np.ndarray]) -> list[list[np.ndarray]]:
    """Corners of faces relative to their first, which is left out."""
    origin = [part.take(corner_vertex[0]) for part in points]
    return [
        [part.take(vertex) - start for part, start in zip(points, origin, strict=True)]
        for vertex in corner_vertex[1:]
    ]


def _cross(a: Vectors, b: Vectors) -> list[np.ndarray]:
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def _unit(vectors: Vectors) -> list[np.ndarray]:
    """Scaled to length 1; zero vectors stay zero."""
    length = np.sqrt(dot_components(vectors, vectors))
    length[length == 0] = np.inf
    return [part / length for part in vectors]


def _normal(points: Sequence[Vectors]) -> list[np.ndarray]:
    """Unit normals of polygons given by `_from_first`: the sum of a fan of triangles."""
    area = _cross(points[0], points[1])
    for one, other in pairwise(points[1:]):
        area = [total + part for total, part in zip(area, _cross(one, other), strict=True)]
    return _unit(area)


def _angles(points: Sequence[Vectors]) -> list[np.ndarray]:
    """The angle at each corner of polygons given by `_from_first`."""
    edges = [points[0]]
    edges += [_less(after, before) for before, after in pairwise(points)]
    edges.append([-part for part in points[-1]])
    corners = list(zip(edges, edges[-1:] + edges[:-1], strict=True))
    if len(corners) > 3:
        return [_angle(ahead, behind, _cross(behind, ahead)) for ahead, behind in corners]
    area = _cross(edges[0], edges[1])
    one, other = (_angle(ahead, behind, area) for ahead, behind in corners[:2])
    return [one, other, np.maximum(np.float32(np.pi) - one - other, 0)]


def _angle(ahead: Vectors, behind: Vectors, across: Vectors) -> np.ndarray:
    """Between one edge and that before it, which runs the other way, given their cross product."""
    size = np.sqrt(dot_components(across, across))
    along = dot_components(ahead, behind)
    longer = np.maximum(size, np.abs(along))
    longer[longer == 0] = 1
    size /= longer
    along /= -longer
    return angle_of(along.astype(np.float32), size.astype(np.float32))


def _less(a: Vectors, b: Vectors) -> list[np.ndarray]:
    return [one - other for one, other in zip(a, b, strict=True)]


def _carried_member(
    rest: Sequence[Vectors], now: Sequence[Vectors], vectors: Vectors, x: Vectors, y: Vectors
) -> np.ndarray:
    """Members of faces that are deformed, as they are now, in the frames x, y.

    In frames of both planes the corners are complex numbers w and u. The linear map that takes w
    to u best, u = a w + b conj(w), has the rotation a / |a| as its polar part, and that part alone
    is applied: members stay 2 pi / N apart and keep their length however the face is stretched.
    Both normals follow from the order of the corners, so a mirrored face needs no care.
    """
    rest_normal = _normal(rest)
    rest_x, rest_y = _frame(rest_normal)
    w, u = _flat(rest, rest_x, rest_y), _flat(now, x, y)
    ww = uw = square = 0
    for one, other in zip(w, u, strict=True):
        ww, uw = ww + one * one, uw + other * one
        square = square + (one.real**2 + one.imag**2)
    turned = square * sum(other * one.conj() for one, other in zip(w, u, strict=True))
    turned -= np.conj(ww) * uw
    turned *= np.logical_or.reduce(rest_normal)
    turned /= np.maximum(np.abs(turned), np.finfo(np.float64).tiny)
    return turned * (dot_components(vectors, rest_x) + 1j * dot_components(vectors, rest_y))


def _flat(points: Sequence[Vectors], x: Vectors, y: Vectors) -> list[np.ndarray]:
    """Corners in a frame of the face, relative to their mean."""
    flat = [dot_components(point, x) + 1j * dot_components(point, y) for point in points]
    mean = sum(flat) / (len(flat) + 1)
    return [-mean, *(point - mean for point in flat)]


def _frame(normal: Vectors) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """`frames.tangent_frame` by components."""
    nx, ny, nz = normal
    sign = np.copysign(nz.dtype.type(1), nz)
    a = -1 / (sign + nz)
    b = nx * ny * a
    x = [1 + sign * nx * nx * a, sign * b, -sign * nx]
    return x, [b, sign + ny * ny * a, -ny]


def _cofactors(linear: np.ndarray) -> np.ndarray:
    """det(L) times the inverse transpose: what L does to normals, mirrored or flattened too."""
    a, b, c = linear
    return np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])


# --- fans ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Fans:
    """Smooth fans of corners: (3, K) float32 normals, (K,) complex64 values in their `_frame`."""

    normal: np.ndarray
    z: np.ndarray
    traits: dict[Trait, np.ndarray]


def _fans(surface: Surface, linear: np.ndarray, faces: _Faces, degree: int) -> _Fans:
    """Average the faces' values at their corners, weighted by the angle there.

    Each is carried to the fan's normal by the minimal rotation from its face's. Faces on which the
    field is undefined have no say.
    """
    normal = np.array(_unit(transformed(surface.fan_normal.T, _cofactors(linear))))
    normal = normal.astype(np.float32)
    frame_x, frame_y = _frame(normal)
    count, fans = len(surface.corner_vertex), normal.shape[1]
    weight = np.empty(count)
    values = [(faces.z, degree)]
    values += [(own, order_of(trait, degree)) for trait, own in faces.traits.items()]
    sums = [(np.empty(count), np.empty(count)) for _ in values]
    for start in range(0, count, BLOCK):
        part = slice(start, min(start + BLOCK, count))
        face, fan = surface.corner_face[part], surface.corner_fan[part].astype(np.intp)
        turn = _carried_turn(
            [own.take(face) for own in faces.normal],
            [there.take(fan) for there in normal],
            [x.take(fan) for x in frame_x],
            [y.take(fan) for y in frame_y],
        )
        np.multiply(faces.angle[part], faces.z.take(face) != 0, out=weight[part])
        for (own, order), (real, imaginary) in zip(values, sums, strict=True):
            z = own.take(face)
            z *= signed_power(turn, order)
            z *= weight[part]
            real[part], imaginary[part] = z.real, z.imag
    total = np.bincount(surface.corner_fan, weight, fans)
    total[total == 0] = np.inf
    means = []
    for real, imaginary in sums:
        z = np.empty(fans, dtype=np.complex64)
        z.real = np.bincount(surface.corner_fan, real, fans) / total
        z.imag = np.bincount(surface.corner_fan, imaginary, fans) / total
        means.append(z)
    return _Fans(normal, means[0], dict(zip(faces.traits, means[1:], strict=True)))


def _carried_turn(source: Vectors, target: Vectors, x: Vectors, y: Vectors) -> np.ndarray:
    """(n,) complex64: the x axes of normals' `_frame` carried to others, in frames x, y of these.

    As `frames.carry`: v - (v.t) / (1 + s.t) (s + t), of which t has no part in the frame.
    """
    vectors, _ = _frame(source)
    share = dot_components(vectors, target)
    share /= np.maximum(1 + dot_components(source, target), np.finfo(share.dtype).eps)
    turn = np.empty(len(share), dtype=np.complex64)
    turn.real = dot_components(vectors, x) - share * dot_components(source, x)
    turn.imag = dot_components(vectors, y) - share * dot_components(source, y)
    size = np.sqrt(turn.real * turn.real + turn.imag * turn.imag)
    size[size == 0] = np.inf
    turn *= np.float32(1) / size
    return turn


# --- triangles -----------------------------------------------------------------------------------


def _fill_triangles(
    carried: Carried,
    part: slice,
    surface: Surface,
    now: np.ndarray,
    faces: _Faces,
    fans: _Fans | None,
    custom: np.ndarray | None,
    degree: int,
) -> None:
    """Write what some triangles have at their corners; without fans, what their faces have."""
    corners = surface.triangles[part].T.astype(np.intp)
    face = surface.triangle_face[part]
    plane_normal = faces.normal.take(face, axis=1)
    if len(surface.triangles) > surface.face_count:
        vertices = [surface.corner_vertex.take(corner) for corner in corners]
        plane_normal[:] = _normal(_from_first(now, vertices))
    if fans is None:
        normals = [[own.take(face) for own in faces.normal]] * 3
        turns = None
    else:
        fan = [surface.corner_fan.take(corner).astype(np.intp) for corner in corners]
        normals, turns = _fan_normals(fan, corners, fans, custom)
    normals = [_completed(normal, plane_normal) for normal in normals]
    x, y = _frame(normals[0])
    # Values on faces where the field is undefined are so at all corners.
    defined = faces.z.take(face) != 0
    outs = [(carried.z, degree, faces.z, fans and fans.z)]
    outs += [
        (out, order_of(trait, degree), faces.traits[trait], fans and fans.traits[trait])
        for trait, out in carried.traits.items()
    ]
    for corner, normal in enumerate(normals):
        carried.normal[corner, :, part] = normal
        back = _carried_turn(normal, normals[0], x, y) if corner and fans is not None else None
        for out, order, of_faces, of_fans in outs:
            z = of_faces.take(face) if of_fans is None else of_fans.take(fan[corner])
            if turns is not None:
                z *= signed_power(turns[corner], order)
            if back is not None:
                z *= signed_power(back, order)
            np.multiply(z, defined, out=out[corner, part])
    carried.axis[:, part] = x
    carried.plane_normal[:, part] = plane_normal
    for number, (one, other) in enumerate(((0, 1), (0, 2), (1, 2))):
        carried.dots[number, part] = dot_components(normals[one], normals[other])
    carried.volume[part] = dot_components(normals[0], _cross(normals[1], normals[2]))


def _completed(normal: list[np.ndarray], plane_normal: np.ndarray) -> list[np.ndarray]:
    """Normals that are zero replaced by those of the triangles, or by any."""
    lost = dot_components(normal, normal) == 0
    if lost.any():
        plane = plane_normal[:, lost]
        plane[2, ~plane.any(axis=0)] = 1
        normal = [part.copy() for part in normal]
        for part, instead in zip(normal, plane, strict=True):
            part[lost] = instead
    return normal


def _fan_normals(
    fan: Sequence[np.ndarray],
    corners: np.ndarray,
    fans: _Fans,
    custom: np.ndarray | None,
) -> tuple[list[list[np.ndarray]], list[np.ndarray] | None]:
    """Normals at corners, and with custom ones the turns from the frames of the fans to theirs."""
    normals = [[part.take(number) for part in fans.normal] for number in fan]
    if custom is None:
        return normals, None
    own = [
        [part.astype(np.float32) for part in _unit([part.take(corner) for part in custom])]
        for corner in corners
    ]
    turns = [
        _carried_turn(normal, there, *_frame(there))
        for normal, there in zip(normals, own, strict=True)
    ]
    return own, turns

"""From bodies and a camera to the G-buffer: who is seen where, and the field there.

A field is given on faces at rest. Each face's member is carried to where the face is now, in
camera space; from the faces to the corners, where it is averaged over each smooth fan; from the
corners to the pixels; and from each pixel's tangent plane into the view plane. Everything but the
first step is done on the representation z = rho exp(i N t), so that nothing depends on which of
the N members is stored.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import RosyError
from ..field.frames import (
    carry,
    carry_components,
    dot,
    dot_components,
    tangent_frame,
    unit,
)
from ..field.representation import power
from ..field.surface import Surface, mix_over_fans, next_corners
from ..progress import Progress, Work, drain
from .camera import Camera, pixel_rays
from .gbuffer import Body, GBuffer
from .raster import Fragments, rasterise
from .steps import links, screen_axes

__all__ = ["links", "project", "projecting", "screen_axes"]

#: Pixels that are worked on at once: bounds memory, and fits the caches.
BLOCK = 1 << 14

DISPLAYS = ("smooth", "flat")


def project(bodies: Sequence[Body], camera: Camera, display: str = "smooth") -> GBuffer:
    """What a camera sees of RoSy surfaces; see `projecting`."""
    return drain(projecting(bodies, camera, display))


def projecting(bodies: Sequence[Body], camera: Camera, display: str = "smooth") -> Work[GBuffer]:
    """Find the visible pixels of all RoSy surfaces and the field's value at each.

    Parameters
    ----------
    bodies : sequence of Body
        Those without a field only hide others.
    camera : Camera
    display : {"smooth", "flat"}
        Whether values and normals are averaged at the corners and interpolated, or each face is
        shown as it is.

    Yields
    ------
    Progress

    Returns
    -------
    GBuffer
        At least one pixel.

    Raises
    ------
    RosyError
        If no body has a field, a field does not fit its surface, a matrix is not finite, or no
        RoSy surface is in view.
    """
    _check(bodies, camera, display)
    yield Progress(0.0, "placing the surfaces")
    places = [_place(body, camera) for body in bodies]
    yield Progress(0.1, "finding what is seen")
    seen = _seen(bodies, places, camera)
    yield Progress(0.4, "carrying the field")
    buffer = _empty_buffer(bodies, places, camera, seen)
    done = 0
    for number, (body, place) in enumerate(zip(bodies, places, strict=True)):
        own = buffer.body == number
        if not own.any():
            continue
        pixels = None if own.all() else np.flatnonzero(own)
        triangle = buffer.triangle if pixels is None else buffer.triangle[pixels]
        shown, shown_of_pixel = _numbered(triangle, len(body.surface.triangles))
        values = _triangle_values(body, place, camera, shown, display)
        for start in range(0, len(triangle), BLOCK):
            yield Progress(0.4 + 0.6 * done / len(buffer.body), "turning the field into the view")
            part = slice(start, min(start + BLOCK, len(triangle)))
            where = part if pixels is None else pixels[part]
            _fill(buffer, where, shown_of_pixel[part], values, body.field.degree)
            done += part.stop - part.start
    return buffer


# --- bodies in camera space ------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Place:
    """A surface in camera space: (V, 3) vertices, and the linear part of the way there."""

    vertices: np.ndarray
    linear: np.ndarray


def _check(bodies: Sequence[Body], camera: Camera, display: str) -> None:
    if display not in DISPLAYS:
        raise RosyError(f"display is {display!r}, not one of {', '.join(DISPLAYS)}")
    if all(body.field is None for body in bodies):
        raise RosyError(f"there is no RoSy object for camera '{camera.name}' to see")
    for body in bodies:
        name = body.surface.name
        if np.shape(body.matrix) != (4, 4) or not np.isfinite(body.matrix).all():
            raise RosyError(f"{name}: its matrix is not 4 x 4 finite numbers")
        if body.field is None:
            continue
        found, wanted = len(body.field.vectors), body.surface.face_count
        if found != wanted:
            raise RosyError(f"{name}: its field has {found} vectors for {wanted} faces")
        if not np.isfinite(body.field.vectors).all():
            face = int(np.argmin(np.isfinite(body.field.vectors).all(axis=1)))
            raise RosyError(f"{name}: its field is not finite on face {face}")


def _place(body: Body, camera: Camera) -> _Place:
    matrix = camera.view @ np.asarray(body.matrix, dtype=np.float64)
    linear = matrix[:3, :3]
    return _Place(body.surface.vertices @ linear.T + matrix[:3, 3], linear)


# --- visibility --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Seen:
    """RoSy pixels, and for each its body and the body's own triangle."""

    fragments: Fragments
    body: np.ndarray
    triangle: np.ndarray


def _seen(bodies: Sequence[Body], places: Sequence[_Place], camera: Camera) -> _Seen:
    """The pixels at which a body with a field is nearest.

    Raises
    ------
    RosyError
        If there are none.
    """
    fragments, first = _rasterised(bodies, places, camera)
    with_field = np.array([body.field is not None for body in bodies])
    body = (np.searchsorted(first, fragments.triangle, side="right") - 1).astype(np.int32)
    rosy = with_field[body]
    if not rosy.any():
        _raise_nothing_in_view(bodies, places, camera)
    if not rosy.all():
        fragments, body = Fragments(*(values[rosy] for values in fragments)), body[rosy]
    return _Seen(fragments, body, fragments.triangle - first[body])


def _rasterised(
    bodies: Sequence[Body], places: Sequence[_Place], camera: Camera
) -> tuple[Fragments, np.ndarray]:
    """All bodies at once, and (B,) int32 the first triangle of each in the fragments' count."""
    vertices = np.concatenate([place.vertices for place in places])
    clip = vertices @ camera.projection[:, :3].T + camera.projection[:, 3]
    vertex_counts = [len(place.vertices) for place in places]
    triangles, offset = [], 0
    for body, count in zip(bodies, vertex_counts, strict=True):
        triangles.append(body.surface.corner_vertex[body.surface.triangles] + np.int32(offset))
        offset += count
    counts = [len(own) for own in triangles]
    first = np.cumsum([0, *counts[:-1]]).astype(np.int32)
    return rasterise(clip, np.concatenate(triangles), camera.width, camera.height), first


def _raise_nothing_in_view(
    bodies: Sequence[Body], places: Sequence[_Place], camera: Camera
) -> None:
    pairs = [pair for pair in zip(bodies, places, strict=True) if pair[0].field is not None]
    fragments, _ = _rasterised(*zip(*pairs, strict=True), camera)
    names = ", ".join(body.surface.name for body, _ in pairs)
    why = "hidden behind other objects" if len(fragments.pixel) else "outside the frame"
    raise RosyError(f"no RoSy object is in view of camera '{camera.name}': {names} is {why}")


def _empty_buffer(
    bodies: Sequence[Body], places: Sequence[_Place], camera: Camera, seen: _Seen
) -> GBuffer:
    """A G-buffer in which normals and the representation are yet to be filled in."""
    count = len(seen.body)
    fragments = seen.fragments
    face = np.empty(count, dtype=np.int32)
    position, toward_eye = _vectors(count), _vectors(count)
    toward_eye[:] = (0.0, 0.0, 1.0)
    single = len(np.unique(seen.body)) == 1
    for number in np.unique(seen.body):
        pixels = slice(None) if single else np.flatnonzero(seen.body == number)
        surface = bodies[number].surface
        face[pixels] = surface.triangle_face[seen.triangle[pixels]]
        corners = surface.corner_vertex[surface.triangles[seen.triangle[pixels]]]
        depth = places[number].vertices[:, 2][corners]
        position[pixels, 2] = dot(depth, fragments.barycentric[pixels])
    x, y = pixel_rays(camera, fragments.pixel)
    if camera.is_perspective:
        inverse = 1 / np.sqrt(x * x + y * y + 1)
        toward_eye[:, 0], toward_eye[:, 1], toward_eye[:, 2] = -x * inverse, -y * inverse, inverse
        x, y = -x * position[:, 2], -y * position[:, 2]
    position[:, 0], position[:, 1] = x, y
    return GBuffer(
        camera=camera,
        names=tuple(body.surface.name for body in bodies),
        degrees=tuple(body.field.degree if body.field else 0 for body in bodies),
        pixel=fragments.pixel,
        body=seen.body,
        face=face,
        triangle=seen.triangle,
        barycentric=fragments.barycentric.astype(np.float32),
        position=position,
        normal=_vectors(count),
        toward_eye=toward_eye,
        representation=np.empty(count, dtype=np.complex64),
        plane_normal=_vectors(count),
        front=np.empty(count, dtype=bool),
    )


def _vectors(count: int) -> np.ndarray:
    """(P, 3) float32, each component of all pixels in a row: what is done here is done by them."""
    return np.empty((3, count), dtype=np.float32).T


# --- from faces at rest to corners in camera space ---------------------------------------------


@dataclass(frozen=True, eq=False)
class _Faces:
    """Some faces in camera space, and the field on them.

    Attributes
    ----------
    normal, x, y : (F, 3) float64 ndarray
        Plane (zero without area) and frame.
    z : (F,) complex128 ndarray
        Representation in that frame.
    """

    normal: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray


def _numbered(values: np.ndarray, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """The distinct values, integers below `limit`, and which of them each is."""
    occurs = np.zeros(limit, dtype=bool)
    occurs[values] = True
    number = np.cumsum(occurs, dtype=np.int32) - 1
    return np.flatnonzero(occurs), number[values]


def _corners_of(face_start: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All corners of some faces, and where each face starts among them."""
    size = face_start[faces + 1] - face_start[faces]
    start = np.concatenate([[0], np.cumsum(size)]).astype(np.int32)
    shift = np.repeat(face_start[faces] - start[:-1], size)
    return np.arange(start[-1], dtype=np.int32) + shift, start


def _face_sums(values: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(F, ...) sums of (C, ...) corner values; quick where all faces have as many corners."""
    size = int(start[1] - start[0])
    if len(values) == size * (len(start) - 1) and (np.diff(start) == size).all():
        values = values.reshape(-1, size, *values.shape[1:])
        return sum(values[:, corner] for corner in range(1, size)) + values[:, 0]
    return np.add.reduceat(values, start[:-1], axis=0)


def _centred(points: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(C, 3) corners relative to the mean of their face's."""
    size = np.diff(start)
    mean = _face_sums(points, start) / size[:, None]
    return points - np.repeat(mean, size, axis=0)


def _carried_faces(
    rest: np.ndarray, now: np.ndarray, start: np.ndarray, vectors: np.ndarray, degree: int
) -> _Faces:
    """Carry members from faces at rest to the same faces as they are now.

    Parameters
    ----------
    rest, now : (C, 3) float64 ndarray
        Corners, in the space of `vectors` and in camera space.
    start : (F + 1,) int32 ndarray
    vectors : (F, 3) float64 ndarray
        A member each.
    degree : int

    Notes
    -----
    In frames of both planes the corners are complex numbers w and u. The linear map that takes w
    to u best, u = a w + b conj(w), has the rotation a / |a| as its polar part, and that part alone
    is applied: members stay 2 pi / N apart and keep their length however the face is stretched.
    Both normals follow from the order of the corners, so a mirrored face needs no care.
    """
    rest, now = _centred(rest, start), _centred(now, start)
    following, size = next_corners(start), np.diff(start)
    rest_normal = unit(_face_sums(np.cross(rest, rest[following]), start))
    normal = unit(_face_sums(np.cross(now, now[following]), start))
    rest_x, rest_y = tangent_frame(rest_normal)
    x, y = tangent_frame(normal)

    def flat(points: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, y = np.repeat(x, size, axis=0), np.repeat(y, size, axis=0)
        return dot(points, x) + 1j * dot(points, y)

    w, u = flat(rest, rest_x, rest_y), flat(now, x, y)
    spread = _face_sums(np.abs(w) ** 2, start)
    turned = spread * _face_sums(u * np.conj(w), start)
    turned -= np.conj(_face_sums(w * w, start)) * _face_sums(u * w, start)
    turned[~(rest_normal.any(axis=1) & normal.any(axis=1))] = 0.0
    member = dot(vectors, rest_x) + 1j * dot(vectors, rest_y)
    return _Faces(normal, x, y, np.abs(member) * power(_phase(member) * _phase(turned), degree))


def _phase(numbers: np.ndarray) -> np.ndarray:
    """Complex numbers scaled to length 1; zero stays zero."""
    length = np.abs(numbers)
    return np.divide(numbers, length, out=np.zeros_like(numbers), where=length > 0)


def _cofactors(linear: np.ndarray) -> np.ndarray:
    """det(L) times the inverse transpose: what L does to normals, mirrored or flattened too."""
    a, b, c = linear
    return np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])


def _corner_angles(now: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(C,) angle of each face at each corner."""
    following = next_corners(start)
    ahead = unit(now[following] - now)
    behind = np.empty_like(ahead)
    behind[following] = -ahead
    return np.arccos(np.clip(dot(ahead, behind), -1, 1))


@dataclass(frozen=True, eq=False)
class _Fans:
    """Smooth fans of corners: (K, 3) normals, (K,) z in their `tangent_frame`."""

    normal: np.ndarray
    z: np.ndarray


def _mixed_over_fans(
    faces: _Faces,
    corner_normal: np.ndarray,
    corner_fan: np.ndarray,
    angle: np.ndarray,
    start: np.ndarray,
    degree: int,
) -> _Fans:
    """Average the faces' values at their corners, weighted by the angle there.

    Each is carried to the fan's normal by the minimal rotation from its face's. Faces on which the
    field is undefined have no say.
    """
    normal = unit(mix_over_fans(corner_normal, corner_fan))
    size = np.diff(start)
    there = normal[corner_fan]
    axis = carry(np.repeat(faces.x, size, axis=0), np.repeat(faces.normal, size, axis=0), there)
    frame_x, frame_y = tangent_frame(normal)
    turn = _phase(dot(axis, frame_x[corner_fan]) + 1j * dot(axis, frame_y[corner_fan]))
    z = np.repeat(faces.z, size)
    weight = angle * (z != 0)
    z = weight * z * power(turn, degree)
    total = mix_over_fans(np.stack([z.real, z.imag, weight], axis=1), corner_fan)
    mean = total[:, 0] + 1j * total[:, 1]
    return _Fans(normal, np.divide(mean, total[:, 2], out=mean, where=total[:, 2] > 0))


# --- triangles ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Triangles:
    """What the pixels of the shown triangles are computed from, single precision.

    Attributes
    ----------
    corner_normal : (3, 3, T) ndarray
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
        Of the triangle itself, turned toward the eye.
    front : (T,) bool ndarray
    """

    corner_normal: np.ndarray
    axis: np.ndarray
    z: np.ndarray
    dots: np.ndarray
    volume: np.ndarray
    plane_normal: np.ndarray
    front: np.ndarray


def _triangle_values(
    body: Body, place: _Place, camera: Camera, shown: np.ndarray, display: str
) -> _Triangles:
    surface = body.surface
    plane_normal, front = _planes(surface, place, camera, shown)
    values = _flat_corners if display == "flat" else _smooth_corners
    normal, z, defined = values(body, place, shown)
    lost = ~normal.any(axis=2)
    normal[lost] = np.broadcast_to(plane_normal, normal.shape)[lost]
    axis, _ = tangent_frame(normal[0])
    z = [z[0], *(_onto(z[k], normal[k], normal[0], body.field.degree) for k in (1, 2))]
    dots = [dot(normal[0], normal[1]), dot(normal[0], normal[2]), dot(normal[1], normal[2])]
    volume = dot(normal[0], np.cross(normal[1], normal[2]))
    return _Triangles(
        corner_normal=np.ascontiguousarray(normal.transpose(0, 2, 1), dtype=np.float32),
        axis=np.ascontiguousarray(axis.T, dtype=np.float32),
        z=np.where(defined, z, 0).astype(np.complex64),
        dots=np.array(dots, dtype=np.float32),
        volume=volume.astype(np.float32),
        plane_normal=np.ascontiguousarray(plane_normal.T, dtype=np.float32),
        front=front,
    )


def _planes(
    surface: Surface, place: _Place, camera: Camera, shown: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Normals of triangles turned toward the eye, and whether they had been."""
    a, b, c = place.vertices[surface.corner_vertex[surface.triangles[shown]]].transpose(1, 0, 2)
    normal = unit(np.cross(b - a, c - a))
    toward_eye = -dot(normal, (a + b + c) / 3) if camera.is_perspective else normal[:, 2]
    front = toward_eye >= 0
    normal[~normal.any(axis=1)] = (0.0, 0.0, 1.0)
    return np.where(front[:, None], normal, -normal), front


def _flat_corners(
    body: Body, place: _Place, shown: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals and values at triangles' corners, the same at all three, and where defined."""
    surface = body.surface
    kept, face = _numbered(surface.triangle_face[shown], surface.face_count)
    faces, _, _ = _faces_of(body, place, kept)
    normal, z = faces.normal[face], faces.z[face]
    return np.stack([normal] * 3), np.stack([z] * 3), z != 0


def _smooth_corners(
    body: Body, place: _Place, shown: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(3, T, 3) normals and (3, T) values at triangles' corners, and (T,) where defined."""
    surface, degree = body.surface, body.field.degree
    shown_corners = surface.triangles[shown].T
    kept = _faces_around(surface, shown_corners)
    faces, corners, start = _faces_of(body, place, kept)
    normal = unit(surface.corner_normal[corners] @ _cofactors(place.linear).T)
    angle = _corner_angles(place.vertices[surface.corner_vertex[corners]], start)
    _, fan = _numbered(surface.corner_fan[corners], len(surface.corner_vertex))
    fans = _mixed_over_fans(faces, normal, fan, angle, start, degree)
    number = np.empty(len(surface.corner_vertex), dtype=np.int32)
    number[corners] = np.arange(len(corners), dtype=np.int32)
    own, shown_fan = normal[number[shown_corners]], fan[number[shown_corners]]
    shared, z = fans.normal[shown_fan], fans.z[shown_fan]
    if np.abs(own - shared).max() > 1e-6:
        z = _onto(z, shared, own, degree)  # custom normals may differ within a fan
    defined = np.zeros(surface.face_count, dtype=bool)
    defined[kept] = faces.z != 0
    return own, z, defined[surface.triangle_face[shown]]


def _faces_around(surface: Surface, shown_corners: np.ndarray) -> np.ndarray:
    """All faces with a corner in the smooth fan of one of these corners."""
    shown_fan = np.zeros(len(surface.corner_vertex), dtype=bool)
    shown_fan[surface.corner_fan[shown_corners]] = True
    touches = np.zeros(surface.face_count, dtype=bool)
    touches[surface.corner_face[shown_fan[surface.corner_fan]]] = True
    return np.flatnonzero(touches)


def _faces_of(body: Body, place: _Place, kept: np.ndarray) -> tuple[_Faces, np.ndarray, np.ndarray]:
    """Some faces with their field, all their corners, and where each starts among those."""
    surface = body.surface
    corners, start = _corners_of(surface.face_start, kept)
    vertex = surface.corner_vertex[corners]
    rest = surface.vertices if surface.rest is None else surface.rest
    vectors, degree = body.field.vectors[kept], body.field.degree
    faces = _carried_faces(rest[vertex], place.vertices[vertex], start, vectors, degree)
    return faces, corners, start


def _onto(z: np.ndarray, source: np.ndarray, target: np.ndarray, degree: int) -> np.ndarray:
    """Values in the `tangent_frame` of one normal carried to that of another."""
    axis = carry(tangent_frame(source)[0], source, target)
    x, y = tangent_frame(target)
    return z * power(_phase(dot(axis, x) + 1j * dot(axis, y)), degree)


# --- pixels --------------------------------------------------------------------------------------


def _fill(
    buffer: GBuffer,
    pixels: slice | np.ndarray,
    shown: np.ndarray,
    values: _Triangles,
    degree: int,
) -> None:
    """Write normals and the representation at some pixels of one body.

    `shown` says for each which entry of `values` it sees.
    """
    weights = buffer.barycentric[pixels].T
    toward_eye = buffer.toward_eye[pixels].T
    front = values.front.take(shown)
    plane_normal = values.plane_normal.take(shown, axis=1)
    corners = [[component.take(shown) for component in corner] for corner in values.corner_normal]
    normal, size = _interpolated_normal(corners, weights)
    if not size.all():
        lost = size == 0
        normal[:, lost] = np.where(front, plane_normal, -plane_normal)[:, lost]
    z = _interpolated_values(values, shown, weights, size, degree)
    axis = carry_components(values.axis.take(shown, axis=1), corners[0], normal)
    if not front.all():
        # The members stay where they are in space; seen from behind, angles run the other way.
        np.conjugate(z, out=z, where=~front)
        np.negative(normal, out=normal, where=~front)
    z *= power(_turn_into_view(axis, normal, toward_eye), degree)
    buffer.normal[pixels] = normal.T
    buffer.plane_normal[pixels] = plane_normal.T
    buffer.front[pixels] = front
    buffer.representation[pixels] = z


def _interpolated_normal(
    corners: Sequence[Sequence[np.ndarray]], weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(3, P) unit n along m = sum b_i n_i, and (P,) the length of m; both 0 where lost."""
    normal = np.empty_like(weights)
    for component, out in enumerate(normal):
        np.multiply(weights[0], corners[0][component], out=out)
        out += weights[1] * corners[1][component]
        out += weights[2] * corners[2][component]
    size = np.sqrt(dot_components(normal, normal))
    size[size < 1e-6] = 0
    normal *= np.divide(np.float32(1), size, out=np.zeros_like(size), where=size > 0)
    return normal, size


def _interpolated_values(
    values: _Triangles, shown: np.ndarray, weights: np.ndarray, size: np.ndarray, degree: int
) -> np.ndarray:
    """(P,) z at the interpolated normal n, relative to `values.axis` carried from n_0 to n.

    Each corner's value is to come along the arc n_i -> n, so that pixels on an edge depend on its
    two ends alone and values are continuous from triangle to triangle. It has come along
    n_i -> n_0 -> n; the two ways differ by the rotation through the signed area A of the spherical
    triangle (n_0, n_i, n), and

        exp(i A / 2) ~ 1 + n_0.n_i + n_i.n + n.n_0 + i n_0 . (n_i x n)

    (Van Oosterom and Strackee 1983), in which all products follow from those of the corners, as
    n is a combination of them.
    """
    b0, b1, b2 = weights
    d01, d02, d12 = (products.take(shown) for products in values.dots)
    z0, z1, z2 = (corner.take(shown) for corner in values.z)
    volume = values.volume.take(shown)
    n0 = b0 + b1 * d01 + b2 * d02
    half1, half2 = np.empty_like(z0), np.empty_like(z0)
    half1.real = size * (1 + d01) + n0 + (b0 * d01 + b1 + b2 * d12)
    half1.imag = b2 * volume
    half2.real = size * (1 + d02) + n0 + (b0 * d02 + b1 * d12 + b2)
    half2.imag = -b1 * volume
    z1 *= power(_squared_phase(half1), degree)
    z2 *= power(_squared_phase(half2), degree)
    z0 *= b0
    z1 *= b1
    z2 *= b2
    z0 += z1
    z0 += z2
    return z0


def _squared_phase(half: np.ndarray) -> np.ndarray:
    """half^2 / |half|^2, and 0 for 0."""
    square = half.real * half.real
    square += half.imag * half.imag
    np.maximum(square, np.float32(1e-30), out=square)
    half = half * half
    half *= 1 / square
    return half


def _turn_into_view(
    axis: Sequence[np.ndarray], normal: np.ndarray, toward_eye: np.ndarray
) -> np.ndarray:
    """(P,) complex direction, in the view frame, of tangents rotated into the view plane."""
    x, y, z = carry_components(axis, normal, toward_eye)
    # In coordinates of `view_frame`: the minimal rotation back from `toward_eye` to (0, 0, 1).
    z /= 1 + toward_eye[2]
    turn = np.empty(len(z), dtype=np.complex64)
    turn.real = x - z * toward_eye[0]
    turn.imag = y - z * toward_eye[1]
    size = np.sqrt(turn.real * turn.real + turn.imag * turn.imag)
    turn *= np.divide(np.float32(1), size, out=np.zeros_like(size), where=size > 0)
    return turn

"""From bodies and a camera to the G-buffer: who is seen where, and the field there.

The field comes from the corners of triangles (`carried`) to the pixels, and from each pixel's
tangent plane into the view plane. Both is done on the representation z = rho exp(i N t), so that
nothing depends on which of the N members is stored.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import NothingInViewError, RosyError
from ..field.frames import carry_components, dot_components, transformed
from ..field.representation import signed_power
from ..memory import keep_freed_memory
from ..progress import Progress, Work, drain, part
from .camera import Camera, pixel_rays
from .carried import Carried, carrying, order_of
from .gbuffer import Body, GBuffer
from .raster import Fragments, rasterise
from .steps import links, screen_axes

__all__ = ["links", "project", "projecting", "screen_axes"]

#: Pixels that are worked on at once: bounds memory, and fits the caches.
BLOCK = 1 << 14

#: Radians by which directions may turn on the way over a triangle without being turned back.
FLAT = 3e-4

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
    check_bodies(bodies, camera, display)
    keep_freed_memory()
    yield Progress(0.0, "finding what is seen")
    seen = _seen(bodies, camera)
    yield Progress(0.3, "finding what is seen")
    buffer = _empty_buffer(bodies, camera, seen)
    count = len(buffer.pixel)
    done = 0
    for number in seen.numbers:
        pixels = slice(0, count) if seen.alone else np.flatnonzero(seen.body == number)
        own = seen.triangle[pixels]
        start, middle, stop = (
            0.4 + 0.6 * share / count for share in (done, done + 0.5 * len(own), done + len(own))
        )
        carried = yield from part(_carried(bodies[number], display), start, middle)
        carried = carried.turned(camera.view[:3, :3])
        _make_room(buffer, carried)
        for first in range(0, len(own), BLOCK):
            yield Progress(
                middle + (stop - middle) * first / len(own), "turning the field into the view"
            )
            block = slice(first, first + BLOCK)
            where = block if seen.alone else pixels[block]
            _fill(buffer, where, own[block], carried, bodies[number].field.degree)
        done += len(own)
    return buffer


def check_bodies(bodies: Sequence[Body], camera: Camera, display: str) -> None:
    """Refuse what cannot be drawn.

    Raises
    ------
    RosyError
        If no body has a field, a field does not fit its surface, or a matrix is not finite.
    """
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


def _carried(body: Body, display: str) -> Work[Carried]:
    """The field at the corners of a body's triangles, found once for all cameras."""
    if display not in body.carried:
        made = yield from carrying(body.surface, body.matrix, body.field, display)
        body.carried[display] = made
    return body.carried[display]


# --- visibility --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Seen:
    """RoSy pixels, and for each its body and the body's own triangle; the numbers of the bodies."""

    fragments: Fragments
    body: np.ndarray
    triangle: np.ndarray
    numbers: list[int]

    @property
    def alone(self) -> bool:
        """Whether all pixels are of one body."""
        return len(self.numbers) == 1


def _seen(bodies: Sequence[Body], camera: Camera) -> _Seen:
    """The pixels at which a body with a field is nearest.

    Raises
    ------
    NothingInViewError
        If there are none.
    """
    fragments, first = rasterised(bodies, camera)
    if len(bodies) == 1:
        if not len(fragments.pixel):
            raise_nothing_in_view(bodies, camera)
        return _Seen(fragments, np.zeros(len(fragments.pixel), np.int32), fragments.triangle, [0])
    with_field = np.array([body.field is not None for body in bodies])
    body = (np.searchsorted(first, fragments.triangle, side="right") - 1).astype(np.int32)
    rosy = with_field[body]
    if not rosy.any():
        raise_nothing_in_view(bodies, camera)
    if not rosy.all():
        kept = np.flatnonzero(rosy)
        fragments, body = Fragments(*(values[kept] for values in fragments)), body[kept]
    numbers = np.flatnonzero(np.bincount(body)).tolist()
    return _Seen(fragments, body, fragments.triangle - first[body], numbers)


def rasterised(bodies: Sequence[Body], camera: Camera) -> tuple[Fragments, np.ndarray]:
    """All bodies at once, and (B,) int32 the first triangle of each in the fragments' count."""
    clip = np.concatenate([_on_clip(body, camera) for body in bodies], axis=1)
    triangles, offset = [], 0
    for body in bodies:
        triangles.append(body.surface.triangle_vertex + np.int32(offset))
        offset += len(body.surface.vertices)
    first = np.cumsum([0, *map(len, triangles[:-1])]).astype(np.int32)
    return rasterise(clip.T, np.concatenate(triangles), camera.width, camera.height), first


def _on_clip(body: Body, camera: Camera) -> np.ndarray:
    """(4, V) vertices in clip space."""
    matrix = camera.projection @ camera.view @ np.asarray(body.matrix, dtype=np.float64)
    return transformed(np.ascontiguousarray(body.surface.vertices.T), matrix[:, :3], matrix[:, 3])


def raise_nothing_in_view(bodies: Sequence[Body], camera: Camera) -> None:
    """Say of bodies of which a camera sees no field why it does not.

    Raises
    ------
    NothingInViewError
    """
    shown = [body for body in bodies if body.field is not None]
    fragments, _ = rasterised(shown, camera)
    names = ", ".join(body.surface.name for body in shown)
    why = "hidden behind other objects" if len(fragments.pixel) else "outside the frame"
    raise NothingInViewError(
        f"no RoSy object is in view of camera '{camera.name}': {names} is {why}"
    )


def _empty_buffer(bodies: Sequence[Body], camera: Camera, seen: _Seen) -> GBuffer:
    """A G-buffer in which normals and the representation are yet to be filled in."""
    count = len(seen.body)
    fragments = seen.fragments
    face = np.empty(count, dtype=np.int32)
    for number in seen.numbers:
        pixels = slice(None) if seen.alone else np.flatnonzero(seen.body == number)
        face[pixels] = bodies[number].surface.triangle_face.take(seen.triangle[pixels])
    position, toward_eye = _vectors(count), _vectors(count)
    for start in range(0, count, BLOCK):
        part = slice(start, start + BLOCK)
        x, y = pixel_rays(camera, fragments.pixel[part])
        position[part, 2] = _z_at_depth(camera, x, y, fragments.depth[part])
        if camera.is_perspective:
            inverse = 1 / np.sqrt(x * x + y * y + 1)
            toward_eye[part, 0], toward_eye[part, 1] = -x * inverse, -y * inverse
            toward_eye[part, 2] = inverse
            x *= -position[part, 2]
            y *= -position[part, 2]
        position[part, 0], position[part, 1] = x, y
    if not camera.is_perspective:
        toward_eye[:] = (0.0, 0.0, 1.0)
    return GBuffer(
        camera=camera,
        names=tuple(body.surface.name for body in bodies),
        degrees=tuple(body.field.degree if body.field else 0 for body in bodies),
        pixel=fragments.pixel,
        body=seen.body,
        face=face,
        triangle=seen.triangle,
        barycentric=fragments.barycentric,
        position=position,
        normal=_vectors(count),
        toward_eye=toward_eye,
        representation=np.empty(count, dtype=np.complex64),
        plane_normal=_vectors(count),
        front=fragments.front,
        bodies=tuple(bodies),
    )


def _z_at_depth(camera: Camera, x: np.ndarray, y: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """z in camera space of points on `pixel_rays` at z / w in clip space."""
    along_x, along_y, along_z, base = camera.projection[2]
    if camera.is_perspective:
        # (-along_x x - along_y y + along_z) z + base = -z depth
        return -base / (depth + (along_z - along_x * x - along_y * y))
    return (depth - base - along_x * x - along_y * y) / along_z


def _vectors(count: int) -> np.ndarray:
    """(P, 3) float32, each component of all pixels in a row: what is done here is done by them."""
    return np.empty((3, count), dtype=np.float32).T


# --- pixels --------------------------------------------------------------------------------------


def _make_room(buffer: GBuffer, carried: Carried) -> None:
    """Room for the traits of a body; elsewhere they are those of a RoSy."""
    for trait in carried.traits:
        if trait not in buffer.traits:
            usual = 1 if trait == ("deviation", 0) else 0
            buffer.traits[trait] = np.full(len(buffer.pixel), usual, dtype=np.complex64)


def _fill(
    buffer: GBuffer,
    pixels: slice | np.ndarray,
    shown: np.ndarray,
    values: Carried,
    degree: int,
) -> None:
    """Write normals and the representation at some pixels of one body.

    `shown` says for each which triangle it sees.
    """
    shown = shown.astype(np.intp)
    weights = buffer.barycentric[pixels].T
    toward_eye = buffer.toward_eye[pixels].T
    front = buffer.front[pixels]
    plane_normal = values.plane_normal.take(shown, axis=1)
    corners = [[component.take(shown) for component in corner] for corner in values.normal]
    normal, size = _interpolated_normal(corners, weights)
    if not size.all():
        lost = size == 0
        normal[:, lost] = plane_normal[:, lost]
    more = [
        (buffer.traits[trait], z, order_of(trait, degree)) for trait, z in values.traits.items()
    ]
    axis = carry_components(values.axis.take(shown, axis=1), corners[0], normal)
    if not front.all():
        np.negative(normal, out=normal, where=~front)
        np.negative(plane_normal, out=plane_normal, where=~front)
    turn = _turn_into_view(axis, normal, toward_eye)
    for out, given, order in [(buffer.representation, values.z, degree), *more]:
        z = _interpolated_values(values, given, shown, weights, size, order)
        if not front.all():
            # The members stay where they are in space; seen from behind, angles run the other way.
            np.conjugate(z, out=z, where=~front)
        z *= signed_power(turn, order)
        out[pixels] = z
    buffer.normal[pixels] = normal.T
    buffer.plane_normal[pixels] = plane_normal.T


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
    size[size < 1e-6] = np.inf
    normal *= 1 / size
    size[np.isinf(size)] = 0
    return normal, size


def _interpolated_values(
    values: Carried,
    corners: np.ndarray,
    shown: np.ndarray,
    weights: np.ndarray,
    size: np.ndarray,
    order: int,
) -> np.ndarray:
    """(P,) z at the interpolated normal n, relative to `values.axis` carried from n_0 to n.

    Of the (3, T) values at corners, which turn with the frame to the power `order`.

    Each corner's value is to come along the arc n_i -> n, so that pixels on an edge depend on its
    two ends alone and values are continuous from triangle to triangle. It has come along
    n_i -> n_0 -> n; the two ways differ by the rotation through the signed area A of the spherical
    triangle (n_0, n_i, n), and

        exp(i A / 2) ~ 1 + n_0.n_i + n_i.n + n.n_0 + i n_0 . (n_i x n)

    (Van Oosterom and Strackee 1983), in which all products follow from those of the corners, as
    n is a combination of them. The triangle lies in that of the corners, whose area is about half
    of their triple product.
    """
    b0, b1, b2 = weights
    z0, z1, z2 = (corner.take(shown) for corner in corners)
    volume = values.volume.take(shown)
    if np.abs(volume).max(initial=0) < 2 * FLAT:
        return z0 * b0 + z1 * b1 + z2 * b2
    d01, d02, d12 = (products.take(shown) for products in values.dots)
    n0 = b0 + b1 * d01 + b2 * d02
    half1, half2 = np.empty_like(z0), np.empty_like(z0)
    half1.real = size * (1 + d01) + n0 + (b0 * d01 + b1 + b2 * d12)
    half1.imag = b2 * volume
    half2.real = size * (1 + d02) + n0 + (b0 * d02 + b1 * d12 + b2)
    half2.imag = -b1 * volume
    z1 *= signed_power(_squared_phase(half1), order)
    z2 *= signed_power(_squared_phase(half2), order)
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
    size[size == 0] = np.inf
    turn *= 1 / size
    return turn

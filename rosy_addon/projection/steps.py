"""What a streamline's step over the pixels of a G-buffer has to know.

`screen_axes` says where a tangent of the surface points on screen, `links` to which neighbouring
pixels the surface goes on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..field.frames import carry_components, dot, view_frame
from .gbuffer import GBuffer

#: Pixels that are worked on at once.
BLOCK = 1 << 14

#: Depth, in pixels for each pixel across, that a plane is taken to recede at most: 88 degrees.
STEEPEST = 30.0

#: How far, in pixels, a depth may be off what both tangent planes predict, where the surface faces
#: the eye, and how much farther for each pixel of depth that it recedes.
TOLERANCE, OBLIQUE_TOLERANCE = 0.5, 0.5


def screen_axes(buffer: GBuffer) -> np.ndarray:
    """How far tangents at the pixels reach on screen.

    Parameters
    ----------
    buffer : GBuffer

    Returns
    -------
    (P, 2) complex64 ndarray
        For each axis of the view frame, rotated from the view plane back to the surface: its
        displacement on screen, right + i up, in pixels, in units of what a vector parallel to the
        picture has at that depth. A member at angle t of the representation moves along
        ``axes @ (cos t, sin t)`` on screen.
    """
    camera = buffer.camera
    across = camera.projection[:2, :2] * [[camera.width], [camera.height]]
    across /= 2 * camera.pixels_per_unit
    across = across.astype(np.float32)
    axes = np.empty((2, len(buffer.pixel)), dtype=np.complex64)
    for start in range(0, len(buffer.pixel), BLOCK):
        part = slice(start, start + BLOCK)
        toward_eye, normal = buffer.toward_eye[part].T, buffer.normal[part].T
        ray = toward_eye[:2] / toward_eye[2] if camera.is_perspective else None
        frame = (axis.T for axis in view_frame(toward_eye.T))
        for axis, out in zip(frame, axes[:, part], strict=True):
            x, y, depth = carry_components(axis, toward_eye, normal)
            if ray is not None:
                # Along a ray, points at depth 1 stay where they are: what counts is the rest.
                x -= depth * ray[0]
                y -= depth * ray[1]
            out.real = x * across[0, 0] + y * across[0, 1]
            out.imag = x * across[1, 0] + y * across[1, 1]
    return axes.T


def links(buffer: GBuffer, crease_angle: float, cross_creases: bool) -> np.ndarray:
    """To which of its neighbours a streamline may step from each pixel.

    Parameters
    ----------
    buffer : GBuffer
    crease_angle : float
        Radians; normals of neighbouring pixels that differ by more are a sharp crease.
    cross_creases : bool
        Whether streamlines run on across creases.

    Returns
    -------
    (P,) uint16 ndarray
        Bit ``(dy + 1) * 3 + (dx + 1)`` is set if the surface goes on to the neighbour at (dx, dy):
        it shows the same body, with no silhouette and no forbidden crease between. Bit 4, the
        pixel itself, is always set, and the relation is symmetric.

    Notes
    -----
    Along the line from a pixel to its neighbour the surface is a curve over the screen, and the
    tangent planes at its ends are two lines. Where the curve is convex or concave the lines cross
    between the ends, however steep it is: the difference in depth lies between the two that the
    lines predict. Before a silhouette it lies outside, beyond a tolerance that covers inflections
    and uneven meshes and that parallel sheets a pixel apart exceed. Depth is measured in a quantity
    of which planes are linear functions on screen: z, under perspective 1 / z.
    """
    slopes = _slopes(buffer)
    aligned = None if cross_creases else np.float32(np.cos(crease_angle))
    camera = buffer.camera
    width = np.int32(camera.width)
    row, column = np.divmod(buffer.pixel, width)
    lowest = int(row[0]) if len(row) else 0
    rows = int(row[-1]) - lowest + 1 if len(row) else 0
    # One row and one pixel more than there are, for neighbours beyond the last.
    index = np.full((rows + 1) * camera.width + 1, -1, dtype=np.int32)
    index[buffer.pixel - lowest * width] = np.arange(len(row), dtype=np.int32)
    bits = np.full(len(row), 1 << 4, dtype=np.uint16)
    for start in range(0, len(row), BLOCK):
        part = slice(start, min(start + BLOCK, len(row)))
        origin = buffer.pixel[part] - lowest * width
        here = np.arange(part.start, part.stop, dtype=np.int32)
        for dx, dy in ((1, 0), (-1, 1), (0, 1), (1, 1)):
            there = index.take(origin + (dy * width + np.int32(dx)))
            if dx:
                there[column[part] == (width - 1 if dx > 0 else 0)] = -1
            nothing = there < 0
            np.copyto(there, here, where=nothing)
            joined = _goes_on(buffer, slopes, part, there, (dx, dy), aligned)
            joined[nothing] = False
            bit = (dy + 1) * 3 + (dx + 1)
            bits[part] |= joined.astype(np.uint16) << np.uint16(bit)
            bits[there[joined]] |= np.uint16(1 << (8 - bit))
    return bits


class _Slopes(NamedTuple):
    """Depth on screen, as a quantity of which planes are linear functions there.

    Attributes
    ----------
    depth : (P,) float32 ndarray
        Orthographic: z. Perspective: one by the depth.
    along, upward : (P,) float32 ndarray
        By how much it grows to the next column and row on the tangent plane.
    scale : (P,) float32 ndarray
        Makes pixels of depth of it, at this pixel.
    steep : (P,) float32 ndarray
        Pixels of depth for a pixel across, in the steepest direction.
    """

    depth: np.ndarray
    along: np.ndarray
    upward: np.ndarray
    scale: np.ndarray
    steep: np.ndarray


def _slopes(buffer: GBuffer) -> _Slopes:
    camera, normal, z = buffer.camera, buffer.plane_normal, buffer.position[:, 2]
    inverse = np.linalg.inv(camera.projection[:2, :2])
    inverse = (inverse * (2.0 / camera.width, 2.0 / camera.height)).astype(np.float32)
    along = normal[:, 0] * inverse[0, 0] + normal[:, 1] * inverse[1, 0]
    upward = normal[:, 0] * inverse[0, 1] + normal[:, 1] * inverse[1, 1]
    if camera.is_perspective:
        # Points r d at depth d along a ray r lie on n.x = c where 1 / d = n.r / c.
        divisor, depth = dot(normal, buffer.position), -1 / z
        scale = -z * np.float32(camera.pixels_per_unit)
    else:
        divisor, depth = -normal[:, 2], z
        scale = np.full(len(z), camera.pixels_per_unit, dtype=np.float32)
    least = np.float32(1e-12)
    divisor = np.where(np.abs(divisor) < least, -least, divisor)
    along, upward = along / divisor, upward / divisor
    steep = scale * np.hypot(along, upward)
    limit = np.minimum(1, np.float32(STEEPEST) / np.maximum(steep, least))
    return _Slopes(depth, along * limit, upward * limit, scale, steep * limit)


def _goes_on(
    buffer: GBuffer,
    slopes: _Slopes,
    here: slice,
    there: np.ndarray,
    step: tuple[int, int],
    aligned: np.float32 | None,
) -> np.ndarray:
    """(K,) bool: whether the surface goes on from pixels to neighbours, `step` away."""
    dx, dy = (np.float32(part) for part in step)
    scale = np.maximum(slopes.scale[here], slopes.scale.take(there))
    jump = slopes.depth.take(there) - slopes.depth[here]
    from_here = jump - _along(slopes.along[here], slopes.upward[here], dx, dy)
    from_there = jump - _along(slopes.along.take(there), slopes.upward.take(there), dx, dy)
    from_here *= scale
    from_there *= scale
    off = np.minimum(np.abs(from_here), np.abs(from_there))
    from_here *= from_there
    off *= from_here > 0
    if not buffer.front.all():
        # No smooth surface shows its other side without a silhouette; an unevenly oriented one may.
        turned_over = buffer.front[here] != buffer.front.take(there)
        jump *= scale
        straight = scale * _along(slopes.along[here], slopes.upward[here], dx, dy)
        most = np.maximum(np.abs(jump - straight), np.abs(from_there))
        np.copyto(off, most, where=turned_over)
    allowed = np.minimum(slopes.steep[here], slopes.steep.take(there))
    allowed *= np.float32(OBLIQUE_TOLERANCE)
    allowed += np.float32(TOLERANCE)
    allowed *= np.float32(np.hypot(dx, dy))
    joined = off <= allowed
    if len(buffer.names) > 1:
        joined &= buffer.body[here] == buffer.body.take(there)
    if aligned is not None:
        normal = buffer.normal.T
        facing = normal[0, here] * normal[0].take(there)
        facing += normal[1, here] * normal[1].take(there)
        facing += normal[2, here] * normal[2].take(there)
        joined &= facing >= aligned
    return joined


def _along(along: np.ndarray, upward: np.ndarray, dx: np.float32, dy: np.float32) -> np.ndarray:
    """By how much depth changes over a step on the tangent plane."""
    if not dx:
        return upward
    change = along if dx > 0 else -along
    return change + upward if dy else change

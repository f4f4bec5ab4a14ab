"""What a streamline's step over the pixels of a G-buffer has to know.

`screen_axes` says where a tangent of the surface points on screen, `links` to which neighbouring
pixels the surface goes on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..field.frames import carry, dot, view_frame
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
    axes = np.empty((len(buffer.pixel), 2), dtype=np.complex64)
    for start in range(0, len(axes), BLOCK):
        part = slice(start, start + BLOCK)
        toward_eye = buffer.toward_eye[part]
        for number, axis in enumerate(view_frame(toward_eye)):
            tangent = carry(axis, toward_eye, buffer.normal[part])
            flat = tangent[:, :2]
            if camera.is_perspective:
                # Along a ray, points at depth 1 stay where they are: what counts is the rest.
                ray = toward_eye[:, :2] / toward_eye[:, 2:]
                flat = flat - tangent[:, 2:] * ray
            screen = flat @ across.T
            axes[part, number] = screen[:, 0] + 1j * screen[:, 1]
    return axes


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
    aligned = -2.0 if cross_creases else float(np.cos(crease_angle))
    camera = buffer.camera
    row, column = np.divmod(buffer.pixel, np.int32(camera.width))
    lowest = int(row[0]) if len(row) else 0
    rows = int(row[-1]) - lowest + 1 if len(row) else 0
    # One row and one pixel more than there are, for neighbours beyond the last.
    index = np.full((rows + 1) * camera.width + 1, -1, dtype=np.int32)
    index[buffer.pixel - np.int32(lowest * camera.width)] = np.arange(len(row), dtype=np.int32)
    bits = np.full(len(row), 1 << 4, dtype=np.uint16)
    for start in range(0, len(row), BLOCK):
        part = slice(start, min(start + BLOCK, len(row)))
        origin = buffer.pixel[part] - np.int32(lowest * camera.width)
        for dx, dy in ((1, 0), (-1, 1), (0, 1), (1, 1)):
            there = index[origin + np.int32(dy * camera.width + dx)]
            there[column[part] == (camera.width - 1 if dx > 0 else 0 if dx < 0 else -1)] = -1
            here = np.flatnonzero(there >= 0).astype(np.int32)
            there, here = there[here], here + np.int32(start)
            joined = _goes_on(buffer, slopes, here, there, (dx, dy), aligned)
            here, there = here[joined], there[joined]
            bit = (dy + 1) * 3 + (dx + 1)
            bits[here] |= np.uint16(1 << bit)
            bits[there] |= np.uint16(1 << (8 - bit))
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
    here: np.ndarray,
    there: np.ndarray,
    step: tuple[int, int],
    aligned: float,
) -> np.ndarray:
    """(K,) bool: whether the surface goes on from pixels to neighbours, `step` away."""
    dx, dy = step
    scale = np.maximum(slopes.scale[here], slopes.scale[there])
    jump = scale * (slopes.depth[there] - slopes.depth[here])
    from_here = jump - scale * (dx * slopes.along[here] + dy * slopes.upward[here])
    from_there = jump - scale * (dx * slopes.along[there] + dy * slopes.upward[there])
    least = np.minimum(np.abs(from_here), np.abs(from_there))
    off = np.where(from_here * from_there > 0, least, 0)
    turned_over = buffer.front[here] != buffer.front[there]
    if turned_over.any():
        # No smooth surface shows its other side without a silhouette; an unevenly oriented one may.
        most = np.maximum(np.abs(from_here), np.abs(from_there))
        off = np.where(turned_over, most, off)
    recedes = np.minimum(slopes.steep[here], slopes.steep[there])
    joined = off <= np.hypot(dx, dy) * (TOLERANCE + OBLIQUE_TOLERANCE * recedes)
    joined &= buffer.body[here] == buffer.body[there]
    joined &= dot(buffer.normal[here], buffer.normal[there]) >= aligned
    return joined

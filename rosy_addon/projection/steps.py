"""What a streamline's step over the pixels of a G-buffer has to know.

`screen_axes` says where a tangent of the surface points on screen, `links` to which neighbouring
pixels the surface goes on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..field.frames import carry_components, dot_components, view_frame
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
    width = np.int32(buffer.camera.width)
    row, column = np.divmod(buffer.pixel, width)
    bits = np.full(len(row), 1 << 4, dtype=np.uint16)
    if not len(row):
        return bits
    left = column.min()
    column -= left - 1
    # With a column of nothing on either side.
    width = int(column.max()) + 2
    aligned = None if cross_creases else np.float32(np.cos(crease_angle))
    rows = max(BLOCK // width, 1)
    for low in range(int(row[0]), int(row[-1]) + 1, rows):
        # And with the first row after these, or one of nothing.
        first, after = np.searchsorted(row, np.array([low, low + rows + 1], row.dtype)).tolist()
        cell = (row[first:after] - low) * width + column[first:after]
        window = _window(buffer, slice(first, after), cell, (rows + 1, width))
        joined = np.zeros((rows + 1, width), dtype=np.uint16)
        for dx, dy in ((1, 0), (-1, 1), (0, 1), (1, 1)):
            here, there = _shifted(rows + 1, width, dx, dy)
            goes_on = _goes_on(window, here, there, (dx, dy), aligned).astype(np.uint16)
            bit = (dy + 1) * 3 + (dx + 1)
            joined[here] |= goes_on << np.uint16(bit)
            joined[there] |= goes_on << np.uint16(8 - bit)
        # The last row's own links to the right are found again with the next rows.
        bits[first:after] |= joined.reshape(-1).take(cell)
    return bits


def nearness(buffer: GBuffer) -> tuple[np.ndarray, np.ndarray]:
    """How near what the pixels show is, in what `links` measures depth in, and its tolerance.

    Parameters
    ----------
    buffer : GBuffer

    Returns
    -------
    near, tolerance : (P,) float32 ndarray
        The nearer the larger; by how much it may be off a pixel away.
    """
    near, tolerance = np.empty((2, len(buffer.pixel)), dtype=np.float32)
    for start in range(0, len(buffer.pixel), BLOCK):
        part = slice(start, start + BLOCK)
        near[part], _, _, tolerance[part] = _slopes(buffer, part)
    return near, tolerance


class _Window(NamedTuple):
    """Some rows of the frame, as far as a G-buffer covers it.

    Attributes
    ----------
    depth : (h, w) float32 ndarray
        A quantity of which planes are linear functions on screen. Orthographic: z. Perspective: one
        by the depth. NaN where nothing is seen.
    along, upward : (h, w) float32 ndarray
        By how much it grows to the next column and row on the tangent plane.
    tolerance : (h, w) float32 ndarray
        How far it may be off what is predicted a pixel away.
    normal : 3 (h, w) float32 ndarrays
    body : (h, w) int32 ndarray or None
        None if there is but one.
    front : (h, w) bool ndarray or None
        None if all are seen from there.
    """

    depth: np.ndarray
    along: np.ndarray
    upward: np.ndarray
    tolerance: np.ndarray
    normal: tuple[np.ndarray, ...]
    body: np.ndarray | None
    front: np.ndarray | None


def _window(buffer: GBuffer, pixels: slice, cell: np.ndarray, shape: tuple[int, int]) -> _Window:
    def spread(values: np.ndarray, nothing: float = 0) -> np.ndarray:
        window = np.full(shape, nothing, dtype=values.dtype)
        window.reshape(-1)[cell] = values
        return window

    depth, along, upward, tolerance = _slopes(buffer, pixels)
    return _Window(
        depth=spread(depth, np.nan),
        along=spread(along),
        upward=spread(upward),
        tolerance=spread(tolerance),
        normal=tuple(spread(component) for component in buffer.normal[pixels].T),
        body=spread(buffer.body[pixels]) if len(buffer.names) > 1 else None,
        front=None if buffer.front.all() else spread(buffer.front[pixels]),
    )


def _slopes(
    buffer: GBuffer, pixels: slice
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """`_Window.depth`, `along`, `upward` and `tolerance` of some pixels."""
    camera, normal, z = buffer.camera, buffer.plane_normal[pixels].T, buffer.position[pixels, 2]
    inverse = (camera.across_axis * (2.0 / camera.width, 2.0 / camera.height)).astype(np.float32)
    along = normal[0] * inverse[0, 0] + normal[1] * inverse[1, 0]
    upward = normal[0] * inverse[0, 1] + normal[1] * inverse[1, 1]
    per_unit = np.float32(camera.pixels_per_unit)
    if camera.is_perspective:
        # Points r d at depth d along a ray r lie on n.x = c where 1 / d = n.r / c.
        divisor, depth = dot_components(normal, buffer.position[pixels].T), -1 / z
        scale = -z * per_unit
    else:
        divisor, depth, scale = -normal[2], z, per_unit
    least = np.float32(1e-12)
    divisor[np.abs(divisor) < least] = -least
    np.divide(1, divisor, out=divisor)
    along *= divisor
    upward *= divisor
    steep = np.sqrt(along * along + upward * upward)
    steep *= scale
    limit = np.minimum(1, np.float32(STEEPEST) / np.maximum(steep, least))
    along *= limit
    upward *= limit
    steep *= limit
    steep *= np.float32(OBLIQUE_TOLERANCE)
    steep += np.float32(TOLERANCE)
    steep /= scale
    return depth, along, upward, steep


def _shifted(
    height: int, width: int, dx: int, dy: int
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The parts of a window that a neighbour lies in, and the neighbours."""
    columns = slice(max(-dx, 0), width - max(dx, 0)), slice(max(dx, 0), width - max(-dx, 0))
    return (slice(0, height - dy), columns[0]), (slice(dy, height), columns[1])


def _goes_on(
    window: _Window,
    here: tuple[slice, slice],
    there: tuple[slice, slice],
    step: tuple[int, int],
    aligned: np.float32 | None,
) -> np.ndarray:
    """Whether the surface goes on from cells to neighbours, `step` away."""
    jump = window.depth[there] - window.depth[here]
    from_here = _along(window.along[here], window.upward[here], *step)
    from_there = _along(window.along[there], window.upward[there], *step)
    allowed = np.minimum(window.tolerance[here], window.tolerance[there])
    if all(step):
        allowed *= np.float32(np.sqrt(2))
    with np.errstate(invalid="ignore"):
        joined = jump <= np.maximum(from_here, from_there) + allowed
        joined &= jump >= np.minimum(from_here, from_there) - allowed
        if window.front is not None:
            # No smooth surface shows its other side without a silhouette; an unevenly oriented one
            # may, where both planes predict the jump.
            straight = np.abs(jump - from_here) <= allowed
            straight &= np.abs(jump - from_there) <= allowed
            straight |= window.front[here] == window.front[there]
            joined &= straight
    if window.body is not None:
        joined &= window.body[here] == window.body[there]
    if aligned is not None:
        facing = window.normal[0][here] * window.normal[0][there]
        facing += window.normal[1][here] * window.normal[1][there]
        facing += window.normal[2][here] * window.normal[2][there]
        joined &= facing >= aligned
    return joined


def _along(along: np.ndarray, upward: np.ndarray, dx: int, dy: int) -> np.ndarray:
    """By how much depth changes over a step on the tangent plane."""
    if not dx:
        return upward
    if not dy:
        return along
    return upward + along if dx > 0 else upward - along

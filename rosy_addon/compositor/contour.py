"""Lines along silhouettes, borders and sharp creases, drawn on the side that is nearer to the eye.

They begin where the surface that a pixel shows does not go on to the next one (`steps.links`), and are
as wide as they are to be on that surface: what is seen beyond belongs to something else.
"""

from __future__ import annotations

import numpy as np

from ..projection.gbuffer import GBuffer
from ..projection.steps import links, nearness
from .look import Look

#: By how many tolerances of depth for each pixel something lies in front of something else.
IN_FRONT = 2.0

#: The four neighbours, and their bits among those of `links`.
BESIDE = ((1, 0, 5), (-1, 0, 3), (0, 1, 7), (0, -1, 1))


def contour(gbuffer: GBuffer, look: Look) -> np.ndarray:
    """How much of each pixel such lines cover.

    Parameters
    ----------
    gbuffer : GBuffer
    look : Look
        With its lengths in the pixels of the frame; its `outline` and its settings of creases count.

    Returns
    -------
    (P,) float32 ndarray
    """
    width, height = gbuffer.camera.width, gbuffer.camera.height
    reach = int(np.ceil(look.outline))
    # With as much of nothing around as lines are wide.
    across = width + 2 * reach + 2
    shown = np.full((height + 2 * reach + 2) * across, -1, dtype=np.int32)
    row, column = np.divmod(gbuffer.pixel, np.int32(width))
    place = (row + reach + 1) * np.int32(across) + column + np.int32(reach + 1)
    shown[place] = np.arange(len(place), dtype=np.int32)
    near, tolerance = nearness(gbuffer)
    edge, broad = _edges(gbuffer, look, shown, place, across, near, tolerance)
    behind = np.float32(IN_FRONT) * tolerance[edge]
    covered = np.zeros(len(place), dtype=np.float32)
    for away, dx, dy in _disc(reach):
        there = shown.take(place[edge] + (dy * across + dx))
        alike = (there >= 0) & (gbuffer.body.take(there) == gbuffer.body[edge])
        alike &= near.take(there) >= near[edge] - behind * np.float32(max(away, 1.0))
        drawn = np.clip(broad[alike] - np.float32(away), 0, 1)
        there = there[alike]
        covered[there] = np.maximum(covered[there], drawn)
    return covered


def _edges(
    gbuffer: GBuffer,
    look: Look,
    shown: np.ndarray,
    place: np.ndarray,
    across: int,
    near: np.ndarray,
    tolerance: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) pixels beside which their surface ends and nothing nearer begins, and (n,) widths there.

    Of creases, which have two sides, each has a half. Where the frame ends nothing is known; where
    only the field ends, the surface goes on.
    """
    joined = links(gbuffer, look.crease_angle, look.cross_creases)
    row, column = np.divmod(gbuffer.pixel, np.int32(gbuffer.camera.width))
    defined = gbuffer.representation != 0
    broad = np.zeros(len(place), dtype=np.float32)
    for dx, dy, bit in BESIDE:
        inside = (column + dx >= 0) & (column + dx < gbuffer.camera.width)
        inside &= (row + dy >= 0) & (row + dy < gbuffer.camera.height)
        apart = np.flatnonzero(inside & defined & (joined >> np.uint16(bit) & 1 == 0))
        there = shown.take(place[apart] + (dy * across + dx))
        jump = (near.take(there) - near[apart]) / (np.float32(IN_FRONT) * tolerance[apart])
        level = (np.abs(jump) <= 1) & (there >= 0)
        width = np.where(level, np.float32(look.outline / 2), np.float32(look.outline))
        width[(jump > 1) & (there >= 0)] = 0
        own = gbuffer.body.take(there) == gbuffer.body[apart]
        width[own & ~defined.take(there) & (there >= 0)] = 0
        broad[apart] = np.maximum(broad[apart], width)
    edge = np.flatnonzero(broad)
    return edge, broad[edge]


def _disc(reach: int) -> list[tuple[float, int, int]]:
    """Distances and offsets of the pixels around one."""
    steps = range(-reach, reach + 1)
    found = [(float(np.hypot(dx, dy)), dx, dy) for dy in steps for dx in steps]
    return [entry for entry in found if entry[0] <= reach]

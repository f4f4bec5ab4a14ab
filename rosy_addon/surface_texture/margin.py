"""The margin around the charts of a texture, so that its filters find the colors of the surface there.

The texels next to a chart show the surface beyond the seam, so that interpolation across it shows none.
Those farther away repeat the nearest one, and are seen only in smaller versions of the texture.
"""

from __future__ import annotations

import numpy as np

from ..compositor.covering import ALL_NEIGHBORS
from ..compositor.pixel_field import NEIGHBOR_OFFSETS, PixelField, SeamSteps
from ..core.progress import report
from .texels import TextureFrame

#: Label of the progress.
LABEL = "filling the margin"


def fill_margin(
    frame: TextureFrame,
    field: PixelField,
    color: np.ndarray,
    margin: int,
    *,
    crosses_seams: bool = True,
) -> np.ndarray:
    """Draw the texels of charts and their margin into the frame.

    Parameters
    ----------
    frame : TextureFrame
    field : PixelField
        At the P texels of the charts.
    color : (P, K) float32 ndarray
    margin : int
        Width of the margin, in texels.
    crosses_seams : bool
        Whether the colors mean the same in all charts, so that those beyond a seam continue a chart.

    Returns
    -------
    (H, W, K) float32 ndarray
        The mean of the colors where there is neither chart nor margin.
    """
    report(0.0, LABEL)
    height, width, channels = frame.height, frame.width, color.shape[1]
    image = np.empty((height, width, channels), dtype=np.float32)
    image[...] = color.mean(axis=0, dtype=np.float64)
    flat = image.reshape(-1, channels)
    flat[field.pixel] = color
    filled = np.zeros(height * width, dtype=bool)
    filled[field.pixel] = True
    if not margin:
        return image
    ring = field.pixel[field.neighbor_mask != ALL_NEIGHBORS]
    if crosses_seams:
        outer, values = _beyond_seams(frame, field, color, filled)
        flat[outer] = values
        filled[outer] = True
        ring = np.union1d(ring, outer)
    for number in range(margin):
        report((number + 1) / (margin + 1), LABEL)
        ring = _dilate(frame, flat, filled, ring)
    return image


def _beyond_seams(
    frame: TextureFrame, field: PixelField, color: np.ndarray, filled: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the empty texels beside the charts, and the colors of the surface that continues there.

    Returns
    -------
    outer : (n,) intp ndarray
        Flat indices into the frame.
    values : (n, K) float32 ndarray
    """
    steps: SeamSteps = field.seam_steps
    kept = np.flatnonzero(np.isin(steps.bit, (1, 3, 5, 7)))
    dx, dy = np.array(NEIGHBOR_OFFSETS)[steps.bit[kept]].T
    outer = _neighbors(frame, field.pixel.take(steps.source[kept]), dx, dy)
    empty = (outer >= 0) & ~filled.take(outer)
    kept, outer = kept[empty], outer[empty]
    values = _interpolated(field, color, steps.target[kept], steps.offset[kept])
    outer, place, count = np.unique(outer, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(place, channel) for channel in values.T], axis=1)
    return outer, (mean / count[:, None]).astype(np.float32)


def _interpolated(
    field: PixelField, color: np.ndarray, texel: np.ndarray, offset: np.ndarray
) -> np.ndarray:
    """(n, K) colors at offsets from the centers of texels, interpolated between linked neighbors."""
    column, row = np.sign(offset.real).astype(np.intp), np.sign(offset.imag).astype(np.intp)
    x, y = np.minimum(np.abs(offset.real), 1), np.minimum(np.abs(offset.imag), 1)
    mask = field.neighbor_mask.take(texel)
    total = np.zeros((len(texel), color.shape[1]), dtype=np.float32)
    weights = np.zeros(len(texel), dtype=np.float32)
    neighbor = field.pixel.take(texel) + row * field.width
    # A linked neighbor in the same row is the texel before or after.
    for dx, dy, place, weight in (
        (0 * column, 0 * row, texel, (1 - x) * (1 - y)),
        (column, 0 * row, texel + column, x * (1 - y)),
        (0 * column, row, np.searchsorted(field.pixel, neighbor), (1 - x) * y),
        (column, row, np.searchsorted(field.pixel, neighbor + column), x * y),
    ):
        linked = mask >> (dx + 3 * dy + 4).astype(np.uint16) & 1
        weight = (weight + 1e-6) * linked
        total += weight[:, None] * color.take(place, axis=0, mode="clip")
        weights += weight
    return total / weights[:, None]


def _dilate(
    frame: TextureFrame, flat: np.ndarray, filled: np.ndarray, ring: np.ndarray
) -> np.ndarray:
    """Fill the empty texels beside a ring of filled ones with the mean of those, in place.

    Parameters
    ----------
    frame : TextureFrame
    flat : (H W, K) float32 ndarray
    filled : (H W,) bool ndarray
    ring : (n,) ndarray of int
        Flat indices into the frame.

    Returns
    -------
    (m,) intp ndarray
        The texels that were filled.
    """
    found = []
    for offset in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        index = _neighbors(frame, ring, *offset)
        index = index[index >= 0]
        index = index[~filled[index]]
        filled[index] = True
        # No index occurs twice: each texel of the ring has another neighbor there.
        found.append(index)
    beside = np.concatenate(found)
    filled[beside] = False
    total = np.zeros((len(beside), flat.shape[1]), dtype=np.float32)
    count = np.zeros(len(beside), dtype=np.float32)
    for offset in NEIGHBOR_OFFSETS:
        neighbor = _neighbors(frame, beside, *offset)
        weight = (filled.take(neighbor) & (neighbor >= 0)).astype(np.float32)
        total += weight[:, None] * flat.take(neighbor, axis=0)
        count += weight
    flat[beside] = total / count[:, None]
    filled[beside] = True
    return beside


def _neighbors(frame: TextureFrame, index: np.ndarray, dx: int, dy: int) -> np.ndarray:
    """Return the (n,) intp flat indices of neighbors; -1 outside of the tile."""
    row, column = np.divmod(index.astype(np.intp), frame.width)
    column += dx
    row %= frame.size
    row += dy
    inside = (column >= 0) & (column < frame.width) & (row >= 0) & (row < frame.size)
    return np.where(inside, index + dy * frame.width + dx, -1)

"""The margin around the charts of a texture, so that its filters find the colors of the surface there.

The texels next to a chart show the surface beyond the seam, so that interpolation across it shows none.
Those farther away repeat the nearest one, and are seen only in smaller versions of the texture.
"""

from __future__ import annotations

import numpy as np

from ..compositor.pixel_field import NEIGHBOR_OFFSETS, PixelField, SeamSteps
from ..progress import Progress, Task
from .texels import TextureFrame

#: Label of all steps.
STEP_LABEL = "filling the margin"


def margin_task(
    frame: TextureFrame, field: PixelField, color: np.ndarray, margin: int
) -> Task[np.ndarray]:
    """Draw the texels of charts and their margin into the frame.

    Parameters
    ----------
    frame : TextureFrame
    field : PixelField
        At the P texels of the charts.
    color : (P, K) float32 ndarray
    margin : int
        Width of the margin, in texels.

    Returns
    -------
    (H, W, K) float32 ndarray
        The mean of the colors where there is neither chart nor margin.
    """
    yield Progress(0.0, STEP_LABEL)
    height, width, channels = frame.height, frame.width, color.shape[1]
    image = np.empty((height, width, channels), dtype=np.float32)
    image[...] = color.mean(axis=0, dtype=np.float64)
    flat = image.reshape(-1, channels)
    flat[field.pixel] = color
    filled = np.zeros(height * width, dtype=bool)
    filled[field.pixel] = True
    outer, values = _beyond_seams(frame, field, color, filled)
    if margin:
        flat[outer] = values
        filled[outer] = True
    tiles = len(frame.tiles) if frame.is_udim else 1
    tile_rows = height // tiles
    for ring in range(margin):
        yield Progress((ring + 1) / (margin + 1), STEP_LABEL)
        for tile in range(tiles):
            rows = slice(tile * tile_rows, (tile + 1) * tile_rows)
            if not _dilate(image[rows], filled.reshape(height, width)[rows]):
                break
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
    offsets = np.array(NEIGHBOR_OFFSETS)[steps.bit]
    row, column = np.divmod(field.pixel.take(steps.source).astype(np.intp), frame.width)
    beside = (offsets == 0).any(axis=1)
    column, outer_row = column + offsets[:, 0], row + offsets[:, 1]
    beside &= (column >= 0) & (column < frame.width)
    # The rows of other tiles are not beside those of this one.
    beside &= (outer_row >= 0) & (outer_row < frame.height)
    beside &= outer_row // frame.size == row // frame.size
    kept = np.flatnonzero(beside)
    outer = outer_row[kept] * frame.width + column[kept]
    empty = ~filled.take(outer)
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
    for dx, dy, weight in (
        (0 * column, 0 * row, (1 - x) * (1 - y)),
        (column, 0 * row, x * (1 - y)),
        (0 * column, row, (1 - x) * y),
        (column, row, x * y),
    ):
        linked = mask >> (dx + 3 * dy + 4).astype(np.uint16) & 1
        weight = (weight + 1e-6) * linked
        neighbor = field.pixel.take(texel) + dy * field.width + dx
        place = np.minimum(np.searchsorted(field.pixel, neighbor), len(field.pixel) - 1)
        total += weight[:, None] * color.take(place, axis=0)
        weights += weight
    return total / weights[:, None]


def _dilate(image: np.ndarray, filled: np.ndarray) -> bool:
    """Fill the empty texels beside filled ones with their mean, in place; return if there were any."""
    height, width, channels = image.shape
    beside = np.zeros_like(filled)
    beside[1:] |= filled[:-1]
    beside[:-1] |= filled[1:]
    beside[:, 1:] |= filled[:, :-1]
    beside[:, :-1] |= filled[:, 1:]
    beside &= ~filled
    row, column = np.nonzero(beside)
    total = np.zeros((len(row), channels), dtype=np.float32)
    count = np.zeros(len(row), dtype=np.float32)
    for dx, dy in NEIGHBOR_OFFSETS:
        neighbor_row = np.clip(row + dy, 0, height - 1)
        neighbor_column = np.clip(column + dx, 0, width - 1)
        weight = filled[neighbor_row, neighbor_column].astype(np.float32)
        total += weight[:, None] * image[neighbor_row, neighbor_column]
        count += weight
    image[row, column] = total / count[:, None]
    filled[row, column] = True
    return bool(len(row))

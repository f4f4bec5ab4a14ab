"""Undirected texture: what hatching draws where the field has no direction.

A streak is a mean of noise along a line. Where there is no line, the mean over a disc takes its
place. It is thresholded like a streak, with statistics of its own, so the picture keeps its tone.
"""

from __future__ import annotations

import numpy as np

from ..projection.pixel_blocks import BLOCK_PIXELS
from .image_noise import NOISE_MEAN
from .pixel_field import PixelField, entries_of_rows
from .reported_blocks import reported_blocks

#: Radius of the disc in line widths: spots are then about as wide as lines.
DISC_WIDTHS = 1.0

#: Samples of the noise in a disc.
SAMPLE_COUNT = 32

#: Angle between two samples of a sunflower spiral, radians.
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))

#: Label of all steps.
STEP_LABEL = "drawing undirected texture"


def disc_offsets(line_width: float) -> np.ndarray:
    """Return the (SAMPLE_COUNT, 2) int32 pixel offsets (dx, dy) of the samples of a disc."""
    # A sunflower spiral is spread evenly over the unit disc.
    index = np.arange(SAMPLE_COUNT)
    radius, angle = np.sqrt((index + 0.5) / SAMPLE_COUNT), index * GOLDEN_ANGLE
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1).astype(np.float32)
    return np.floor(np.float32(DISC_WIDTHS * line_width) * disc + np.float32(0.5)).astype(np.int32)


def undirected_texture(
    field: PixelField, noise: np.ndarray, line_width: float
) -> np.ndarray | None:
    """Average the noise over a disc around each pixel where the field is undefined.

    Samples of the disc beyond the pixels of the field are left out.

    Parameters
    ----------
    field : PixelField
    noise : (P, K) float32 ndarray
    line_width : float
        Width of a cell of the noise in pixels.

    Returns
    -------
    (P,) float32 ndarray or None
        The means, relative to `NOISE_MEAN`; NaN where the field is defined. None if it is defined
        everywhere.
    """
    undefined = np.flatnonzero(field.representation == 0)
    if not len(undefined):
        return None
    offsets = disc_offsets(line_width)
    margin = int(np.abs(offsets).max())
    stride = field.width + 2 * margin
    texture = np.full(len(noise), np.nan, dtype=np.float32)
    # Rows are padded with the pixels that a disc can reach.
    band_rows = max(BLOCK_PIXELS // field.width, 2 * margin, 1)
    for first_row in range(0, field.height, band_rows):
        stop_row = first_row + band_rows
        band = undefined[
            entries_of_rows(field.pixel[undefined], field.width, (first_row, stop_row))
        ]
        if not len(band):
            continue
        around_rows = first_row - margin, stop_row + margin
        around = entries_of_rows(field.pixel, field.width, around_rows)
        # Sums of noise and of samples, as complex numbers.
        samples = np.zeros((band_rows + 2 * margin) * stride, dtype=np.complex64)
        first_cell = (first_row - margin) * stride - margin
        mean = noise[around].mean(axis=1) - np.float32(NOISE_MEAN)
        samples[_padded(field, field.pixel[around], stride) - first_cell] = mean + 1j
        share = first_row / field.height
        for block in reported_blocks(len(band), STEP_LABEL, share, share):
            cell = _padded(field, field.pixel[band[block]], stride) - first_cell
            total = np.zeros(len(cell), dtype=np.complex64)
            for dx, dy in offsets.tolist():
                total += samples.take(cell + (dy * stride + dx))
            # The disc around a lone pixel may have no samples.
            texture[band[block]] = total.real / np.maximum(total.imag, 1)
    return texture


def _padded(field: PixelField, pixel: np.ndarray, stride: int) -> np.ndarray:
    """Flat indices of pixels into a frame with longer rows."""
    row, column = np.divmod(pixel, np.int32(field.width))
    return row.astype(np.intp) * stride + column


def disc_means(noise: np.ndarray, line_width: float) -> np.ndarray:
    """Average an image of noise over a disc around each pixel.

    Parameters
    ----------
    noise : (H, W) ndarray
        Taken as periodic.
    line_width : float
        Width of a cell of the noise in pixels.

    Returns
    -------
    (H, W) float32 ndarray
    """
    total = np.zeros(noise.shape, dtype=np.float32)
    for dx, dy in disc_offsets(line_width).tolist():
        total += np.roll(noise, (-dy, -dx), axis=(0, 1))
    return total / np.float32(SAMPLE_COUNT)

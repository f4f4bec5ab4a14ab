"""Undirected texture: what hatching draws where the field has no direction.

A streak is a mean of noise along a streamline. Where the field is undefined, there is no streamline, and
a mean of noise over a disc is used instead. It is thresholded like a streak, with its own statistics, so
the picture keeps its tone.
"""

import numpy as np

from .image_noise import NOISE_MEAN
from .pixel_field import PixelField, pixel_window

#: Radius of the disc in line widths: spots are then about as wide as lines.
DISC_WIDTHS = 1.0

#: Samples of the noise in a disc.
SAMPLE_COUNT = 32

#: Angle between two samples of a sunflower spiral, radians.
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def disc_offsets(line_width: float) -> np.ndarray:
    """Return the (SAMPLE_COUNT, 2) int32 pixel offsets (dx, dy) of the samples of a disc.

    The radius is `DISC_WIDTHS` times `line_width`, which is in pixels.
    """
    # A sunflower spiral is spread evenly over the unit disc.
    index = np.arange(SAMPLE_COUNT)
    radius, angle = np.sqrt((index + 0.5) / SAMPLE_COUNT), index * GOLDEN_ANGLE
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1).astype(np.float32)
    return np.floor(np.float32(DISC_WIDTHS * line_width) * disc + np.float32(0.5)).astype(np.int32)


def undirected_texture(field: PixelField, noise: np.ndarray, line_width: float) -> np.ndarray:
    """Average the noise over a disc around each pixel where the field is undefined.

    Samples of the disc that are not at pixels of the field are left out.

    Parameters
    ----------
    field : PixelField
    noise : (P, K) float32 ndarray
        Noise at the pixels, with the mean `NOISE_MEAN`. The K channels are averaged.
    line_width : float
        Width of a cell of the noise in pixels.

    Returns
    -------
    (P,) float32 ndarray
        The means, relative to `NOISE_MEAN`; NaN where the field is defined.
    """
    undefined = np.flatnonzero(field.representation == 0)
    offsets = disc_offsets(line_width)
    cell, shape = pixel_window(field.pixel, field.width, int(np.abs(offsets).max()))
    # Sums of noise and of samples, as complex numbers.
    samples = np.zeros(shape, dtype=np.complex64).reshape(-1)
    samples[cell] = noise.mean(axis=1) - np.float32(NOISE_MEAN) + np.complex64(1j)
    texture = np.full(len(noise), np.nan, dtype=np.float32)
    center, total = cell[undefined], np.zeros(len(undefined), dtype=np.complex64)
    for dx, dy in offsets.tolist():
        total += samples.take(center + (dy * shape[1] + dx))
    # The disc around a lone pixel may have no samples.
    texture[undefined] = total.real / np.maximum(total.imag, 1)
    return texture


def disc_means(noise: np.ndarray, line_width: float) -> np.ndarray:
    """Average an image of noise over a disc around each pixel.

    Parameters
    ----------
    noise : (H, W) ndarray
        The image is taken as periodic.
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

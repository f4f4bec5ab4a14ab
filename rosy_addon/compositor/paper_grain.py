"""Paper grain: band-pass noise that breaks up the ink as the texture of rough paper does.

The grain is anchored like the streaks: to the picture, or to the surfaces. In an animation, grain
that stays in place while the surfaces move would look like a dirty window (the "shower door"
effect).
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ..core.progress import progress
from .image_noise import (
    BLOCK_ROWS,
    NOISE_MEAN,
    NoiseSettings,
    TileRectangle,
    box_radius,
    cached_tiles,
    gaussian_blur,
    hash_bits,
    tile_rectangle,
)
from .look_units import PixelLook

#: Standard deviation of the finest of the blurs whose differences are the frequency bands, in
#: line widths, and its minimum in pixels.
FINEST_SIGMA_WIDTHS, MIN_SIGMA_PIXELS = 0.16, 0.7

#: Combined with the seed of a look, so that the paper grain is independent of the streaks.
SEED_SALT = 0x5EED

#: Amplitudes of the frequency bands, one octave each, from fine to coarse.
BAND_WEIGHTS = (1.0, 0.6, 0.4)

#: Standard deviation of the paper grain that is added to the streaks if `Look.paper_grain` is 1, in
#: standard deviations of the streaks.
PAPER_GRAIN_STRENGTH = 1.2

#: Noise cells of the grain that is anchored to surfaces: size in line widths, minimum
#: size in pixels of the picture, and width of the high pass in cells.
SURFACE_CELL_WIDTHS, MIN_SURFACE_CELL_PIXELS, HIGH_PASS_CELLS = 0.4, 1.5, 6.0

#: Number of independent noise channels on surfaces. Lines use them in turn.
PAPER_GRAIN_CHANNELS = 3

#: Label of all steps.
STEP_LABEL = "drawing the paper grain"


def picture_paper_grain(
    pixel: np.ndarray,
    width: int,
    line_width: float,
    seed: int,
    subpixels: int = 1,
    line_count: int = 1,
) -> np.ndarray:
    """Make paper grain that is anchored to the picture.

    The grain of different lines must be independent. Otherwise the coverages of crossing lines
    would be correlated, and the tone would be too light. So each line uses the same noise at a
    different horizontal offset.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat pixel indices into a supersampled frame, ascending.
    width : int
        Width of that frame in pixels.
    line_width : float
        Width of the lines in pixels of the picture. The paper grain scales with it.
    seed : int
        Seed of the look.
    subpixels : int
        Subpixels along each side of a pixel. All subpixels of a pixel have the same height.
    line_count : int
        Number of lines (pairs of opposite directions of the field) at a pixel.

    Returns
    -------
    (line_count, P) float32 ndarray
        Heights with mean 0 and standard deviation 1. Ink adheres better where they are larger.
    """
    offset = line_offset(line_width)
    rectangle = tile_rectangle(pixel, width, subpixels, extra_columns=(line_count - 1) * offset)
    tiles = cached_tiles(_grain_tiles, rectangle, line_width, seed)
    row, column = np.divmod(pixel, np.int32(width))
    index = rectangle.index(row // subpixels, column // subpixels)
    return np.stack([tiles.take(index + line * offset) for line in range(line_count)])


def surface_paper_grain_settings(look: PixelLook) -> NoiseSettings:
    """Return the settings of the noise for paper grain that is anchored to surfaces.

    Lengths are in the unit of the look: pixels of the frame, or steps of streamlines on a texture. The noise
    has `PAPER_GRAIN_CHANNELS` channels. Their standard deviation is `StreakStatistics.paper_grain_std`.

    Parameters
    ----------
    look : PixelLook
    """
    cell = max(SURFACE_CELL_WIDTHS * look.line_width, MIN_SURFACE_CELL_PIXELS * look.supersampling)
    seed = look.seed ^ SEED_SALT
    return NoiseSettings(cell, seed, PAPER_GRAIN_CHANNELS, high_pass=HIGH_PASS_CELLS * cell)


def surface_paper_grain(noise: np.ndarray, std: float, line_count: int) -> np.ndarray:
    """Make paper grain from noise on surfaces.

    Parameters
    ----------
    noise : (P, K) float32 ndarray
        Noise with the mean `NOISE_MEAN`, made with `surface_paper_grain_settings`.
    std : float
        Standard deviation of the noise: `StreakStatistics.paper_grain_std`.
    line_count : int
        Number of lines (pairs of opposite directions of the field) at a pixel.

    Returns
    -------
    (line_count, P) float32 ndarray
        Heights with mean 0 and standard deviation 1.
    """
    channel = np.arange(line_count) % PAPER_GRAIN_CHANNELS
    return ((noise - np.float32(NOISE_MEAN)) / np.float32(std)).T.take(channel, axis=0)


def line_offset(line_width: float) -> int:
    """Return the offset in pixels between the grain of successive lines, at which it is uncorrelated."""
    return int(np.ceil(3 * _band_sigmas(line_width)[-1]))


def _band_sigmas(line_width: float) -> list[float]:
    """Return the standard deviations, ascending, of the blurs whose differences are the frequency bands.

    They are in pixels, like `line_width`.
    """
    finest_sigma = max(FINEST_SIGMA_WIDTHS * line_width, MIN_SIGMA_PIXELS)
    return [finest_sigma * 2**octave for octave in range(len(BAND_WEIGHTS) + 1)]


def _grain_tiles(rectangle: TileRectangle, line_width: float, seed: int) -> np.ndarray:
    """Return the flat float32 heights of the paper grain in a rectangle of the picture, row by row.

    The mean is 0, the standard deviation 1. `line_width` is in pixels.
    """
    sigmas = _band_sigmas(line_width)
    margin = 4 * box_radius(sigmas[-1])
    left, right, bottom, top = rectangle
    column = np.arange(left - margin, right + margin, dtype=np.int32)
    row = np.arange(bottom - margin, top + margin, dtype=np.int32)[:, None]
    white = np.empty((len(row), len(column)), dtype=np.float32)
    for start in range(0, len(row), BLOCK_ROWS):
        block = slice(start, start + BLOCK_ROWS)
        bits = hash_bits((column, row[block]), seed ^ SEED_SALT, 0, 0.5)
        white[block] = bits.astype(np.float32) - np.float32(0.5)
    heights = _band_noise(white, sigmas)[margin:-margin, margin:-margin]
    return np.ascontiguousarray(heights / np.float32(_band_noise_std(*sigmas))).reshape(-1)


def _band_noise(white: np.ndarray, sigmas: Sequence[float]) -> np.ndarray:
    """Return the weighted sum of the frequency bands of (H, W) white noise.

    A band is the difference of two successive blurs. `sigmas` are the standard deviations of the blurs in
    pixels, ascending.
    """
    total = np.zeros_like(white)
    finer = _blur(white, sigmas[0])
    for finer_sigma, broader_sigma, weight in zip(sigmas, sigmas[1:], BAND_WEIGHTS, strict=False):
        broader = _blur(white, broader_sigma)
        # The standard deviation of blurred white noise is proportional to 1 / sigma.
        total += np.float32(weight * finer_sigma / sigmas[0]) * (finer - broader)
        finer = broader
    return total


def _blur(image: np.ndarray, sigma: float) -> np.ndarray:
    """Approximate a Gaussian blur of `sigma` pixels, also if it is too small for `gaussian_blur`."""
    if sigma > 1.5:
        with progress(0.0, label=STEP_LABEL):
            return gaussian_blur(image, sigma)
    for axis in (0, 1) * max(round(2 * sigma**2), 1):
        # The kernel (1, 2, 1) / 4 has the variance 1 / 2.
        forward, backward = (np.roll(image, shift, axis=axis) for shift in (1, -1))
        image = np.float32(0.5) * image + np.float32(0.25) * (forward + backward)
    return image


@lru_cache(maxsize=16)
def _band_noise_std(*sigmas: float) -> float:
    """Return the standard deviation of the `_band_noise` of random values -1/2 and 1/2.

    It is computed from the impulse response. `sigmas` are the standard deviations of the blurs in pixels.
    """
    radius = 4 * box_radius(sigmas[-1])
    impulse = np.zeros((2 * radius + 1,) * 2, dtype=np.float32)
    impulse[radius, radius] = 1
    return float(np.linalg.norm(_band_noise(impulse, sigmas)) / 2)

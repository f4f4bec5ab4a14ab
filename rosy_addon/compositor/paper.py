"""The tooth of paper: heights that catch the ink of a soft tool.

They stay with the picture as the paper of a drawing does, or with the surfaces, where streaks do: one
sheet for many frames would seem to lie between the eye and what moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from .look import Look
from .noise import blur_reach, blurred, hash_bits, tiled

#: Deviation of the finest blur whose differences are the bands of the relief, in grains, and the
#: least, pixels: what is finer is not paper, but noise.
FINEST, SMOOTHEST = 0.16, 0.7

#: The tooth is not to know of the streaks.
OWN_SEED = 0x5EED

#: How much each band has to say, an octave each: fine tooth on broad unevenness.
SHARES = (1.0, 0.6, 0.4)

#: Of the threshold of ink, at `Look.paper_grain` 1, in deviations of the streaks.
TOOTH = 1.2

#: Size of the tooth that stays with surfaces, in grains of the streaks and at least in pixels, and
#: what is broader than so many of these is taken out.
ON_SURFACE, SMALLEST, BROADEST = 0.4, 1.5, 6.0

#: The lines of so many families catch on different spots of a surface.
TEETH = 3

#: So many pixels of paper are kept for the next picture.
_KEPT = 1 << 22


def paper_tooth(
    pixel: np.ndarray, width: int, grain: float, seed: int, side: int = 1, lines: int = 1
) -> np.ndarray:
    """How well the paper takes the ink of each line at each pixel, with mean 0 and deviation 1.

    Lines that cross do not catch on the same spots, or they would leave more of the paper than lines
    that know nothing of each other: each is drawn on a stretch of the paper that lies beside that of
    the one before.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat pixel indices into a supersampled frame, ascending.
    width : int
        Of that frame.
    grain : float
        Of the noise of streaks, pixels of the picture: the tooth is as much finer or broader.
    seed : int
    side : int
        Subpixels of a pixel, each way; all of them are of one height.
    lines : int

    Returns
    -------
    (lines, P) float32 ndarray
    """
    row, column = np.divmod(pixel, np.int32(width))
    row, column = row // side, column // side
    beside = stretch(grain)
    left, right = tiled(int(column.min()), int(column.max()) + 1 + (lines - 1) * beside)
    bottom, top = tiled(int(row[0]), int(row[-1]) + 1)
    make = _sheet if (right - left) * (top - bottom) <= _KEPT else _sheet.__wrapped__
    sheet = make(left, right, bottom, top, grain, seed)
    place = (row - bottom) * np.int32(right - left) + (column - left)
    return np.stack([sheet.take(place + line * beside) for line in range(lines)])


def surface_tooth(look: Look) -> dict[str, Any]:
    """The tooth that stays with surfaces, by the parameters of `surface_noise`.

    A channel for each of `TEETH` families. Its deviation is `hatching.Statistics.tooth_deviation`.

    Parameters
    ----------
    look : Look
        With its lengths in the pixels of the frame.
    """
    grain = max(ON_SURFACE * look.grain, SMALLEST * look.supersampling)
    return {
        "grain": grain,
        "seed": look.seed ^ OWN_SEED,
        "channels": TEETH,
        "density": 0.5,
        "high_pass": BROADEST * grain,
    }


def stretch(grain: float) -> int:
    """Pixels from the paper of one line to that of the next: what they have in common is gone."""
    return int(np.ceil(3 * _blurs(grain)[-1]))


def _blurs(grain: float) -> list[float]:
    """Deviations of the blurs between which the bands of the relief lie, pixels."""
    finest = max(FINEST * grain, SMOOTHEST)
    return [finest * 2**number for number in range(len(SHARES) + 1)]


@lru_cache(maxsize=2)
def _sheet(left: int, right: int, bottom: int, top: int, grain: float, seed: int) -> np.ndarray:
    """(pixels,) float32 heights of a rectangle of the picture."""
    blurs = _blurs(grain)
    margin = 4 * blur_reach(blurs[-1])
    column = np.arange(left - margin, right + margin, dtype=np.int32)
    row = np.arange(bottom - margin, top + margin, dtype=np.int32)[:, None]
    white = hash_bits(column, row, seed ^ OWN_SEED, 0, 0.5).astype(np.float32) - np.float32(0.5)
    heights = _relief(white, blurs)[margin:-margin, margin:-margin]
    return np.ascontiguousarray(heights / np.float32(_deviation(*blurs))).reshape(-1)


def _relief(white: np.ndarray, blurs: Sequence[float]) -> np.ndarray:
    """Bands of (H, W) white noise, from each blur to the next."""
    total = np.zeros_like(white)
    finer = _softened(white, blurs[0])
    for finer_blur, broader_blur, share in zip(blurs, blurs[1:], SHARES, strict=False):
        broader = _softened(white, broader_blur)
        # What a blur leaves of white noise goes with the inverse of its deviation.
        total += np.float32(share * finer_blur / blurs[0]) * (finer - broader)
        finer = broader
    return total


def _softened(image: np.ndarray, deviation: float) -> np.ndarray:
    """Nearly a Gaussian blur, also of less than `blurred` can do."""
    if deviation > 1.5:
        return blurred(image, deviation)
    for axis in (0, 1) * max(round(2 * deviation**2), 1):
        # Weights 1, 2, 1: a variance of a half.
        ahead, behind = (np.roll(image, way, axis=axis) for way in (1, -1))
        image = np.float32(0.5) * image + np.float32(0.25) * (ahead + behind)
    return image


@lru_cache(maxsize=16)
def _deviation(*blurs: float) -> float:
    """Of the relief of noise of deviation a half, by what it makes of a single pixel."""
    reach = 4 * blur_reach(blurs[-1])
    single = np.zeros((2 * reach + 1,) * 2, dtype=np.float32)
    single[reach, reach] = 1
    return float(np.linalg.norm(_relief(single, blurs)) / 2)

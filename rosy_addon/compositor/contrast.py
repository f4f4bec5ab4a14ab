"""How bright and how varied the pixels of LIC images are, without looking at any."""

from __future__ import annotations

import numpy as np

from .look import Look
from .noise import MEAN, streak_statistics


def even_out(mean: np.ndarray, samples: np.ndarray, look: Look) -> np.ndarray:
    """Give streamlines that ended early the spread of whole ones.

    The mean of n samples has full / n times the variance of that of all of them; without this,
    borders and the surroundings of zeros glare. Means over less than two cells of the noise are
    hardly means at all, but bright and dark dots: these fade to grey.

    Parameters
    ----------
    mean : (P, K) float32 ndarray
        Mean noise along each streamline.
    samples : (P,) float32 ndarray
        n, at least 1.
    look : Look
        Its `length`, `step` and `grain` count.
    """
    full = np.float32(2 * look.length + 1)
    cells = samples * np.float32(look.step / look.grain)
    factor = np.sqrt(samples / full) * np.minimum(cells / 2, 1)
    return MEAN + (mean - MEAN) * factor[:, None]


def blend_gain(images: int, samples: np.ndarray, look: Look) -> np.ndarray:
    """The factor that gives the mean of M member images the spread of one: about sqrt(M).

    Equation 6 of the paper takes the M values at a pixel for independent. They are not quite: all
    M streamlines cross there and share the noise around the crossing, so that the variance of
    the mean is (1 + r) / M of that of one, r being the sum of the correlations of one of them with
    the others (`noise.streak_statistics`). At N = 7 and the usual length sqrt(M) alone is a
    tenth too much. Correlations grow as streamlines get shorter.

    Parameters
    ----------
    images : int
        M.
    samples : (P,) float32 ndarray
        Of a streamline, mean over the M of a pixel.
    look : Look
        Its `length`, `step`, `grain` and `high_pass` count.

    Returns
    -------
    (P,) float32 ndarray
        sqrt(M / (1 + r)), from 1 to sqrt(M).
    """
    full = 2 * look.length + 1
    noise = (full * look.step, look.grain, look.high_pass)
    _, crossing = streak_statistics(*noise, images)
    shared = np.clip(crossing * full / samples, 0, images - 1)
    return np.sqrt(images / (1 + shared)).astype(np.float32)


def averaging_gain(look: Look) -> float:
    """The factor that gives supersampled streaks the contrast of those drawn at once.

    Parameters
    ----------
    look : Look
        With its lengths in the pixels of the supersampled frame.
    """
    side = look.supersampling
    full = (2 * look.length + 1) * look.step
    averaged, _ = streak_statistics(full, look.grain, look.high_pass, average=side)
    at_once, _ = streak_statistics(full / side, look.grain / side, look.high_pass / side)
    return at_once / averaged


def expected_deviation(look: Look) -> float:
    """Standard deviation of one member image with whole streamlines, from theory."""
    length = (2 * look.length + 1) * look.step
    return streak_statistics(length, look.grain, look.high_pass)[0]


def scale_contrast(tone: np.ndarray, gain: np.ndarray | float) -> np.ndarray:
    """Values spread by `gain` about the mean of the noise (equation 6)."""
    return MEAN + gain * (tone - MEAN)

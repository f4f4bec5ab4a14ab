"""How bright and how varied the pixels of LIC images are, without looking at any."""

from __future__ import annotations

import numpy as np

from .flow import image_count
from .noise import MEAN, correlation_length


def even_out(mean: np.ndarray, samples: np.ndarray, full: int) -> np.ndarray:
    """Give streamlines that ended early the spread of whole ones.

    The mean of n samples has full / n times the variance of that of all of them; without this,
    borders and the surroundings of zeros glare.

    Parameters
    ----------
    mean : (P, K) float32 ndarray
        Mean noise along each streamline.
    samples : (P,) float32 ndarray
        n, at least 1.
    full : int
        Samples of a whole streamline.
    """
    return MEAN + (mean - MEAN) * np.sqrt(samples / np.float32(full))[:, None]


def blend_gain(degree: int, samples: np.ndarray, step: float, grain: float) -> np.ndarray:
    """The factor that gives the mean of M member images the spread of one: about sqrt(M).

    Equation 6 of the paper takes the M values at a pixel for independent. They are not quite: all
    M streamlines cross there, and share the noise around the crossing. Two straight ones of
    length l at an angle a, over noise with cells of side g and the correlation length c (see
    `noise.correlation_length`) are correlated by g^2 / (l c sin a). With the M lines at multiples
    of pi / M the variance of the mean is (1 + r) / M of that of one, r being the sum below; at
    N = 7 and the usual length sqrt(M) alone is a tenth too much.

    Parameters
    ----------
    degree : int
        N.
    samples : (P,) float32 ndarray
        Of a streamline, mean over the M of a pixel.
    step, grain : float
        Pixels.

    Returns
    -------
    (P,) float32 ndarray
        sqrt(M / (1 + r)), from 1 to sqrt(M).
    """
    images = image_count(degree)
    crossings = np.sum(1 / np.sin(np.pi * np.arange(1, images) / images))
    shared = grain**2 * crossings / (correlation_length(grain) * step * samples)
    return np.sqrt(images / (1 + np.minimum(shared, images - 1))).astype(np.float32)


def expected_deviation(length: int, step: float, grain: float) -> float:
    """Standard deviation of one member image with whole streamlines, from theory.

    Parameters
    ----------
    length : int
        Steps each way.
    step, grain : float
        Pixels.
    """
    return 0.5 * float(np.sqrt(correlation_length(grain) / ((2 * length + 1) * step)))


def scale_contrast(tone: np.ndarray, gain: np.ndarray | float) -> np.ndarray:
    """Values spread by `gain` about the mean of the noise (equation 6)."""
    return MEAN + gain * (tone - MEAN)

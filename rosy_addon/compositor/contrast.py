"""How bright and how varied the pixels of LIC images are, without looking at any."""

from __future__ import annotations

import numpy as np

from .kernel import whole_samples
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
        Its `length`, `taper`, `step` and `grain` count.
    """
    full = np.float32(whole_samples(look))
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
        Its `length`, `taper`, `step`, `grain` and `high_pass` count.

    Returns
    -------
    (P,) float32 ndarray
        sqrt(M / (1 + r)), from 1 to sqrt(M).
    """
    _, crossing = streak_statistics(*streaks_of(look), images, tapered=look.taper)
    shared = np.clip(crossing * whole_samples(look) / samples, 0, images - 1)
    return np.sqrt(images / (1 + shared)).astype(np.float32)


def averaging_gain(look: Look) -> float:
    """The factor that gives supersampled streaks the contrast of those drawn at once.

    Parameters
    ----------
    look : Look
        With its lengths in the pixels of the supersampled frame.
    """
    side = look.supersampling
    fine = streaks_of(look)
    averaged, _ = streak_statistics(*fine, average=side, tapered=look.taper)
    at_once, _ = streak_statistics(*(length / side for length in fine), tapered=look.taper)
    return at_once / averaged


def expected_deviation(look: Look) -> float:
    """Standard deviation of one member image with whole streamlines, from theory."""
    return streak_statistics(*streaks_of(look), tapered=look.taper)[0]


def streaks_of(look: Look) -> tuple[float, float, float]:
    """Length of the streamlines, grain and high pass of the noise, in pixels."""
    return (2 * look.length + 1) * look.step, look.grain, look.high_pass


def scale_contrast(tone: np.ndarray, gain: np.ndarray | float) -> np.ndarray:
    """Values spread by `gain` about the mean of the noise (equation 6)."""
    return MEAN + gain * (tone - MEAN)

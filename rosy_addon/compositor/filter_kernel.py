"""The filter kernel of LIC: weights of the samples along a streamline, constant or tapered.

With tapered weights, streaks end in points. Averages also change less when the length of a
streamline in pixels changes, as it does when the camera moves closer.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .look import Look


class KernelWeights(NamedTuple):
    """Sums over the weights w of the samples of streamlines.

    Attributes
    ----------
    total : ndarray
        sum w, the divisor of weighted means.
    effective_samples : ndarray
        (sum w)^2 / sum w^2 (Kish 1965). The mean of that many samples with equal weights has the
        same variance.
    """

    total: np.ndarray
    effective_samples: np.ndarray


def kernel_weights(forward: Any, backward: Any, full_length: Any, tapered: bool) -> KernelWeights:
    """Sum the weights of streamlines through one sample.

    Parameters
    ----------
    forward, backward : ndarray or float
        Numbers of samples on either side, as floats, at most `full_length`.
    full_length : ndarray or float
        Number of samples on either side of a streamline that does not end early.
    tapered : bool
        Whether the sample d steps from the center has the weight 1 - d / (full_length + 1)
        instead of 1.

    Returns
    -------
    KernelWeights
    """
    if not tapered:
        return KernelWeights(*[1 + forward + backward] * 2)
    taper_slope = 1 / (1 + np.asarray(full_length, dtype=np.result_type(forward)))
    total = 1 + _taper_sum(forward, taper_slope) + _taper_sum(backward, taper_slope)
    return KernelWeights(
        total,
        total**2
        / (1 + _taper_square_sum(forward, taper_slope) + _taper_square_sum(backward, taper_slope)),
    )


def full_sample_count(look: Look) -> float:
    """`KernelWeights.effective_samples` of streamlines that do not end early."""
    length = np.float64(look.length)
    return float(kernel_weights(length, length, length, look.taper).effective_samples)


def _taper_sum(count: Any, taper_slope: Any) -> Any:
    """Sum of 1 - d taper_slope for d from 1 to count."""
    return count - taper_slope * count * (count + 1) / 2


def _taper_square_sum(count: Any, taper_slope: Any) -> Any:
    """Sum of (1 - d taper_slope)^2 for d from 1 to count."""
    return count - taper_slope * count * (count + 1) * (1 - taper_slope * (2 * count + 1) / 6)

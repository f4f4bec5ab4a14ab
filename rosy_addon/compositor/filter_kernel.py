"""The filter kernel of LIC: weights of the samples along a streamline.

A box has constant weights. With tapered weights, streaks end in points. Averages also change less when
the length of a streamline in pixels changes, as it does when the camera moves closer. With a ramp, the
weights fall along the direction of the field: streaks have a bright head and a faint tail (Wegenkittl,
Groeller and Purgathofer, Animating flow fields: rendering of oriented line integral convolution, 1997).
"""

from typing import Any, Literal, NamedTuple

import numpy as np

#: Names of the kernels.
Kernel = Literal["box", "taper", "ramp"]


#: How much the weights of samples fall from the center to the end of a streamline: forward, backward.
WEIGHT_SLOPES: dict[Kernel, tuple[int, int]] = {"box": (0, 0), "taper": (1, 1), "ramp": (1, -1)}


#: The kernel of each value of `Look.fade`.
KERNEL_OF_FADE: dict[str, Kernel] = {"none": "box", "ends": "taper", "tail": "ramp"}


def sample_weights(position: np.ndarray, length: float, kernel: Kernel) -> np.ndarray:
    """Return the weights of samples at given positions: whole steps from the center, positive if forward.

    The weight of the center is 1. Samples more than `length` steps away have the weight 0.
    """
    forward, backward = WEIGHT_SLOPES[kernel]
    slope = np.where(position > 0, forward, backward) / (1 + length)
    return np.where(np.abs(position) <= length, 1 - slope * np.abs(position), 0.0)


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


def kernel_weights(forward: Any, backward: Any, full_length: Any, kernel: Kernel) -> KernelWeights:
    """Sum the weights of streamlines through one sample.

    Parameters
    ----------
    forward, backward : ndarray or float
        Numbers of samples on either side, without the center, as floats, at most `full_length`. Forward is
        along the direction of the field, if the kernel is a ramp.
    full_length : ndarray or float
        Number of samples on either side of a streamline that does not end early.
    kernel : {"box", "taper", "ramp"}
        Weight of the sample d steps from the center: 1 for "box", and 1 - d / (full_length + 1) for the
        others. For "ramp", d is negative on the backward side, so weights there are between 1 and 2.

    Returns
    -------
    KernelWeights
    """
    if kernel == "box":
        return KernelWeights(*[1 + forward + backward] * 2)
    slope = 1 / (1 + np.asarray(full_length, dtype=np.result_type(forward)))
    forward_slope, backward_slope = WEIGHT_SLOPES[kernel]
    forward_sum, forward_squares = _weight_sums(forward, forward_slope * slope)
    backward_sum, backward_squares = _weight_sums(backward, backward_slope * slope)
    total = 1 + forward_sum + backward_sum
    return KernelWeights(total, total**2 / (1 + forward_squares + backward_squares))


def full_sample_count(length: int, kernel: Kernel) -> float:
    """Return `KernelWeights.effective_samples` of streamlines that do not end early."""
    full = np.float64(length)
    return float(kernel_weights(full, full, full, kernel).effective_samples)


def _weight_sums(count: Any, slope: Any) -> tuple[Any, Any]:
    """Return the sums over d from 1 to `count` of the weights 1 - d * slope, and of their squares."""
    step_sum = slope * count * (count + 1)
    return count - step_sum / 2, count - step_sum * (1 - slope * (2 * count + 1) / 6)

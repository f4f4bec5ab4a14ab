"""How much the samples along a streamline count: all the same, or the less the nearer to its ends.

Means of tapered weights change less when a streamline gets longer or shorter, as it does in pixels
when one comes nearer, and streaks end in points.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .look import Look


class Weights(NamedTuple):
    """What the samples of some streamlines weigh.

    Attributes
    ----------
    total : ndarray
        Their sum.
    samples : ndarray
        As many samples that count the same would vary as much: (sum w)^2 / sum w^2 (Kish 1965).
    """

    total: np.ndarray
    samples: np.ndarray


def weights_of(ahead: Any, behind: Any, reach: Any, tapered: bool) -> Weights:
    """Of streamlines from one sample on.

    Parameters
    ----------
    ahead, behind : ndarray or float
        Floats: samples on either side, at most `reach`.
    reach : ndarray or float
        Samples on either side of a streamline that has not ended early: the one at a distance d
        weighs 1 - d / (reach + 1) if they are tapered.
    tapered : bool
    """
    if not tapered:
        return Weights(*[1 + ahead + behind] * 2)
    fall = 1 / (1 + np.asarray(reach, dtype=np.result_type(ahead)))
    total = 1 + _sum(ahead, fall) + _sum(behind, fall)
    return Weights(total, total**2 / (1 + _squares(ahead, fall) + _squares(behind, fall)))


def whole_samples(look: Look) -> float:
    """`Weights.samples` of streamlines that have not ended early."""
    length = np.float64(look.length)
    return float(weights_of(length, length, length, look.taper).samples)


def _sum(count: Any, fall: Any) -> Any:
    """Of 1 - d fall, for d from 1 to count."""
    return count - fall * count * (count + 1) / 2


def _squares(count: Any, fall: Any) -> Any:
    """The same, of the squares."""
    return count - fall * count * (count + 1) * (1 - fall * (2 * count + 1) / 6)

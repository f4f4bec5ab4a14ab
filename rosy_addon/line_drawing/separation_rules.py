"""`SeparationRules`, and which points of strokes are close enough on the surface to be compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Points of one stroke are compared only if they are farther apart along it than this, in spacings.
MIN_SELF_ARC = 2.5

#: Points are on different parts of a fold if the cosine between their normals is below the first
#: value, or the slope between them relative to the mean normal (height over distance) is above the
#: second.
MIN_NORMAL_COSINE, MAX_SLOPE = 0.1, 0.6


@dataclass(frozen=True)
class SeparationRules:
    """Limits on the separation and the length of strokes, in spacings.

    Attributes
    ----------
    min_separation : float
        Strokes end before they come nearer than this to another stroke of their family.
    max_gap : float
        Strokes end where a gap beside them is wider than this but too narrow for another stroke
        (see `lateral_neighbors.MAX_COVERED_GAP`).
    min_length : float
        Shorter strokes are removed.
    max_length : float
        Strokes end when they are longer than this.
    """

    min_separation: float = 0.75
    max_gap: float = 1.24
    min_length: float = 1.5
    max_length: float = np.inf

"""The ink of hatching that is drawn from thresholds, for any tone.

`filtered_edges` and `layer_coverage` are written for numbers of two kinds: arrays, with which
`ink_of_thresholds` draws, and numbers of a node tree, with which `scene.hatching_nodes` makes the node group
*RoSy Hatching*.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import numpy as np

from .ink_thresholds import MAX_LAYERS, layer_shares
from .inks import Inks, has_ink_per_line, inks_of
from .look import Look
from .streak_statistics import softness

#: The density of normally distributed streaks is about this times c (1 - c) at the threshold of the
#: coverage c. At c = 1/2 it is 1 / sqrt(2 pi), and the factor 4 / sqrt(2 pi) = 1.596.
DENSITY_FACTOR = 1.6

#: Spread of thresholds that is due to the storage of their spread with 8 bits: the standard deviation of
#: its rounding is 1 / (255 sqrt(12)) = 0.0011.
ROUNDING_SPREAD = 0.001

#: Square of half the width of an even distribution of thresholds t over the variance of 2 t - 1. For the
#: half width w, the variance of t is w^2 / 3, and 2 t - 1 has four times as much.
EDGE_VARIANCE = 0.75

#: Half the width of the sharpest edges, in thresholds: half a step of 8 bits, 1 / 510.
MIN_EDGE = 0.002

#: Coverages that differ from 0 or 1 by less than this fade to it.
EXACT_ENDS = 0.02

#: Correction of coverages where a filter averages a few thresholds, which are not evenly distributed about
#: their mean. Fitted to means of 2 to 64 thresholds, and to lines at least 4 pixels apart: the mean coverage is
#: right to 0.02
#: (`test_smaller_versions_of_a_texture_keep_the_tone`).
FILTER_CORRECTION = 3.0

#: Smallest transmittance, and smallest difference to it.
MIN_TRANSMITTANCE = 1e-3


def layer_inks(look: Look, line_count: int) -> tuple[int, Inks]:
    """Return the number of lines that cross at most, and their inks: one each, or one for all."""
    layers = min(look.layers, line_count, MAX_LAYERS)
    return layers, inks_of(look, layers if has_ink_per_line(look) else 1)


def ink_of_thresholds(
    pixels: np.ndarray, tone: np.ndarray, look: Look, line_count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the ink of a tone, as the node group *RoSy Hatching* does.

    Parameters
    ----------
    pixels : (P, 4) float32 ndarray
        From `threshold_pixels`, or means of them.
    tone : (P,) ndarray
        Linear, 0 to 1.
    look : Look
        Its settings of the ink are used.
    line_count : int
        Number of lines through a point.

    Returns
    -------
    color : (P, 3) float32 ndarray
        Linear color of ink on paper, or of the ink alone if the paper is not opaque.
    coverage : (P,) float32 ndarray
        0 to 1.
    """
    layers, inks = layer_inks(look, line_count)
    required = inks.target_transmittance(inks.complement_if_light(tone))
    colors = [
        inks.ink_at_tone(np.full(len(tone), min(layer, len(inks.dark) - 1)), tone)
        for layer in range(layers)
    ]
    left = [1 - inks.required_coverage(required, ink) for ink in colors]
    shares = layer_shares(1 - left[0], layers, look.layering)
    thresholds = [pixels[:, layer].view(_Values) for layer in range(MAX_LAYERS)]
    filtered = filtered_edges(pixels[:, 3].view(_Values), thresholds)
    edge_factor = DENSITY_FACTOR * softness(look.crispness)
    is_opaque = inks.paper_alpha == 1
    color = colors[-1] if not is_opaque else np.broadcast_to(inks.paper, (len(tone), 3))
    bare = np.ones(len(tone), dtype=np.float32)
    # The lines that come first are on top of the others.
    for layer in reversed(range(layers)):
        left_by_layer = left[layer].view(_Values)
        covered = np.asarray(
            layer_coverage(left_by_layer, shares[layer], thresholds[layer], filtered, edge_factor)
        )
        bare *= 1 - covered
        part = covered / np.maximum(1 - bare, np.float32(1e-6)) if not is_opaque else covered
        color = color + part[:, None] * (colors[layer] - color)
    return color.astype(np.float32), 1 - bare


class FilteredEdges(NamedTuple):
    """What follows from the spread of the thresholds that a filter of the texture has averaged.

    Attributes
    ----------
    edge
        Half the width of an even distribution with this spread.
    correction
        Factor of the correction of coverages; see `FILTER_CORRECTION`.
    """

    edge: Any
    correction: Any


def filtered_edges(spread: Any, thresholds: Sequence[Any]) -> FilteredEdges:
    """Compute what the filter of the texture did to thresholds.

    Numbers are `_Values` or `scene.node_builder.Number`.

    Parameters
    ----------
    spread
        Alpha of `threshold_pixels`.
    thresholds : sequence
        The other three channels.
    """
    centered = [threshold * 2 - 1.0 for threshold in thresholds]
    mean_square = reduce(add, [value * value for value in centered]) / MAX_LAYERS
    variance = (spread - mean_square - ROUNDING_SPREAD).at_least(0.0)
    evenness = (variance * 3).at_most(1.0)
    correction = evenness * FILTER_CORRECTION * evenness * (1 - evenness)
    return FilteredEdges((variance * EDGE_VARIANCE).square_root(), correction)


def layer_coverage(
    left: Any, share: Any, threshold: Any, filtered: FilteredEdges, edge_factor: Any
) -> Any:
    """Compute the coverage by the lines of one layer, 0 to 1; numbers as in `filtered_edges`.

    Parameters
    ----------
    left
        The transmittance that all lines together should have.
    share
        Exponent of it for these lines; see `layer_shares`.
    threshold
        Threshold of the layer.
    filtered : FilteredEdges
    edge_factor
        `DENSITY_FACTOR` times the softness of edges.
    """
    coverage = 1 - left.at_least(MIN_TRANSMITTANCE) ** share
    # Edges as wide as this leave the mean coverage of all thresholds unchanged.
    room = coverage.at_most(1 - coverage)
    inner = coverage * (1 - coverage)
    edge = (inner * edge_factor).at_most(room).at_least(filtered.edge).at_least(MIN_EDGE)
    corrected = coverage + filtered.correction * inner * (1 - coverage * 2)
    covered = (corrected - threshold) / (edge * 2) + 0.5
    # What is narrower than the edge covers no point of it entirely, be it ink or paper.
    missed = 1 - (room / edge).at_most(1.0)
    is_dark = coverage > 0.5
    covered = covered.at_least(is_dark * missed).at_most(1 - (1 - is_dark) * missed)
    # No ink at all, and nothing but ink, are exact.
    return is_dark + (room / EXACT_ENDS).at_most(1.0) * (covered - is_dark)


class _Values(np.ndarray):
    """An array with the operations of `scene.node_builder.Number`."""

    def at_least(self, other: Any) -> Any:
        return np.maximum(self, other)

    def at_most(self, other: Any) -> Any:
        return np.minimum(self, other)

    def square_root(self) -> Any:
        return np.sqrt(self)

    def __gt__(self, other: Any) -> Any:
        return np.greater(self, other).astype(self.dtype)

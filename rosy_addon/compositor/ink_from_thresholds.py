"""Ink of hatching for any tone, drawn from stored thresholds (see `ink_thresholds`).

`filtered_edges` and `layer_coverage` are written once for two uses: `ink_of_thresholds` calls them with
arrays, and `scene.hatching_nodes` with sockets of shader nodes, to make the node group *RoSy Hatching*.
"""

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import numpy as np

from .ink_thresholds import MAX_LAYERS, layer_shares
from .inks import Inks, has_ink_per_line, inks_of
from .look import Look
from .streak_statistics import softness

#: The probability density of normally distributed streaks, at the threshold of the coverage c, is about this
#: factor times c (1 - c). At c = 1/2 the density is 1 / sqrt(2 pi), so the factor is 4 / sqrt(2 pi) = 1.596.
DENSITY_FACTOR = 1.6

#: Part of a stored spread that may be due to its rounding to 8 bits: the standard deviation of the
#: rounding error, 1 / (255 sqrt(12)) = 0.0011.
ROUNDING_SPREAD = 0.001

#: Ratio of w^2 to the variance of 2 t - 1, for thresholds t that are evenly distributed over the width 2 w.
#: The variance of t is w^2 / 3, and the variance of 2 t - 1 is four times as much.
EDGE_VARIANCE = 0.75

#: Half the width of the sharpest edges, in thresholds: half a step of 8 bits, 1 / 510.
MIN_EDGE = 0.002

#: Coverages that differ from 0 or 1 by less than this fade to 0 or 1.
EXACT_ENDS = 0.02

#: Strength of the correction of coverages where a texture filter has averaged a few thresholds, which are not
#: evenly distributed about their mean. It is fitted to means of 2 to 64 thresholds, and to lines at least 4
#: pixels apart. The mean coverage then has an error of at most 0.02
#: (`test_smaller_versions_of_a_texture_keep_the_tone`).
FILTER_CORRECTION = 3.0

#: Lower bound of transmittances, and of differences between them.
MIN_TRANSMITTANCE = 1e-3


def layer_inks(look: Look, line_count: int) -> tuple[int, Inks]:
    """Return the number of layers of hatching, and their inks: one for each layer, or one for all.

    Each layer holds the lines along one direction of the field. There are at most `line_count` layers.
    """
    layers = min(look.layers, line_count, MAX_LAYERS)
    return layers, inks_of(look, layers if has_ink_per_line(look) else 1)


def ink_of_thresholds(
    pixels: np.ndarray, tone: np.ndarray, look: Look, line_count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the ink for a tone from thresholds, as the node group *RoSy Hatching* does.

    Parameters
    ----------
    pixels : (P, 4) float32 ndarray
        Pixels from `threshold_pixels`, or means of such pixels.
    tone : (P,) ndarray
        Linear, 0 to 1.
    look : Look
        Its settings of the ink are used.
    line_count : int
        Number of lines (pairs of opposite directions of the field) through a point.

    Returns
    -------
    color : (P, 3) float32 ndarray
        Linear color of ink on paper, or of the ink alone if the paper is not opaque.
    coverage : (P,) float32 ndarray
        0 to 1.
    """
    layers, inks = layer_inks(look, line_count)
    required = inks.target_transmittance(inks.complement_if_light(tone))
    indices = [min(layer, len(inks.dark) - 1) for layer in range(layers)]
    colors = [inks.ink_at_tone(np.full(len(tone), index), tone) for index in indices]
    left = [1 - inks.required_coverage(required, ink) for ink in colors]
    shares = layer_shares(1 - left[0], layers, look.layering)
    thresholds = [pixels[:, layer].view(_Values) for layer in range(MAX_LAYERS)]
    filtered = filtered_edges(pixels[:, 3].view(_Values), thresholds)
    edge_factor = DENSITY_FACTOR * softness(look.crispness)
    is_opaque = inks.paper_alpha == 1
    color = colors[-1] if not is_opaque else np.broadcast_to(inks.paper, (len(tone), 3))
    bare = np.ones(len(tone), dtype=np.float32)
    # The first layer is drawn last, on top of the others.
    for layer in reversed(range(layers)):
        parameters = left[layer].view(_Values), shares[layer], thresholds[layer]
        covered = np.asarray(layer_coverage(*parameters, filtered, edge_factor))
        bare *= 1 - covered
        part = covered / np.maximum(1 - bare, np.float32(1e-6)) if not is_opaque else covered
        color = color + part[:, None] * (colors[layer] - color)
    return color.astype(np.float32), 1 - bare


class FilteredEdges(NamedTuple):
    """Parameters of the edges of ink where a texture filter has averaged several thresholds.

    Attributes
    ----------
    edge
        Half the width of a soft edge, in thresholds (0 to 1): half the width of the uniform distribution
        that has the same variance as the averaged thresholds.
    correction
        Strength of the correction that keeps the mean coverage; see `FILTER_CORRECTION`. 0 where no
        thresholds have been averaged.
    """

    edge: Any
    correction: Any


def filtered_edges(spread: Any, thresholds: Sequence[Any]) -> FilteredEdges:
    """Compute the edges of ink from the spread of the thresholds that a texture filter has averaged.

    All numbers are arrays (`_Values`) or sockets of nodes (`scene.node_builder.Number`).

    Parameters
    ----------
    spread
        Alpha channel of `threshold_pixels`.
    thresholds : sequence
        Red, green and blue channels of `threshold_pixels`.
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
    """Compute the coverage by the lines of one layer, 0 to 1.

    All numbers are arrays or sockets of nodes, as in `filtered_edges`.

    Parameters
    ----------
    left
        The fraction of the paper that the lines of all layers together should leave bare.
    share
        Share of this layer in the ink: it should leave ``left ** share`` bare; see `layer_shares`.
    threshold
        Threshold of the layer.
    filtered : FilteredEdges
    edge_factor
        `DENSITY_FACTOR` times the `softness` of the edges of ink. It is multiplied by c (1 - c), for the
        coverage c, to get half the width of edges in thresholds.
    """
    coverage = 1 - left.at_least(MIN_TRANSMITTANCE) ** share
    # Edges as wide as this leave the mean coverage of all thresholds unchanged.
    room = coverage.at_most(1 - coverage)
    inner = coverage * (1 - coverage)
    edge = (inner * edge_factor).at_most(room).at_least(filtered.edge).at_least(MIN_EDGE)
    corrected = coverage + filtered.correction * inner * (1 - coverage * 2)
    covered = (corrected - threshold) / (edge * 2) + 0.5
    # Ink (or paper) that is narrower than the edge covers no point of the edge entirely.
    missed = 1 - (room / edge).at_most(1.0)
    is_dark = coverage > 0.5
    covered = covered.at_least(is_dark * missed).at_most(1 - (1 - is_dark) * missed)
    # Coverages of 0 and 1 are exact.
    return is_dark + (room / EXACT_ENDS).at_most(1.0) * (covered - is_dark)


class _Values(np.ndarray):
    """An array with the methods of `scene.node_builder.Number`, a socket of shader nodes."""

    def at_least(self, other: Any) -> Any:
        return np.maximum(self, other)

    def at_most(self, other: Any) -> Any:
        return np.minimum(self, other)

    def square_root(self) -> Any:
        return np.sqrt(self)

    def __gt__(self, other: Any) -> Any:
        return np.greater(self, other).astype(self.dtype)

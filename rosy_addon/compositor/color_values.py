"""Range of color values (numbers on surfaces that a color map shows), and their positions in the map."""

from collections.abc import Iterable

import numpy as np

from ..core.errors import RosyError
from ..projection.gbuffer import GBuffer, MeshInstance, with_field
from ..projection.surface_sampling import surface_values
from .look import Look, colors_values

#: Smallest difference between the color values at the bottom and at the top of the color map. If the
#: difference is that small, the map is a step: larger values have the color at the top.
MIN_VALUE_RANGE = 1e-30

#: The lowest and the highest of some color values; None if no value is finite.
ValueRange = tuple[float, float] | None


def check_color_values(look: Look, instances: Iterable[MeshInstance]) -> None:
    """Check that a surface has color values if the look shows them; pass if it does not.

    Raises
    ------
    RosyError
        If the look shows color values, and no mesh instance with a field has any.
    """
    if colors_values(look) and all(item.color_values is None for item in with_field(instances)):
        raise RosyError("hue 'values' needs numbers on the surface, but no object has any")


def value_range(values: np.ndarray) -> ValueRange:
    """Return the lowest and the highest finite value, or None if no value is finite."""
    finite = np.isfinite(values)
    if not finite.any():
        return None
    low, high = values.min(where=finite, initial=np.inf), values.max(where=finite, initial=-np.inf)
    return float(low), float(high)


def value_ranges(instances: Iterable[MeshInstance]) -> list[ValueRange]:
    """Return the `value_range` of each mesh instance that has both a field and color values."""
    colored = [instance.color_values for instance in with_field(instances)]
    return [value_range(values) for values in colored if values is not None]


def value_ends(look: Look, ranges: Iterable[ValueRange]) -> tuple[float, float]:
    """Return the color values at the bottom and at the top of the color map.

    Parameters
    ----------
    look : Look
        Its `color_range` is returned, unless both ends of it are 0.
    ranges : iterable of (float, float) or None
        Ranges of color values from `value_ranges`. If both ends of `color_range` are 0, the smallest range
        that contains them all is returned, or (0, 0) if there is none.
    """
    if any(look.color_range):
        return look.color_range
    known = [entry for entry in ranges if entry is not None] or [(0.0, 0.0)]
    return min(low for low, _ in known), max(high for _, high in known)


def value_scale(look: Look, ranges: Iterable[ValueRange]) -> tuple[float, float]:
    """Return (low, scale): the color value v is at the position (v - low) * scale in the color map.

    `ranges` are ranges of color values from `value_ranges`. If low and high are equal, the scale is a large
    finite number: the map is a step, and larger values have the position 1 after clipping.
    """
    low, high = value_ends(look, ranges)
    difference = high - low
    if abs(difference) < MIN_VALUE_RANGE:
        difference = MIN_VALUE_RANGE
    return low, 1 / difference


def scaled_positions(values: np.ndarray, low: float, scale: float) -> np.ndarray:
    """Return the (P,) float32 positions of (P,) color values in the color map, clipped to 0 to 1.

    The position of the value v is (v - low) * scale, with `low` and `scale` from `value_scale`.
    """
    return np.clip((values.astype(np.float64) - low) * scale, 0, 1).astype(np.float32)


def map_positions(gbuffer: GBuffer, look: Look) -> np.ndarray:
    """Compute the position in the color map of the color value at each pixel.

    Parameters
    ----------
    gbuffer : GBuffer
        Its `instances` must be set. The color map spans the color values of all instances, visible or not,
        unless the look has a `color_range`.
    look : Look

    Returns
    -------
    (P,) float32 ndarray
        0 to 1 at the pixels of the G-buffer; NaN where the surface has no color value.

    Raises
    ------
    RosyError
        If the look shows color values, and no mesh instance with a field has any.
    """
    check_color_values(look, gbuffer.instances)
    low, scale = value_scale(look, value_ranges(gbuffer.instances))
    return scaled_positions(surface_values(gbuffer), low, scale)

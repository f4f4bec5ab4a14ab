"""The colors of numbers on surfaces: their range, and where they are in the color map."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..core.errors import RosyError
from ..projection.gbuffer import GBuffer, MeshInstance
from ..projection.surface_sampling import surface_values
from .look import Look, colors_values
from .reported_blocks import reported_blocks

#: Smallest difference between the numbers at the bottom and at the top of the color map. With it, the
#: map is a step: larger numbers have the color at the top.
MIN_VALUE_RANGE = 1e-30

#: The lowest and the highest of some numbers; None if there are none.
ValueRange = tuple[float, float] | None


def check_color_values(look: Look, instances: Iterable[MeshInstance]) -> None:
    """Check that there are numbers on a surface if a look colors them.

    Raises
    ------
    RosyError
        If no mesh instance with a field has any.
    """
    if colors_values(look) and all(
        instance.color_values is None for instance in instances if instance.field is not None
    ):
        raise RosyError("hue 'values' needs numbers on the surface, but no object has any")


def value_range(values: np.ndarray) -> ValueRange:
    """Return the range of the finite ones of some numbers."""
    finite = np.isfinite(values)
    if not finite.any():
        return None
    low, high = values.min(where=finite, initial=np.inf), values.max(where=finite, initial=-np.inf)
    return float(low), float(high)


def value_ranges(instances: Iterable[MeshInstance]) -> list[ValueRange]:
    """Return the range of the numbers of each mesh instance that has a field and numbers."""
    return [
        value_range(instance.color_values)
        for instance in instances
        if instance.field is not None and instance.color_values is not None
    ]


def value_ends(look: Look, ranges: Iterable[ValueRange]) -> tuple[float, float]:
    """Return the numbers at the bottom and at the top of the color map of a look.

    Parameters
    ----------
    look : Look
        If both ends of its `color_range` are 0, the range of the numbers is used.
    ranges : iterable of (float, float) or None
        From `value_range`, of the mesh instances that have a field and numbers.
    """
    if any(look.color_range):
        return look.color_range
    known = [entry for entry in ranges if entry is not None] or [(0.0, 0.0)]
    return min(low for low, _ in known), max(high for _, high in known)


def value_scale(look: Look, ranges: Iterable[ValueRange]) -> tuple[float, float]:
    """Return (low, scale) of a look: a number v is at (v - low) * scale in the color map.

    Parameters as in `value_ends`.
    """
    low, high = value_ends(look, ranges)
    difference = high - low
    if abs(difference) < MIN_VALUE_RANGE:
        difference = MIN_VALUE_RANGE
    return low, 1 / difference


def scaled_positions(values: np.ndarray, low: float, scale: float) -> np.ndarray:
    """Return the (P,) float32 positions of (P,) numbers in the color map, 0 to 1; see `value_scale`."""
    return np.clip((values.astype(np.float64) - low) * scale, 0, 1).astype(np.float32)


def map_positions(gbuffer: GBuffer, look: Look) -> np.ndarray:
    """Find where the numbers of the surfaces are in the color map.

    Parameters
    ----------
    gbuffer : GBuffer
        With `instances`. The numbers of all of them, visible or not, are the range of the color map.
    look : Look

    Returns
    -------
    (P,) float32 ndarray
        0 to 1 at the pixels of the G-buffer; NaN where there is no number.

    Raises
    ------
    RosyError
        See `check_color_values`.
    """
    check_color_values(look, gbuffer.instances)
    low, scale = value_scale(look, value_ranges(gbuffer.instances))
    positions = np.empty(len(gbuffer.pixel), dtype=np.float32)
    for block in reported_blocks(len(positions), "finding colors"):
        positions[block] = scaled_positions(surface_values(gbuffer.part(block)), low, scale)
    return positions

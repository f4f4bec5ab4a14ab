"""Comparison of two fields on one surface: their angles and their singularities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..progress import progress, report
from .analysis import ErrorStatistics, angle_errors, error_statistics
from .rosy_field import RosyField
from .singularities import find_singularities
from .singularity_matching import match_on_surface
from .surface import Surface


class FieldComparison(NamedTuple):
    """How two fields differ.

    Attributes
    ----------
    angles : (F,) float64 ndarray
        Of `angle_errors`, in radians.
    statistics : ErrorStatistics
        Of the angles.
    singularity_count, other_count : int
        Singularities of each field.
    matched_count : int
        Those that have the same index in both, at nearly the same place.
    """

    angles: np.ndarray
    statistics: ErrorStatistics
    singularity_count: int
    other_count: int
    matched_count: int


def compare_fields(surface: Surface, field: RosyField, other: RosyField) -> FieldComparison:
    """Compare two fields of the same degree on a surface."""
    report(0.0, "comparing the fields")
    angles = angle_errors(surface, field, other)
    with progress(0.2, 0.5):
        own = find_singularities(surface, field)
    with progress(0.5, 0.8):
        others = find_singularities(surface, other)
    with progress(0.8, 1.0):
        matching = match_on_surface(surface, own, others)
    statistics = error_statistics(surface, angles)
    return FieldComparison(angles, statistics, len(own[0]), len(others[0]), len(matching.distance))

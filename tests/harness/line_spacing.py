"""Distances between evenly spaced lines, measured on the surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree


def spacing_ratios(lines: Any, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Measure the distance between lines in each triangle, relative to the one asked for.

    Parameters
    ----------
    lines : SurfaceLines
    spacing : float
        Distance that was asked for, in the units of the triangles.

    Returns
    -------
    ratio : (L, M) ndarray
    area : (L,) ndarray
        Areas of the triangles.
    """
    inverse, area = _metric(lines.tree)
    phase = lines.pattern.phase.astype(float)
    change = phase[..., 1:] - phase[..., :1]
    squared_gradient = np.einsum("lmi,lij,lmj->lm", change, inverse, change)
    gradient = np.sqrt(np.maximum(squared_gradient, 1e-30))  # 0 where the field is undefined
    return 1 / (gradient * spacing), area


def share_within(lines: Any, spacing: float, tolerance: float, distance: float) -> float:
    """Measure the share of the area, for the worst family, where lines have the spacing.

    Parameters
    ----------
    lines : SurfaceLines
    spacing : float
    tolerance : float
        Allowed relative difference.
    distance : float
        Triangles that are nearer to the end of a line are left out, in multiples of the spacing.
    """
    ratio, area = spacing_ratios(lines, spacing)
    center = lines.tree.vertices[lines.tree.leaf_vertex].mean(axis=1)
    ends = center[(lines.pattern.index != 0).any(axis=1)]
    is_far = cKDTree(ends.reshape(-1, 3)).query(center)[0] > distance * spacing
    assert area[is_far].sum() > 0.4 * area.sum()
    is_even = np.abs(ratio[is_far] - 1) <= tolerance
    return float((is_even * area[is_far, None]).sum(axis=0).min() / area[is_far].sum())


def _metric(tree: Any) -> tuple[np.ndarray, np.ndarray]:
    """(L, 2, 2) inverses of the scalar products of the sides at corner 0, and (L,) areas."""
    points = tree.vertices[tree.leaf_vertex]
    sides = points[:, 1:] - points[:, :1]
    gram = np.einsum("lai,lbi->lab", sides, sides)
    area = 0.5 * np.sqrt(np.maximum(np.linalg.det(gram), 0))
    return np.linalg.inv(gram), area

"""Distances between evenly spaced lines, measured on the surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree


def gradients(lines: Any) -> np.ndarray:
    """Return the (L, M, 3) gradients of the phases in the triangles, in lines per unit of length."""
    points = lines.tree.vertices[lines.tree.leaf_vertex]
    sides = points[:, 1:] - points[:, :1]
    change = lines.pattern.phase[..., 1:].astype(float) - lines.pattern.phase[..., :1]
    return np.einsum("lia,lma->lmi", np.linalg.pinv(sides), change)


def spacing_ratios(lines: Any, spacing: float) -> np.ndarray:
    """Return the (L, M) distances between lines in the triangles, relative to the one asked for."""
    gradient = np.linalg.norm(gradients(lines), axis=2)
    return 1 / (np.maximum(gradient, 1e-15) * spacing)  # 0 where the field is undefined


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
    ratio = spacing_ratios(lines, spacing)
    points = lines.tree.vertices[lines.tree.leaf_vertex]
    sides, center = points[:, 1:] - points[:, :1], points.mean(axis=1)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    ends = center[(lines.pattern.index != 0).any(axis=1)]
    is_far = cKDTree(ends.reshape(-1, 3)).query(center)[0] > distance * spacing
    assert area[is_far].sum() > 0.4 * area.sum()
    is_even = np.abs(ratio[is_far] - 1) <= tolerance
    return float((is_even * area[is_far, None]).sum(axis=0).min() / area[is_far].sum())

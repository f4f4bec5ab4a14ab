"""What the clipping planes of a 3D view cut away."""

from __future__ import annotations

import numpy as np


def is_cut_away(points: np.ndarray, clip_planes: np.ndarray | None) -> np.ndarray:
    """Return which points are on the negative side of a plane.

    Parameters
    ----------
    points : (n, 3) ndarray
    clip_planes : (6, 4) ndarray or None
        In the space of the points. None cuts nothing away.

    Returns
    -------
    (n,) bool ndarray
    """
    if clip_planes is None:
        return np.zeros(len(points), dtype=bool)
    return ((points @ clip_planes[:, :3].T + clip_planes[:, 3]) < 0).any(axis=1)

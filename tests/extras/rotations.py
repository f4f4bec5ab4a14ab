"""Fields in closed form."""

from __future__ import annotations

import numpy as np


def rotation(points: np.ndarray) -> np.ndarray:
    """(n, 3) velocities of the rotation about z, tangent to every surface of revolution about z."""
    return np.stack([-points[:, 1], points[:, 0], np.zeros(len(points))], axis=1)

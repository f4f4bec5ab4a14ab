"""Fields in closed form, and angles between fields."""

from __future__ import annotations

import numpy as np


def rotation(points: np.ndarray) -> np.ndarray:
    """(n, 3) velocities of the rotation about z, tangent to every surface of revolution about z."""
    return np.stack([-points[:, 1], points[:, 0], np.zeros(len(points))], axis=1)


def angle_between_lines(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n,) angles in degrees between (n, 3) vectors and their opposites."""
    cosine = np.abs((first * second).sum(axis=1))
    cosine /= np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return np.degrees(np.arccos(np.minimum(cosine, 1)))

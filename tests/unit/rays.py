"""Intersections of all rays with all triangles."""

import numpy as np


def ray_intersections(
    origin: np.ndarray, direction: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where lines meet the planes of triangles (Möller and Trumbore).

    Parameters
    ----------
    origin, direction : (R, 3) ndarray
    triangles : (T, 3, 3) ndarray
        Their corners.

    Returns
    -------
    barycentric : (R, T, 3) ndarray
        All are at least 0 on the triangle. Not finite if the line is parallel to the plane.
    distance : (R, T) ndarray
        In lengths of the direction, negative behind the origin.
    """
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    origin, direction = origin[:, None], direction[:, None]
    p, q = np.cross(direction, v), np.cross(origin - a, u)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / (u * p).sum(axis=2)
        s = ((origin - a) * p).sum(axis=2) * inverse
        t = (q * direction).sum(axis=2) * inverse
        return np.stack([1 - s - t, s, t], axis=2), (v * q).sum(axis=2) * inverse

"""Choose points of a picture that keep a distance from each other."""

from __future__ import annotations

import numpy as np


def spaced_points(position: np.ndarray, spacing: float, frame: tuple[int, int]) -> np.ndarray:
    """Choose points, first come first served, with at least a distance between any two.

    Parameters
    ----------
    position : (n, 2) float64 ndarray
        In the frame, pixels from the lower left, in order of preference.
    spacing : float
        Pixels.
    frame : (int, int)
        Width and height, pixels.

    Returns
    -------
    (K,) intp ndarray
        The chosen points, in ascending order.

    Notes
    -----
    A cell of the grid, with a diagonal of the spacing, has one point at most. In each round all points are chosen
    that come first in the 5 x 5 cells around them, and those near them are left out. The result is that
    of taking one point after the other.
    """
    side = spacing / np.sqrt(2.0)
    columns, rows = (int(length / side) + 5 for length in frame)
    column, row = (np.maximum(position, 0.0) / side).astype(np.intp).T
    cell = np.minimum(row + 2, rows - 1) * columns + np.minimum(column + 2, columns - 1)
    around = [dy * columns + dx for dy in range(-2, 3) for dx in range(-2, 3)]
    # Cells around those at the border are beyond the ends, where nothing is.
    cell += 2 * columns + 2
    cell_count = (rows + 4) * columns + 8
    count = len(position)
    chosen = []
    left = np.arange(count)
    while len(left):
        first = np.full(cell_count, count)
        first[cell[left[::-1]]] = left[::-1]
        candidate = left[first[cell[left]] == left]
        earliest = np.min([first[cell[candidate] + offset] for offset in around], axis=0)
        new = candidate[earliest == candidate]
        chosen.append(new)
        taken = np.full(cell_count, -1)
        taken[cell[new]] = new
        is_near = np.zeros(len(left), dtype=bool)
        for offset in around:
            other = taken[cell[left] + offset]
            step = position[left] - position[other]
            is_near |= (other >= 0) & ((step * step).sum(axis=1) < spacing**2)
        left = left[~is_near]
    return np.sort(np.concatenate(chosen)) if chosen else np.empty(0, dtype=np.intp)

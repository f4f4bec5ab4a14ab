"""Choose points of a picture, or in space, that keep a distance from each other."""

from __future__ import annotations

from itertools import product

import numpy as np


def spaced_points(position: np.ndarray, spacing: float) -> np.ndarray:
    """Choose points, first come first served, with at least a distance between any two.

    Parameters
    ----------
    position : (n, d) float64 ndarray
        In order of preference.
    spacing : float

    Returns
    -------
    (K,) intp ndarray
        The chosen points, in ascending order.

    Notes
    -----
    A cell of the grid, with a diagonal of the spacing, has one point at most. In each round all points are chosen
    that come first in the 5^d cells around them, and those near them are left out. The result is that
    of taking one point after the other.
    """
    count, dimension = position.shape
    if not count:
        return np.empty(0, dtype=np.intp)
    cell, around = _cells(position, spacing / np.sqrt(dimension))
    cell_count = around.shape[1]
    chosen = []
    left = np.arange(count)
    while len(left):
        first = np.full(cell_count + 1, count)
        first[cell[left[::-1]]] = left[::-1]
        candidate = left[first[cell[left]] == left]
        earliest = np.full(len(candidate), count)
        for neighbor in around:
            np.minimum(earliest, first[neighbor[cell[candidate]]], out=earliest)
        new = candidate[earliest == candidate]
        chosen.append(new)
        taken = np.full(cell_count + 1, -1)
        taken[cell[new]] = new
        for neighbor in around:
            other = taken[neighbor[cell[left]]]
            near = np.flatnonzero(other >= 0)
            if not len(near):
                continue
            step = position[left[near]] - position[other[near]]
            is_near = (step * step).sum(axis=1) < spacing**2
            left = np.delete(left, near[is_near])
    return np.sort(np.concatenate(chosen))


def _cells(position: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Sort points into cells of a grid.

    Returns
    -------
    cell : (n,) intp ndarray
        The cell of each point, among the C cells that have points.
    around : (5^d, C) intp ndarray
        The cells around each of them, itself first; C where there is none.
    """
    index = ((position - position.min(axis=0)) / side).astype(np.int64) + 2
    stride = np.cumprod([1, *(index.max(axis=0) + 3)])[:-1]
    key, cell = np.unique(index @ stride, return_inverse=True)
    steps = np.array(list(product(range(-2, 3), repeat=position.shape[1])))
    steps = steps[np.argsort(np.abs(steps).sum(axis=1), kind="stable")]
    around = np.empty((len(steps), len(key)), dtype=np.intp)
    for step, out in zip(steps @ stride, around, strict=True):
        place = np.minimum(np.searchsorted(key, key + step), len(key) - 1)
        out[:] = np.where(key[place] == key + step, place, len(key))
    return cell.reshape(-1), around

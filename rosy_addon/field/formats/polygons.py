"""Vertices and polygons as flat arrays: the result of every mesh reader."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Polygons(NamedTuple):
    """Vertices and polygons, in the order of the file.

    Attributes
    ----------
    vertices : (V, 3) float64 ndarray
        Positions in object space.
    corner_vertex : (C,) int64 ndarray
        Index of the vertex of each corner, counted from 0.
    face_start : (F + 1,) int64 ndarray
        The corners of face f are ``face_start[f] .. face_start[f + 1] - 1``.
    """

    vertices: np.ndarray
    corner_vertex: np.ndarray
    face_start: np.ndarray

    @property
    def face_count(self) -> int:
        """F, the number of polygons."""
        return len(self.face_start) - 1


def offsets_from_sizes(sizes: np.ndarray | list[int]) -> np.ndarray:
    """(n + 1,) int64 offsets of n consecutive ranges of these sizes; the last is the total size.

    Examples
    --------
    >>> offsets_from_sizes([3, 4, 3])
    array([ 0,  3,  7, 10])
    """
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

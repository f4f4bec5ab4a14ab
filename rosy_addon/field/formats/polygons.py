"""What every mesh format gives: vertices and polygons as flat arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Polygons(NamedTuple):
    """Vertices and polygons, in the order of the file.

    Attributes
    ----------
    vertices : (V, 3) float64 ndarray
    corner_vertex : (C,) int64 ndarray
        Vertex of each corner, from 0.
    face_start : (F + 1,) int64 ndarray
        The corners of face f are ``face_start[f] .. face_start[f + 1] - 1``.
    """

    vertices: np.ndarray
    corner_vertex: np.ndarray
    face_start: np.ndarray

    @property
    def face_count(self) -> int:
        """F."""
        return len(self.face_start) - 1


def starts_of(sizes: np.ndarray | list[int]) -> np.ndarray:
    """(n + 1,) int64: where each of n stretches of these sizes starts, and the end of the last."""
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

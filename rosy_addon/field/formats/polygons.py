"""The results of file readers: polygons as flat arrays, and the unchecked contents of a field file."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class Polygons(NamedTuple):
    """The vertices and polygons of a mesh file, as flat arrays in the order of the file.

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


@dataclass(frozen=True, eq=False)
class RawField:
    """The rows of a field file, not yet checked against a mesh.

    n is the number of rows, N the degree of the field.

    Attributes
    ----------
    values : (n, k, 3) float64 ndarray
        k vectors for each row of the file: one of the N member vectors (k = 1), all N directions (k = N), or
        the rows of a tensor (k = 3). Or (n, 1, 2): members as two numbers; see `vertex_frames.in_space`.
    degree : int or None
        N; None if the file does not state it. It is then k, unless k is 1.
    header_count : int or None
        Number of rows that the header declares; None if the header does not declare it.
    domain : {"face", "vertex"} or None
        The mesh elements to which the rows belong; None to infer it from the number of rows.
    tensors : bool
        Whether `values` are symmetric 3 x 3 tensors.
    polygons : Polygons or None
        The mesh, if the file contains one.
    """

    values: np.ndarray
    degree: int | None = None
    header_count: int | None = None
    domain: str | None = None
    tensors: bool = False
    polygons: Polygons | None = None

    @property
    def columns(self) -> int:
        """Count of numbers in each row of the file, such as 3 N for N vectors."""
        return int(np.prod(self.values.shape[1:]))


def offsets_from_sizes(sizes: np.ndarray | list[int]) -> np.ndarray:
    """Return (n + 1,) int64: where n consecutive ranges of these sizes start, and where the last one ends.

    Examples
    --------
    >>> offsets_from_sizes([3, 4, 3])
    array([ 0,  3,  7, 10])
    """
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

"""Unchecked contents of a field file: the result of every field reader."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .polygons import Polygons


@dataclass(frozen=True, eq=False)
class RawField:
    """The rows of a field file, not yet checked against a mesh.

    n is the number of rows, N the degree of the field.

    Attributes
    ----------
    values : (n, k, 3) float64 ndarray
        k vectors per row: one member (k = 1), all N directions (k = N), or the rows of a tensor
        (k = 3).
    degree : int or None
        N; None if the file does not state it.
    header_count : int or None
        Number of rows that the header declares; None if there is no such header.
    domain : {"face", "vertex"} or None
        The mesh elements that the rows belong to; None to infer them from the number of rows.
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
        """3 k, the count of numbers per row."""
        return int(np.prod(self.values.shape[1:]))

"""What a field file gives, before it is known whether it fits a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .polygons import Polygons


@dataclass(frozen=True, eq=False)
class Given:
    """Rows of a field file.

    Attributes
    ----------
    values : (n, k, 3) float64 ndarray
        k vectors a row: one member, or all N directions; or (n, 3, 3) tensors.
    degree : int or None
        N; None if the file does not say.
    says : int or None
        How many rows the file says it has.
    domain : {"face", "vertex"} or None
        What they belong to; None if that is told by their number.
    tensors : bool
    polygons : Polygons or None
        The mesh, of files that hold one.
    """

    values: np.ndarray
    degree: int | None = None
    says: int | None = None
    domain: str | None = None
    tensors: bool = False
    polygons: Polygons | None = None

    @property
    def columns(self) -> int:
        """Numbers a row."""
        return int(np.prod(self.values.shape[1:]))

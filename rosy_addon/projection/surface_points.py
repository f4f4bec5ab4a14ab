"""Points on the surfaces of mesh instances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class SurfacePoints(NamedTuple):
    """P points on mesh instances.

    Attributes
    ----------
    instance_id : (P,) int32 ndarray
        Index of the mesh instance.
    triangle : (P,) int32 ndarray
        Index of the triangle of the instance's surface.
    barycentric : (P, 3) float64 ndarray
        Barycentric coordinates of the point in that triangle.
    """

    instance_id: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray

    def part(self, chosen: np.ndarray) -> SurfacePoints:
        """Return the points that a mask or an array of indices selects."""
        return SurfacePoints(*(column[chosen] for column in self))

    @staticmethod
    def of(instance_id: int, triangle: np.ndarray, barycentric: np.ndarray) -> SurfacePoints:
        """Return points on one instance."""
        return SurfacePoints(
            np.full(len(triangle), instance_id, dtype=np.int32), triangle, barycentric
        )

    @staticmethod
    def concatenate(parts: list[SurfacePoints]) -> SurfacePoints:
        """Return the points of all parts, in their order."""
        return SurfacePoints(*(np.concatenate(column) for column in zip(*parts, strict=True)))

"""The tone of a surface, given at its corners or by an image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .mip_map import MipMap


@dataclass(frozen=True, eq=False)
class SurfaceTone:
    """The tone of a surface: painted, computed or from an image. Linear, 0 is dark, 1 is light.

    Attributes
    ----------
    values : (C, 1) or (C, 2) float32 ndarray
        At the C corners of the surface. Without an image the tone, shape (C, 1). With an image the
        texture coordinates u and v, shape (C, 2).
    image : (H, W) float32 ndarray or None
        Tones. The bottom row is first.
    """

    values: np.ndarray
    image: np.ndarray | None = None

    @cached_property
    def mip_map(self) -> MipMap:
        """The mip map of the image. Only valid if there is an image."""
        return MipMap(self.image)

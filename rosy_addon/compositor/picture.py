"""The finished picture and the layers it was made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Picture:
    """An image of a field, rows from the bottom as in Blender.

    Attributes
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear light, not premultiplied; alpha is 0 where no field is seen. At supersampling 1 all
        covered pixels have alpha 1.
    layers : dict of str to ndarray
        What it was made of, over the P visible pixels *before* supersampling is averaged away:
        ``pixel`` (P,) int32 indices into the (supersampled) frame; ``members`` (M, P, K) float32,
        the LIC of each member field in display values around 0.5, before contrast correction, K
        being 1 or 3 channels; ``tone`` (P, K) float32, the blend after correction and gain, not
        clipped; ``samples`` (P,) float32, mean number of samples of a pixel's streamlines;
        ``weight`` (P,) float32, the share of the first set of images; ``shading`` (P,) float32.
    """

    rgba: np.ndarray
    layers: dict[str, np.ndarray]

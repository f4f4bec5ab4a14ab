"""The finished picture and the layers it was made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .images import Images


@dataclass(frozen=True, eq=False)
class Layers:
    """What the pixels of one degree were made of, before supersampling is averaged away.

    Attributes
    ----------
    degree : int
    pixel : (P,) int32 ndarray
        Flat indices into the (supersampled) frame.
    images : Images
        The LIC of each member and their blend, around 0.5, before contrast correction.
    tone : (P, K) float32 ndarray
        The blend after contrast correction and gain: display values, not clipped.
    """

    degree: int
    pixel: np.ndarray
    images: Images
    tone: np.ndarray


@dataclass(frozen=True, eq=False)
class Picture:
    """An image of a field, rows from the bottom as in Blender.

    Attributes
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear light, not premultiplied. Alpha is the part of the pixel where a field is seen.
    layers : tuple of Layers
        One a degree that is seen, in ascending order.
    """

    rgba: np.ndarray
    layers: tuple[Layers, ...]

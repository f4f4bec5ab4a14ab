"""The tone of a surface, given at its corners or by an image. The image is sampled from a mip map."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


class MipMap:
    """An image at full resolution, half, a quarter and so on, down to a single pixel.

    Parameters
    ----------
    image : (H, W) float ndarray
        The bottom row is first.

    Attributes
    ----------
    levels : list of (h, w) float32 ndarray
        From full resolution to a single pixel. Odd sizes are rounded up.
    """

    def __init__(self, image: np.ndarray) -> None:
        self.levels = [np.ascontiguousarray(image, dtype=np.float32)]
        while self.levels[-1].size > 1:
            self.levels.append(_downsample(self.levels[-1]))

    def sample(
        self, u: np.ndarray, v: np.ndarray, level: np.ndarray, *, repeat: bool
    ) -> np.ndarray:
        """Sample the image: bilinear within a level, nearest between levels.

        Parameters
        ----------
        u, v : (n,) ndarray
            Texture coordinates, from 0 to 1 over the width and the height.
        level : (n,) ndarray
            Mip level, 0 for full resolution. Rounded to the nearest level that exists.
        repeat : bool
            Whether the image repeats beyond its borders. Otherwise coordinates are clamped.

        Returns
        -------
        (n,) float32 ndarray
        """
        result = np.empty(len(u), dtype=np.float32)
        level_index = np.clip(np.rint(level), 0, len(self.levels) - 1).astype(np.int32)
        for index in np.flatnonzero(np.bincount(level_index)).tolist():
            selected = np.flatnonzero(level_index == index)
            image = self.levels[index]
            result[selected] = _sample_bilinear(image, u[selected], v[selected], repeat)
        return result


def _downsample(image: np.ndarray) -> np.ndarray:
    """Halve an image by averaging 2 x 2 pixels; an odd last row or column is repeated."""
    height, width = image.shape
    added = [(0, size % 2 if size > 1 else 0) for size in (height, width)]
    result = np.pad(image, added, "edge")
    if height > 1:
        result = 0.5 * (result[::2] + result[1::2])
    if width > 1:
        result = 0.5 * (result[:, ::2] + result[:, 1::2])
    return result.astype(np.float32)


def _sample_bilinear(image: np.ndarray, u: np.ndarray, v: np.ndarray, repeat: bool) -> np.ndarray:
    """Interpolate (n,) values bilinearly between the pixel centers of one (h, w) image.

    `u` and `v` are texture coordinates, from 0 to 1 over the width and the height. If `repeat` is false, they
    are clamped.
    """
    height, width = image.shape
    neighbors, fractions = [], []
    for position, size in ((v, height), (u, width)):
        position = position - np.floor(position) if repeat else np.clip(position, 0, 1)
        position = position * size - 0.5
        first = np.floor(position)
        fractions.append((position - first).astype(np.float32))
        first = first.astype(np.intp)
        for index in (first, first + 1):
            neighbors.append(index % size if repeat else np.clip(index, 0, size - 1))
    low, high, left, right = neighbors
    fraction_y, fraction_x = fractions
    below = image[low, left] * (1 - fraction_x) + image[low, right] * fraction_x
    above = image[high, left] * (1 - fraction_x) + image[high, right] * fraction_x
    return below * (1 - fraction_y) + above * fraction_y


@dataclass(frozen=True, eq=False)
class SurfaceTone:
    """The tone of a surface: painted, computed or from an image. Linear, 0 is dark, 1 is light.

    Attributes
    ----------
    values : (C, 1) or (C, 2) float32 ndarray
        Values at the C corners of the surface. Without an image, they are tones, shape (C, 1). With an
        image, they are texture coordinates u and v, shape (C, 2).
    image : (H, W) float32 ndarray or None
        Image of tones. The bottom row is first.
    """

    values: np.ndarray
    image: np.ndarray | None = None

    @cached_property
    def mip_map(self) -> MipMap:
        """The mip map of the image. Only valid if there is an image."""
        return MipMap(self.image)

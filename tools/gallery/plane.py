"""Make planar fields, and draw them."""

from collections.abc import Callable

import numpy as np

from rosy_addon.compositor.look import Look
from tests.harness.planar import PlanarPicture, compose_planar

from .sheet import display

#: A planar field of degree N: a function from points x + i y, in pixels from the center of the picture, to
#: the N-th power z of a member as a complex number.
PlanarField = Callable[[np.ndarray], np.ndarray]


def points(size: int, supersampling: int = 1) -> np.ndarray:
    """Return the pixel centers of a square picture as complex numbers, relative to its center.

    The array has `size` times `supersampling` rows and columns, the first row at the bottom.
    """
    axis = (np.arange(size * supersampling) + 0.5) / supersampling - size / 2
    return axis + 1j * axis[:, None]


def singularity(index: int) -> PlanarField:
    """Return a field of any degree N with a singularity of index `index` / N in the center."""
    return lambda p: (p / np.abs(p)) ** index


def compose_field(field: PlanarField, degree: int, size: int, look: Look) -> PlanarPicture:
    """Draw a field without supersampling.

    Return the picture with its layer, the images that it is made of.
    """
    z = field(points(size))
    return compose_planar(np.angle(z) / degree, degree, look, np.abs(z))


def draw_field(
    field: PlanarField, degree: int, size: int, look: Look, supersampling: int = 2
) -> np.ndarray:
    """Draw a field with supersampling, and return the picture, (size, size, 3) uint8."""
    z = field(points(size, supersampling))
    rgba = compose_planar(
        np.angle(z) / degree, degree, enlarged(look, supersampling), np.abs(z)
    ).rgba
    return display(rgba.reshape(size, supersampling, size, supersampling, 4).mean(axis=(1, 3)))


def enlarged(look: Look, supersampling: int) -> Look:
    """Return a look whose lengths in pixels are multiplied by the supersampling."""
    lengths = ("length", "line_width", "high_pass")
    return look.with_settings({name: getattr(look, name) * supersampling for name in lengths})


def averaged(values: np.ndarray, size: int, supersampling: int, index: int = 0) -> np.ndarray:
    """Return one channel of the (P, K) values of a supersampled picture, averaged to (size, size) pixels."""
    return values[:, index].reshape(size, supersampling, size, supersampling).mean(axis=(1, 3))


def channel(values: np.ndarray, size: int, index: int = 0) -> np.ndarray:
    """Return one channel of the (P, K) values of a planar picture as a (size, size) array."""
    return values[:, index].reshape(size, size)

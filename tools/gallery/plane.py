"""Planar fields, and pictures of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rosy_addon.compositor.look import Look
from tests.harness.planar import PlanarPicture, compose_planar

from .sheet import display

#: A function from points x + i y, in pixels from the center of the picture, to z.
PlanarField = Callable[[np.ndarray], np.ndarray]


def points(size: int, supersampling: int = 1) -> np.ndarray:
    """Return the pixel centers of a square as complex numbers, relative to its center.

    The array has `size` times `supersampling` rows and columns, the first row at the bottom.
    """
    axis = (np.arange(size * supersampling) + 0.5) / supersampling - size / 2
    return axis + 1j * axis[:, None]


def singularity(index: int) -> PlanarField:
    """Return a field with a singularity of index `index` / N in the center."""
    return lambda p: (p / np.abs(p)) ** index


def compose_field(field: PlanarField, degree: int, size: int, look: Look) -> PlanarPicture:
    """Draw the picture of a field and its layer, without supersampling."""
    z = field(points(size))
    return compose_planar(np.angle(z) / degree, degree, look, np.abs(z))


def draw_field(
    field: PlanarField, degree: int, size: int, look: Look, supersampling: int = 2
) -> np.ndarray:
    """Return a picture of a field, (size, size, 3) uint8, supersampled in each direction."""
    z = field(points(size, supersampling))
    rgba = compose_planar(
        np.angle(z) / degree, degree, enlarged(look, supersampling), np.abs(z)
    ).rgba
    return display(rgba.reshape(size, supersampling, size, supersampling, 4).mean(axis=(1, 3)))


def enlarged(look: Look, supersampling: int) -> Look:
    """Return a look with its lengths in the pixels of a supersampled picture."""
    lengths = ("length", "line_width", "high_pass")
    return look.with_settings({name: getattr(look, name) * supersampling for name in lengths})


def averaged(values: np.ndarray, size: int, supersampling: int, index: int = 0) -> np.ndarray:
    """Return one channel, (size, size), of the (P, K) values of a supersampled picture."""
    return values[:, index].reshape(size, supersampling, size, supersampling).mean(axis=(1, 3))


def channel(values: np.ndarray, size: int, index: int = 0) -> np.ndarray:
    """Return one channel, (size, size), of the (P, K) values of a planar picture."""
    return values[:, index].reshape(size, size)

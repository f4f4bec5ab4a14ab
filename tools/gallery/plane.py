"""Planar fields, and pictures of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rosy_addon.compositor.compose import compose_planar
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.picture import Picture

from .sheet import display

#: A function from points x + i y, in pixels from the center of the picture, to z.
PlanarField = Callable[[np.ndarray], np.ndarray]


def points(size: int, finer: int = 1) -> np.ndarray:
    """(size * finer,) * 2 complex centers of the pixels of a square, relative to its center."""
    along = (np.arange(size * finer) + 0.5) / finer - size / 2
    return along + 1j * along[:, None]


def singularity(index: int) -> PlanarField:
    """Return a field with a singularity of index `index` / N in the center."""
    return lambda p: (p / np.abs(p)) ** index


def compose_field(field: PlanarField, degree: int, size: int, look: Look) -> Picture:
    """Draw the picture of a field and its layers, without supersampling."""
    z = field(points(size))
    return compose_planar(np.angle(z) / degree, degree, look, np.abs(z))


def draw_field(
    field: PlanarField, degree: int, size: int, look: Look, finer: int = 2
) -> np.ndarray:
    """Draw (size, size, 3) uint8, supersampled `finer` times in each direction."""
    z = field(points(size, finer))
    rgba = compose_planar(np.angle(z) / degree, degree, enlarged(look, finer), np.abs(z)).rgba
    return display(rgba.reshape(size, finer, size, finer, 4).mean(axis=(1, 3)))


def enlarged(look: Look, finer: int) -> Look:
    """Return a look with its lengths in pixels of a picture that is `finer` times larger."""
    lengths = ("length", "grain", "high_pass")
    return look.with_settings({name: getattr(look, name) * finer for name in lengths})


def averaged(values: np.ndarray, size: int, finer: int, number: int = 0) -> np.ndarray:
    """(size, size) one channel of the (P, K) values of a picture that is `finer` times larger."""
    return values[:, number].reshape(size, finer, size, finer).mean(axis=(1, 3))


def channel(values: np.ndarray, size: int, number: int = 0) -> np.ndarray:
    """(size, size) one channel of the (P, K) values of a planar picture."""
    return values[:, number].reshape(size, size)

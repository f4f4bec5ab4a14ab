"""Planar fields, and pictures of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rosy_addon.compositor.compose import compose_planar
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.picture import Picture

from .sheet import display

#: The representation z at points x + i y, in pixels from the middle of the picture.
PlanarField = Callable[[np.ndarray], np.ndarray]


def points(size: int, finer: int = 1) -> np.ndarray:
    """(size * finer,) * 2 complex centers of the pixels of a square, counted from its middle."""
    along = (np.arange(size * finer) + 0.5) / finer - size / 2
    return along + 1j * along[:, None]


def singularity(index: int) -> PlanarField:
    """A field whose members turn by `index` / N around the middle."""
    return lambda p: (p / np.abs(p)) ** index


def compose_field(field: PlanarField, degree: int, size: int, look: Look) -> Picture:
    """The picture of a field and its layers, without supersampling."""
    z = field(points(size))
    return compose_planar(np.angle(z) / degree, degree, look, np.abs(z))


def draw_field(
    field: PlanarField, degree: int, size: int, look: Look, finer: int = 2
) -> np.ndarray:
    """(size, size, 3) uint8: drawn `finer` times as large each way and averaged."""
    z = field(points(size, finer))
    rgba = compose_planar(np.angle(z) / degree, degree, enlarged(look, finer), np.abs(z)).rgba
    return display(rgba.reshape(size, finer, size, finer, 4).mean(axis=(1, 3)))


def enlarged(look: Look, finer: int) -> Look:
    """A look with its lengths in the pixels of a picture `finer` times as large."""
    lengths = ("length", "grain", "high_pass")
    return look.with_settings({name: getattr(look, name) * finer for name in lengths})


def averaged(values: np.ndarray, size: int, finer: int, number: int = 0) -> np.ndarray:
    """(size, size) one channel of (P, K) values of a picture `finer` times as large."""
    return values[:, number].reshape(size, finer, size, finer).mean(axis=(1, 3))


def channel(values: np.ndarray, size: int, number: int = 0) -> np.ndarray:
    """(size, size) one channel of the (P, K) values of a planar picture."""
    return values[:, number].reshape(size, size)

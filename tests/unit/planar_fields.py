"""Planar fields with known singularities, for tests of the compositor."""

import numpy as np

from rosy_addon.compositor.look import Look

#: Settings that choose a kernel.
KERNELS = {"box": {}, "taper": {"fade": "ends"}, "ramp": {"fade": "tail"}}


#: The noise of the paper, the contrast of one member, and no light.
PLAIN = Look(gain=1.0, density=0.5, high_pass=0.0, shading=0.0)


def plain(**settings) -> Look:
    """The plain look with some settings changed."""
    return PLAIN.with_settings(settings)


def kernel_window(length: int, kernel: str) -> np.ndarray:
    """(2 length + 1,) weights of the samples of a streamline, along it from end to end."""
    offset = np.arange(-length, length + 1)
    distance = {"box": 0 * offset, "taper": np.abs(offset), "ramp": offset}[kernel]
    return 1 - distance / (length + 1)


def pixel_centers(size: int) -> tuple[np.ndarray, np.ndarray]:
    """(size, size) x and y of pixel centers, rows from the bottom."""
    y, x = np.mgrid[0:size, 0:size] + 0.5
    return x, y


def pair_angle(x: np.ndarray, y: np.ndarray, size: int, degree: int) -> np.ndarray:
    """Angle of a degree-N field with singularities of index 1/N and -1/N."""
    plus = np.arctan2(y - 0.5 * size, x - 0.33 * size)
    minus = np.arctan2(y - 0.5 * size, x - 0.67 * size)
    return (plus - minus) / degree + 0.3


def swirl_angle(x: np.ndarray, y: np.ndarray, size: int) -> np.ndarray:
    """Angle of a smooth vector field without zeros, whose direction varies everywhere."""
    return 0.5 + np.sin(2 * np.pi * x / size) + np.cos(2 * np.pi * y / size)

"""Choice of the LIC method by the settings of a look, and the noise that is convolved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..memory import raise_mmap_threshold
from ..progress import progress
from .band import Band
from .brute_force import brute_force
from .fast_lic import compute_fast_lic, fast_lic_lengths
from .flow import noise_channel_count
from .ibfv import ibfv, ibfv_lengths
from .image_noise import compute_image_noise
from .lic_images import LicImages
from .look import Look
from .member_decomposition import member_decomposition
from .pixel_field import PixelField

#: LIC methods by the value of `Look.method`.
METHODS: dict[str, Callable[[PixelField, Look, np.ndarray], LicImages]] = {
    "members": member_decomposition,
    "brute": brute_force,
    "sheets": compute_fast_lic,
    "ibfv": ibfv,
}


def lic(field: PixelField, look: Look, noise: np.ndarray | None = None) -> LicImages:
    """Average noise along the streamlines of each member, with the method of the look.

    Parameters
    ----------
    field : PixelField
    look : Look
        In pixels of the frame.
    noise : (P, K) float32 ndarray, optional
        By default `look_noise(field, look)`.

    Returns
    -------
    LicImages
    """
    (images,) = lic_lengths(field, [look], noise)
    return images


def lic_lengths(
    field: PixelField,
    looks: Sequence[Look],
    noise: np.ndarray | None = None,
    band: Band | None = None,
    name: str = "",
) -> list[LicImages]:
    """Do the same as `lic` for looks that differ in the length of streamlines, longest first.

    The images may be those of a band of the picture; see `compute_fast_lic`.
    """
    raise_mmap_threshold()
    look = looks[0]
    if noise is None:
        with progress(0.0):
            noise = look_noise(field, look)
    if look.method == "sheets":
        return fast_lic_lengths(field, looks, noise, band, name)
    if look.method == "ibfv":
        return ibfv_lengths(field, looks, noise)
    images = []
    for each in looks:
        images.append(METHODS[look.method](field, each, noise))
    return images


def look_noise(field: PixelField, look: Look) -> np.ndarray:
    """(P, K) float32 image-space noise of a look at the pixels of a field."""
    return compute_image_noise(field.pixel, field.width, **noise_args(look))


def noise_args(look: Look) -> dict[str, Any]:
    """Return the noise settings of a look as parameters of `image_noise` and `surface_noise`."""
    return {
        "grain": look.grain,
        "seed": look.seed,
        "channels": noise_channel_count(look),
        "density": look.density,
        "high_pass": look.high_pass,
    }

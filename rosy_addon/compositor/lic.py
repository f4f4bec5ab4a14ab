"""Choice of the LIC method by the settings of a look, and the noise that is convolved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.memory import raise_mmap_threshold
from ..core.progress import progress
from .fast_lic import fast_lic
from .flow import noise_channel_count
from .ibfv import streak_waves, wave_images
from .image_noise import image_noise
from .lic_images import LicImages
from .look import Look
from .member_decomposition import member_decomposition
from .per_pixel_lic import brute_force
from .pixel_field import PixelField
from .strips import Strip


def lic_lengths(
    field: PixelField, looks: Sequence[Look], noise: np.ndarray, strip: Strip | None = None
) -> list[LicImages]:
    """Average noise along the streamlines of each member, with the method of the looks.

    Parameters
    ----------
    field : PixelField
    looks : sequence of Look
        In pixels of the frame. They differ in the length of streamlines. The first is the longest.
    noise : (P, K) float32 ndarray
    strip : Strip, optional
        With the method "sheets", the images are those at its `averaged_rows`.

    Returns
    -------
    list of LicImages
        Of each look.
    """
    raise_mmap_threshold()
    method = looks[0].method
    if method == "sheets":
        return fast_lic(field, looks, noise, strip)
    if method == "ibfv":
        return wave_images(streak_waves(field, looks, noise), looks)
    convolve = member_decomposition if method == "members" else brute_force
    images = []
    for number, look in enumerate(looks):
        with progress(number / len(looks), (number + 1) / len(looks)):
            images.append(convolve(field, look, noise))
    return images


def look_noise(field: PixelField, look: Look) -> np.ndarray:
    """(P, K) float32 image-space noise of a look at the pixels of a field."""
    return image_noise(field.pixel, field.width, **noise_args(look))


def noise_args(look: Look) -> dict[str, Any]:
    """Return the noise settings of a look as parameters of `image_noise` and `surface_noise`."""
    return {
        "cell": look.line_width,
        "seed": look.seed,
        "channels": noise_channel_count(look),
        "density": look.density,
        "high_pass": look.high_pass,
    }

"""Choice of the LIC method by the settings of a look, and the noise that is convolved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..memory import raise_mmap_threshold
from ..progress import Task, run_to_completion, subtask
from .band import Band
from .brute_force import brute_force_task
from .fast_lic import fast_lic_lengths_task, fast_lic_task
from .flow import noise_channel_count
from .ibfv import ibfv_lengths_task, ibfv_task
from .image_noise import image_noise_task
from .lic_images import LicImages
from .look import Look
from .member_decomposition import member_decomposition_task
from .pixel_field import PixelField

#: LIC methods by the value of `Look.method`.
METHODS: dict[str, Callable[[PixelField, Look, np.ndarray], Task[LicImages]]] = {
    "members": member_decomposition_task,
    "brute": brute_force_task,
    "sheets": fast_lic_task,
    "ibfv": ibfv_task,
}


def lic_task(field: PixelField, look: Look, noise: np.ndarray | None = None) -> Task[LicImages]:
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
    (images,) = yield from lic_lengths_task(field, [look], noise)
    return images


def lic_lengths_task(
    field: PixelField,
    looks: Sequence[Look],
    noise: np.ndarray | None = None,
    band: Band | None = None,
    name: str = "",
) -> Task[list[LicImages]]:
    """Do the same as `lic_task` for looks that differ in the length of streamlines, longest first.

    The images may be those of a band of the picture; see `fast_lic_task`.
    """
    raise_mmap_threshold()
    look = looks[0]
    if noise is None:
        noise = yield from subtask(look_noise_task(field, look), 0.0, 0.0)
    if look.method == "sheets":
        return (yield from fast_lic_lengths_task(field, looks, noise, band, name))
    if look.method == "ibfv":
        return (yield from ibfv_lengths_task(field, looks, noise))
    images = []
    for each in looks:
        images.append((yield from METHODS[look.method](field, each, noise)))
    return images


def look_noise(field: PixelField, look: Look) -> np.ndarray:
    """(P, K) float32 image-space noise of a look at the pixels of a field."""
    return run_to_completion(look_noise_task(field, look))


def look_noise_task(field: PixelField, look: Look) -> Task[np.ndarray]:
    """Do the same as `look_noise`, in steps."""
    return image_noise_task(field.pixel, field.width, **noise_args(look))


def noise_args(look: Look) -> dict[str, Any]:
    """Return the noise settings of a look as parameters of `image_noise` and `surface_noise`."""
    return {
        "grain": look.grain,
        "seed": look.seed,
        "channels": noise_channel_count(look),
        "density": look.density,
        "high_pass": look.high_pass,
    }

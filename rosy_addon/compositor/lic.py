"""Choice of the LIC method by the settings of a look, and the noise that is convolved."""

from collections.abc import Sequence

import numpy as np

from ..core.memory import raise_mmap_threshold
from ..core.progress import progress
from .fast_lic import fast_lic
from .flow import blend_channels, noise_channel_count
from .ibfv import streak_waves, wave_images
from .image_noise import NOISE_MEAN, NoiseSettings, image_noise
from .lic_images import LicImages
from .look import has_flow
from .look_units import PixelLook
from .per_pixel_lic import brute_force, member_decomposition
from .pixel_field import PixelField
from .strips import Strip


def lic_lengths(
    field: PixelField, looks: Sequence[PixelLook], noise: np.ndarray, strip: Strip | None = None
) -> list[LicImages]:
    """Compute LIC images: average noise along the streamlines of each member of the field.

    Parameters
    ----------
    field : PixelField
    looks : sequence of PixelLook
        They differ in the length of streamlines. The first has the greatest length. Their `method` says
        which module computes the images: "sheets" is `fast_lic`, "ibfv" is `ibfv`, and "members" and
        "brute" are in `per_pixel_lic`.
    noise : (P, K) float32 ndarray
        K channels of noise at the pixels, with the mean `NOISE_MEAN`.
    strip : Strip, optional
        Rows to draw. With the method "sheets", the images have the pixels of its `averaged_rows`; other
        methods draw all pixels.

    Returns
    -------
    list of LicImages
        One for each look.
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


def look_noise(field: PixelField, look: PixelLook) -> np.ndarray:
    """Return the (P, K) float32 image-space noise of a look at the pixels of a field."""
    return image_noise(field.pixel, field.width, noise_settings(look))


def unconvolved_noise(noise: np.ndarray, look: PixelLook) -> np.ndarray:
    """Return the noise that is shown where no LIC is done: (P, K), or (P, 1) if the look has flow."""
    if not has_flow(look):
        return noise
    mean = np.float32(NOISE_MEAN)
    return mean + blend_channels(noise - mean, look.flow_phase)


def noise_settings(look: PixelLook) -> NoiseSettings:
    """Return the settings of the noise that LIC averages along streamlines."""
    channels = noise_channel_count(look)
    return NoiseSettings(look.line_width, look.seed, channels, look.density, look.high_pass)

"""Stages between a G-buffer and a picture, with their cache: pixel field, noise, LIC images, outline."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..core.cache import Cache
from ..core.progress import progress
from ..projection.gbuffer import GBuffer
from ..projection.surface_sampling import feature_curvatures
from .even_lines import EvenLines, even_lines
from .ibfv import streak_waves, wave_images
from .image_noise import NoiseSettings
from .lic import lic_lengths, look_noise, noise_settings, unconvolved_noise
from .lic_images import LicImages
from .look import crease_angle_of, has_flow
from .look_units import PixelLook
from .outline import OUTLINE_SETTINGS, outline_coverage
from .paper_grain import picture_paper_grain, surface_paper_grain, surface_paper_grain_settings
from .pixel_field import PixelField, surface_pixel_field
from .streak_statistics import look_streak_statistics
from .strips import Strip
from .surface_noise import surface_noise
from .undirected import undirected_texture
from .wobble import has_wobble, rotate_pixel_field, wobble_angle

#: Fraction of the progress of LIC for making the noise.
NOISE_SHARE = 0.3


class ComposeStages:
    """The intermediate results of one G-buffer, computed once and stored in a cache.

    The key of a result contains the G-buffer and the settings that it depends on. A look that
    differs only in other settings reuses it.

    Parameters
    ----------
    gbuffer : GBuffer
    cache : Cache
        May be shared with other G-buffers.
    mesh_cache : Cache
        Stores results that do not depend on the camera.
    """

    def __init__(self, gbuffer: GBuffer, cache: Cache, mesh_cache: Cache) -> None:
        self._gbuffer, self._cache, self._mesh_cache = gbuffer, cache, mesh_cache

    def pixel_field(self, degree: int, look: PixelLook) -> PixelField:
        """Return the `PixelField` of one degree, with its directions rotated by the wobble of the look."""
        args = self._gbuffer, degree, crease_angle_of(look)
        create = partial(surface_pixel_field, *args)
        field = self._cache.get_or_create(("pixel field", *args), create)
        if not has_wobble(look):
            return field
        angle = self._wobble_angle(look)[field.gbuffer_index]
        return rotate_pixel_field(field, np.float32(look.wobble) * angle)

    def noise(self, field: PixelField, look: PixelLook) -> np.ndarray:
        """Return the (P, K) float32 noise of a look at the pixels of a field.

        It is anchored to the picture or to the surfaces. There are K channels (`noise_channel_count`), with
        the mean `NOISE_MEAN`.
        """
        if look.anchor == "surface":
            return self._surface_noise(field, look, noise_settings(look), look.detail)
        key = "picture noise", self._gbuffer, field.degree, noise_settings(look)
        return self._cache.get_or_create(key, partial(look_noise, field, look))

    def lic(
        self, field: PixelField, looks: Sequence[PixelLook], strip: Strip | None = None
    ) -> list[LicImages]:
        """Compute the LIC images of a field in the `averaged_rows` of a strip, or find them in the cache.

        `looks` must differ only in the length of streamlines, the longest first. `strip` is used only if the
        setting `method` of the looks is "sheets".
        """
        key = "LIC images", self._gbuffer, field.degree, strip, *(look.lic_key() for look in looks)
        return self._cache.get_or_create(key, partial(self._new_lic, field, looks, strip))

    def _new_lic(
        self, field: PixelField, looks: Sequence[PixelLook], strip: Strip | None
    ) -> list[LicImages]:
        """Compute LIC images that are not in the cache.

        With the method "ibfv" and flow, they are made from `ibfv.StreakWaves`, which are cached.
        """
        if looks[0].method != "ibfv" or not has_flow(looks[0]):
            return self._convolved(partial(lic_lengths, strip=strip), field, looks)
        # The waves are the same at all times and speeds; see `ibfv`.
        settings = replace(looks[0].look, flow=1.0)
        still = [replace(look, look=settings, flow_phase=0.0).lic_key() for look in looks]
        key = "streak waves", self._gbuffer, field.degree, *still
        compute = partial(self._convolved, streak_waves, field, looks)
        return wave_images(self._cache.get_or_create(key, compute), looks)

    def _convolved(
        self, convolve: Callable[..., Any], field: PixelField, looks: Sequence[PixelLook]
    ) -> Any:
        """Make the noise of a field, and return the result of `convolve` (a method of LIC) for it.

        `convolve` takes the field, the looks and the noise. The looks differ only in the length of
        streamlines.
        """
        with progress(0.0, NOISE_SHARE):
            noise = self.noise(field, looks[0])
        with progress(NOISE_SHARE, 1.0):
            return convolve(field, looks, noise)

    def undirected_texture(self, field: PixelField, look: PixelLook) -> np.ndarray | None:
        """Return the (P,) means of noise over discs where the field is undefined, which hatching draws there.

        They are relative to `NOISE_MEAN`, and NaN where the field is defined. None if it is defined
        everywhere.
        """
        if field.representation.all():
            return None
        noise = unconvolved_noise(self.noise(field, look), look)
        return undirected_texture(field, noise, look.line_width)

    def even_lines(self, field: PixelField, look: PixelLook) -> EvenLines:
        """Compute the evenly spaced lines of a field, or find them in the cache."""

        def compute() -> EvenLines:
            angle = self._wobble_angle(look)[field.gbuffer_index] if has_wobble(look) else None
            return even_lines(self._gbuffer, field, look, angle, self._mesh_cache)

        key = "even lines", self._gbuffer, field.degree, look.lic_key()
        return self._cache.get_or_create(key, compute)

    def outline(self, field: PixelField, look: PixelLook) -> np.ndarray:
        """Return the (P,) float32 coverage by outlines at the pixels of a field; see `outline_coverage`."""
        key = "outline", self._gbuffer, *(getattr(look, name) for name in OUTLINE_SETTINGS)
        compute = partial(outline_coverage, self._gbuffer, look, self._mesh_cache)
        return self._cache.get_or_create(key, compute)[field.gbuffer_index]

    def paper_grain(self, field: PixelField, look: PixelLook) -> np.ndarray:
        """Return the (M, P) heights of the paper grain for each of the M lines of the field.

        The mean is 0, the standard deviation 1.
        """
        lines, subpixels = field.line_count, look.supersampling
        if look.anchor == "picture":
            width = look.line_width / subpixels
            return picture_paper_grain(field.pixel, field.width, width, look.seed, subpixels, lines)
        noise = self._surface_noise(field, look, surface_paper_grain_settings(look))
        return surface_paper_grain(noise, look_streak_statistics(look).paper_grain_std, lines)

    def _surface_noise(
        self, field: PixelField, look: PixelLook, settings: NoiseSettings, detail: float = 0.0
    ) -> np.ndarray:
        """Return the (P, K) float32 noise anchored to surfaces, at the pixels of a field.

        `settings` are its cells and its K channels. Cells on small features are smaller by up to the fraction
        `detail`.
        """
        args = self._gbuffer, settings, look.pixel_size, look.supersampling, detail

        def compute() -> np.ndarray:
            curvature = feature_curvatures(self._gbuffer, self._mesh_cache) if detail else None
            return surface_noise(*args, curvature)

        return self._cache.get_or_create(("surface noise", *args), compute)[field.gbuffer_index]

    def _wobble_angle(self, look: PixelLook) -> np.ndarray:
        """Return the (Q,) float32 angle between drawn lines and the field at all Q pixels of the G-buffer.

        It is in radians, for a `Look.wobble` of 1.
        """
        size = look.line_width, look.pixel_size, look.supersampling
        key = "wobble", self._gbuffer, look.anchor, *size
        return self._cache.get_or_create(key, partial(wobble_angle, self._gbuffer, look))

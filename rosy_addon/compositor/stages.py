"""The cached stages between a G-buffer and a picture: pixel field, noise, LIC images, outline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..cache import Cache
from ..progress import Task, subtask
from ..projection.feature_curvatures import feature_curvatures_task
from ..projection.gbuffer import GBuffer
from .band import Band, drawn_pixels
from .even_lines import EvenLines, even_lines_task
from .flow import unconvolved_noise
from .ibfv import StreakWaves, streak_waves_task, wave_images_task
from .lic import lic_lengths_task, look_noise_task, noise_args
from .lic_images import LicImages
from .look import Look, has_flow, lic_key
from .look_units import cell_size_args
from .outline import OUTLINE_SETTINGS, outline_task
from .paper_grain import surface_paper_grain_args
from .pixel_field import PixelField, surface_pixel_field_task
from .surface_noise import surface_noise_task
from .undirected import undirected_texture_task
from .wobble import has_wobble, rotate_pixel_field_task, wobble_angle_task

#: Share of the progress of LIC that the noise takes.
NOISE_SHARE = 0.3


class ComposeStages:
    """The intermediate results of one G-buffer, computed once and stored in a cache.

    The key of a result contains the G-buffer and the settings that it depends on. A look that
    differs only in other settings reuses it. All looks have lengths in pixels of the G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
    cache : Cache
        May be shared with other G-buffers.
    mesh_cache : Cache
        Stores what does not depend on the camera.
    band : Band, optional
        The rows whose LIC images are computed, if not all.
    """

    def __init__(
        self, gbuffer: GBuffer, cache: Cache, mesh_cache: Cache, band: Band | None = None
    ) -> None:
        self._gbuffer = gbuffer
        self._cache = cache
        self._mesh_cache = mesh_cache
        self._band = band

    def drawn(self, field: PixelField) -> slice:
        """Return the range of the pixels of a field that its LIC images have."""
        return drawn_pixels(self._band, field.pixel, field.width)

    def pixel_field_task(self, degree: int, look: Look) -> Task[PixelField]:
        """Pixel field of one degree, rotated by the wobble of the look."""
        settings = look.crease_angle, look.cross_creases
        field = yield from self._cache.get_or_create_task(
            ("pixel field", self._gbuffer, degree, *settings),
            lambda: surface_pixel_field_task(self._gbuffer, degree, *settings),
        )
        if not has_wobble(look):
            return field
        angle = (yield from self._wobble_angle_task(look))[field.gbuffer_index]
        return (yield from rotate_pixel_field_task(field, np.float32(look.wobble) * angle))

    def lic_task(self, field: PixelField, looks: Sequence[Look]) -> Task[list[LicImages]]:
        """Compute the LIC images of a field, or find them in the cache.

        The looks differ in the length of streamlines. The first is the longest.
        """

        def waves_task() -> Task[list[StreakWaves]]:
            noise = yield from subtask(self._noise_task(field, looks[0]), 0.0, NOISE_SHARE)
            if noise is None:
                noise = yield from look_noise_task(field, looks[0])
            task = streak_waves_task(field, looks, noise)
            return (yield from subtask(task, NOISE_SHARE, 1.0))

        def compute_task() -> Task[list[LicImages]]:
            if looks[0].method == "ibfv" and has_flow(looks[0]):
                # They serve all frames.
                still = [lic_key(replace(look, flow=1.0, flow_phase=0.0)) for look in looks]
                key = "streak waves", self._gbuffer, field.degree, *still
                waves = yield from self._cache.get_or_create_task(key, waves_task)
                return (yield from wave_images_task(waves, looks))
            noise = yield from subtask(self._noise_task(field, looks[0]), 0.0, NOISE_SHARE)
            task = lic_lengths_task(field, looks, noise, self._band, f"degree {field.degree}")
            return (yield from subtask(task, NOISE_SHARE, 1.0))

        key = "LIC images", self._gbuffer, field.degree, *map(lic_key, looks)
        return (yield from self._cache.get_or_create_task(key, compute_task))

    def line_means_task(self, field: PixelField, look: Look, values: np.ndarray) -> Task[LicImages]:
        """Average (P, K) values along the lines of a field."""
        task = lic_lengths_task(field, [look], values, self._band, f"means, degree {field.degree}")
        (images,) = yield from task
        return images

    def undirected_texture_task(self, field: PixelField, look: Look) -> Task[np.ndarray | None]:
        """Compute the texture where the field is undefined; see `undirected_texture_task`."""
        if field.representation.all():
            return None
        noise = yield from self._noise_task(field, look)
        if noise is None:
            noise = yield from look_noise_task(field, look)
        noise = unconvolved_noise(noise, look)
        return (yield from undirected_texture_task(field, noise, look.grain))

    def even_lines_task(self, field: PixelField, look: Look) -> Task[EvenLines]:
        """Compute the evenly spaced lines of a field, or find them in the cache."""

        def compute_task() -> Task[EvenLines]:
            wobble_angle = None
            if has_wobble(look):
                wobble_angle = (yield from self._wobble_angle_task(look))[field.gbuffer_index]
            task = even_lines_task(self._gbuffer, field, look, wobble_angle, self._mesh_cache)
            return (yield from task)

        key = "even lines", self._gbuffer, field.degree, lic_key(look)
        return (yield from self._cache.get_or_create_task(key, compute_task))

    def outline_task(self, field: PixelField, look: Look) -> Task[np.ndarray]:
        """(P,) float32 coverage by outlines at the pixels of a field; see `outline_task`."""
        coverage = yield from self._cache.get_or_create_task(
            ("outline", self._gbuffer, *(getattr(look, name) for name in OUTLINE_SETTINGS)),
            lambda: outline_task(self._gbuffer, look, self._mesh_cache),
        )
        return coverage[field.gbuffer_index]

    def surface_paper_grain_task(self, field: PixelField, look: Look) -> Task[np.ndarray]:
        """(P, K) float32 heights of the paper grain, for a look that is anchored to the surface.

        They are not normalized: the mean is `NOISE_MEAN`.
        """
        args = surface_paper_grain_args(look) | cell_size_args(look)
        return self._surface_noise_task(field, args)

    def _noise_task(self, field: PixelField, look: Look) -> Task[np.ndarray | None]:
        """(P, K) float32 noise anchored to the surface. None if the look uses image-space noise."""
        if look.anchor == "picture":
            return None
        args = noise_args(look) | cell_size_args(look)
        if look.detail:
            args["detail"] = look.detail
        return (yield from self._surface_noise_task(field, args))

    def _surface_noise_task(self, field: PixelField, args: dict[str, Any]) -> Task[np.ndarray]:
        """(P, K) float32 noise at the pixels of a field; see `surface_noise_task`."""

        def noise_task() -> Task[np.ndarray]:
            curvature = None
            if "detail" in args:
                curvature = yield from feature_curvatures_task(self._gbuffer, self._mesh_cache)
            return (yield from surface_noise_task(self._gbuffer, **args, curvature=curvature))

        key = "surface noise", self._gbuffer, *sorted(args.items())
        noise = yield from self._cache.get_or_create_task(key, noise_task)
        return noise[field.gbuffer_index]

    def _wobble_angle_task(self, look: Look) -> Task[np.ndarray]:
        """(Q,) float32 angles at all Q pixels of the G-buffer; see `wobble_angle_task`."""
        key = "wobble", self._gbuffer, look.anchor, look.grain, *cell_size_args(look).values()
        return self._cache.get_or_create_task(key, lambda: wobble_angle_task(self._gbuffer, look))

"""Lookup tables of shaders, as textures: colors, inks, thresholds, noise and paper grain."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..compositor.even_lines import look_width_table
from ..compositor.family_hues import PALETTE
from ..compositor.hatching import has_paper_grain
from ..compositor.image_noise import image_noise
from ..compositor.inks import ink_count, inks_of
from ..compositor.lic import noise_settings
from ..compositor.look import is_even
from ..compositor.look_units import PixelLook
from ..compositor.paper_grain import line_offset, picture_paper_grain
from ..compositor.streak_statistics import look_streak_statistics
from ..compositor.undirected import disc_offsets
from ..compositor.wobble import wave_table
from ..core.color import color_stops
from .mesh_buffers import FieldKind
from .resources import GpuResources

#: Noise is computed for frames whose sides are rounded up to a multiple of this number of pixels, so that it
#: can be used again if the frame grows a little.
NOISE_TILE_PIXELS = 256


def palette(resources: GpuResources) -> Any:
    """Return `family_hues.PALETTE` as a texture. It is also a placeholder for textures that are not read."""
    return resources.lookup_texture("palette", None, lambda: PALETTE[None])


def color_map(resources: GpuResources, look: PixelLook) -> Any:
    """Return the color map of a look as a texture."""
    name = look.color_map
    return resources.lookup_texture("colors", name, lambda: color_stops(name)[None])


def thresholds(resources: GpuResources, look: PixelLook) -> Any:
    """Return a texture of the ink thresholds for each coverage from 0 to 1, in the first channel.

    Row 0 contains `StreakStatistics.threshold` or, for evenly spaced lines, the widths from
    `even_lines.look_width_table`. Row 1 contains `StreakStatistics.disc_threshold`, for the texture where
    the field is undefined. The look must have ink.
    """
    statistics = look_streak_statistics(look)
    table = look_width_table(look) if is_even(look) else statistics.threshold
    rows = np.stack([table, statistics.disc_threshold])
    return resources.lookup_texture("thresholds", rows.tobytes(), lambda: rows[..., None])


def undirected_offsets(resources: GpuResources, look: PixelLook) -> Any:
    """Return a texture of sample positions in a disc, in the first two channels.

    They are `undirected.disc_offsets`: offsets in pixels from the center of the disc over which the noise is
    averaged where the field is undefined.
    """
    width = look.line_width
    return resources.lookup_texture("disc_offsets", width, lambda: disc_offsets(width)[None])


def ink_table(resources: GpuResources, kind: FieldKind, look: PixelLook) -> Any:
    """Return a texture of the inks of `inks.Inks`: the dark inks, then the light inks."""
    inks = inks_of(look.look, ink_count(look.look, kind.line_count, kind.family_count))
    stops = np.concatenate([inks.dark, inks.light])
    return resources.lookup_texture("inks", stops.tobytes(), lambda: stops[None])


def waves(resources: GpuResources) -> Any:
    """Return a texture of the waves that `wobble` sums up: a texel per wave, a row of `wave_table`."""
    return resources.lookup_texture("waves", None, lambda: wave_table()[None])


def picture_grain(
    resources: GpuResources, size: tuple[int, int], look: PixelLook, line_count: int
) -> Any:
    """Return a texture of `paper_grain.picture_paper_grain`, in the first channel.

    It is at least as large as a frame with a `size` in pixels. It is wider than the frame, so that
    each of the `line_count` line directions at a pixel reads another column (`line_offset`). A look
    without paper grain gets the placeholder `palette`.
    """
    if not has_paper_grain(look):
        return palette(resources)
    size = size[0] + (line_count - 1) * line_offset(look.line_width), size[1]

    def values_at(pixel: np.ndarray, width: int) -> np.ndarray:
        return picture_paper_grain(pixel, width, look.line_width, look.seed)

    key = look.line_width, look.seed
    return _pixel_texture(resources, "paper_grain", key, size, values_at)


def picture_noise(resources: GpuResources, size: tuple[int, int], look: PixelLook) -> Any:
    """Return a texture of the noise of `image_noise.image_noise` for a frame of this size in pixels.

    It has one component for each noise channel.
    """
    settings = noise_settings(look)
    values = partial(image_noise, settings=settings)
    return _pixel_texture(resources, "noise", settings, size, values)


def _pixel_texture(
    resources: GpuResources, name: str, key: Any, size: tuple[int, int], values: Callable[..., Any]
) -> Any:
    """Return a texture of values at the pixels of a frame.

    It is kept under `name`, and created again if `key`, the settings that the values depend on, changes.
    Width and height of the texture are rounded up to multiples of `NOISE_TILE_PIXELS`.
    `values(pixel, width)` returns the values at (P,) flat indices into a frame of this width.
    """
    width, height = (-(-side // NOISE_TILE_PIXELS) * NOISE_TILE_PIXELS for side in size)

    def create() -> np.ndarray:
        pixel = np.arange(width * height, dtype=np.int32)
        return values(pixel, width).reshape(height, width, -1)

    return resources.lookup_texture(name, key, create, (width, height))

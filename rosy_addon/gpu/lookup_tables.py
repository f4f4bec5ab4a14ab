"""Textures that shaders look values up in: colors, inks, thresholds, noise and paper grain."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..color import color_stops
from ..compositor.even_lines import has_even_lines, look_width_table
from ..compositor.family_hues import PALETTE
from ..compositor.hatching import has_paper_grain
from ..compositor.image_noise import image_noise
from ..compositor.inks import ink_count, inks_of
from ..compositor.lic import noise_args
from ..compositor.look import Look, is_hatched
from ..compositor.paper_grain import line_offset, picture_paper_grain
from ..compositor.streak_statistics import look_streak_statistics
from ..compositor.undirected import disc_offsets
from ..compositor.wobble import wave_table
from .field_kind import FieldKind
from .resources import GpuResources

#: Noise is computed for whole tiles of this side, so that a frame can grow a little.
NOISE_TILE_PIXELS = 256


def palette(resources: GpuResources) -> Any:
    """Return `family_hues.PALETTE`. It is also bound in place of textures that are not read."""
    return _color_table(resources, "palette", None, lambda: PALETTE)


def color_map(resources: GpuResources, look: Look) -> Any:
    """Return the color map of a look."""
    name = look.colour_map
    return _color_table(resources, "colours", name, lambda: color_stops(name))


def thresholds(resources: GpuResources, look: Look) -> Any:
    """Return the thresholds of `streak_statistics`, in the first channel.

    Row 0 is for streaks, or for even lines the widths of `even_lines.look_width_table`. Row 1 is for
    undirected texture.
    """
    if not is_hatched(look):
        return palette(resources)
    statistics = look_streak_statistics(look)
    table = look_width_table(look) if has_even_lines(look) else statistics.threshold
    rows = np.stack([table, statistics.disc_threshold])
    return resources.lookup_texture(
        "thresholds", rows.tobytes(), lambda: _in_channels(rows[..., None])
    )


def undirected_offsets(resources: GpuResources, look: Look) -> Any:
    """Return `undirected.disc_offsets` in the first two channels."""
    if not is_hatched(look):
        return palette(resources)
    return resources.lookup_texture(
        "disc_offsets", look.grain, lambda: _in_channels(disc_offsets(look.grain)[None])
    )


def ink_table(resources: GpuResources, kind: FieldKind, look: Look) -> Any:
    """Return the inks of `inks.Inks`: the dark ones, then the middle ones, then the light ones."""
    inks = inks_of(look, ink_count(look, kind.line_count, kind.family_count))
    stops = np.concatenate([inks.dark, inks.middle, inks.light])
    return _color_table(resources, "inks", stops.tobytes(), lambda: stops)


def waves(resources: GpuResources) -> Any:
    """Return the waves of `wobble`."""
    return resources.lookup_texture("waves", None, lambda: wave_table()[None])


def picture_grain(
    resources: GpuResources, width: int, height: int, look: Look, line_count: int
) -> Any:
    """Return `paper_grain.picture_paper_grain` in the first channel.

    The texture is for a frame of this size. Each line has its own part of it.
    """
    if not has_paper_grain(look):
        return palette(resources)
    width += (line_count - 1) * line_offset(look.grain)

    def create(width: int, height: int) -> np.ndarray:
        pixel = np.arange(width * height, dtype=np.int32)
        values = picture_paper_grain(pixel, width, look.grain, look.seed)
        return _in_channels(values.reshape(height, width, 1))

    return resources.growing_texture(
        "paper_grain", (look.grain, look.seed), _whole_tiles(width, height), create
    )


def picture_noise(resources: GpuResources, width: int, height: int, look: Look) -> Any:
    """Return the noise of `image_noise.image_noise` for a frame of this size."""
    settings = noise_args(look)

    def create(width: int, height: int) -> np.ndarray:
        pixel = np.arange(width * height, dtype=np.int32)
        values = image_noise(pixel, width, **settings)
        return _in_channels(values.reshape(height, width, settings["channels"]))

    return resources.growing_texture("noise", settings, _whole_tiles(width, height), create)


def _whole_tiles(width: int, height: int) -> tuple[int, int]:
    """Return a size rounded up to whole tiles."""
    tile = NOISE_TILE_PIXELS
    return -(-width // tile) * tile, -(-height // tile) * tile


def _in_channels(values: np.ndarray) -> np.ndarray:
    """Return (H, W, C) values as (H, W, 4) float32; the other channels are 0."""
    data = np.zeros((*values.shape[:2], 4), dtype=np.float32)
    data[:, :, : values.shape[2]] = values
    return data


def _color_table(
    resources: GpuResources, name: str, key: Any, create: Callable[[], np.ndarray]
) -> Any:
    """Return (C, 3) colors as a texture of one row."""

    def as_row() -> np.ndarray:
        rgb = np.asarray(create(), dtype=np.float32)
        return np.concatenate([rgb, np.ones_like(rgb[:, :1])], axis=1)[None]

    return resources.lookup_texture(name, key, as_row)

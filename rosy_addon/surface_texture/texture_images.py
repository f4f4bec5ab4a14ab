"""Textures drawn and converted for images of Blender, in one function."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..cache import BAKE_CACHE
from ..compositor.look import Look
from ..compositor.shading import Light
from ..image_io.image_data import ImageData, image_of_pixels
from ..progress import progress
from ..projection.gbuffer import MeshInstance
from .draw import DEFAULT_MARGIN, DEFAULT_SIZE, draw_texture

#: Share of the time after which a texture is drawn.
CONVERSION_START = 0.95


class TextureSettings(NamedTuple):
    """How a texture is drawn; see `draw_texture`."""

    size: int = DEFAULT_SIZE
    margin: int = DEFAULT_MARGIN
    is_udim: bool = False
    content: str = "look"


class TextureImages(NamedTuple):
    """A texture as images of Blender store it.

    Attributes
    ----------
    tiles : dict of int to ImageData
        By their UDIM numbers.
    is_data, line_count
        As for `Texture`.
    note : str
        See `Texture.overlap_note`.
    """

    tiles: dict[int, ImageData]
    is_data: bool
    line_count: int
    note: str


def draw_texture_images(
    instance: MeshInstance,
    uv: np.ndarray,
    look: Look,
    settings: TextureSettings,
    lights: Sequence[Light] | None,
    as_float: bool,
) -> TextureImages:
    """Draw a texture with the cache of bakes in the process that calls it.

    Parameters
    ----------
    instance, uv, look, lights
        As for `draw_texture`.
    settings : TextureSettings
    as_float : bool
        Store linear values in single precision (.exr) instead of 8 bits (.png).
    """
    with progress(0.0, CONVERSION_START):
        texture = draw_texture(
            instance, uv, look, **settings._asdict(), lights=lights, cache=BAKE_CACHE
        )
    BAKE_CACHE.evict_over_limit()
    pixels, tiles = texture.tiles(), {}
    for index, (number, rgba) in enumerate(pixels.items()):
        extent = (1.0 - CONVERSION_START) / len(pixels)
        start = CONVERSION_START + extent * index
        with progress(start, start + extent):
            tiles[number] = image_of_pixels(rgba, as_float, is_color=not texture.is_data)
    note = texture.overlap_note(instance.surface.name)
    return TextureImages(tiles, texture.is_data, texture.line_count, note)

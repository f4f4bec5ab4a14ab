"""Draw the field of a mesh as a texture for one of its UV maps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..compositor.color_values import check_color_values, scaled_positions, value_range, value_scale
from ..compositor.compose import colorize, streak_tone
from ..compositor.flow import NO_DRIFT, Drift, noise_channel_count
from ..compositor.ink_thresholds import sharp_look
from ..compositor.lic import lic_lengths, noise_settings
from ..compositor.lic_images import with_magnitude_range
from ..compositor.look import (
    Look,
    colors_magnitude,
    colors_values,
    crease_angle_of,
    is_hatched,
    undefined_drawing,
)
from ..compositor.look_units import MESH_PIXELS, PixelLook, surface_pixel_look
from ..compositor.pixel_field import PixelField
from ..compositor.shading import Light
from ..core.cache import BAKE_CACHE, Cache
from ..core.errors import RosyError
from ..core.memory import (
    PIXEL_BYTES,
    PROCESS_BYTES,
    TRIANGLE_BYTES,
    check_memory,
    raise_mmap_threshold,
    samples_memory,
)
from ..core.progress import progress
from ..image_io.image_data import ImageData, image_of_pixels
from ..line_drawing.tangent_mesh import TangentMesh, build_tangent_mesh
from ..projection.gbuffer import MeshInstance
from ..projection.pixel_blocks import reported_blocks
from ..projection.surface_sampling import values_in_triangles
from .charts import UvCharts, uv_charts
from .hatching import lit_ink, thresholds
from .line_order import direction_map
from .texel_field import texel_field, texel_noise
from .texels import (
    FIRST_TILE,
    Texels,
    TexelSurface,
    TextureFrame,
    fill_margin,
    rasterize_charts,
    texture_frame,
)

#: Fraction of the texels that may be smaller on the surface than a step of a streamline.
FINE_FRACTION = 0.05

#: Smallest length of a step of a streamline, as a multiple of the mean size of a texel on the surface.
MIN_STEP = 0.25

#: Names of the settings of a look that affect a texture. All other settings have no effect.
TEXTURE_SETTINGS = (
    *("ink", "display", "unit", "unit_size", "dpi", "length", "fade", "flow"),
    *("line_width", "line_distance", "density"),
    *("high_pass", "hue", "seed", "gain", "crease_angle"),
    *("magnitude_length", "color_range", "color_map", "undefined"),
    *("breaks", "wobble", "paper_grain", "guiding_angle"),
)

#: Texels on each side of a texture: default and range.
DEFAULT_SIZE, MIN_SIZE, MAX_SIZE = 2048, 16, 16384

#: Margin in texels: default and maximum.
DEFAULT_MARGIN, MAX_MARGIN = 16, 512

#: The possible contents of a texture, with descriptions for the user.
CONTENTS = {
    "look": "The picture of the look",
    "anisotropy": "The direction of the field as an anisotropy map of glTF, for brushed metal",
    "flow": "The direction of the field as a flow map, for moving textures",
}

#: Names of the settings of a look that affect a texture of directions.
DIRECTION_SETTINGS = ("display", "crease_angle", "guiding_angle")

#: Smallest `Texture.overlap` that is reported to the user. Overlap is measured in whole texels.
NOTABLE_OVERLAP = 0.05

#: Fraction of the progress at which a texture is drawn and its conversion to images begins.
CONVERSION_START = 0.95


@dataclass(frozen=True, eq=False)
class Texture:
    """A texture of the surface.

    Attributes
    ----------
    frame : TextureFrame
        Size of the texture, and its tiles.
    rgba : (H, W, 4) float32 ndarray
        Pixels. The bottom row is first. The tiles of a UDIM texture are stacked.
    overlap : float
        Fraction of the area of all charts that is not shown because other charts overlap it.
    is_data : bool
        Whether the pixels are thresholds of ink (`compositor.ink_thresholds`) or directions. Otherwise
        they are linear colors.
    line_count : int
        Number of line directions of the field at a point. Opposite directions count as one.
    """

    frame: TextureFrame
    rgba: np.ndarray
    overlap: float
    is_data: bool
    line_count: int

    def overlap_note(self, name: str) -> str:
        """Return a message about overlapping charts of the mesh `name`; empty if they hardly overlap."""
        if self.overlap <= NOTABLE_OVERLAP:
            return ""
        return (
            f"{name}: {self.overlap:.0%} of its UV map lies under other charts, which show the same "
            "texels: unwrap the mesh without overlaps if they are to differ"
        )

    def tiles(self) -> dict[int, np.ndarray]:
        """Return the (size, size, 4) picture of each tile, by its UDIM number; 1001 without UDIM tiles."""
        if not self.frame.is_udim:  # all tiles show the same picture
            return {FIRST_TILE: self.rgba}
        pictures = np.split(self.rgba, len(self.frame.tiles))
        return dict(zip(self.frame.tile_names(), pictures, strict=True))


def draw_texture(
    instance: MeshInstance,
    uv: np.ndarray,
    look: Look,
    size: int,
    *,
    margin: int = DEFAULT_MARGIN,
    is_udim: bool = False,
    lights: Sequence[Light] | None = None,
    content: str = "look",
    drift: Drift = NO_DRIFT,
    cache: Cache | None = None,
) -> Texture:
    """Draw the field of a mesh as a texture.

    Streamlines are traced on the surface, not in the UV map, so their shape and width do not depend on the
    charts of the UV map.

    Parameters
    ----------
    instance : MeshInstance
        An instance with a field. Its `color_values` determine the colors if the look asks for it, but not
        in hatching.
    uv : (C, 2) ndarray
        u and v at the corners of the surface.
    look : Look
        Settings of light and camera have no effect. A length in pixels becomes a length on the surface:
        `MESH_PIXELS` (1024) pixels are the side of a square with the area of the surface.
    size : int
        Texels on each side of the texture, or of a tile of it.
    margin : int
        Width of the margin around charts, in texels.
    is_udim : bool
        Whether each UDIM tile of the UV map has a picture of its own.
    lights : sequence of Light, optional
        Lights in world space. If they are given, hatching is drawn as ink under this light. Otherwise a
        texture of hatching contains thresholds, and the material draws the ink.
    content : {"look", "anisotropy", "flow"}
        What the texture shows: the picture of the look, or the direction of the field as an anisotropy map
        or as a flow map; see `direction_map`.
    drift : Drift
        How far streaks have drifted, if the look has flow.
    cache : Cache, optional
        Stores what does not depend on the look.

    Returns
    -------
    Texture

    Raises
    ------
    RosyError
        If there is no field, the size or the margin is out of range, the UV map cannot be drawn, the look
        needs `color_values` and there are none, or there is not enough memory.
    """
    name = instance.surface.name
    check_texture_size(size, margin)
    if texture_colors_values(look, content):
        check_color_values(look, [instance])
    raise_mmap_threshold()
    crease_angle = crease_angle_of(look)
    with progress(0.0, 0.05):
        mesh = build_tangent_mesh(
            instance, display=look.display, crease_angle=crease_angle, cache=cache
        )
    with progress(0.05, 0.1):
        charts = uv_charts(instance.surface, mesh, uv)
    frame = texture_frame(charts, size, name, is_udim)
    _check_texture_memory(frame, charts, mesh, look)
    with progress(0.1, 0.15):
        texels = rasterize_charts(charts, frame, name)
    on = TexelSurface(instance, mesh, charts, texels, step_length(mesh, charts, texels), cache)
    with progress(0.15, 0.3):
        field = texel_field(on, crease_angle)
    is_direction = content != "look"
    is_ink = is_hatched(look) and not is_direction
    with progress(0.3, 0.9):
        if is_direction:
            pixels = direction_map(on, content, look.guiding_angle)
        else:
            pixels = _look_pixels(on, field, look, drift)
    is_lit = is_ink and lights is not None
    if is_lit:
        with progress(0.9, 0.95):
            pixels = lit_ink(on, pixels, lights, look)
            if undefined_drawing(look) == "hidden":
                pixels[:, 3] *= field.representation != 0
    # Directions are relative to their chart.
    with progress(0.95, 1.0):
        rgba = fill_margin(frame, field, pixels, margin, not is_direction)
    is_data = is_direction or (is_ink and not is_lit)
    return Texture(frame, rgba, texels.overlap, is_data, mesh.family_count)


def texture_colors_values(look: Look, content: str = "look") -> bool:
    """Return whether a texture is colored by `color_values`. Hatching has the colors of its ink instead."""
    return content == "look" and colors_values(look) and not is_hatched(look)


def check_texture_size(size: int, margin: int) -> None:
    """Check the size and the margin of a texture, in texels.

    Raises
    ------
    RosyError
        If one of them is out of range.
    """
    ranges = (size, MIN_SIZE, MAX_SIZE, "a size"), (margin, 0, MAX_MARGIN, "a margin")
    for value, low, high, what in ranges:
        if not low <= value <= high:
            what = f"{what} of {value} texels"
            raise RosyError(f"a texture cannot have {what}: choose {low} to {high}")


def _check_texture_memory(
    frame: TextureFrame, charts: UvCharts, mesh: TangentMesh, look: Look
) -> None:
    """Raise RosyError if there is not enough memory to draw a texture."""
    texels = frame.width * frame.height
    used = min(float((mesh.area * np.abs(charts.density)).sum()) * frame.size**2, texels)
    many_images = is_hatched(look) or noise_channel_count(look) > 1
    needed = PROCESS_BYTES + PIXEL_BYTES * texels + TRIANGLE_BYTES * len(mesh.area)
    needed += samples_memory(used, mesh.family_count, many_images)
    tiles = f"{len(frame.tiles)} tiles of " if frame.is_udim and len(frame.tiles) > 1 else ""
    texture = f"a texture of {tiles}{frame.size} x {frame.size} texels"
    check_memory(needed, texture, "choose a smaller size")


def step_length(mesh: TangentMesh, charts: UvCharts, texels: Texels) -> float:
    """Return the length of a step of streamlines, in Blender units.

    It is about the size of the smallest texels on the surface, so that streamlines rarely skip a texel.
    """
    texels_per_unit = charts.stretch()[0][texels.triangle] * texels.frame.size
    finest = float(np.quantile(texels_per_unit, 1 - FINE_FRACTION))
    mean_size = float(np.sqrt(mesh.area.sum() / len(texels)))
    return max(1 / finest if finest else 0.0, MIN_STEP * mean_size)


def _look_pixels(on: TexelSurface, field: PixelField, look: Look, drift: Drift) -> np.ndarray:
    """Return (P, 4) values at texels: thresholds for a look with ink, linear RGBA for any other look.

    `look` has the settings of the user, `drift` is how far its streaks have drifted.
    """
    is_ink = is_hatched(look)
    # Lines are about as wide as in a picture that the mesh fills.
    pixel = float(np.sqrt(on.mesh.area.sum())) / MESH_PIXELS
    step_look = surface_pixel_look(sharp_look(look) if is_ink else look, on.step, pixel, drift)
    step_look = step_look.for_symmetry(field.symmetry)
    if is_ink:
        return thresholds(on, field, step_look, look.guiding_angle)
    return _colors(on, field, step_look)


def _colors(on: TexelSurface, field: PixelField, look: PixelLook) -> np.ndarray:
    """Return (P, 4) float32 RGBA at texels: the linear colors of the field, and the opacity.

    The opacity is 1; it is 0 where the field is undefined if the look hides these parts. The lengths of
    `look` are in steps of streamlines.
    """
    with progress(0.0, 0.3):
        noise = texel_noise(on, noise_settings(look))
    with progress(0.3, 0.95):
        (images,) = lic_lengths(field, [look], noise)
    with progress(0.95, 0.97):
        tone = streak_tone(field, look, images)
    if colors_magnitude(look):
        look = with_magnitude_range(look, field)
    if colors_values(look):
        texels = on.texels
        values = values_in_triangles(on.instance, texels.triangle, texels.barycentric)
        low, scale = value_scale(look.look, [value_range(on.instance.color_values)])
        field = replace(field, map_position=scaled_positions(values, low, scale))
    color = np.ones((len(field.pixel), 4), dtype=np.float32)
    for block in reported_blocks(len(color), "drawing the colors", 0.97, 1.0):
        color[block, :3] = colorize(field.part(block), images.part(block), tone[block], look)
    if undefined_drawing(look) == "hidden":
        color[:, 3] = field.representation != 0
    return color


class TextureSettings(NamedTuple):
    """The arguments of `draw_texture` that the user can set besides the look.

    Attributes
    ----------
    size : int
        Texels on each side of the texture, or of a tile of it.
    margin : int
        Width of the margin around charts, in texels.
    is_udim : bool
        Whether each UDIM tile of the UV map has a picture of its own.
    content : {"look", "anisotropy", "flow"}
        What the texture shows: the picture of the look, or the direction of the field as an anisotropy map
        or as a flow map.
    drift : Drift
        How far streaks have drifted.
    """

    size: int = DEFAULT_SIZE
    margin: int = DEFAULT_MARGIN
    is_udim: bool = False
    content: str = "look"
    drift: Drift = NO_DRIFT


class TextureImages(NamedTuple):
    """A texture as images of Blender store it.

    Attributes
    ----------
    tiles : dict of int to ImageData
        Image of each tile, by its UDIM number.
    is_data : bool
        Whether the pixels are thresholds of ink or directions. Otherwise they are colors.
    line_count : int
        Number of line directions of the field at a point. Opposite directions count as one.
    note : str
        Message for the user about overlapping charts; empty if they hardly overlap.
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
    """Draw a texture, and convert it to images. Uses the cache of bakes of the current process.

    Parameters
    ----------
    instance : MeshInstance
        An instance with a field.
    uv : (C, 2) ndarray
        u and v at the corners of the surface.
    look : Look
        Settings of the user.
    settings : TextureSettings
        The other arguments of `draw_texture`.
    lights : sequence of Light or None
        Lights in world space under which hatching is drawn as ink. None: it is stored as thresholds.
    as_float : bool
        Whether images store linear values in single precision (.exr), or else in 8 bits (.png).
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

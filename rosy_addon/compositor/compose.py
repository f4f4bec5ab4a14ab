"""Compose a picture from a G-buffer: LIC, then color or hatching, then downsampling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..core.cache import Cache
from ..core.color import map_colors, to_linear
from ..core.progress import progress
from ..projection.gbuffer import GBuffer
from ..projection.pixel_blocks import BLOCK_PIXELS, reported_blocks
from .color_values import map_positions, value_ends, value_ranges
from .contrast import blend_gain, scale_contrast, supersampling_gain
from .covering import scatter_rows
from .family_hues import family_hues
from .flow import NO_DRIFT, Drift
from .hatching import (
    HatchedLines,
    has_breaks,
    has_outline,
    has_overshoot,
    has_paper_grain,
    line_images,
    overshoot_steps,
    render_hatching,
)
from .image_noise import NOISE_MEAN
from .ink_thresholds import picture_thresholds, sharp_look
from .lic import lic_lengths
from .lic_images import LicImages, magnitude_ends, relative_magnitude, with_magnitude_range
from .look import Look, colors_magnitude, colors_values, is_even, is_hatched, undefined_drawing
from .look_units import PixelLook, pixel_look
from .picture import Picture, common_color_range
from .pixel_field import PixelField, entries_of_rows
from .shading import Light
from .stages import ComposeStages
from .streak_statistics import look_streak_statistics
from .strip_division import divide_into_strips
from .strips import Strip, join_strips
from .target_tone import ReferenceRender, target_tone

#: Fraction of the progress for tones, directions and outlines. They are computed once for all strips.
SHARED_SHARE = 0.3

#: Contrast of streaks in colored pictures, relative to streaks in gray pictures.
COLOR_CONTRAST = 1.5


def compose(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    reference: ReferenceRender | None = None,
    cache: Cache | None = None,
    mesh_cache: Cache | None = None,
    strips: Sequence[Strip] | None = None,
    draws_thresholds: bool = False,
    drift: Drift = NO_DRIFT,
) -> Picture:
    """Draw the picture of the fields at the pixels of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
        It has the width and the height of the picture times `look.supersampling`. If it has a `coverage` (the
        parts of pixels that surfaces cover, for antialiasing), it has the size of the picture itself.
    look : Look
        The settings of the user, with lengths in pixels of the picture.
    lights : sequence of Light
        Lights of the scene in camera space. Used if the light of the look is "scene".
    reference : ReferenceRender, optional
        Another render of the scene, whose luminance is the tone. Required if the tone of the look is
        "picture".
    cache : Cache, optional
        Stores intermediate results. For the same G-buffer and another look, the results that do not
        depend on the changed settings are reused.
    mesh_cache : Cache, optional
        Stores results that do not depend on the camera. By default `cache` stores them, too.
    strips : sequence of Strip, optional
        Rows to draw, from `divide_into_strips`; by default all rows. The G-buffer must contain these rows
        and the rows around them that streamlines reach. Without effect if `look.supersampling` is above 1 and
        the G-buffer has no `coverage`: such a picture is drawn as a single strip.
    draws_thresholds : bool
        Whether to draw the thresholds of the ink (`ink_thresholds`), which do not depend on the tone,
        instead of the ink. Without effect if the look has no ink.
    drift : Drift
        How far the streaks of an animation have drifted.

    Returns
    -------
    Picture
        The rows of the strips. If the last strip is not the topmost one of the picture, the rows in which
        it fades into the strip above follow.

    Raises
    ------
    RosyError
        If the tone of the look is "picture" without a `reference`, or "attribute" or "image" and no mesh has
        a tone; or if the look shows color values and no mesh has any.
    """
    camera, instances = gbuffer.camera, gbuffer.instances
    is_antialiased = gbuffer.coverage is not None
    supersampling = 1 if is_antialiased else look.supersampling
    if supersampling > 1:
        strips = [Strip(0, camera.height, camera.height)]
    elif strips is None:
        strips = divide_into_strips(look, camera, instances)
    draws_thresholds = draws_thresholds and is_hatched(look)
    if draws_thresholds:
        look = sharp_look(look)
    frame_look = pixel_look(look, camera, instances, supersampling, drift, is_antialiased)
    cache = Cache() if cache is None else cache
    stages = ComposeStages(gbuffer, cache, cache if mesh_cache is None else mesh_cache)
    with progress(0.0, SHARED_SHARE):
        with progress(0.0, 0.2):
            tone_rgb = target_tone(gbuffer, look, lights, reference, cache)
            canvas = _Canvas(gbuffer, frame_look, tone_rgb, draws_thresholds)
        layers = []
        for number, degree in enumerate(canvas.degrees):
            with progress(0.2 + 0.8 * number / len(canvas.degrees), 1.0):
                layers.append(_prepare_layer(stages, canvas, degree, frame_look))
    with progress(SHARED_SHARE, 1.0):
        rgba, spread = _draw_strips(stages, canvas, layers, strips)
    color_range = _color_range(gbuffer, look, layers, canvas)
    line_count = max((layer.field.line_count for layer in layers), default=0)
    shown_spread = spread[..., 0] if draws_thresholds else None
    return Picture(rgba, shown_spread, color_range, line_count=line_count)


def _draw_strips(
    stages: ComposeStages, canvas: _Canvas, layers: Sequence[_Layer], strips: Sequence[Strip]
) -> list[np.ndarray]:
    """Draw all layers, strip by strip. Return the (H, W, 4) RGBA picture and the `_Canvas.spread` image.

    The second image has the spread in its first channel. It has no columns if no thresholds are drawn.
    """
    pictures = []
    for number, strip in enumerate(strips):
        for index, layer in enumerate(layers):
            start = (number + index / len(layers)) / len(strips)
            with progress(start, start + 0.95 / (len(layers) * len(strips))):
                _draw_layer(stages, canvas, layer, strip)
        with progress((number + 0.95) / len(strips), (number + 1) / len(strips)):
            pictures.append(canvas.picture(strip))
    return [join_strips(images, strips) for images in zip(*pictures, strict=True)]


def _color_range(
    gbuffer: GBuffer, look: Look, layers: Sequence[_Layer], canvas: _Canvas
) -> tuple[float, float] | None:
    """Return the values at the ends of the color map, for the color key.

    None if the picture has no color map, or if the fields of different degrees have different color ranges.
    """
    if canvas.map_position is not None:
        return value_ends(look, value_ranges(gbuffer.instances))
    if colors_magnitude(look):
        return common_color_range({layer.lines.look.color_range for layer in layers})
    return None


class _Canvas:
    """The colors of the pixels of a G-buffer. They are drawn strip by strip.

    Attributes
    ----------
    look : PixelLook
    degrees : list of int
        Degrees of the visible fields.
    tone_rgb : (P, 3) float32 ndarray
        Target tone of each pixel, linear factors; see `target_tone`.
    map_position : (P,) float32 ndarray or None
        Position in the color map of the color value of each pixel; None if the look does not show color
        values.
    color : (P, 3) float32 ndarray
        Color of each pixel: linear, not premultiplied. 0 until its strip is drawn.
    alpha : (P,) float32 ndarray
        Opacity of each pixel, 0 to 1.
    spread : (P, 1) float32 ndarray
        If thresholds of ink are drawn in place of colors: the alpha channel that
        `ink_thresholds.threshold_pixels` returns, which tells how far the thresholds in a pixel spread.
        Otherwise it has the shape (0, 1).
    """

    def __init__(
        self, gbuffer: GBuffer, look: PixelLook, tone_rgb: np.ndarray, draws_thresholds: bool
    ) -> None:
        count = len(gbuffer.pixel)
        self._gbuffer, self.look, self.tone_rgb = gbuffer, look, tone_rgb
        self.draws_thresholds = draws_thresholds
        visible = np.flatnonzero(np.bincount(gbuffer.instance_id)).tolist()
        self.degrees = sorted({gbuffer.instance_degrees[index] for index in visible})

        self.map_position = None
        if colors_values(look) and not draws_thresholds:
            self.map_position = map_positions(gbuffer, look.look)
        self.color = np.zeros((count, 3), dtype=np.float32)
        self.alpha = np.ones(count, dtype=np.float32)
        self.spread = np.zeros((count if draws_thresholds else 0, 1), dtype=np.float32)

    def picture(self, strip: Strip) -> tuple[np.ndarray, np.ndarray]:
        """Return two RGBA images of a strip: its colors, and the `spread` of thresholds as gray.

        The second image has no columns if colors are drawn instead of thresholds.
        """
        rgba = self._resolved(self.color, strip.drawn_rows)
        if not self.draws_thresholds:
            return rgba, rgba[:, :0]
        return rgba, self._resolved(self.spread, strip.drawn_rows)

    def _resolved(self, color: np.ndarray, rows: tuple[int, int]) -> np.ndarray:
        """Assemble rows of the finished picture: average the colors of the subpixels of each pixel.

        Parameters
        ----------
        color : (P, 3) or (P, 1) float32 ndarray
            Linear, not premultiplied.
        rows : (int, int)
            The first row of the image in the supersampled frame, and the row after its last one.

        Returns
        -------
        (h, w, 4) float32 ndarray
            Linear RGBA, not premultiplied, with an element for each pixel of the finished picture.
        """
        gbuffer, s = self._gbuffer, self.look.supersampling
        pixel, width, coverage = gbuffer.pixel, gbuffer.camera.width, gbuffer.coverage
        height, is_averaged = (rows[1] - rows[0]) // s, s > 1 or coverage is not None
        rgba = np.zeros((height, width // s, 4), dtype=np.float32)
        band_rows = max(BLOCK_PIXELS // (width * s), 1)
        for lines in reported_blocks(height, "drawing the ink", size=band_rows):
            band = rgba[lines]
            band_of_frame = rows[0] + lines.start * s, rows[0] + lines.stop * s
            first_pixel = band_of_frame[0] * width
            block = entries_of_rows(pixel, width, band_of_frame)
            if block.start == block.stop:
                continue  # memory that is not written to is not used
            # Colors are premultiplied for averaging. Subpixels without a field are black, with alpha 0.
            band_rgba = np.zeros((band.size // 4 * s * s, 4), dtype=np.float32)
            alpha = self.alpha[block] * (1 if coverage is None else coverage.own[block])
            block_rgba = _rgba(color[block], alpha, is_averaged)
            scatter_rows(band_rgba, pixel[block] - first_pixel, block_rgba)
            if coverage is not None:
                shares = entries_of_rows(coverage.pixel, width, band_of_frame)
                entry = coverage.entry[shares]
                shared = _rgba(color[entry], self.alpha[entry] * np.float32(coverage.share), True)
                np.add.at(band_rgba, coverage.pixel[shares] - first_pixel, shared)
            if s > 1:
                band_rgba = band_rgba.reshape(len(band), s, width // s, s, 4).mean(axis=(1, 3))
            band[...] = band_rgba.reshape(band.shape)
            if is_averaged:
                band_alpha = band[..., 3:]
                np.divide(band[..., :3], band_alpha, out=band[..., :3], where=band_alpha > 0)
        return rgba


def _rgba(color: np.ndarray, alpha: np.ndarray, is_premultiplied: bool) -> np.ndarray:
    """Return (n, 4) float32 RGBA of (n, 3) or (n, 1) colors that are not premultiplied, and (n,) alphas.

    The result is premultiplied if `is_premultiplied`. Colors with one channel are gray.
    """
    rgba = np.empty((len(color), 4), dtype=np.float32)
    rgba[:, 3] = alpha
    rgba[:, :3] = color * rgba[:, 3:] if is_premultiplied else color
    return rgba


class _Layer(NamedTuple):
    """Data of the fields of one degree that is the same for all strips.

    Attributes
    ----------
    field : PixelField
    lines : HatchedLines
        The attributes that depend on the strip, such as the LIC images, are not set. The `look` is adapted
        to the symmetry of the field and the range of its magnitudes.
    tone : (P,) float32 ndarray or None
        Target tone of the pixels of `field`, if the look is hatched; None otherwise.
    """

    field: PixelField
    lines: HatchedLines
    tone: np.ndarray | None = None


def _prepare_layer(stages: ComposeStages, canvas: _Canvas, degree: int, look: PixelLook) -> _Layer:
    """Compute the data of the fields of one degree that all strips share.

    `look` is the look of the whole picture, not yet adapted to the symmetry of the fields.
    """
    with progress(0.0, 0.3):
        field = stages.pixel_field(degree, look)
    look = look.for_symmetry(field.symmetry)
    even_lines = paper_grain = outline = None
    if is_even(look):
        with progress(0.3, 0.6):
            even_lines = stages.even_lines(field, look)
    if colors_magnitude(look):
        look = with_magnitude_range(look, field)
    if not is_hatched(look):
        return _Layer(field, HatchedLines(look))
    if has_paper_grain(look):
        with progress(0.6, 0.7):
            paper_grain = stages.paper_grain(field, look)
    if has_outline(look):
        with progress(0.7, 0.9):
            outline = stages.outline(field, look)
    with progress(0.9, 1.0):
        undirected = stages.undirected_texture(field, look)
    lines = HatchedLines(
        look, paper_grain=paper_grain, outline=outline, undirected=undirected, even_lines=even_lines
    )
    if even_lines is None or undirected is not None or has_breaks(look) or has_paper_grain(look):
        look_streak_statistics(look)  # stores them for `HatchedLines.coverage`
    tone = canvas.tone_rgb[field.gbuffer_index].mean(axis=1)
    return _Layer(field, lines, np.clip(tone, 0, 1, out=tone))


def _draw_layer(stages: ComposeStages, canvas: _Canvas, layer: _Layer, strip: Strip) -> None:
    """Draw the fields of one degree in a strip: write their colors to `canvas`."""
    field, look = layer.field, layer.lines.look
    rows = entries_of_rows(field.pixel, field.width, strip.averaged_rows)
    lines = layer.lines.part(rows)
    with progress(0.0, 0.7):
        images, break_images = line_images(look, lambda looks: stages.lic(field, looks, strip))
        lines = lines._replace(images=images, break_images=break_images)
    with progress(0.7, 0.9):
        if layer.tone is None:
            streaks = streak_tone(field, look, images)
        else:
            tone = layer.tone[rows]
            if has_overshoot(look):
                lines = lines._replace(line_tones=_tone_along_lines(layer, strip))
    field = field.part(rows)
    if canvas.map_position is not None:
        field = replace(field, map_position=canvas.map_position[field.gbuffer_index])
    for block in reported_blocks(len(field.pixel), "drawing the ink", 0.9, 1.0):
        part, part_lines = field.part(block), lines.part(block)
        entries = part.gbuffer_index
        if layer.tone is None:
            canvas.color[entries] = colorize(part, part_lines.images, streaks[block], look)
            canvas.color[entries] *= canvas.tone_rgb[entries]
        elif canvas.draws_thresholds:
            pixels = picture_thresholds(part, part_lines, canvas.look.supersampling)
            canvas.color[entries], canvas.spread[entries] = pixels[:, :3], pixels[:, 3:]
        else:
            color, alpha = render_hatching(part, part_lines, tone[block])
            canvas.color[entries], canvas.alpha[entries] = color, alpha
        if undefined_drawing(look) == "hidden" and not canvas.draws_thresholds:
            canvas.alpha[entries] *= part.representation != 0


def _tone_along_lines(layer: _Layer, strip: Strip) -> np.ndarray:
    """Return the (M, n) mean tone, 0 to 1, along the streamlines of each of the M lines of the field.

    Lines are in the order of the member images, the n pixels are in the `averaged_rows` of the strip. A mean
    covers the `overshoot` of the look in both directions: the distance by which lines of ink continue past
    the border of a tone.
    """
    # `normalize_variance` scales the means of streamlines that end early. A channel of ones is
    # scaled by the same factor, which is divided out below. There are two such channels, because LIC
    # takes one or three channels.
    channels = np.ones((len(layer.tone), 3), dtype=np.float32)
    channels[:, 0] = layer.tone
    look = layer.lines.look.for_means(overshoot_steps(layer.lines.look))
    (images,) = lic_lengths(layer.field, [look], channels, strip)
    centered = images.members - np.float32(NOISE_MEAN)
    means = NOISE_MEAN + np.float32(1 - NOISE_MEAN) * centered[..., 0] / centered[..., 1]
    return np.clip(means, 0, 1, out=means)


def streak_tone(field: PixelField, look: PixelLook, images: LicImages) -> np.ndarray:
    """Scale the mean of the M member images to the contrast of one image, times the gain of the look.

    Contrast is the standard deviation of the streaks.

    Returns
    -------
    (P, K) float32 ndarray
        Display values (sRGB), not clipped. K is 1 for gray noise, 3 for colored noise.
    """
    supersampled_gain = np.float32(supersampling_gain(look) if look.supersampling > 1 else 1)
    blended_gain = blend_gain(field.line_count, images.effective_samples, look)
    return scale_contrast(images.blend, (look.gain * blended_gain * supersampled_gain)[:, None])


def colorize(field: PixelField, images: LicImages, tone: np.ndarray, look: PixelLook) -> np.ndarray:
    """Return the (P, 3) or (P, 1) linear colors of pixels.

    Pixels are gray, or colored by the magnitude, the family of lines or the color values, as the look says.
    Pixels without a color value are gray. Where the field is undefined, pixels are a uniform gray, unless the
    look draws streaks there. `tone`, (P, K), holds the brightness of the streaks as display values, from
    `streak_tone`. `images` determine which family dominates.
    """
    hue, position = None, None
    if colors_magnitude(look):
        hue = map_colors(relative_magnitude(field, magnitude_ends(look, field)), look.color_map)
    elif field.map_position is not None:
        position = field.map_position
        hue = map_colors(np.nan_to_num(position), look.color_map)
    elif look.hue == "families":
        hue = family_hues(field, images, look)
    color = to_linear(tone if hue is None else hue * (1 + COLOR_CONTRAST * (tone - NOISE_MEAN)))
    if undefined_drawing(look) != "texture":
        color[field.representation == 0] = to_linear(np.float32(NOISE_MEAN))
    if hue is not None and position is not None:
        missing = np.isnan(position)
        color[missing] = to_linear(tone[missing])
    return color

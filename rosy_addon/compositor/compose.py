"""Compose a picture from a G-buffer: LIC, then color or hatching, then downsampling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..cache import Cache
from ..color import map_colors, to_linear
from ..progress import progress, report
from ..projection.gbuffer import GBuffer, PixelCoverage
from ..projection.pixel_blocks import BLOCK_PIXELS, pixel_blocks
from .band import Band
from .color_values import compute_map_positions, value_ends, value_ranges
from .contrast import blend_gain, scale_contrast, supersampling_gain
from .covering import scatter_rows
from .even_lines import EvenLines, even_line_images, has_even_lines
from .family_hues import family_hues
from .filter_kernel import look_for_symmetry
from .flow import with_cycle_distance
from .hatching import (
    LineModulation,
    has_breaks,
    has_outline,
    has_overshoot,
    has_paper_grain,
    overshoot_steps,
    render_hatching,
)
from .image_noise import NOISE_MEAN
from .ink_thresholds import picture_thresholds, sharp_look
from .lic import lic
from .lic_images import LicImages, relative_magnitude, with_magnitude_range
from .look import Look, colors_magnitude, colors_values, is_hatched
from .look_units import AntialiasedLook, antialiased_look, look_in_pixels, supersampled_look
from .paper_grain import PAPER_GRAIN_CHANNELS, picture_paper_grain
from .picture import DegreeLayer, Picture, common_color_range
from .pixel_field import PixelField, planar_pixel_field
from .shading import Light
from .stages import ComposeStages
from .streak_statistics import break_steps, look_streak_statistics
from .target_tone import ReferenceRender, target_tone

#: Contrast of streaks in colored pictures, relative to gray pictures.
COLOR_CONTRAST = 1.5


def compose(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    reference: ReferenceRender | None = None,
    cache: Cache | None = None,
    mesh_cache: Cache | None = None,
    band: Band | None = None,
    draws_thresholds: bool = False,
) -> Picture:
    """Draw the fields of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
        Its resolution is that of the picture times `look.supersampling`, in both directions; or that
        of the picture, if it has a `coverage`.
    look : Look
        Its lengths are in pixels of the picture or in Blender units, not in pixels of the G-buffer.
    lights : sequence of Light
        Lights of the scene in the space of the camera. Used if the light of the look is "scene".
    reference : ReferenceRender, optional
        Required if the tone of the look is "picture".
    cache : Cache, optional
        Stores intermediate results. For the same G-buffer and another look, those that do not
        depend on the changed settings are reused.
    mesh_cache : Cache, optional
        Stores what does not depend on the camera, by default `cache`.
    band : Band, optional
        The rows that are drawn, if not all. The G-buffer has them and their context.
    draws_thresholds : bool
        Whether the picture has the thresholds of its ink (`ink_thresholds`), if the look has ink. They do
        not depend on the tone.

    Returns
    -------
    Picture
        Of these rows.

    Raises
    ------
    RosyError
        If the source of the tone or of the colors does not exist; see `target_tone.check_tone` and
        `color_values.check_color_values`.

    See Also
    --------
    compose : The same, run to its end.
    """
    camera = gbuffer.camera
    if gbuffer.coverage is not None:
        look = replace(look, supersampling=1)
    look = with_cycle_distance(look_in_pixels(look, camera, gbuffer.instances))
    pixel_look = supersampled_look(look) if gbuffer.coverage is None else antialiased_look(look)
    draws_thresholds = draws_thresholds and is_hatched(look)
    if draws_thresholds:
        pixel_look = sharp_look(pixel_look)
    spread = np.zeros((len(gbuffer.pixel) if draws_thresholds else 0, 1), dtype=np.float32)
    color = np.zeros((len(gbuffer.pixel), 3), dtype=np.float32)
    alpha = np.ones(len(gbuffer.pixel), dtype=np.float32)
    cache = Cache() if cache is None else cache
    stages = ComposeStages(gbuffer, cache, cache if mesh_cache is None else mesh_cache, band)
    with progress(0.0):
        tone_rgb = target_tone(gbuffer, look, lights, reference, cache)
    map_position = None
    if colors_values(look) and not draws_thresholds:
        with progress(0.0):
            map_position = compute_map_positions(gbuffer, look)
    layers, color_tops = [], set()
    visible_ids = np.flatnonzero(np.bincount(gbuffer.instance_id)).tolist()
    degrees = sorted({gbuffer.instance_degrees[instance_id] for instance_id in visible_ids})
    for layer_index, degree in enumerate(degrees):
        start, stop = layer_index / len(degrees), (layer_index + 1) / len(degrees)
        report(start, "finding directions")
        with progress(start):
            field = stages.pixel_field(degree, pixel_look)
        field_look = look_for_symmetry(pixel_look, field.symmetry)
        even_lines = break_images = None
        break_look = replace(field_look, length=break_steps(field_look))
        if has_even_lines(field_look):
            with progress(start, stop):
                even_lines = stages.even_lines(field, field_look)
            with progress(stop):
                images = even_line_images(even_lines)
            if has_breaks(look):
                with progress(stop):
                    (break_images,) = stages.lic(field, [break_look])
        elif has_breaks(look):
            with progress(start, stop):
                images, break_images = stages.lic(field, [field_look, break_look])
        else:
            with progress(start, stop):
                (images,) = stages.lic(field, [field_look])
        part_look = (
            with_magnitude_range(field_look, field) if colors_magnitude(look) else field_look
        )
        if colors_magnitude(look):
            color_tops.add(part_look.magnitude_range)
        tone = modulation = None
        drawn = stages.drawn(field)
        if is_hatched(look):
            with progress(stop):
                tone = _mean_tone(tone_rgb[field.gbuffer_index])
                modulation = _line_modulation(
                    stages, field, field_look, tone, break_images, even_lines
                )
            tone = tone[drawn]
        field = field.part(drawn)
        if map_position is not None:
            field = replace(field, map_position=map_position[field.gbuffer_index])
        with progress(stop):
            layer = compute_layer(field, field_look, images)
        for block in pixel_blocks(len(field.pixel)):
            report(stop, "drawing the ink")
            part, part_images = field.part(block), images.part(block)
            entries = part.gbuffer_index
            if modulation is None:
                color[entries] = colorize(part, part_images, layer.tone[block], part_look)
            elif draws_thresholds:
                pixels = picture_thresholds(
                    part, part_images, part_look, modulation.part(block), look.supersampling
                )
                color[entries], spread[entries] = pixels[:, :3], pixels[:, 3:]
            else:
                color[entries], alpha[entries] = render_hatching(
                    part, part_images, part_look, tone[block], modulation.part(block)
                )
        layers.append(layer)
    if not is_hatched(look):
        color *= tone_rgb
    rows = (0, camera.height) if band is None else (band.start, band.stop)
    frame = camera.width, rows, look.supersampling, gbuffer.coverage
    with progress(1.0):
        rgba = _resolve_pixels(gbuffer.pixel, color, alpha, *frame)
    color_range = common_color_range(color_tops)
    if map_position is not None:
        color_range = value_ends(look, value_ranges(gbuffer.instances))
    line_count = max((len(layer.images.members) for layer in layers), default=0)
    if not draws_thresholds:
        return Picture(rgba, tuple(layers), None, color_range, None, line_count)
    with progress(1.0):
        spread_rgba = _resolve_pixels(gbuffer.pixel, spread, alpha, *frame)
    return Picture(rgba, tuple(layers), spread_rgba[..., 0], color_range, None, line_count)


def compose_planar(
    angles: np.ndarray,
    degree: int,
    look: Look,
    magnitude: np.ndarray | float | None = None,
    noise: np.ndarray | None = None,
) -> Picture:
    """Draw a field in the plane, without mesh, camera and light.

    Parameters
    ----------
    angles : (H, W) ndarray
        Angle of a member at each pixel, radians, counter-clockwise from the direction of the rows.
        Rows from the bottom. NaN is undefined.
    degree : int
    look : Look
        Lengths are in pixels. Its supersampling is ignored.
    magnitude : (H, W) ndarray or float, optional
        rho, by default 1.
    noise : (H, W) or (H, W, 3) ndarray, optional
        Values from 0 to 1. By default the noise of the look in image space.

    Returns
    -------
    Picture
    """
    field = planar_pixel_field(angles, degree, magnitude)
    if noise is not None:
        noise = np.asarray(noise, dtype=np.float32).reshape(len(field.pixel), -1)
    look = look_for_symmetry(with_cycle_distance(replace(look, supersampling=1)), field.symmetry)
    images = lic(field, look, noise)
    layer = compute_layer(field, look, images)
    color = colorize(field, layer.images, layer.tone, look)
    opaque = np.ones(len(field.pixel), dtype=np.float32)
    return Picture(
        _resolve_pixels(field.pixel, color, opaque, field.width, (0, field.height), 1), (layer,)
    )


def _mean_tone(tone_rgb: np.ndarray) -> np.ndarray:
    """(P,) float32 tones from 0 to 1: the means of the three channels of (P, 3) tones."""
    tone = np.empty(len(tone_rgb), dtype=np.float32)
    for block in pixel_blocks(len(tone)):
        report(block.start / len(tone), "finding tones")
        tone[block] = np.clip(tone_rgb[block].mean(axis=1), 0, 1)
    return tone


def _line_modulation(
    stages: ComposeStages,
    field: PixelField,
    look: Look,
    tone: np.ndarray,
    break_images: LicImages | None,
    even_lines: EvenLines | None,
) -> LineModulation:
    """Compute the parts of the `LineModulation` that a look uses, at the pixels that are drawn."""
    undirected = stages.undirected_texture(field, look)
    uses_streaks = even_lines is None or has_breaks(look) or has_paper_grain(look)
    if uses_streaks or undirected is not None:
        look_streak_statistics(look)  # `line_coverage` finds them in their cache
    paper_grain = line_tones = None
    if has_paper_grain(look):
        paper_grain = _paper_grain(stages, field, look)
    if has_overshoot(look):
        line_tones = _tone_along_lines(stages, field, look, tone)
    outline = stages.outline(field, look) if has_outline(look) else None
    drawn = stages.drawn(field)
    return LineModulation(
        break_images,
        None if paper_grain is None else paper_grain[:, drawn],
        line_tones,
        None if outline is None else outline[drawn],
        None if undirected is None else undirected[drawn],
        even_lines,
    )


def _tone_along_lines(
    stages: ComposeStages, field: PixelField, look: Look, tone: np.ndarray
) -> np.ndarray:
    """(M, n) means of (P,) tones along lines, over the overshoot distance in each direction."""
    if isinstance(look, AntialiasedLook):
        look = look.without_antialiasing()
    # Weights that fall exponentially would reach too far.
    method = "sheets" if look.method == "ibfv" else look.method
    overshoot_look = replace(
        look,
        method=method,
        length=overshoot_steps(look),
        taper=False,
        oriented=False,
        flow=0.0,
    )
    # `normalize_variance` scales the means of streamlines that end early. A channel of ones is
    # scaled by the same factor, which is divided out below. It is there twice, as images have one
    # or three channels.
    channels = np.ones((len(tone), 3), dtype=np.float32)
    channels[:, 0] = tone
    images = stages.line_means(field, overshoot_look, channels)
    means = np.empty(images.members.shape[:2], dtype=np.float32)
    for block in pixel_blocks(means.shape[1]):
        report(1.0, "finding tones")
        centered = images.members[:, block] - np.float32(NOISE_MEAN)
        means[:, block] = (
            NOISE_MEAN + np.float32(1 - NOISE_MEAN) * centered[..., 0] / centered[..., 1]
        )
    return np.clip(means, 0, 1, out=means)


def _paper_grain(stages: ComposeStages, field: PixelField, look: Look) -> np.ndarray:
    """(M, P) heights of the paper for each line, with mean 0 and standard deviation 1."""
    if look.anchor == "picture":
        subpixels = look.supersampling
        grain = look.grain / subpixels
        return picture_paper_grain(
            field.pixel, field.width, grain, look.seed, subpixels, field.line_count
        )
    noise = stages.surface_paper_grain(field, look)
    report(1.0, "drawing the paper grain")
    std = np.float32(look_streak_statistics(look).paper_grain_std)
    channel = np.arange(field.line_count) % PAPER_GRAIN_CHANNELS
    heights = np.empty((field.line_count, len(noise)), dtype=np.float32)
    for block in pixel_blocks(len(noise)):
        report(1.0, "drawing the paper grain")
        heights[:, block] = ((noise[block] - np.float32(NOISE_MEAN)) / std).T[channel]
    return heights


def compute_layer(field: PixelField, look: Look, images: LicImages) -> DegreeLayer:
    """Build the layer of one degree: its blend, with the contrast of one image times the gain."""
    supersampled_gain = np.float32(supersampling_gain(look) if look.supersampling > 1 else 1)
    tone = np.empty_like(images.blend)
    for block in pixel_blocks(len(tone)):
        report(block.start / len(tone), "blending lines")
        effective_samples = images.effective_samples[block]
        gain = look.gain * blend_gain(field.line_count, effective_samples, look) * supersampled_gain
        tone[block] = scale_contrast(images.blend[block], gain[:, None])
    return DegreeLayer(field.degree, field.pixel, images, tone)


def colorize(field: PixelField, images: LicImages, tone: np.ndarray, look: Look) -> np.ndarray:
    """(P, 3) or (P, 1) linear colors of pixels: gray, or colored by magnitude, family or numbers.

    (P, K) `tone` is that of `DegreeLayer`. Pixels without a number are gray.
    """
    hue, position = None, None
    if colors_magnitude(look):
        hue = map_colors(relative_magnitude(field, look), look.colour_map)
    elif field.map_position is not None:
        position = field.map_position
        hue = map_colors(np.nan_to_num(position), look.colour_map)
    elif look.hue == "families":
        hue = family_hues(field, images, look)
    if hue is None:
        return to_linear(tone)
    color = to_linear(hue * (1 + COLOR_CONTRAST * (tone - NOISE_MEAN)))
    if position is not None:
        missing = np.isnan(position)
        color[missing] = to_linear(tone[missing])
    return color


def _resolve_pixels(
    pixel: np.ndarray,
    color: np.ndarray,
    alpha: np.ndarray,
    width: int,
    rows: tuple[int, int],
    supersampling: int,
    coverage: PixelCoverage | None = None,
) -> np.ndarray:
    """Assemble the image from the colors of subpixels.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat indices into the supersampled frame.
    color : (P, 3) or (P, 1) float32 ndarray
        Linear, not premultiplied.
    alpha : (P,) float32 ndarray
    width : int
        Of the supersampled frame, in pixels.
    rows : (int, int)
        Of that frame: the first row of the image, and the row after its last one.
    supersampling : int
        Subpixels along each side of a pixel.
    coverage : PixelCoverage, optional
        Shares of pixels that the colors have, if they are not those of subpixels.

    Returns
    -------
    (H / supersampling, width / supersampling, 4) float32 ndarray
        Linear RGBA, not premultiplied.
    """
    s = supersampling
    height = (rows[1] - rows[0]) // s
    rgba = np.zeros((height, width // s, 4), dtype=np.float32)
    band_rows = max(BLOCK_PIXELS // (width * s), 1)
    for start in range(0, height, band_rows):
        report(start / height, "drawing the ink")
        band = rgba[start : start + band_rows]
        first_pixel = (rows[0] + start * s) * width
        border = np.array([first_pixel, first_pixel + band.size // 4 * s * s], dtype=np.int64)
        block = slice(*np.searchsorted(pixel, border.astype(pixel.dtype)).tolist())
        if block.start == block.stop:  # rows that are not written to take no memory
            continue
        # Colors are premultiplied for averaging. Subpixels without a field are black, with alpha 0.
        band_rgba = np.zeros((band.size // 4 * s * s, 4), dtype=np.float32)
        block_rgba = np.empty((block.stop - block.start, 4), dtype=np.float32)
        block_rgba[:, 3] = alpha[block]
        if s == 1 and coverage is None:
            block_rgba[:, :3] = color[block]
            scatter_rows(band_rgba, pixel[block] - first_pixel, block_rgba)
            band[...] = band_rgba.reshape(band.shape)
            continue
        if coverage is not None:
            block_rgba[:, 3] *= coverage.own[block]
        block_rgba[:, :3] = color[block] * block_rgba[:, 3:]
        scatter_rows(band_rgba, pixel[block] - first_pixel, block_rgba)
        if coverage is None:
            band[...] = band_rgba.reshape(len(band), s, width // s, s, 4).mean(axis=(1, 3))
        else:
            first, stop = np.searchsorted(coverage.pixel, border.astype(np.int32)).tolist()
            entry = coverage.entry[first:stop]
            shared = np.empty((len(entry), 4), dtype=np.float32)
            shared[:, 3] = alpha[entry] * np.float32(coverage.share)
            shared[:, :3] = color[entry] * shared[:, 3:]
            np.add.at(band_rgba, coverage.pixel[first:stop] - first_pixel, shared)
            band[...] = band_rgba.reshape(band.shape)
        band_alpha = band[..., 3:]
        np.divide(band[..., :3], band_alpha, out=band[..., :3], where=band_alpha > 0)
    return rgba

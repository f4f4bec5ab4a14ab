"""Compose a picture from a G-buffer: LIC, then color or hatching, then downsampling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..cache import Cache
from ..color import map_colors, to_linear
from ..progress import Progress, Task, run_to_completion, subtask
from ..projection.gbuffer import GBuffer
from .contrast import blend_gain, scale_contrast, supersampling_gain
from .family_hues import family_hues
from .hatching import (
    LineModulation,
    has_breaks,
    has_outline,
    has_overshoot,
    has_paper_grain,
    render_hatching,
)
from .image_noise import NOISE_MEAN
from .lic import METHODS, lic_task
from .lic_images import LicImages, relative_magnitude, with_magnitude_range
from .look import Look, colors_magnitude, is_hatched
from .look_units import look_in_pixels, supersampled_look
from .paper_grain import PAPER_GRAIN_CHANNELS, picture_paper_grain
from .per_pixel_lic import pixel_blocks
from .picture import DegreeLayer, Picture
from .pixel_field import PixelField, planar_pixel_field
from .shading import Light
from .stages import ComposeStages
from .streak_statistics import break_steps, look_streak_statistics
from .target_tone import ReferenceRender, target_tone_task

#: Pixels per block. Bounds memory, and fits the caches of the processor.
BLOCK_PIXELS = 1 << 14

#: Contrast of streaks in colored pictures, relative to gray pictures.
COLOR_CONTRAST = 1.5


def compose_task(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    reference: ReferenceRender | None = None,
    cache: Cache | None = None,
) -> Task[Picture]:
    """Draw the fields of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
        Its resolution is that of the picture times `look.supersampling`, in both directions.
    look : Look
        Its lengths are in pixels of the picture or in Blender units, not in pixels of the G-buffer.
    lights : sequence of Light
        Lights of the scene in the space of the camera. Used if the light of the look is "scene".
    reference : ReferenceRender, optional
        Required if the tone of the look is "picture".
    cache : Cache, optional
        Stores intermediate results. For the same G-buffer and another look, those that do not
        depend on the changed settings are reused.

    Returns
    -------
    Picture

    Raises
    ------
    RosyError
        If the source of the tone does not exist; see `target_tone.check_tone`.

    See Also
    --------
    compose : The same, run to its end.
    """
    camera = gbuffer.camera
    look = look_in_pixels(look, camera, gbuffer.instances)
    pixel_look = supersampled_look(look)
    color = np.empty((len(gbuffer.pixel), 3), dtype=np.float32)
    alpha = np.ones(len(gbuffer.pixel), dtype=np.float32)
    cache = Cache() if cache is None else cache
    stages = ComposeStages(gbuffer, cache)
    tone_task = target_tone_task(gbuffer, look, lights, reference, cache)
    tone_rgb = yield from subtask(tone_task, 0.0, 0.0)
    layers = []
    degrees = np.unique(np.asarray(gbuffer.instance_degrees)[gbuffer.instance_id]).tolist()
    for layer_index, degree in enumerate(degrees):
        start, stop = layer_index / len(degrees), (layer_index + 1) / len(degrees)
        yield Progress(start, "finding directions")
        field = yield from subtask(stages.pixel_field_task(degree, pixel_look), start, start)
        images = yield from subtask(stages.lic_task(field, pixel_look), start, stop)
        layer = _build_layer(field, pixel_look, images)
        part_look = (
            with_magnitude_range(pixel_look, field) if colors_magnitude(look) else pixel_look
        )
        tone = modulation = None
        if is_hatched(look):
            tone = np.clip(tone_rgb[field.gbuffer_index].mean(axis=1), 0, 1)
            modulation = yield from subtask(
                _line_modulation_task(stages, field, pixel_look, tone), stop, stop
            )
        for block in pixel_blocks(len(field.pixel)):
            yield Progress(stop, "drawing the ink")
            part, part_images = field.part(block), images.part(block)
            entries = part.gbuffer_index
            if modulation is None:
                color[entries] = _colorize(part, part_images, layer.tone[block], part_look)
            else:
                color[entries], alpha[entries] = render_hatching(
                    part, part_images, part_look, tone[block], modulation.part(block)
                )
        layers.append(layer)
    if not is_hatched(look):
        color *= tone_rgb
    yield Progress(1.0, "drawing the ink")
    rgba = _resolve_pixels(
        gbuffer.pixel, color, alpha, camera.width, camera.height, look.supersampling
    )
    return Picture(rgba, tuple(layers))


def compose(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    reference: ReferenceRender | None = None,
    cache: Cache | None = None,
) -> Picture:
    """Draw the fields of a G-buffer, without progress reports; see `compose_task`."""
    return run_to_completion(compose_task(gbuffer, look, lights, reference, cache))


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
    look = replace(look, supersampling=1)
    layer = _build_layer(field, look, run_to_completion(lic_task(field, look, noise)))
    color = _colorize(field, layer.images, layer.tone, look)
    opaque = np.ones(len(field.pixel), dtype=np.float32)
    return Picture(
        _resolve_pixels(field.pixel, color, opaque, field.width, field.height, 1), (layer,)
    )


def _line_modulation_task(
    stages: ComposeStages, field: PixelField, look: Look, tone: np.ndarray
) -> Task[LineModulation]:
    """Compute the parts of the `LineModulation` that a look uses."""
    break_images = paper_grain = line_tones = None
    if has_breaks(look):
        break_images = yield from stages.lic_task(field, replace(look, length=break_steps(look)))
    if has_paper_grain(look):
        paper_grain = yield from _paper_grain_task(stages, field, look)
    if has_overshoot(look):
        line_tones = yield from _tone_along_lines_task(field, look, tone)
    outline = stages.outline(field, look) if has_outline(look) else None
    return LineModulation(break_images, paper_grain, line_tones, outline)


def _tone_along_lines_task(field: PixelField, look: Look, tone: np.ndarray) -> Task[np.ndarray]:
    """(M, P) means of (P,) tones along lines, over the overshoot distance in each direction."""
    overshoot_look = replace(look, length=max(round(look.overshoot / look.step), 1), taper=False)
    # `normalize_variance` scales the means of streamlines that end early. A channel of ones is
    # scaled by the same factor, which is divided out below. It is there twice, as images have one
    # or three channels.
    ones = np.ones_like(tone)
    images = yield from METHODS[look.method](
        field, overshoot_look, np.stack([tone, ones, ones], axis=1)
    )
    centered = images.members - np.float32(NOISE_MEAN)
    means = NOISE_MEAN + np.float32(1 - NOISE_MEAN) * centered[..., 0] / centered[..., 1]
    return np.clip(means, 0, 1)


def _paper_grain_task(stages: ComposeStages, field: PixelField, look: Look) -> Task[np.ndarray]:
    """(M, P) heights of the paper for each line, with mean 0 and standard deviation 1."""
    if look.anchor == "picture":
        subpixels = look.supersampling
        grain = look.grain / subpixels
        return picture_paper_grain(
            field.pixel, field.width, grain, look.seed, subpixels, field.line_count
        )
    heights = (yield from stages.surface_paper_grain_task(field, look)) - np.float32(NOISE_MEAN)
    heights /= np.float32(look_streak_statistics(look).paper_grain_std)
    return heights.T[np.arange(field.line_count) % PAPER_GRAIN_CHANNELS]


def _build_layer(field: PixelField, look: Look, images: LicImages) -> DegreeLayer:
    """Build the layer of one degree: its blend, with the contrast of one image times the gain."""
    gain = look.gain * blend_gain(field.line_count, images.effective_samples, look)
    if look.supersampling > 1:
        gain *= np.float32(supersampling_gain(look))
    tone = scale_contrast(images.blend, gain[:, None])
    return DegreeLayer(field.degree, field.pixel, images, tone)


def _colorize(field: PixelField, images: LicImages, tone: np.ndarray, look: Look) -> np.ndarray:
    """(P, 3) or (P, 1) linear colors of pixels: gray, or colored by magnitude or by family.

    (P, K) `tone` is that of `DegreeLayer`.
    """
    hue = None
    if colors_magnitude(look):
        hue = map_colors(relative_magnitude(field, look), look.colour_map)
    elif look.hue == "families":
        hue = family_hues(field, images, look)
    if hue is None:
        return to_linear(tone)
    return to_linear(hue * (1 + COLOR_CONTRAST * (tone - NOISE_MEAN)))


def _resolve_pixels(
    pixel: np.ndarray,
    color: np.ndarray,
    alpha: np.ndarray,
    width: int,
    height: int,
    supersampling: int,
) -> np.ndarray:
    """Assemble the image from the colors of subpixels.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat indices into the supersampled frame.
    color : (P, 3) or (P, 1) float32 ndarray
        Linear, not premultiplied.
    alpha : (P,) float32 ndarray
    width, height : int
        Of the supersampled frame, in pixels.
    supersampling : int
        Subpixels along each side of a pixel.

    Returns
    -------
    (height / supersampling, width / supersampling, 4) float32 ndarray
        Linear RGBA, not premultiplied.
    """
    rgba = np.zeros((height * width, 4), dtype=np.float32)
    # The four floats of a pixel are copied as one complex128.
    scalars = rgba.view(np.complex128)[:, 0]
    for start in range(0, len(pixel), BLOCK_PIXELS):
        block = slice(start, start + BLOCK_PIXELS)
        block_alpha = alpha[block, None]
        # Colors are premultiplied for averaging. Subpixels without a field are black, with alpha 0.
        premultiplied = color[block] if supersampling == 1 else color[block] * block_alpha
        block_rgba = np.empty((len(block_alpha), 4), dtype=np.float32)
        block_rgba[:, :3], block_rgba[:, 3:] = premultiplied, block_alpha
        scalars[pixel[block]] = block_rgba.view(np.complex128)[:, 0]
    s = supersampling
    if s == 1:
        return rgba.reshape(height, width, 4)
    rgba = rgba.reshape(height // s, s, width // s, s, 4).mean(axis=(1, 3))
    alpha = rgba[..., 3:]
    np.divide(rgba[..., :3], alpha, out=rgba[..., :3], where=alpha > 0)
    return rgba

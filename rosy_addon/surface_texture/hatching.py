"""Hatching at texels, stored as thresholds: the ink for any light follows from them.

`compositor.ink_thresholds` describes the thresholds.
"""

from collections.abc import Sequence

import numpy as np

from ..compositor.even_lines import WOBBLE_SHIFT, EvenLines, line_phases, resolved_share
from ..compositor.hatching import HatchedLines, has_breaks, has_paper_grain, line_images
from ..compositor.ink_from_thresholds import ink_of_thresholds
from ..compositor.ink_thresholds import (
    cyclic_places,
    line_thresholds,
    ordered_thresholds,
    threshold_pixels,
)
from ..compositor.inks import inks_of
from ..compositor.lic import lic_lengths, noise_settings, unconvolved_noise
from ..compositor.look import Look, is_even
from ..compositor.look_units import PixelLook
from ..compositor.paper_grain import surface_paper_grain, surface_paper_grain_settings
from ..compositor.pixel_field import PixelField, all_members
from ..compositor.shading import Light
from ..compositor.streak_statistics import look_streak_statistics
from ..compositor.target_tone import apply_tone_curve
from ..compositor.undirected import undirected_texture
from ..compositor.wobble import WOBBLE_STD, has_wobble, rotate_pixel_field, solid_wobble_angle
from ..core.progress import progress
from ..projection.pixel_blocks import reported_blocks
from ..projection.rest_coordinates import matrix_scale, rest_positions
from ..projection.surface_lines import MAX_TRIANGLES, cached_surface_lines
from .line_order import first_line_weights, line_order
from .texel_field import frames_at, texel_noise
from .texels import TexelSurface

#: Width of the strip in which two line directions of the field swap their order, in line widths.
SWAP_WIDTHS = 8.0

#: Largest number of triangles per texel on which evenly spaced lines are computed. It is reached only if
#: texels on parts of the surface are much smaller than on average, for example if charts overlap.
TRIANGLES_PER_TEXEL = 16

#: Where a field has no direction, spots are drawn: at least this many along the side of a texture.
MIN_SPOTS = 8

#: Label of the progress.
LABEL = "drawing hatching"


def thresholds(
    on: TexelSurface, field: PixelField, look: PixelLook, guiding_angle: float
) -> np.ndarray:
    """Compute the thresholds of hatching at P texels.

    Parameters
    ----------
    on : TexelSurface
        The texels, and the surface that they show.
    field : PixelField
        Field at the texels.
    look : PixelLook
        Look with ink, from `sharp_look`. Its lengths are in steps of streamlines.
    guiding_angle : float
        Angle, in radians from the horizontal direction on the surface, that the first line direction is near
        to. See `line_order`.

    Returns
    -------
    (P, 4) float32 ndarray
        Thresholds of up to three layers in red, green and blue, 0 to 1, and in alpha a measure of their
        spread (`threshold_pixels`).
    """
    with progress(0.0, 0.1):
        order = line_order(on.mesh, guiding_angle, SWAP_WIDTHS * look.line_width * on.step)
    wobble_angle = None
    if has_wobble(look):
        with progress(0.1, 0.13):
            wobble_angle = _wobble_angle(on, look)
        with progress(0.13, 0.15):
            field = rotate_pixel_field(field, np.float32(look.wobble) * wobble_angle)
    with progress(0.15, 0.85):
        lines = _lines(on, field, look, wobble_angle)
    members = all_members(field, look.guiding_angle)[: field.line_count]
    pixels = np.empty((len(field.pixel), 4), dtype=np.float32)
    for block in reported_blocks(len(pixels), LABEL, 0.85, 1.0):
        part = lines.part(block)
        thresholds = np.stack([line_thresholds(line, part) for line in range(field.line_count)])
        triangle, weights = on.texels.triangle[block], on.texels.barycentric[block]
        frame = frames_at(on.charts, triangle, weights)
        in_frame = np.stack([member[block] * frame for member in members])
        first = first_line_weights(order.first_at(triangle, weights), in_frame, order.degree)
        undefined = field.representation[block] == 0
        ordered = ordered_thresholds(thresholds, cyclic_places(first), undefined, look)
        resolved = 1.0
        if part.even_lines is not None:
            resolved = resolved_share(part.even_lines.period.min(axis=0))
        pixels[block] = threshold_pixels(ordered, resolved)
    return pixels


def lit_ink(
    on: TexelSurface, pixels: np.ndarray, lights: Sequence[Light], look: Look
) -> np.ndarray:
    """Draw hatching for the diffuse light of lamps, without shadows.

    Parameters
    ----------
    on : TexelSurface
        The P texels, and the surface that they show.
    pixels : (P, 4) float32 ndarray
        Thresholds of the hatching, from `thresholds`.
    lights : sequence of Light
        Lamps in world space.
    look : Look
        Look with the settings of the ink, the strength of the shading, and the tone curve.

    Returns
    -------
    (P, 4) float32 ndarray
        Linear color and opacity of the texels, not premultiplied.
    """
    inks = inks_of(look)
    colors = np.ones_like(pixels)
    for block in reported_blocks(len(pixels), LABEL):
        triangle, weights = on.texels.triangle[block], on.texels.barycentric[block]
        position = on.mesh.points_at(triangle, weights)
        normal = on.mesh.shading_normals_at(triangle, weights)
        irradiance = sum(light.irradiance(position, normal) * light.luminance for light in lights)
        light = 1 - look.shading + look.shading * irradiance
        tone = np.minimum(apply_tone_curve(light, look), 1)
        color, coverage = ink_of_thresholds(pixels[block], tone, look, on.mesh.family_count)
        if inks.paper_alpha < 1:
            color, colors[block, 3] = inks.on_paper(color, coverage)
        colors[block, :3] = color
    return colors


def _lines(
    on: TexelSurface, field: PixelField, look: PixelLook, wobble_angle: np.ndarray | None
) -> HatchedLines:
    """Return the streaks or the evenly spaced lines of a field at the texels.

    Breaks and paper grain, which make them uneven, and the undirected texture are included. Lengths of `look`
    are in steps of streamlines. `wobble_angle` is from `_wobble_angle`; None if lines do not wobble.
    """
    is_spaced, undefined = is_even(look), not field.representation.all()
    even_lines = noise = undirected = paper_grain = None
    if not is_spaced or has_breaks(look) or undefined:
        with progress(0.0, 0.3):
            noise = texel_noise(on, noise_settings(look))
    if is_spaced:
        with progress(0.3, 0.6):
            even_lines = _even_lines(on, field, look, wobble_angle)
    with progress(0.6 if is_spaced else 0.3, 0.8):
        images, break_images = line_images(look, lambda looks: lic_lengths(field, looks, noise))
    with progress(0.8, 0.9):
        std = look_streak_statistics(look).paper_grain_std
    if undefined:
        texels_per_unit = np.sqrt(np.abs(on.charts.density[on.texels.triangle]))
        size = on.texels.frame.size
        # All spots have the same size in texels: the median of the line width.
        spot = look.line_width * on.step * float(np.median(texels_per_unit)) * size
        spot = min(spot, size / MIN_SPOTS)
        undirected = undirected_texture(field, unconvolved_noise(noise, look), spot)
    if has_paper_grain(look):
        with progress(0.9, 1.0):
            heights = texel_noise(on, surface_paper_grain_settings(look))
            paper_grain = surface_paper_grain(heights, std, field.line_count)
    return HatchedLines(
        look, images, break_images, paper_grain, undirected=undirected, even_lines=even_lines
    )


def _wobble_angle(on: TexelSurface, look: PixelLook) -> np.ndarray:
    """Return (P,) float32: the angles, in radians, by which lines deviate from the field if `wobble` is 1."""
    rest = rest_positions(on.instance.surface).astype(np.float32)
    line_width = look.line_width * on.step / matrix_scale(on.instance.matrix)
    angle = np.empty(len(on.texels), dtype=np.float32)
    for block in reported_blocks(len(angle), "bending lines"):
        position = on.interpolated(rest, block)
        angle[block] = solid_wobble_angle(np.ascontiguousarray(position.T), np.float32(line_width))
    return angle


def _even_lines(
    on: TexelSurface, field: PixelField, look: PixelLook, wobble_angle: np.ndarray | None
) -> EvenLines:
    """Return evenly spaced lines along the field, evaluated at the texels.

    Lengths of `look` are in steps of streamlines. `wobble_angle` is from `_wobble_angle`; None if lines do
    not wobble.
    """
    texels = on.texels
    spacing = look.line_distance * on.step
    max_triangles = min(MAX_TRIANGLES, TRIANGLES_PER_TEXEL * len(texels))
    with progress(0.0, 0.8):
        lines = cached_surface_lines(on.instance, look.display, spacing, on.cache, max_triangles)
    triangles, corners = np.arange(len(on.mesh.points)), on.mesh.points
    sides = [on.mesh.to_frame(triangles, corners[:, k] - corners[:, 0]) for k in (1, 2)]
    streaks, period = np.empty((2, field.line_count, len(texels)), dtype=np.float32)
    for block in reported_blocks(len(texels), LABEL, 0.8, 1.0):
        triangle, weights = texels.triangle[block], texels.barycentric[block]
        part, place = field.part(block), lines.tree.locate(triangle, weights)
        members = all_members(part, look.guiding_angle)
        first, second = lines.heading.take(place[0], axis=1)
        heading = first * sides[0].take(triangle) + second * sides[1].take(triangle)
        member = members[0] * frames_at(on.charts, triangle, weights)
        turn = np.angle(member * heading.conj()) * (field.degree / (2 * np.pi))
        direction = np.rint(turn).astype(np.int32)
        phases, foreshortening = line_phases(lines, place, part, members, direction)
        period[:, block] = look.line_distance * foreshortening
        if wobble_angle is not None:
            phases += np.float32(look.wobble * WOBBLE_SHIFT / WOBBLE_STD) * wobble_angle[block]
        streaks[:, block] = 1 - 2 * np.abs(phases - np.rint(phases))
    return EvenLines(streaks, period, growth=None)

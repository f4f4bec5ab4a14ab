"""Evenly spaced lines, as in engravings: a phase on the surface instead of streaks of noise.

The phase of each family of lines (`projection.surface_lines`) is evaluated at the pixels. Lines lie
where the phase is an integer. The distance of the phase from the nearest integer is evenly distributed.
So lines whose width is a fraction of the distance between lines cover the same fraction of the paper,
and the tone is exact. Lines get wider in dark tones and thinner in light tones.

Edges are smoothed by a box filter of at least a pixel. Where lines are too close for the pixels,
they fade into their mean. Where foreshortening crowds the lines of one direction, lines at a larger
distance on the surface replace them. These are drawn only in darker tones than lines in other directions.
Where lines are too far apart, as in near parts of a perspective picture, further lines grow between them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..core.cache import Cache
from ..core.deterministic_trig import vector_angle
from ..core.progress import progress
from ..field.frames import transform_components
from ..projection.gbuffer import GBuffer, MeshInstance
from ..projection.pixel_blocks import part_of, reported_blocks
from ..projection.pixel_values import view_plane_rotation
from ..projection.surface_lines import SurfaceLines, cached_surface_lines
from .look_units import PixelLook, instance_line_spacing
from .paper_grain import PAPER_GRAIN_STRENGTH
from .pixel_field import PixelField, all_members
from .streak_statistics import COVERAGES, break_amount, smoothstep
from .wobble import WOBBLE_STD

#: Distances between lines on screen, in pixels of the picture, over which lines fade in.
FADE_PIXELS = (1.3, 2.6)

#: Distances between lines on screen, relative to the `line_distance` of the look. Below the first, lines
#: are crowded: lines in other directions are drawn before them. At the second, they are not crowded at all.
CROWDED_SHARES = (0.25, 0.5)

#: Distance on the surface between the lines that replace crowded ones, in distances between the crowded ones.
COARSE_RATIO = 3.0

#: Range of distances between lines over which further lines grow between them: the base-2 logarithm
#: of the distance relative to the `line_distance` of the look.
GROWTH_OCTAVES = (0.5, 1.0)

#: Width of the edges of lines at crispness 0, as a fraction of the distance between lines.
MAX_EDGE_WIDTH = 0.5

#: Standard deviation of the displacement of lines at wobble 1, in distances between lines.
WOBBLE_SHIFT = 0.2

#: Largest weight of the short streaks of LIC noise that break lines into pieces.
MAX_BREAK_AMOUNT = 0.85

#: Label of all steps.
STEP_LABEL = "spacing lines"


@dataclass(frozen=True, eq=False)
class EvenLines:
    """Evenly spaced lines at the pixels of a field.

    Attributes
    ----------
    streaks : (M, P) float32 ndarray
        For each of the M directions of the field: 1 in the middle of a line, 0 halfway between two lines,
        linear between. Directions are in the order of `all_members(field, look.guiding_angle)`.
    period : (M, P) float32 ndarray
        Distance between lines on screen, in pixels of the frame. 0 where there are no lines.
    growth : (P,) float32 ndarray or None
        Width of the new lines halfway between the existing lines, as a fraction of the width of the existing
        lines: from 0 (no new lines) to 1 (equally wide). None if there are no new lines at any pixel.
    coarse_streaks : (M, P) float32 ndarray or None
        `streaks` of the lines that replace crowded ones. None if no lines are crowded.
    """

    streaks: np.ndarray
    period: np.ndarray
    growth: np.ndarray | None
    coarse_streaks: np.ndarray | None = None

    def part(self, extent: slice) -> EvenLines:
        """Return the evenly spaced lines at the pixels `extent`."""
        return part_of(self, (..., extent))

    def coverage(self, line: int, target_coverage: np.ndarray, look: PixelLook) -> np.ndarray:
        """Compute the coverage of each pixel by the lines of one direction of the field.

        Parameters
        ----------
        line : int
            Index of the direction, from 0 to M - 1.
        target_coverage : (P,) ndarray
            Width of the lines as a fraction of the distance between lines, 0 to 1: the mean coverage.
        look : PixelLook
            Its `crispness` and `supersampling` are used.

        Returns
        -------
        (P,) float32 ndarray
            Part of each pixel that is ink, 0 to 1.
        """
        width = np.asarray(target_coverage, dtype=np.float32)
        relief = self._relief(line, width, look)
        if self.coarse_streaks is None:
            return width + relief
        crowding = self.crowding(line, look)
        covered = width + (1 - crowding) * relief
        crowded = np.flatnonzero(crowding)
        streak, period = self.coarse_streaks[line, crowded], self.period[line, crowded]
        growth = None if self.growth is None else self.growth[crowded]
        coarse = EvenLines(streak[None], np.float32(COARSE_RATIO) * period[None], growth)
        covered[crowded] += crowding[crowded] * coarse._relief(0, width[crowded], look)
        return covered

    def _relief(self, line: int, width: np.ndarray, look: PixelLook) -> np.ndarray:
        """Return the (P,) coverage of each pixel by lines, minus their mean coverage `width`."""
        position, period = np.float32(0.5) - np.float32(0.5) * self.streaks[line], self.period[line]
        min_edge = np.float32(MAX_EDGE_WIDTH * (1 - look.crispness) ** 2)
        edge = np.clip(1 / np.maximum(period, np.float32(1e-6)), min_edge, 1)
        if self.growth is None:
            covered = _box_filtered(position, width, edge)
        else:
            between = np.float32(0.5) * self.growth * width
            covered = _box_filtered(position, width - between, edge)
            covered += _box_filtered(np.float32(0.5) - position, between, edge)
        return resolved_share(period, look.supersampling) * (covered - width)

    def crowding(self, line: int, look: PixelLook) -> np.ndarray:
        """Compute how much the lines of one direction of the field are crowded on screen.

        Parameters
        ----------
        line : int
            Index of the direction, from 0 to M - 1.
        look : PixelLook
            Its `line_distance` is used.

        Returns
        -------
        (P,) float32 ndarray
            0: not crowded; 1: closer than the smaller of the two `crowded_pixels`.
        """
        low, high = (np.float32(pixels) for pixels in crowded_pixels(look))
        return 1 - smoothstep((self.period[line] - low) / (high - low))


def resolved_share(period: np.ndarray, supersampling: int = 1) -> np.ndarray:
    """Compute how much of the contrast of lines is drawn, from 0 (too close for the pixels) to 1.

    Parameters
    ----------
    period : ndarray
        Distance between lines, in pixels of the frame.
    supersampling : int
        Pixels of the frame along a side of a pixel of the picture.
    """
    low, high = (np.float32(pixels * supersampling) for pixels in FADE_PIXELS)
    return smoothstep((period - low) / (high - low))


def crowded_pixels(look: PixelLook) -> tuple[float, float]:
    """Return the distances between lines on screen at which crowding is 1 and 0, in pixels of the frame.

    Lines closer than the first are fully crowded, lines farther apart than the second are not crowded.
    """
    low, high = CROWDED_SHARES
    return low * look.line_distance, high * look.line_distance


def _box_filtered(position: np.ndarray, width: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Return the fraction of an interval that lines cover, for lines at unit distance from each other.

    Parameters
    ----------
    position : (P,) float32 ndarray
        Distance of the center of the interval from the nearest line, 0 to 0.5.
    width : (P,) float32 ndarray
        Width of the lines, 0 to 1.
    edge : (P,) float32 ndarray
        Length of the interval: above 0, at most 1.
    """
    half, low, high = 0.5 * width, position - 0.5 * edge, position + 0.5 * edge
    covered = np.minimum(high, half) - np.maximum(low, -half)
    np.maximum(covered, 0, out=covered)
    covered += np.maximum(high - (1 - half), 0)  # the next line
    covered += np.maximum(half - 1 - low, 0)  # the previous line
    covered /= edge
    return covered


def uneven_width(
    target_coverage: np.ndarray,
    look: PixelLook,
    break_streak: np.ndarray | None,
    paper_grain: np.ndarray | None,
) -> np.ndarray:
    """Vary the widths of lines by breaks and by the paper grain, without a change of their mean width.

    Parameters
    ----------
    target_coverage : (P,) ndarray
        Mean width, as a fraction of the distance between lines.
    look : PixelLook
        Its `breaks`, `wobble` and `paper_grain` are used.
    break_streak, paper_grain : (P,) ndarray or None
        Short streaks that break lines, and the height of the paper, each with mean 0 and standard
        deviation 1; see `hatching.HatchedLines`. None if lines are not broken, or the paper has no grain.

    Returns
    -------
    (P,) ndarray
        Widths as fractions of the distance between lines, 0 to 1.
    """
    if break_streak is None and paper_grain is None:
        return target_coverage
    amount = np.minimum(break_amount(target_coverage, look.breaks, look.wobble), MAX_BREAK_AMOUNT)
    # Scaled to the standard deviation 1, the `streaks` of even lines have a uniform distribution.
    scale = 1 / ((1 - amount) * math.sqrt(12))
    width = np.interp(target_coverage, COVERAGES, look_width_table(look))
    if break_streak is not None:
        width = width + scale * amount * break_streak
    if paper_grain is not None:
        width = width + scale * PAPER_GRAIN_STRENGTH * look.paper_grain * paper_grain
    return np.clip(width, 0, 1)


def look_width_table(look: PixelLook) -> np.ndarray:
    """Return (COVERAGE_STEPS,) widths of lines before breaks and paper grain change them.

    Element i is the width for which the mean of the changed widths is i / (COVERAGE_STEPS - 1).
    """
    return _width_table(look.breaks, look.wobble, PAPER_GRAIN_STRENGTH * look.paper_grain)


@lru_cache(maxsize=16)
def _width_table(breaks: float, wobble: float, paper_grain_amplitude: float) -> np.ndarray:
    """Return (COVERAGE_STEPS,) widths m of lines before breaks and paper grain change them.

    Breaks and grain add a normally distributed variation s X to the width, and the sum is clipped to 0 to 1.
    Element i of the result is the m for which the mean of the clipped widths is i / (COVERAGE_STEPS - 1). The
    mean of clip(m + s X, 0, 1) is g(m) - g(m - 1), with g(x) = x F(x / s) + s f(x / s), where F is the
    distribution function and f the density of X. It is solved for m by bisection.

    Parameters
    ----------
    breaks, wobble : float
        Settings of the look. With the grain, they determine the standard deviation s.
    paper_grain_amplitude : float
        Standard deviation of the paper grain, in standard deviations of the streaks.
    """
    amount = np.minimum(break_amount(COVERAGES, breaks, wobble), MAX_BREAK_AMOUNT)
    spread = np.sqrt(amount**2 + paper_grain_amplitude**2) / ((1 - amount) * math.sqrt(12))
    spread = np.maximum(spread, 1e-6)
    erf = np.vectorize(math.erf, otypes=[float])

    def ramp(x: np.ndarray) -> np.ndarray:
        scaled = x / spread
        density = np.exp(-0.5 * scaled**2) / math.sqrt(2 * math.pi)
        return x * 0.5 * (1 + erf(scaled / math.sqrt(2))) + spread * density

    low, high = -6 * spread, 1 + 6 * spread
    for _ in range(40):
        middle = 0.5 * (low + high)
        is_low = ramp(middle) - ramp(middle - 1) < COVERAGES
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return 0.5 * (low + high)


def even_lines(
    gbuffer: GBuffer,
    field: PixelField,
    look: PixelLook,
    wobble_angle: np.ndarray | None = None,
    cache: Cache | None = None,
) -> EvenLines:
    """Evaluate evenly spaced lines at the pixels of a field.

    Parameters
    ----------
    gbuffer : GBuffer
        Its `instances` must be set.
    field : PixelField
        A field of one degree, from `gbuffer`.
    look : PixelLook
    wobble_angle : (P,) float32 ndarray, optional
        Angle of the wobble (lines drawn by hand) at the pixels of the field, in radians, from
        `wobble.wobble_angle`. It is for a `Look.wobble` of 1, and displaces the lines.
    cache : Cache, optional
        Stores the lines on the surfaces, which do not depend on the camera.

    Returns
    -------
    EvenLines
    """
    count = len(field.pixel)
    streaks, period = np.zeros((2, field.line_count, count), dtype=np.float32)
    growth = np.zeros(count, dtype=np.float32)
    coarse_streaks = None
    instance_id = gbuffer.instance_id[field.gbuffer_index]
    present = np.flatnonzero(np.bincount(instance_id)).tolist()
    for number, index in enumerate(present):
        start, stop = number / len(present), (number + 1) / len(present)
        lines = _InstanceLines(gbuffer, field, look, gbuffer.instances[index], wobble_angle, cache)
        pixels = np.flatnonzero(instance_id == index)
        with progress(start, (start + stop) / 2):
            result = lines.at(pixels, 1.0)
        streaks[:, pixels], period[:, pixels], growth[pixels] = result
        is_crowded = (result[1] < crowded_pixels(look)[1]).any(axis=0)
        pixels = pixels[is_crowded & (field.representation[pixels] != 0)]
        if len(pixels):
            with progress((start + stop) / 2, stop):
                result = lines.at(pixels, COARSE_RATIO)
            coarse_streaks = np.zeros_like(streaks) if coarse_streaks is None else coarse_streaks
            coarse_streaks[:, pixels] = result[0]
    return EvenLines(streaks, period, growth if growth.any() else None, coarse_streaks)


def line_phases(
    lines: SurfaceLines,
    place: tuple[np.ndarray, np.ndarray],
    field: PixelField,
    members: list[np.ndarray],
    first_direction: np.ndarray,
    step: np.ndarray | int = 1,
) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate the lines of a surface along each direction of the field, at n pixels or texels.

    Parameters
    ----------
    lines : SurfaceLines
    place : tuple of ndarray
        The n points of the surface: index of the leaf triangle and weights of its corners, from
        ``lines.tree.locate``.
    field : PixelField
        The field at the n pixels.
    members : list of (n,) complex64 ndarray
        Unit vectors in the view plane, from `all_members`.
    first_direction : (n,) int ndarray
        Index, modulo N, of ``members[0]`` among the N directions of `lines`.
    step : (n,) int ndarray or int
        Difference of this index from one member to the next: 1, or -1 where the surface is seen from behind.

    Returns
    -------
    phases : (M, n) float32 ndarray
        Phase of the lines along each of the M line directions: the position across these lines, in distances
        between lines.
    foreshortening : (M, n) float32 ndarray
        Distance between lines on screen, relative to the distance on a surface that faces the eye.
    """
    across = np.abs((field.screen_jacobian[:, 0].conj() * field.screen_jacobian[:, 1]).imag)
    phases, foreshortening = np.empty((2, field.line_count, len(across)), dtype=np.float32)
    for line in range(field.line_count):
        family = (first_direction + step * line) % field.degree % field.line_count
        phases[line] = lines.pattern.evaluate(*place, family)
        along = np.abs(field.to_screen(field.member_direction(members[line]), foreshorten=True))
        foreshortening[line] = across / np.maximum(along, np.float32(1e-6))
    return phases, foreshortening


class _InstanceLines:
    """The evenly spaced lines of one mesh instance.

    The parameters are the G-buffer, a field of one degree from it, the look, the mesh instance, and the
    wobble angle and the cache of `even_lines`.
    """

    def __init__(
        self,
        gbuffer: GBuffer,
        field: PixelField,
        look: PixelLook,
        instance: MeshInstance,
        wobble_angle: np.ndarray | None,
        cache: Cache | None,
    ) -> None:
        self._gbuffer, self._field, self._look = gbuffer, field, look
        self._instance, self._wobble_angle, self._cache = instance, wobble_angle, cache
        #: Distance between lines on the surface, in Blender units.
        self._spacing = instance_line_spacing(look, gbuffer.camera, instance)
        # The sides of triangles from corner 0 to corners 1 and 2, in camera space.
        matrix = gbuffer.camera.view @ np.asarray(instance.matrix, dtype=np.float64)
        surface = instance.surface
        points = transform_components(np.ascontiguousarray(surface.vertices.T), matrix[:3, :3])
        first, *others = (points.take(corner, axis=1) for corner in surface.triangle_vertex.T)
        self._sides = np.stack([(corner - first).astype(np.float32) for corner in others])

    def at(self, pixels: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Evaluate the evenly spaced lines of the instance at some pixels of the field.

        Parameters
        ----------
        pixels : (n,) intp ndarray
            Indices into the pixels of the field.
        ratio : float
            Distance between lines on the surface, relative to the `line_distance` of the look.

        Returns
        -------
        streaks, period : (M, n) float32 ndarray
            `EvenLines.streaks`, and the distance between lines on screen in pixels of the frame. `period`
            does not depend on `ratio`: it is the distance at the ratio 1.
        growth : (n,) float32 ndarray
            Width of the new lines as a fraction of the width of the existing lines, 0 to 1.
        """
        look, spacing = self._look, ratio * self._spacing
        lines = cached_surface_lines(self._instance, look.display, spacing, self._cache)
        streaks, period = np.empty((2, self._field.line_count, len(pixels)), dtype=np.float32)
        growth = np.zeros(len(pixels), dtype=np.float32)
        for block in reported_blocks(len(pixels), STEP_LABEL, 1.0, 1.0):
            part = pixels[block]
            phases, line_period, octaves = self._evaluate(self._field.part(part), lines)
            if self._wobble_angle is not None:
                shift = np.float32(look.wobble * WOBBLE_SHIFT / WOBBLE_STD)
                phases += shift * self._wobble_angle[part]
            if octaves is not None:
                doublings = np.floor(octaves)
                first, last = GROWTH_OCTAVES
                growth[block] = smoothstep((octaves - doublings - first) / (last - first))
                scale = np.exp2(doublings).astype(np.float32)
                phases *= scale
                line_period /= scale
            streaks[:, block] = 1 - 2 * np.abs(phases - np.rint(phases))
            period[:, block] = line_period
        return streaks, period, growth

    def _evaluate(
        self, field: PixelField, lines: SurfaceLines
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Evaluate the lines of the surface at the pixels of `field`, which holds some pixels of the frame.

        Returns
        -------
        phases : (M, n) float32 ndarray
            Phase of each of the M families of lines. Lines lie where it is an integer.
        period : (M, n) float32 ndarray
            Distance between lines on screen, in pixels of the frame.
        octaves : (n,) float32 ndarray or None
            Base-2 logarithm of the distance between lines, without foreshortening, relative to the
            `line_distance` of the look, at least 0. None if no further lines grow where lines are far apart.
        """
        gbuffer, look, entries = self._gbuffer, self._look, field.gbuffer_index
        leaf, weights = lines.tree.locate(gbuffer.triangle[entries], gbuffer.barycentric[entries])
        members = all_members(field, look.guiding_angle)
        # Directions of the surface are counted counter-clockwise about the normal of the triangle.
        step = np.where(gbuffer.front_facing[entries], 1, -1)
        heading = self._heading_in_view(entries, lines.heading.take(leaf, axis=1))
        relative = members[0] * heading.conj()
        turn = vector_angle(relative.real, relative.imag) * np.float32(field.degree / (2 * np.pi))
        first_direction = step * np.rint(turn).astype(np.int32)
        asked_pixels = np.float32(look.line_distance)
        # Distance between lines on screen, relative to `line_distance`.
        unit = self._spacing / look.line_distance
        scale = np.full(len(entries), unit * gbuffer.camera.pixels_per_unit, dtype=np.float32)
        if gbuffer.camera.is_perspective:
            scale /= -gbuffer.position[entries, 2]
        octaves = None
        if not look.pixel_size:
            octaves = np.maximum(np.log2(np.maximum(scale, np.float32(1e-9))), 0)
        defined = (field.representation != 0) & (heading != 0)
        place = leaf, weights
        phases, foreshortening = line_phases(lines, place, field, members, first_direction, step)
        return phases, asked_pixels * scale * foreshortening * defined, octaves

    def _heading_in_view(self, entries: np.ndarray, heading: np.ndarray) -> np.ndarray:
        """Return the (n,) complex64 directions in the view plane of headings on the surface.

        `heading`, (2, n), is from `SurfaceLines.heading`: a unit vector in the plane of the triangle, as
        multiples of the sides from corner 0 to corner 1 and to corner 2. `entries` are the indices of the n
        pixels in the G-buffer.
        """
        gbuffer = self._gbuffer
        first, second = self._sides.take(gbuffer.triangle[entries], axis=2)
        tangent = heading[0] * first + heading[1] * second
        normal, view = gbuffer.geometric_normal[entries].T, gbuffer.view_direction[entries].T
        return view_plane_rotation(tangent, normal, view)

"""Hatching: thresholds turn LIC images into lines of ink on paper that reproduce a tone.

Ink is drawn where the streaks of an LIC image exceed a threshold. The fraction of the paper above any
threshold is known from the statistics of streaks (`streak_statistics`), so the threshold follows from the
coverage that the tone requires, and no image has to be analyzed.

A *line* here is a pair of opposite directions of the field, and all ink along it. M lines cross at a pixel.
Each line with the coverage a transmits 1 - a of the light. To reach the tone T together, each line transmits
1 - a = T^s, with shares s that sum to 1. In light tones one line has the share 1. Further lines join in
darker tones, in order of their angle to the guiding angle (their *rank*).

Effects that make lines uneven are added to the streaks before the threshold: shorter streaks, which break
lines or vary their width, and the grain of the paper. The statistics include them: the tone stays the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.color import map_colors, to_linear
from .even_lines import EvenLines, uneven_width
from .family_hues import line_families
from .image_noise import NOISE_MEAN
from .inks import MAX_INKS, has_ink_per_line, ink_count, inks_of
from .lic_images import LicImages, magnitude_ends, relative_magnitude
from .look import colors_magnitude, is_even, is_hatched, undefined_drawing
from .look_units import PixelLook
from .paper_grain import PAPER_GRAIN_STRENGTH
from .pixel_field import PixelField, all_members
from .streak_statistics import (
    COVERAGES,
    NO_INK,
    break_amount,
    break_steps,
    look_streak_statistics,
    smoothstep,
    softness,
)

#: Range of darkness (1 - tone), beyond the onset of a line, over which the line grows to its full share.
ONSET_RANGE = 0.35

#: A line already begins faintly at this darkness before its onset. This hides the seam where two lines swap
#: ranks.
ONSET_LEAD = 0.15

#: Half the width of the blend between two ranks, in units of the rank.
RANK_BLEND = 0.4

#: Half the width of the step from paper to ink of antialiased streaks, in multiples of the change of the
#: streak over a pixel.
PIXEL_SOFTNESS = 1.0

#: Coverage, as a fraction of a pixel, below which ink is not visible.
MIN_COVERAGE = 1e-3


class HatchedLines(NamedTuple):
    """The input of hatching: streaks or even lines, what makes them uneven, and the outline.

    Attributes
    ----------
    look : PixelLook
    images : LicImages or None
        Member images in the order of `all_members(field, look.guiding_angle)`, once they are computed.
    break_images : LicImages or None
        LIC images whose streaks are as long as the pieces of broken lines (`break_steps`), if there are any.
    paper_grain : (M, P) float32 ndarray or None
        Height of the paper for each line, with mean 0 and standard deviation 1. Ink adheres better
        where it is larger.
    line_tones : (M, P) float32 ndarray or None
        Target tone of each line, linear, 0 to 1, if it differs from the tone of the pixel: the mean
        of the tone along the line. Lines then overshoot the borders of tones and get thinner there.
    outline : (P,) float32 ndarray or None
        Coverage of each pixel by lines along silhouettes and creases, 0 to 1.
    undirected : (P,) float32 ndarray or None
        Mean of the noise over a disc where the field is undefined, relative to `NOISE_MEAN`; NaN elsewhere.
    even_lines : EvenLines or None
        Evenly spaced lines, if they are drawn instead of the streaks of LIC images.
    """

    look: PixelLook
    images: LicImages | None = None
    break_images: LicImages | None = None
    paper_grain: np.ndarray | None = None
    line_tones: np.ndarray | None = None
    outline: np.ndarray | None = None
    undirected: np.ndarray | None = None
    even_lines: EvenLines | None = None

    def part(self, extent: slice) -> HatchedLines:
        """Return the input of hatching at the pixels `extent` only."""
        return HatchedLines(self.look, *(_part(values, extent) for values in self[1:]))

    def relief(self, line: int) -> np.ndarray | np.float32:
        """Return what the paper grain adds to the LIC image of one direction of the field.

        `line` is the index of the direction. The result is (P,) float32, in standard deviations of the image;
        or the scalar 0 if there is no paper grain.
        """
        if self.paper_grain is None:
            return np.float32(0)
        return np.float32(PAPER_GRAIN_STRENGTH * self.look.paper_grain) * self.paper_grain[line]

    def break_streak(self, line: int) -> np.ndarray | None:
        """Return the (P,) noise, averaged along short streamlines, that breaks lines of ink into pieces.

        `line` is the index of a direction of the field (opposite members count as one). The mean is 0, the
        standard deviation 1. None if lines are not broken.
        """
        if self.break_images is None:
            return None
        std = look_streak_statistics(self.look).break_std
        return standard_streak(self.break_images, line, std)[0]

    def spots(self, line: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the pixels where the field is undefined, and what is thresholded there in place of a LIC image.

        The pixels are (n,) indices. The (n,) float32 values are `undirected`, scaled to the standard
        deviation 1, plus the paper grain of the line with the index `line`. If no spots are drawn, they are
        below all thresholds.
        """
        below = 0 if undefined_drawing(self.look) == "texture" else np.float32(NO_INK)
        std = np.float32(look_streak_statistics(self.look).disc_std)
        spots = self.undirected / std + self.relief(line) - below
        undefined = np.flatnonzero(~np.isnan(spots))
        return undefined, spots[undefined]

    def target_tones(self, tone: np.ndarray) -> np.ndarray:
        """Return the target tones of lines: (M, P) `line_tones` if set, else the (P,) `tone` as (1, P)."""
        return tone[None] if self.line_tones is None else self.line_tones

    def coverage(self, line: int, target_coverage: np.ndarray) -> np.ndarray:
        """Compute the coverage of each pixel by the ink lines along one direction of the field.

        Parameters
        ----------
        line : int
            Index of the direction (opposite members count as one), as in `images.members`.
        target_coverage : (P,) ndarray
            Fraction of the paper that these lines should cover on average, 0 to 1.

        Returns
        -------
        (P,) float32 ndarray
            0 to 1.
        """
        look = self.look
        if self.even_lines is not None:
            grain = None if self.paper_grain is None else self.paper_grain[line]
            width = uneven_width(target_coverage, look, self.break_streak(line), grain)
            coverage = self.even_lines.coverage(line, width, look)
        else:
            statistics = look_streak_statistics(look)
            streak, slope = standard_streak(self.images, line, statistics.std)
            if self.break_images is not None:
                amount = break_amount(target_coverage, look.breaks, look.wobble)
                broken = standard_streak(self.break_images, line, statistics.break_std)
                streak += amount * (broken[0] - streak)
                if slope is not None:
                    slope += amount * (broken[1] - slope)
            streak += self.relief(line)
            coverage = _above_threshold(streak, target_coverage, statistics.threshold, look, slope)
        if self.undirected is not None:
            undefined, spots = self.spots(line)
            target, table = target_coverage[undefined], look_streak_statistics(look).disc_threshold
            coverage[undefined] = _above_threshold(spots, target, table, look)
        return coverage


def _part(values: Any, extent: slice) -> Any:
    """Return values (an array, or an object with a method `part`) at some of the pixels; None for None."""
    if values is None:
        return None
    return values[..., extent] if isinstance(values, np.ndarray) else values.part(extent)


def render_hatching(
    field: PixelField, lines: HatchedLines, tone: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the lines of a field with ink on paper.

    Parameters
    ----------
    field : PixelField
    lines : HatchedLines
    tone : (P,) float32 ndarray
        Target tone, linear, 0 to 1.

    Returns
    -------
    color : (P, 3) float32 ndarray
        Linear color of ink and paper, not premultiplied.
    alpha : (P,) float32 ndarray
        1 if the paper is opaque, the coverage by ink if the paper is transparent.
    """
    tone = np.clip(tone, 0, 1)
    ink_indices = line_ink_indices(field, lines.look)
    if ink_indices is None:
        ink, coverage = _render_one_ink(field, lines, tone)
    else:
        ink, coverage = _render_many_inks(field, lines, tone, ink_indices)
    return inks_of(lines.look.look).on_paper(ink, coverage)


def _render_one_ink(
    field: PixelField, lines: HatchedLines, tone: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the (P, 3) linear color of the ink and its (P,) coverage, if all lines have the same ink."""
    look = lines.look
    inks = inks_of(look.look)
    by_magnitude, position = colors_magnitude(look), field.map_position
    if by_magnitude:
        magnitude = relative_magnitude(field, magnitude_ends(look, field))
        ink = to_linear(map_colors(magnitude, look.color_map))
    else:
        ink = inks.ink_at_tone(np.zeros_like(tone), tone)
    if position is not None:
        mapped = to_linear(map_colors(np.nan_to_num(position), look.color_map))
        ink = np.where(np.isnan(position)[:, None], ink, mapped)
    transmittance = inks.complement_if_light(lines.target_tones(tone))
    if not by_magnitude and position is None:
        transmittance = 1 - inks.required_coverage(inks.target_transmittance(transmittance), ink)
    bare_paper = np.ones_like(tone)
    for line, share in enumerate(line_shares(field, lines, transmittance)):
        target_coverage = 1 - transmittance[line % len(transmittance)] ** share
        bare_paper *= 1 - lines.coverage(line, target_coverage)
    if lines.outline is not None:
        bare_paper *= 1 - lines.outline
    return ink, 1 - bare_paper


def _render_many_inks(
    field: PixelField, lines: HatchedLines, tone: np.ndarray, ink_indices: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the (P, 3) linear color of the ink and its (P,) coverage, if lines have different inks.

    `ink_indices` has the (P,) ink of each of the M lines. Inks are transparent: the transmittances of
    crossing lines are multiplied.
    """
    look = lines.look
    inks = inks_of(look.look, ink_count(look.look, field.line_count, field.family_count))
    transmittance = inks.complement_if_light(lines.target_tones(tone))
    target_transmittance = inks.target_transmittance(transmittance)
    bare_paper = np.ones_like(tone)
    transmitted = np.ones((len(tone), 3), dtype=np.float32)
    for line, share in enumerate(line_shares(field, lines, transmittance)):
        ink = inks.ink_at_tone(ink_indices[line], tone)
        line_transmittance = target_transmittance[line % len(target_transmittance)] ** share
        target_coverage = inks.required_coverage(line_transmittance, ink)
        coverage = lines.coverage(line, target_coverage)
        transmitted *= 1 - coverage[:, None] * (1 - inks.transmittance(ink))
        bare_paper *= 1 - coverage
    if lines.outline is not None:
        ink = inks.ink_at_tone(np.zeros_like(tone), tone)
        transmitted *= 1 - lines.outline[:, None] * (1 - inks.transmittance(ink))
        bare_paper *= 1 - lines.outline
    color = inks.complement_if_light(inks.complement_if_light(inks.paper) * transmitted)
    coverage = 1 - bare_paper
    # color = paper + coverage * (ink - paper), solved for the ink.
    ink = inks.paper + (color - inks.paper) / np.maximum(coverage, MIN_COVERAGE)[:, None]
    return np.clip(ink, 0, 1), coverage


def standard_streak(
    images: LicImages, line: int, std: float
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the LIC image of one direction of the field with mean 0 and variance 1, and its slopes.

    `line` is the index of the direction, `std` the standard deviation of `images`. The slopes
    (`LicImages.slopes`) are scaled in the same way, or None if the images have none.
    """
    streak = (images.members[line].mean(axis=1) - NOISE_MEAN) / std
    return streak, None if images.slopes is None else images.slopes[line] / std


def _above_threshold(
    streak: np.ndarray,
    target_coverage: np.ndarray,
    thresholds: np.ndarray,
    look: PixelLook,
    slope: np.ndarray | None = None,
) -> np.ndarray:
    """Return (P,) coverages: 1 where streaks exceed the threshold of the target coverage, with soft edges.

    Parameters
    ----------
    streak : (P,) ndarray
        Streaks with mean 0 and standard deviation 1.
    target_coverage : (P,) ndarray
        0 to 1.
    thresholds : (COVERAGE_STEPS,) ndarray
        Threshold for each coverage from 0 to 1: `StreakStatistics.threshold` or `disc_threshold`.
    look : PixelLook
        Its `crispness` is used.
    slope : (P,) ndarray, optional
        Change of the streak across the line, per pixel. Edges are then at least as soft as in a mean over a
        pixel.
    """
    threshold = np.interp(target_coverage, COVERAGES, thresholds)
    half_width = np.float32(softness(look.crispness))
    if slope is not None:
        slope = np.float32(PIXEL_SOFTNESS) * slope
        slope *= slope
        # The wider edges add slope**2 / 5 to the variance of the streaks, which is 1. The
        # threshold moves by as much, so that the mean coverage stays.
        threshold = threshold * np.sqrt(1 + slope / 5)
        half_width = np.sqrt(half_width * half_width + slope)
    return smoothstep((streak - threshold) / (2 * half_width) + 0.5)


def has_breaks(look: Any) -> bool:
    """Return whether lines are broken into pieces, or vary in width as drawn by hand."""
    return is_hatched(look) and (look.breaks > 0 or look.wobble > 0)


def line_images(
    look: PixelLook, convolve: Callable[[list[PixelLook]], list[LicImages]]
) -> tuple[LicImages | None, LicImages | None]:
    """Compute the LIC images for a look with ink: of its lines, and of the breaks in lines.

    Parameters
    ----------
    look : PixelLook
    convolve : callable
        Function that computes LIC images for looks that differ in the length of streamlines, the longest
        first.

    Returns
    -------
    images : LicImages or None
        Images of the lines. None if lines are evenly spaced, because these need no noise.
    break_images : LicImages or None
        Images with shorter streamlines, which determine where lines break. None if lines do not break.
    """
    looks = [] if is_even(look) else [look]
    if has_breaks(look):
        looks.append(look.with_length(break_steps(look)))
    images = convolve(looks) if looks else []
    return None if is_even(look) else images[0], images[-1] if has_breaks(look) else None


def has_overshoot(look: Any) -> bool:
    """Return whether lines continue past the borders of tones."""
    return is_hatched(look) and look.overshoot > 0


def overshoot_steps(look: PixelLook) -> int:
    """Return the steps in each direction over which the tone is averaged for the overshoot."""
    return max(round(look.overshoot), 1)


def has_outline(look: Any) -> bool:
    """Return whether lines are drawn along silhouettes and creases."""
    return is_hatched(look) and look.outline > 0


def has_paper_grain(look: Any) -> bool:
    """Return whether the grain of the paper breaks up the ink."""
    return is_hatched(look) and look.paper_grain > 0


def is_shaded_by_pixel(look: Any) -> bool:
    """Return whether a pixel with several samples is shaded once (True) or at every sample (False).

    Hatching needs the slopes of streaks to smooth the edges of the ink, and only the method "sheets"
    computes them.
    """
    return not is_hatched(look) or look.method == "sheets"


def line_ink_indices(field: PixelField, look: PixelLook) -> list[np.ndarray] | None:
    """Find the ink of each line at each pixel.

    All lines of a family have the same ink. If the field does not distinguish families, the ink is chosen by
    the rank of the line: its place in the order of the angles to the guiding angle.

    Returns
    -------
    list of M (P,) ndarrays, or None
        Indices of inks (see `Inks.ink_at_tone`). If inks are chosen by rank, indices are fractional where
        two lines swap ranks. None if all lines have the same ink.
    """
    if not has_ink_per_line(look.look):
        return None
    families = line_families(field, look)
    if families is not None:
        return [np.minimum(family, MAX_INKS - 1) for family in families]
    return [soft_rank_of(rank, field.line_count) for rank in line_ranks(field, look)]


def line_ranks(field: PixelField, look: PixelLook) -> list[np.ndarray]:
    """Return M (P,) float32 arrays: the angle between each line and the guiding angle, scaled to 0 to M.

    A line has a rank from k to k + 1 if k other lines are nearer to the guiding angle. Where two
    lines swap ranks, both have the same integer rank.
    """
    ranks = []
    for member in all_members(field, look.guiding_angle)[: field.line_count]:
        relative = member * np.complex64(np.exp(-1j * look.guiding_angle))
        angle = np.arctan2(np.abs(relative.imag), np.abs(relative.real))
        ranks.append(angle * np.float32(2 * field.line_count / np.pi))
    return ranks


def soft_rank_of(rank: np.ndarray, rank_count: int) -> np.ndarray:
    """Round ranks down to integers, with a smooth transition around the integers, where lines swap ranks.

    The result is at most `rank_count - 1`.
    """
    soft_rank = np.zeros_like(rank)
    for boundary in range(1, rank_count):
        soft_rank += smoothstep((rank - boundary + RANK_BLEND) / (2 * RANK_BLEND))
    return soft_rank


def line_shares(
    field: PixelField, lines: HatchedLines, transmittance: np.ndarray
) -> list[np.ndarray]:
    """Compute the share s of the ink that each line takes: the line transmits T^s of the light.

    Lines join as the picture gets darker, in the order of their ranks. Even lines that are crowded
    join last. The shares are continuous where two lines swap ranks, so no seam is visible.

    Parameters
    ----------
    field : PixelField
    lines : HatchedLines
        The lines of the field at the same pixels. The shares depend on their look, and on their evenly spaced
        lines if there are any.
    transmittance : (M, P) or (1, P) ndarray
        Target transmittance of all ink together, with a row for each line if lines have different targets.

    Returns
    -------
    list of M (P,) float32 ndarrays
        If all lines have the same target, the shares sum to 1 at each pixel. Where the field is
        undefined, the first line has the share 1.
    """
    onsets = _onset_darkness(field, lines.look, lines.even_lines)
    first_onset = np.minimum.reduce(onsets)
    delays = [onset - first_onset for onset in onsets]
    rows = [onset_shares(darkness, delays) for darkness in 1 - transmittance]
    shares = rows[0] if len(rows) == 1 else [row[line] for line, row in enumerate(rows)]
    undefined = field.representation == 0
    if undefined.any():
        for line, share in enumerate(shares):
            share[undefined] = line == 0
    return shares


def onset_shares(darkness: np.ndarray, delays: Sequence[np.ndarray | float]) -> list[np.ndarray]:
    """Compute the share of the ink that each line takes in the hatching of a tone.

    Parameters
    ----------
    darkness : ndarray
        1 - transmittance of the tone, 0 to 1.
    delays : sequence of ndarray or float
        For each line, the darkness at which it joins.

    Returns
    -------
    list of ndarray
        Share of each line, from 0 (it has no ink) to 1. The shares sum to 1.
    """
    extent = ONSET_RANGE + ONSET_LEAD
    weights = [smoothstep((darkness - delay + ONSET_LEAD) / extent) for delay in delays]
    total = np.add.reduce(weights)
    return [weight / total for weight in weights]


def _onset_darkness(
    field: PixelField, look: PixelLook, even_lines: EvenLines | None
) -> list[np.ndarray]:
    """Return M (P,) arrays: the darkness (1 - transmittance) at which each line joins the hatching.

    It is above 1 for ranks beyond `look.layers`, so these lines are never drawn. Crowded `even_lines` join
    later.
    """
    onsets = []
    for line, rank in enumerate(line_ranks(field, look)):
        onset = soft_rank_of(rank, look.layers) * np.float32(look.layering)
        if look.layers < field.line_count:
            onset += 2 * smoothstep((rank - look.layers + RANK_BLEND) / (2 * RANK_BLEND))
        if even_lines is not None:
            delay = np.float32(field.line_count * look.layering)
            onset += delay * even_lines.crowding(line, look)
        onsets.append(onset)
    return onsets

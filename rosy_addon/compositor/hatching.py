"""Lines of ink on paper, as many and as wide as the tone asks for.

Every streak of an LIC image stands for a line that may be drawn: ink lies where the streak rises above a
threshold. How much of the paper streaks above any threshold cover is known from their statistics,
so the threshold follows from the coverage that is wanted; no image is analysed. Of several families of
lines each leaves (1 - a) of the light, so that together they leave the tone T if they take shares s of
it, 1 - a = T^s with shares that sum to 1. In light tones one family has it all, in darker ones the next
ones join in, those nearest to the guiding angle first.

Whatever makes lines uneven is part of the streaks before they are compared with the threshold, and
of the statistics that it comes from, so that the tone stays: shorter streaks, which break lines or make
them swell and thin out, and the tooth of the paper.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from .anchored import OCTAVES, octave_shares
from .colour import map_colours, to_linear
from .flow import Flow, all_members
from .hues import families_of_lines
from .images import Images, relative_magnitude
from .inks import INKS, inks_of
from .look import Look
from .noise import MEAN, image_noise
from .paper import TOOTH, paper_tooth, surface_tooth

#: Darkness over which a family that joins in comes to its full share.
JOINING = 0.35

#: By how much earlier it begins to, faintly: where two change places, they do so without a seam.
EARLY = 0.15

#: Half the width of the step from paper to ink, in deviations of the streaks: soft and crisp.
SOFTEST, CRISPEST = 1.6, 0.2

#: How far lines are made of pieces where a hand wavers as much as it can.
SWELL = 0.5

#: Length of the pieces of broken lines each way, in grains, and at most as a part of the whole.
PIECE, LONGEST_PIECE = 4.0, 0.4

#: Share of a pixel below which it has no ink that could be seen.
LEAST = 1e-3

#: Coverages of which a line's is looked up, and of how many degrees of brokenness.
STEPS, BREAKS = 256, 17

#: Side of the sample that thresholds are read off, in grains and at least and at most in pixels; and
#: into how many steps the streaks in it are sorted.
SAMPLE, SMALLEST_SAMPLE, LARGEST_SAMPLE, BINS = 64, 320, 768, 1600


class Hand(NamedTuple):
    """What makes lines uneven.

    Attributes
    ----------
    pieces : Images or None
        Of streaks as long as the pieces of broken lines (`piece_length`).
    tooth : (M, P) float32 ndarray or None
        How much better than elsewhere the paper takes the ink of each line, in deviations.
    tones : (M, P) float32 ndarray or None
        The light that each line is to leave, if that is not the tone alone: its mean along the line,
        so that lines run on past the borders of tones, thinning out, the strongest farthest.

    outline : (P,) float32 ndarray or None
        How much of each pixel is covered by lines along silhouettes and creases.
    """

    pieces: Images | None = None
    tooth: np.ndarray | None = None
    tones: np.ndarray | None = None
    outline: np.ndarray | None = None


def hatched(
    flow: Flow, images: Images, look: Look, tone: np.ndarray, hand: Hand
) -> tuple[np.ndarray, np.ndarray]:
    """Lines of ink on paper.

    Parameters
    ----------
    flow : Flow
    images : Images
        Of the members from that nearest to the look's guiding angle on.
    look : Look
        With its lengths in the pixels of the frame.
    tone : (P,) float32 ndarray
        The light that there is to be, 0 to 1, linear.
    hand : Hand
        What makes them uneven.

    Returns
    -------
    colour : (P, 3) float32 ndarray
        Linear light; of clear paper that of the ink alone.
    alpha : (P,) float32 ndarray
        1, and of clear paper how much of the pixel is ink.
    """
    tone = np.clip(tone, 0, 1)
    families = families_of_ink(flow, look)
    if families is None:
        ink, coverage = _one_ink(flow, images, look, tone, hand)
    else:
        ink, coverage = _many_inks(flow, images, look, tone, hand, families)
    if look.clear_paper:
        return ink, coverage
    paper = inks_of(look).paper
    return paper + coverage[:, None] * (ink - paper), np.ones_like(coverage)


def _one_ink(
    flow: Flow, images: Images, look: Look, tone: np.ndarray, hand: Hand
) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) linear light of the ink, and (P,) how much of each pixel it covers."""
    inks = inks_of(look)
    by_magnitude = look.magnitude in ("colour", "both")
    if by_magnitude:
        ink = to_linear(map_colours(relative_magnitude(flow, look), look.colour_map))
    else:
        ink = inks.at(np.zeros_like(tone), tone)
    left = inks.inverted(_tones(tone, hand))
    if not by_magnitude:
        left = 1 - inks.covering(inks.wanted(left), ink)
    paper = np.ones_like(tone)
    for line, share in enumerate(family_shares(flow, look, left)):
        covered = 1 - left[line % len(left)] ** share
        paper *= 1 - line_coverage(line, covered, images, look, hand)
    if hand.outline is not None:
        paper *= 1 - hand.outline
    return ink, 1 - paper


def _many_inks(
    flow: Flow,
    images: Images,
    look: Look,
    tone: np.ndarray,
    hand: Hand,
    families: list[np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """The same with an ink for each family: each lets some light through, and they multiply."""
    inks = inks_of(look, inks_told(flow))
    left = inks.inverted(_tones(tone, hand))
    wanted = inks.wanted(left)
    paper = np.ones_like(tone)
    through = np.ones((len(tone), 3), dtype=np.float32)
    for line, share in enumerate(family_shares(flow, look, left)):
        ink = inks.at(families[line], tone)
        covered = inks.covering(wanted[line % len(wanted)] ** share, ink)
        coverage = line_coverage(line, covered, images, look, hand)
        through *= 1 - coverage[:, None] * (1 - inks.through(ink))
        paper *= 1 - coverage
    if hand.outline is not None:
        ink = inks.at(np.zeros_like(tone), tone)
        through *= 1 - hand.outline[:, None] * (1 - inks.through(ink))
        paper *= 1 - hand.outline
    colour = inks.inverted(inks.inverted(inks.paper) * through)
    coverage = 1 - paper
    # What is seen is paper and ink: the ink is what is left without the paper.
    ink = inks.paper + (colour - inks.paper) / np.maximum(coverage, LEAST)[:, None]
    return np.clip(ink, 0, 1), coverage


def _tones(tone: np.ndarray, hand: Hand) -> np.ndarray:
    """(M, P) the light that each line is to leave, or (1, P) if it is the same for all."""
    return tone[None] if hand.tones is None else hand.tones


def line_coverage(
    line: int, covered: np.ndarray, images: Images, look: Look, hand: Hand
) -> np.ndarray:
    """How much of each pixel the ink of one line covers.

    Parameters
    ----------
    line : int
        Which of the images' members.
    covered : (P,) ndarray
        How much of the paper it is to cover, 0 to 1.
    images, look, hand
        As of `hatched`.

    Returns
    -------
    (P,) float32 ndarray
    """
    statistics = statistics_of(look)
    streak = (images.members[line].mean(axis=1) - MEAN) / statistics.deviation
    if hand.pieces is not None:
        piece = (hand.pieces.members[line].mean(axis=1) - MEAN) / statistics.piece_deviation
        streak += brokenness(covered, look.breaks, look.wobble) * (piece - streak)
    if hand.tooth is not None:
        streak += np.float32(TOOTH * look.paper_grain) * hand.tooth[line]
    limit = np.interp(covered, np.linspace(0, 1, STEPS), statistics.threshold)
    return _smooth_step((streak - limit) / (2 * softness(look.crispness)) + 0.5)


def brokenness(covered: np.ndarray, breaks: float, wobble: float) -> np.ndarray:
    """How far lines are made of pieces, where they are to cover so much of the paper.

    The lights break first; a hand that wavers makes lines swell and thin out everywhere.
    """
    least = SWELL * wobble
    return least + (1 - least) * breaks * (1 - covered) ** 2


def has_pieces(look: Look) -> bool:
    """Whether lines are made of pieces at all."""
    return look.ink == "hatch" and (look.breaks > 0 or look.wobble > 0)


def runs_on(look: Look) -> bool:
    """Whether lines run on past the borders of tones."""
    return look.ink == "hatch" and look.overshoot > 0


def has_outline(look: Look) -> bool:
    """Whether there are lines along silhouettes and creases."""
    return look.ink == "hatch" and look.outline > 0


def has_tooth(look: Look) -> bool:
    """Whether ink catches on the tooth of the paper."""
    return look.ink == "hatch" and look.paper_grain > 0


def piece_length(look: Look) -> int:
    """Steps each way of the streaks that lines are broken into."""
    steps = min(PIECE * look.grain / look.step, LONGEST_PIECE * look.length)
    return max(round(steps), 1)


def families_of_ink(flow: Flow, look: Look) -> list[np.ndarray] | None:
    """M times (P,): the number of the ink that each line is drawn with; None if all have one.

    That of its family or, if the field's lines are not told apart, by how near it is to the guiding
    angle, in between where two change places.
    """
    if look.hue == "one" or look.magnitude in ("colour", "both"):
        return None
    told = families_of_lines(flow, look)
    if told is not None:
        return [np.minimum(family, INKS - 1) for family in told]
    return [_places(rank, flow.lines) for rank in _ranks(flow, look)]


def inks_told(flow: Flow) -> int:
    """How many inks the lines of a field are drawn with, if each has its own."""
    told = next((number for kind, number in flow.traits if kind == "family"), flow.lines)
    return min(told, INKS)


def _ranks(flow: Flow, look: Look) -> list[np.ndarray]:
    """M times (P,): how many lines are nearer to the guiding angle, going over from one to the next."""
    ranks = []
    for member in all_members(flow, look.guiding_angle)[: flow.lines]:
        toward = member * np.complex64(np.exp(-1j * look.guiding_angle))
        away = np.arctan2(np.abs(toward.imag), np.abs(toward.real))
        ranks.append(away * np.float32(2 * flow.lines / np.pi))
    return ranks


def _places(rank: np.ndarray, count: int) -> np.ndarray:
    """Ranks as whole numbers from 0, but around those at which two lines change places."""
    place = np.zeros_like(rank)
    for layer in range(1, count):
        place += _smooth_step((rank - layer + 0.4) / 0.8)
    return place


def family_shares(flow: Flow, look: Look, left: np.ndarray) -> list[np.ndarray]:
    """M times (P,) float32: which share of the ink each line takes.

    By how many others are nearer to the guiding angle, as a number that goes over from one to the
    next: where two families change places both take the same, and no seam shows. Of lines that are to
    leave the same the shares sum to 1.

    Parameters
    ----------
    flow : Flow
    look : Look
        Its `guiding_angle`, `layers` and `layering` count.
    left : (M, P) or (1, P) ndarray
        What each line, or all of them, are to leave of the paper's light.
    """
    onsets = [_onset(rank, look) for rank in _ranks(flow, look)]
    first = np.minimum.reduce(onsets)
    later = [onset - first for onset in onsets]
    found = []
    for dark in 1 - left:
        shares = [_smooth_step((dark - onset + EARLY) / (JOINING + EARLY)) for onset in later]
        total = np.add.reduce(shares)
        if len(left) == 1:
            return [share / total for share in shares]
        found.append(shares[len(found)] / total)
    return found


def _onset(rank: np.ndarray, look: Look) -> np.ndarray:
    """The darkness at which lines of a rank join in; beyond 1 where they are one layer too many."""
    onset = _places(rank, look.layers) * np.float32(look.layering)
    return onset + 2 * _smooth_step((rank - look.layers + 0.4) / 0.8)


def softness(crispness: float) -> float:
    """Half the width of the step from paper to ink, in deviations."""
    return SOFTEST * (CRISPEST / SOFTEST) ** crispness


class Statistics(NamedTuple):
    """What streaks are like, by which lines of ink are drawn.

    Attributes
    ----------
    threshold : (STEPS,) float64 ndarray
        Above which value streaks are ink, for them to cover even shares of the paper from 0 to 1,
        in deviations from the mean.
    deviation : float
        Of the streaks.
    piece_deviation : float
        Of those as long as the pieces of broken lines.
    tooth_deviation : float
        Of a tooth that stays with surfaces.
    """

    threshold: np.ndarray
    deviation: float
    piece_deviation: float
    tooth_deviation: float = 1.0


def statistics_of(look: Look) -> Statistics:
    """`ink_statistics` of a look, with its lengths in the pixels of the frame."""
    return ink_statistics(
        (2 * look.length + 1) * look.step,
        look.grain,
        look.density,
        look.high_pass,
        look.crispness,
        tapered=look.taper,
        anchored=look.anchor == "surface",
        piece=(2 * piece_length(look) + 1) * look.step,
        breaks=look.breaks,
        wobble=look.wobble,
        tooth=TOOTH * look.paper_grain,
        surface_tooth=_tooth_on_surface(look),
    )


def _tooth_on_surface(look: Look) -> tuple[float, float, float] | None:
    """Grain, density and high pass of the tooth, if it stays with surfaces."""
    if look.anchor == "picture":
        return None
    noise = surface_tooth(look)
    return noise["grain"], noise["density"], noise["high_pass"]


@lru_cache(maxsize=16)
def ink_statistics(
    length: float,
    grain: float,
    density: float,
    high_pass: float,
    crispness: float,
    *,
    tapered: bool = False,
    anchored: bool = False,
    piece: float = 1.0,
    breaks: float = 0.0,
    wobble: float = 0.0,
    tooth: float = 0.0,
    surface_tooth: tuple[float, float, float] | None = None,
) -> Statistics:
    """Read off a sample of noise what streaks cover.

    Parameters
    ----------
    length : float
        Of the streamlines, pixels.
    grain, density, high_pass
        Of the noise.
    crispness, breaks, wobble : float
        Of the look.
    tapered : bool
        Whether they are less of a streamline's ends.
    anchored : bool
        Whether the noise is that of surfaces.
    piece : float
        Length of the pieces of broken lines, pixels.
    tooth : float
        Deviation of what the tooth of the paper adds to the streaks.
    surface_tooth : 3 floats, optional
        Grain, density and high pass of a tooth that stays with surfaces.
    """
    side = int(np.clip(SAMPLE * grain, SMALLEST_SAMPLE, LARGEST_SAMPLE))
    reach = max(round(length), 1)
    width = side + reach
    noise = _sample((side, width), grain, density, high_pass, anchored)
    streaks, deviation = _standardised(_means_along(noise, reach, side, tapered))
    within = min(max(round(piece), 1), reach)
    pieces, piece_deviation = _standardised(_means_along(noise, within, side, tapered))
    uneven, tooth_deviation = 0.0, 1.0
    if tooth and surface_tooth is not None:
        heights = _sample(streaks.shape, *surface_tooth, anchored=True)
        tooth_deviation = float(heights.std())
        uneven = tooth / tooth_deviation * (heights - heights.mean())
    elif tooth:
        heights = paper_tooth(np.arange(streaks.size, dtype=np.int32), len(streaks[0]), grain, 1)
        uneven = tooth * heights[0].reshape(streaks.shape)
    wanted = np.linspace(0, 1, STEPS)
    degrees = brokenness(wanted, breaks, wobble)
    known = np.linspace(degrees.min(), degrees.max(), BREAKS if breaks else 1)
    samples = [streaks + degree * (pieces - streaks) + uneven for degree in known]
    table = _limits(samples, softness(crispness))
    if len(known) == 1:
        return Statistics(table[0], deviation, piece_deviation, tooth_deviation)
    place = (degrees - known[0]) / (known[-1] - known[0]) * (BREAKS - 1)
    below = np.minimum(place.astype(int), BREAKS - 2)
    low, high = (table[row, np.arange(STEPS)] for row in (below, below + 1))
    return Statistics(
        low + (place - below) * (high - low), deviation, piece_deviation, tooth_deviation
    )


def _limits(samples: list[np.ndarray], soft: float) -> np.ndarray:
    """(S, STEPS): above which values each of S samples of streaks cover even shares from 0 to 1."""
    low, high = min(map(np.min, samples)), max(map(np.max, samples))
    edges = np.linspace(low, high, BINS + 1)
    limits = np.linspace(high + soft, low - soft, 4 * STEPS)
    inked = _smooth_step(((edges[:-1] + edges[1:]) / 2 - limits[:, None]) / (2 * soft) + 0.5)
    wanted = np.linspace(0, 1, STEPS)
    shares = (np.histogram(sample, edges)[0] / sample.size for sample in samples)
    return np.array([np.interp(wanted, inked @ share, limits) for share in shares])


def _sample(
    shape: tuple[int, int], grain: float, density: float, high_pass: float, anchored: bool
) -> np.ndarray:
    """Some noise of a picture, or as that of a surface, as an image.

    Of a surface across which the middle one of its octaves has the size that is asked for.
    """
    pixel = np.arange(shape[0] * shape[1], dtype=np.int32)
    away = np.arange(OCTAVES) - OCTAVES // 2 if anchored else np.zeros(1)
    noise = np.zeros(shape, dtype=np.float32)
    for octave, share in zip(away, octave_shares(away) if anchored else (1.0,), strict=True):
        size = grain * 2.0**octave
        cells = image_noise(pixel, shape[1], size, 1, 1, density=density, high_pass=high_pass)
        noise += np.float32(share) * cells.reshape(shape)
    return noise


def _means_along(noise: np.ndarray, length: int, side: int, tapered: bool) -> np.ndarray:
    """(n, side) means over so many pixels of the rows of (n, width) noise, from its middle."""
    # A mean of tapered weights is one of means over half the length.
    for reach in [max(length // 2, 1)] * 2 if tapered else [length]:
        sums = np.cumsum(np.pad(noise, ((0, 0), (1, 0))), axis=1, dtype=np.float64)
        noise = (sums[:, reach:] - sums[:, :-reach]) / reach
    start = (noise.shape[1] - side) // 2
    return noise[:, start : start + side]


def _standardised(means: np.ndarray) -> tuple[np.ndarray, float]:
    """Means in deviations from their own mean; and the deviation."""
    deviation = float(means.std())
    return (means - means.mean()) / deviation, deviation


def _smooth_step(x: np.ndarray) -> np.ndarray:
    """0 below 0, 1 above 1, and a cubic between."""
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)

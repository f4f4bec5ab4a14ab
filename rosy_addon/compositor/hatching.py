"""Lines of ink on paper, as many and as wide as the tone asks for.

Every streak of an LIC image stands for a line that may be drawn: ink lies where the streak rises above a
threshold. How much of the paper streaks above any threshold cover is known from their statistics,
so the threshold follows from the coverage that is wanted; no image is analysed. Of several families of
lines each leaves (1 - a) of the light, so that together they leave the tone T if they take shares s of
it, 1 - a = T^s with shares that sum to 1. In light tones one family has it all, in darker ones the next
ones join in, those nearest to the guiding angle first.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .colour import LUMINANCE, from_hex, to_linear
from .flow import Flow, all_members
from .images import Images
from .look import Look
from .noise import MEAN, image_noise

#: Darkness over which a family that joins in comes to its full share.
JOINING = 0.35

#: By how much earlier it begins to, faintly: where two change places, they do so without a seam.
EARLY = 0.15

#: Half the width of the step from paper to ink, in deviations of the streaks: soft and crisp.
SOFTEST, CRISPEST = 1.6, 0.2

#: Side of the sample that thresholds are read off, pixels, and how many coverages are looked up.
SAMPLE, STEPS = 320, 256


def ink_coverage(flow: Flow, images: Images, look: Look, tone: np.ndarray) -> np.ndarray:
    """How much of each pixel is ink.

    Parameters
    ----------
    flow : Flow
    images : Images
        Of the members from that nearest to the look's guiding angle on.
    look : Look
        With its lengths in the pixels of the frame.
    tone : (P,) float32 ndarray
        The light that there is to be, 0 to 1, linear.

    Returns
    -------
    (P,) float32 ndarray
        0 to 1.
    """
    threshold, deviation = thresholds_of(look)
    soft = softness(look.crispness)
    left = np.clip(1 - tone if is_light(look) else tone, 0, 1)
    paper = np.ones(len(left), dtype=np.float32)
    for share, member in zip(family_shares(flow, look, left), images.members, strict=True):
        covered = 1 - left**share
        limit = np.interp(covered, np.linspace(0, 1, STEPS), threshold)
        above = (member.mean(axis=1) - MEAN) / deviation - limit
        paper *= 1 - _smooth_step(above / (2 * soft) + 0.5)
    return 1 - paper


def is_light(look: Look) -> bool:
    """Whether the ink is lighter than the paper, so that there is the more of it the more light."""
    ink, paper = (
        to_linear(from_hex(code)) @ LUMINANCE for code in (look.ink_colour, look.paper_colour)
    )
    return bool(ink > paper)


def inked(coverage: np.ndarray, look: Look) -> np.ndarray:
    """(P, 3) float32 linear light of ink on paper."""
    paper, ink = (to_linear(from_hex(code)) for code in (look.paper_colour, look.ink_colour))
    return paper + coverage[:, None] * (ink - paper)


def family_shares(flow: Flow, look: Look, tone: np.ndarray) -> list[np.ndarray]:
    """M times (P,) float32: which share of the ink each line takes; they sum to 1.

    By how many others are nearer to the guiding angle, as a number that goes over from one to the
    next: where two families change places both take the same, and no seam shows.
    """
    dark = 1 - tone
    ranks = []
    for member in all_members(flow, look.guiding_angle)[: flow.lines]:
        toward = member * np.complex64(np.exp(-1j * look.guiding_angle))
        away = np.arctan2(np.abs(toward.imag), np.abs(toward.real))
        ranks.append(away * np.float32(2 * flow.lines / np.pi))
    onsets = [_onset(rank, look) for rank in ranks]
    first = np.minimum.reduce(onsets)
    shares = [_smooth_step((dark - onset + first + EARLY) / (JOINING + EARLY)) for onset in onsets]
    total = np.add.reduce(shares)
    return [share / total for share in shares]


def _onset(rank: np.ndarray, look: Look) -> np.ndarray:
    """The darkness at which lines of a rank join in; beyond 1 where they are one layer too many."""
    onset = np.zeros_like(rank)
    for layer in range(1, look.layers):
        onset += _smooth_step((rank - layer + 0.4) / 0.8)
    onset *= np.float32(look.layering)
    onset += 2 * _smooth_step((rank - look.layers + 0.4) / 0.8)
    return onset


def softness(crispness: float) -> float:
    """Half the width of the step from paper to ink, in deviations."""
    return SOFTEST * (CRISPEST / SOFTEST) ** crispness


def thresholds_of(look: Look) -> tuple[np.ndarray, float]:
    """`ink_thresholds` of a look, with its lengths in the pixels of the frame."""
    length = (2 * look.length + 1) * look.step
    return ink_thresholds(length, look.grain, look.density, look.high_pass, look.crispness)


@lru_cache(maxsize=16)
def ink_thresholds(
    length: float, grain: float, density: float, high_pass: float, crispness: float
) -> tuple[np.ndarray, float]:
    """Above which value streaks are ink, for them to cover a share of the paper.

    Parameters
    ----------
    length : float
        Of the streamlines, pixels.
    grain, density, high_pass
        Of the noise.
    crispness : float
        Of the look.

    Returns
    -------
    threshold : (STEPS,) float64 ndarray
        For even shares from 0 to 1, in deviations from the mean.
    deviation : float
        Of the streaks.
    """
    reach = max(round(length), 1)
    width = SAMPLE + reach
    pixel = np.arange(SAMPLE * width, dtype=np.int32)
    noise = image_noise(pixel, width, grain, 1, 1, density=density, high_pass=high_pass)
    sums = np.cumsum(noise.reshape(SAMPLE, width), axis=1, dtype=np.float64)
    means = ((sums[:, reach:] - sums[:, :-reach]) / reach).ravel()
    deviation = float(means.std())
    streaks = np.sort((means - means.mean()) / deviation)[:: max(len(means) // 20_000, 1)]
    soft = softness(crispness)
    limits = np.linspace(streaks[-1] + soft, streaks[0] - soft, 4 * STEPS)
    covered = [float(_smooth_step((streaks - limit) / (2 * soft) + 0.5).mean()) for limit in limits]
    return np.interp(np.linspace(0, 1, STEPS), covered, limits), deviation


def _smooth_step(x: np.ndarray) -> np.ndarray:
    """0 below 0, 1 above 1, and a cubic between."""
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)

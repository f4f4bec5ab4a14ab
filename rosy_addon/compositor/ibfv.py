"""Image based flow visualization on the covering surface: noise that is carried along and blended.

Van Wijk (Image based flow visualization, SIGGRAPH 2002) carries the picture a step along a vector field,
blends it with a little noise, and repeats this frame by frame. The picture is then an average of the noise
upstream, with weights q^m that fall exponentially with the number m of steps. On the covering surface (see
`covering`), an N-RoSy is a vector field, too. A state is a pixel with one direction (sheet) of the field.
Each state receives the values that arrive along its own sheet.

After many frames, the picture is the sum over m of q^m A^m n, where n is the noise, and A carries a picture
one step. Repeating the blend would interpolate between pixels at every step, which blurs streaks. So the
sum is doubled instead:

    F_2D = F_D + q^D A^D F_D,    A^2D = A^D A^D.

A^D is given by the point D steps upstream on the streamline of each state (see `streamline_origins`).
A few doublings replace more than a hundred blends. Each doubling interpolates values only once.

Noise that varies in time makes the streaks drift. It is the sum of the three channels n_c of the flow, with
the weights (1 + 2 cos(2 pi (phase + c / 3))) / 3, so it is n_c at the phase -c / 3. The squares of the
weights have the sum 1, so the contrast is constant. The noise is thus a constant part, plus a cosine part and
a sine part that are multiplied by the cosine and the sine of 2 pi phase. A does not depend on the time. So
the picture of any frame is a blend of the same three images: the averages of the three parts. No frame
depends on earlier frames, and animations can loop.

Streaks of a field of odd degree are averages upstream along its directions. In a field of even degree, a
line is a pair of opposite sheets, and its streaks are the mean of both.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.progress import progress
from ..projection.pixel_blocks import reported_blocks
from .contrast import normalize_variance
from .covering import Covering, build_covering, member_lines
from .filter_kernel import full_sample_count, kernel_weights
from .flow import FLOW_CHANNELS
from .image_noise import NOISE_MEAN
from .lic_images import LicImages, lic_images, magnitude_step_limits
from .look import has_flow
from .look_units import PixelLook
from .pixel_field import PixelField
from .streamline_origins import Origins, Sheets

#: The doublings end when the weights of further steps are below this. Averages are divided by the sum of
#: the weights that were added.
MIN_WEIGHT = 0.01

#: Sharpening of the noise for each doubling: the factor of the differences from the four neighbors, which are
#: added to the noise of a pixel. It makes up for the blur of interpolation on average. (Streaks along the
#: rows of pixels are not blurred, others are.)
SHARPENING = 0.02

#: Factors of the contrast, measured so that streaks have the same standard deviation as with other methods:
#: for averages over one side of a pixel (with more steps), and for averages over both sides.
ONE_SIDED_MATCH, TWO_SIDED_MATCH = np.float32(1.06), np.float32(1.02)

#: Weight of the noise at the pixel itself in the sum along each of the two opposite sheets of a line. Both
#: sums contain that pixel.
OWN_WEIGHT = 0.5


@dataclass(frozen=True, eq=False)
class StreakWaves:
    """The noise averaged along each line (pair of opposite directions), as a function of the flow phase.

    Attributes
    ----------
    constant : (M, P, K) float32 ndarray
        Averages relative to `NOISE_MEAN`, scaled to the variance of full streamlines.
    wave : (M, P) complex64 ndarray or None
        Part that depends on the phase: the real part of its product with exp(2 pi i phase) is added to
        `constant`. None if the look has no flow.
    effective_samples : (P,) float32 ndarray
        Number of samples of equal weight whose mean has the variance of the averages; mean over the lines.
    """

    constant: np.ndarray
    wave: np.ndarray | None
    effective_samples: np.ndarray

    def images(self, phase: float) -> LicImages:
        """Return the LIC images at a phase of the flow, from 0 to 1."""
        members = self.constant + np.float32(NOISE_MEAN)
        if self.wave is not None:
            turn = np.complex64(np.exp(2j * np.pi * phase))
            members[..., 0] += self.wave.real * turn.real - self.wave.imag * turn.imag
        return lic_images(members, self.effective_samples)


def wave_images(waves: Sequence[StreakWaves], looks: Sequence[PixelLook]) -> list[LicImages]:
    """Return the LIC images of each look at its phase of the flow, from its `StreakWaves`."""
    return [wave.images(look.flow_phase) for wave, look in zip(waves, looks, strict=True)]


def streak_waves(
    field: PixelField, looks: Sequence[PixelLook], noise: np.ndarray
) -> list[StreakWaves]:
    """Average noise along the lines of a field, for looks that differ in the length of streamlines.

    Parameters
    ----------
    field : PixelField
    looks : sequence of PixelLook
        Looks in pixels of the frame. The first has the greatest length.
    noise : (P, K) float32 ndarray
        Noise with the mean `NOISE_MEAN`. If the looks have flow, these are its three channels.

    Returns
    -------
    list of StreakWaves
        One for each look.
    """
    look = looks[0]
    # Of the noise, the covering only needs the number of channels.
    with progress(0.0, 0.05):
        covering = build_covering(field, look, np.zeros((len(field.pixel), 1), np.float32))
    with progress(0.05, 0.1):
        sheets = Sheets(covering, is_upstream=look.kernel != "ramp")
    with progress(0.1):
        decays = [_decay(field, each) for each in looks]
        doublings = max(_doubling_count(float(np.max(decay))) for decay in decays)
        full_decays = [float(_full_decay(field, each)) for each in looks]
        sharpening = np.float32(SHARPENING * _doubling_count(max(full_decays)))
        sources = _sharpened_sources(sheets, noise, look, sharpening)
        sums = [_Sums(sheets, sources, decay, _step_turn(look)) for decay in decays]
    with progress(0.1, 0.2):
        origins = sheets.one_step()
    for doubling in range(doublings):
        start, stop = (0.2 + 0.7 * place / doublings for place in (doubling, doubling + 1))
        with progress(start, stop):
            origins = _doubled(sheets, sums, 1 << doubling, origins, doubling == doublings - 1)
    with progress(0.9, 1.0):
        pairs = zip(looks, sums, strict=True)
        return [_line_waves(field, covering, each, total) for each, total in pairs]


def _noise_sources(noise: np.ndarray, look: PixelLook) -> list[np.ndarray]:
    """Return the noise that is summed along streamlines, as complex numbers.

    Parameters
    ----------
    noise : (P, K) float32 ndarray
        Noise with the mean 0.

    Returns
    -------
    list of (P,) complex64 ndarray
        The real part of the first array is the first channel of the noise or, with flow, its constant part.
        The imaginary part is 1, so that its sum is the sum of the weights. The second array has the other two
        channels of colored noise, or the noise that becomes `StreakWaves.wave`.
    """
    if has_flow(look):
        third = np.exp(2j * np.pi * np.arange(FLOW_CHANNELS) / FLOW_CHANNELS)
        weights = np.stack([np.full(FLOW_CHANNELS, 0.5), third.real, third.imag]) * (2 / 3)
        constant, real, imaginary = (
            sum(weight * channel for weight, channel in zip(row, noise.T, strict=True))
            for row in weights.astype(np.float32)
        )
        return [constant + np.complex64(1j), real + np.complex64(1j) * imaginary]
    sources = [noise[:, 0] + np.complex64(1j)]
    if noise.shape[1] == 3:
        sources.append(noise[:, 1] + np.complex64(1j) * noise[:, 2])
    return sources


def _step_turn(look: PixelLook) -> float:
    """Return the change of the phase of the noise from one step of a streamline to the next, in radians.

    Streaks drift by `flow_distance` steps while the phase makes a full turn.
    """
    if not has_flow(look):
        return 0.0
    angle = 2 * np.pi / look.flow_distance
    # Noise that arrives from upstream started earlier. Noise downstream arrives there later.
    return angle if look.kernel == "ramp" else -angle


def _is_two_sided(field: PixelField, look: PixelLook) -> bool:
    """Return whether streaks are averages over both directions of a line, with equal weights."""
    return field.symmetry.has_opposites and not has_flow(look)


def _doubling_count(decay: float) -> int:
    """Return how many doublings a sum needs, if successive weights have the ratio `decay`."""
    steps = math.log(MIN_WEIGHT) / math.log(decay) if decay > 0 else 0
    return math.ceil(math.log2(max(steps, 1)))


def _full_decay(field: PixelField, look: PixelLook) -> np.float32:
    """Return the ratio q of the weights of successive steps of full streamlines."""
    samples = np.float64(full_sample_count(look.length, look.kernel))
    return np.float32(decay_of_samples(samples, _is_two_sided(field, look)))


def _decay(field: PixelField, look: PixelLook) -> np.ndarray:
    """Return the float32 ratio q of the weights of successive steps.

    The shape is (P,) if the length of streamlines depends on the magnitude, otherwise ().
    """
    limits = magnitude_step_limits(field, look)
    if limits is None:
        return _full_decay(field, look)
    length = np.arange(look.length + 1, dtype=np.float64)
    samples = kernel_weights(length, length, length, look.kernel).effective_samples
    return decay_of_samples(samples, _is_two_sided(field, look)).astype(np.float32)[limits]


def decay_of_samples(effective_samples: np.ndarray, two_sided: bool) -> np.ndarray:
    """Find the decay of a kernel with given effective samples (`KernelWeights`), by bisection.

    Parameters
    ----------
    effective_samples : float64 ndarray
        At least 1.
    two_sided : bool
        Whether the kernel averages both directions of a line.

    Returns
    -------
    float64 ndarray
        Of the same shape: q, the ratio of the weights of successive steps.
    """
    low, high = np.zeros_like(effective_samples), np.ones_like(effective_samples)
    for _ in range(40):
        middle = (low + high) / 2
        total = OWN_WEIGHT + middle / (1 - middle)
        squares = _square_sum(0.0, middle)
        if two_sided:
            squares = (squares + OWN_WEIGHT**2) / 2
        is_low = total**2 < effective_samples * squares
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return low


def _square_sum(rest: np.ndarray | float, decay: np.ndarray) -> np.ndarray:
    """Return the sum of the squared weights of the steps along one direction.

    The weights are `OWN_WEIGHT`, q, q^2, ..., q^n, where q is `decay` and n is the number of steps before the
    streamline ends. `rest` is q^n: 0 if the streamline does not end.
    """
    return OWN_WEIGHT**2 + decay**2 * (1 - np.square(rest)) / (1 - decay**2)


def _sharpened_sources(
    sheets: Sheets, noise: np.ndarray, look: PixelLook, sharpening: np.float32
) -> list[np.ndarray]:
    """Return the sharpened noise of cells that is summed along streamlines: (C,) complex64 `_noise_sources`.

    It is computed from (P, K) `noise` at the pixels, and is 0 at cells without a pixel. `sharpening` is the
    factor of differences from neighbors; see `SHARPENING`.
    """
    plain: list[np.ndarray] = []
    for _, block, cell in sheets.blocks(1):
        parts = _noise_sources(noise[block] - np.float32(NOISE_MEAN), look)
        plain = plain or [np.zeros(sheets.cell_count, dtype=np.complex64) for _ in parts]
        for source, part in zip(plain, parts, strict=True):
            source[cell] = part
    sharp = [source.copy() for source in plain]
    for _, _, cell in sheets.blocks(1):
        for linked, neighbor in sheets.linked_neighbors(cell):
            for source, result in zip(plain, sharp, strict=True):
                result[linked] += sharpening * (source.take(linked) - source.take(neighbor))
    return sharp


class _Sums:
    """Weighted sums of noise along the streamlines of all states of the covering surface.

    Parameters
    ----------
    sheets : Sheets
    sources : list of (C,) complex64 ndarray
        Noise of cells that is summed, from `_sharpened_sources`.
    decay : (P,) or () float32 ndarray
        q, the ratio of the weights of successive steps.
    turn : float
        Angle in radians by which the second source is rotated at each step.

    Attributes
    ----------
    values : list of (S C,) complex64 ndarray
        For the states of the S sheets and C cells of `sheets`: sum of each source over the first D steps
        upstream of each state, in which the noise at the pixel itself has the weight 1. D is 1 at first, and
        is doubled by `_doubled`.
    weight : (P,) or () float32 ndarray
        q^D, the weight of the next D steps.
    """

    def __init__(
        self, sheets: Sheets, sources: list[np.ndarray], decay: np.ndarray, turn: float
    ) -> None:
        self._sheets, self._turn = sheets, turn
        self.sources, self.decay = sources, decay
        self.weight = decay
        size = sheets.count * sheets.cell_count
        self.values = [np.zeros(size, dtype=np.complex64) for _ in sources]
        for _, block, state in sheets.blocks():
            for total, source in zip(self.values, sources, strict=True):
                total[state] = source.take(sheets.cells[block])

    def weighted(self, place: int, values: np.ndarray, steps: int, block: slice) -> np.ndarray:
        """Multiply the sums that arrive from D steps upstream by q^D, which `weight` holds for these D.

        Source 0 is the constant part of the noise. Source 1, with flow, holds the cosine part and the sine part as complex
        numbers; its sums are also rotated by the phase over D steps (`_step_turn`).

        The arithmetic uses real numbers. Products of complex numbers are not rounded alike on all
        processors.

        Parameters
        ----------
        place : int
            Index of the source.
        values : (n,) complex64 ndarray
            Sums that arrive at the pixels of a block.
        steps : int
            D, for which the attribute `weight` is q^D.
        block : slice
            The pixels.
        """
        values = values * (self.weight[block] if np.ndim(self.weight) else self.weight)
        angle = self._turn * steps
        if not place or not angle:
            return values
        cosine, sine = np.float32(math.cos(angle)), np.float32(math.sin(angle))
        turned = np.empty_like(values)
        turned.real = values.real * cosine - values.imag * sine
        turned.imag = values.real * sine + values.imag * cosine
        return turned

    def at(
        self, covering_sheet: int, block: slice
    ) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """Return the sums at the pixels of a block along one sheet (direction) of the covering surface.

        `covering_sheet` is the number of the sheet in the `Covering`. The result is a list with the (n,) sums
        of each source, the (n,) sums of the weights, and the (n,) sums of the squared weights. The noise at
        the pixel itself has the weight `OWN_WEIGHT` in them.
        """
        sheets = self._sheets
        cell = sheets.cells[block].astype(np.intp)
        state = sheets.covering_sheet.index(covering_sheet) * sheets.cell_count + cell
        values = [
            total.take(state) - np.float32(1 - OWN_WEIGHT) * source.take(cell)
            for total, source in zip(self.values, self.sources, strict=True)
        ]
        weight = values[0].imag
        decay = self.decay[block] if np.ndim(self.decay) else self.decay
        other_weight = weight - np.float32(OWN_WEIGHT)
        rest = 1 - other_weight * (1 - decay) / np.maximum(decay, np.float32(1e-6))
        return values, weight, _square_sum(np.clip(rest, 0, 1), decay).astype(np.float32)


def _doubled(
    sheets: Sheets, sums: Sequence[_Sums], steps: int, origins: Origins, is_last: bool
) -> Origins:
    """Double the number of steps that sums cover: add the sums at the origins, which are `steps` upstream.

    `sums` has the sums for each look, which are changed. `origins` are the points `steps` upstream of every
    state.

    Returns
    -------
    Origins
        The points 2 * `steps` upstream of every state. Empty if `is_last`.
    """
    doubled = [[values.copy() for values in total.values] for total in sums]
    result = Origins.ended(0 if is_last else len(origins.cell))
    for _, block, state in sheets.blocks():
        around = sheets.surroundings(origins.at(state))
        for total, results in zip(sums, doubled, strict=True):
            for place, (values, target) in enumerate(zip(total.values, results, strict=True)):
                target[state] += total.weighted(place, around.interpolate(values), steps, block)
        if not is_last:
            result.put(state, sheets.interpolated(origins, around))
    for total, results in zip(sums, doubled, strict=True):
        total.values = results
        total.weight = total.weight * total.weight
    return result


def _line_waves(field: PixelField, covering: Covering, look: PixelLook, sums: _Sums) -> StreakWaves:
    """Average the sums of the two opposite sheets of each line, and equalize the contrast.

    Averages are scaled to the variance of full streamlines.
    """
    lines, count = field.line_count, len(field.pixel)
    flows = has_flow(look)
    match = TWO_SIDED_MATCH if _is_two_sided(field, look) else ONE_SIDED_MATCH
    channels = 2 * len(sums.sources) - 1
    constant = np.empty((lines, count, 1 if flows else channels), dtype=np.float32)
    wave = np.empty((lines, count), dtype=np.complex64) if flows else None
    effective_samples = np.zeros(count, dtype=np.float32)
    for line, first_sheet in enumerate(member_lines(field).tolist()):
        for block in reported_blocks(count, "blending lines", line / lines, (line + 1) / lines):
            cell = covering.cell_of_pixel[block].astype(np.intp)
            state = first_sheet * covering.cell_count + cell
            if covering.has_directions:
                is_along = bool(covering.is_along_member(state[:1])[0])
                opposite = first_sheet + (lines if is_along == (look.kernel != "ramp") else 0)
                values, weight, squares = sums.at(opposite, block)
            else:
                forward = covering.forward_share(state) if flows else np.float32(0.5)
                backward = 1 - forward
                # Noise that drifts forward arrives along the opposite sheet.
                one, one_weight, one_squares = sums.at(first_sheet + lines, block)
                other, other_weight, other_squares = sums.at(first_sheet, block)
                values = [forward * a + backward * b for a, b in zip(one, other, strict=True)]
                weight = forward * one_weight + backward * other_weight
                squares = forward**2 * one_squares + backward**2 * other_squares
                squares += 2 * forward * backward * np.float32(OWN_WEIGHT**2)
            samples = weight**2 / squares
            parts = [values[0].real, *(part for v in values[1:] for part in (v.real, v.imag))]
            mean = np.stack(parts, axis=1)
            mean *= (match / weight)[:, None]
            mean += np.float32(NOISE_MEAN)
            scaled = normalize_variance(mean, samples, look) - np.float32(NOISE_MEAN)
            constant[line, block] = scaled[:, : constant.shape[2]]
            if wave is not None:
                wave[line, block] = scaled[:, 1] + np.complex64(1j) * scaled[:, 2]
            effective_samples[block] += samples
    effective_samples /= lines
    return StreakWaves(constant, wave, effective_samples)

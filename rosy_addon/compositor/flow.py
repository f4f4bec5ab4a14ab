"""Flow: streaks that drift along the field, by filter kernels that move along the streamlines.

The average of noise around a point c steps upstream is the streak that has drifted c steps. So the kernel
of a streamline is moved against the field, and the streaks move with it, rigidly and by any fraction of a
pixel. No frame depends on another one.

A kernel cannot move on forever. There are three channels of noise, with a kernel each. It moves by the
*distance* of the cycle, from half of it downstream to half of it upstream, while its weight rises from 0
and falls to 0 again as the square of a sine. Then it begins again. The kernels are a third of the cycle
apart, so that the squares of their weights have a constant sum: the contrast stays the same. After a
cycle the picture is the same, so loops have no seam.

Lines of a field of odd degree drift along its directions. Those of even degree have none. They drift toward
the guiding angle. Where a line is perpendicular to it, one half of the kernel moves either way.

Cabral and Leedom (Imaging vector fields using line integral convolution, SIGGRAPH 1993) move streaks by
kernels that are periodic along the streamline. Those change their shape, and have no constant contrast.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .filter_kernel import Kernel, kernel_of, kernel_weights, sample_weights
from .image_noise import NOISE_MEAN
from .look import Look, has_flow

#: Channels of noise. Three is the least number for which the squares of the weights have a constant sum.
FLOW_CHANNELS = 3

#: The distance of a cycle with the method "ibfv", in lengths of a streamline in one direction. Its streaks are waves
#: of the noise in time: shorter ones would cut them into pieces.
IBFV_DISTANCE = 4.0

#: The cosine of the angle between a line and the guiding angle above which the line drifts one way only. Of
#: four directions, one is always above it.
ONE_WAY_COSINE = math.sqrt(0.5)

#: Levels of `MovingKernel.energies`, at most.
MAX_LEVELS = 256

#: Steps between a streamline and the center of a pixel that it passes, at most, along the streamline.
MAX_AXIAL_STEPS = 2


def noise_channel_count(look: Look) -> int:
    """Return the number of noise channels that a look convolves."""
    if has_flow(look):
        return FLOW_CHANNELS
    return 3 if look.noise == "colour" else 1


def cycle_distance(look: Look) -> float:
    """Return the pixels that streaks drift in a cycle."""
    if look.flow_distance:
        return look.flow_distance
    return look.length * look.step * (IBFV_DISTANCE if look.method == "ibfv" else 1.0)


def with_cycle_distance(look: Look) -> Look:
    """Return the look with the distance of a cycle, which looks of other lengths keep."""
    return replace(look, flow_distance=cycle_distance(look)) if has_flow(look) else look


def flow_at(look: Look, frame: float, loop_frames: int = 0) -> Look:
    """Return the look of a frame of an animation.

    Parameters
    ----------
    look : Look
        Its `flow_phase` is that of frame 0.
    frame : float
        Counted from the first one.
    loop_frames : int
        Frames after which the animation is to begin again; 0 if it need not. The distance of a cycle is
        shortened so that the frames are whole cycles.

    Returns
    -------
    Look
        As it is, if its streaks do not drift.
    """
    if not has_flow(look):
        return look
    distance = cycle_distance(look)
    if loop_frames:
        total = look.flow * loop_frames
        distance = total / max(math.ceil(total / distance - 1e-9), 1)
    phase = (look.flow_phase + frame * look.flow / distance) % 1.0
    return replace(look, flow_distance=distance, flow_phase=phase)


def _channel_positions(phase: float) -> np.ndarray:
    """Return the (3,) float64 positions of the channels in their cycles, from 0 to 1."""
    return (phase + np.arange(FLOW_CHANNELS) / FLOW_CHANNELS) % 1.0


def channel_weights(phase: float) -> np.ndarray:
    """Return the (3,) float64 weights of the channels. The sum of their squares is 1."""
    position = _channel_positions(phase)
    return math.sqrt(8 / 9) * np.sin(np.pi * position) ** 2


def channel_shifts(look: Look) -> np.ndarray:
    """Return the (3,) float64 steps that the streaks of the channels have drifted, either way."""
    return (_channel_positions(look.flow_phase) - 0.5) * (cycle_distance(look) / look.step)


def blend_channels(noise: np.ndarray, look: Look) -> np.ndarray:
    """Return the (P, 1) float32 blend of (P, 3) noise around 0, with the variance of one channel."""
    return noise @ channel_weights(look.flow_phase).astype(np.float32)[:, None]


def unconvolved_noise(noise: np.ndarray, look: Look) -> np.ndarray:
    """Return (P, K) noise as it is seen where nothing is convolved: with a single channel if there is flow."""
    if not has_flow(look):
        return noise
    mean = np.float32(NOISE_MEAN)
    return mean + blend_channels(noise - mean, look)


def streamline_reach(look: Look) -> int:
    """Return how many steps the kernel of a look reaches from its pixel, at most, in each direction."""
    if not has_flow(look):
        return look.length
    return look.length + math.ceil(cycle_distance(look) / (2 * look.step)) + MAX_AXIAL_STEPS + 1


def forward_share(cosine: np.ndarray) -> np.ndarray:
    """Return the share of the kernel of a line without direction that drifts forward.

    Parameters
    ----------
    cosine : ndarray
        Of the angle between its forward direction and the guiding angle.
    """
    x = np.clip(0.5 + cosine * (0.5 / ONE_WAY_COSINE), 0.0, 1.0)
    return x * x * (3 - 2 * x)


class MovingKernel(NamedTuple):
    """The kernels of the channels of a look whose streaks drift.

    Attributes
    ----------
    kind : {"box", "taper", "ramp"}
    length : int
        Steps of the kernel at rest, in each direction.
    shifts, weights : (3,) float64 ndarray
        From `channel_shifts` and `channel_weights`.
    reach : int
        R, steps from the pixel to the last sample.
    energies : (3, L, 2 R + 2) float64 ndarray
        Prefix sums over the samples, from -R - 1, of the squares of the weights forward and backward, and
        of their products. Level l is for streamlines of the length times l / (L - 1).
    full_samples : (L,) float64 ndarray
        `filter_kernel.KernelWeights.effective_samples` of the kernels at rest.
    """

    kind: Kernel
    length: int
    shifts: np.ndarray
    weights: np.ndarray
    reach: int
    energies: np.ndarray
    full_samples: np.ndarray

    def effective_samples(
        self, share: np.ndarray, forward: np.ndarray, behind: np.ndarray, ahead: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Count the samples of equal weight whose mean has the variance of the average.

        Parameters
        ----------
        share : (n,) float32 ndarray
            Length of the kernels, relative to `length`.
        forward : (n,) float32 ndarray
            Share of the kernel that drifts forward.
        behind, ahead : (n,) intp ndarray
            Steps to the ends of the streamlines.

        Returns
        -------
        effective_samples : (n,) float64 ndarray
        factor : (n,) float64 ndarray
            By which weighted sums are multiplied to be averages times the effective samples.
        """
        table = self.energies.reshape(3, -1)
        width, levels = self.energies.shape[2], len(self.full_samples)
        level = np.rint(share * (levels - 1)).astype(np.intp)
        center = level * width + (self.reach + 1)
        available = table.take(center + np.minimum(ahead, self.reach), axis=1)
        available -= table.take(center - np.minimum(behind, self.reach) - 1, axis=1)
        shares = np.stack([forward**2, (1 - forward) ** 2, 2 * forward * (1 - forward)])
        full = (shares * self.energies[:, level, -1]).sum(axis=0)
        samples = self.full_samples[level]
        return samples * (shares * available).sum(axis=0) / full, np.sqrt(samples / full)


def moving_kernel(look: Look, levels: int = 1) -> MovingKernel:
    """Return the kernels of a look.

    Parameters
    ----------
    look : Look
        In pixels of the frame, with flow.
    levels : int
        Of the lengths of streamlines, if they depend on the magnitude; see `MovingKernel.energies`.
    """
    length, kind = look.length, kernel_of(look)
    shifts, weights = channel_shifts(look), channel_weights(look.flow_phase)
    reach = streamline_reach(look)
    position = np.arange(-reach, reach + 1)
    energies = np.zeros((3, levels, len(position) + 1))
    full_samples = np.empty(levels)
    for level in range(levels):
        share = level / (levels - 1) if levels > 1 else 1.0
        level_length = float(round(share * length))
        full_samples[level] = kernel_weights(*[level_length] * 3, kind).effective_samples
        rows = np.stack(
            [
                weight * _shifted_weights(position, share * shift, level_length, kind)
                for shift, weight in zip(shifts, weights, strict=True)
            ]
        )
        mirrored = rows[:, ::-1]
        for total, products in zip(
            energies[:, level], (rows**2, mirrored**2, rows * mirrored), strict=True
        ):
            np.cumsum(products.sum(axis=0), out=total[1:])
    return MovingKernel(kind, length, shifts, weights, reach, energies, full_samples)


def _shifted_weights(position: np.ndarray, shift: float, length: float, kind: Kernel) -> np.ndarray:
    """Weights of a kernel whose center is `shift` steps backward, interpolated between whole steps."""
    whole = math.floor(shift)
    fraction = shift - whole
    return (1 - fraction) * sample_weights(position + whole, length, kind) + fraction * (
        sample_weights(position + whole + 1, length, kind)
    )

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

import numpy as np

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

#: Steps between a streamline and the center of a pixel that it passes, at most, along the streamline.
MAX_AXIAL_STEPS = 2


def noise_channel_count(look: Look) -> int:
    """Return the number of noise channels that a look convolves."""
    if has_flow(look):
        return FLOW_CHANNELS
    return 3 if look.noise == "color" else 1


def cycle_distance(look: Look) -> float:
    """Return the pixels that streaks drift in a cycle."""
    if look.flow_distance:
        return look.flow_distance
    return look.length * (IBFV_DISTANCE if look.method == "ibfv" else 1.0)


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
    return (_channel_positions(look.flow_phase) - 0.5) * cycle_distance(look)


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
    return look.length + math.ceil(cycle_distance(look) / 2) + MAX_AXIAL_STEPS + 1


def forward_share(cosine: np.ndarray) -> np.ndarray:
    """Return the share of the kernel of a line without direction that drifts forward.

    Parameters
    ----------
    cosine : ndarray
        Of the angle between its forward direction and the guiding angle.
    """
    x = np.clip(0.5 + cosine * (0.5 / ONE_WAY_COSINE), 0.0, 1.0)
    return x * x * (3 - 2 * x)

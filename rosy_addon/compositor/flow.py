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
from typing import Any, NamedTuple

import numpy as np

from .look import Look, has_colored_noise, has_flow

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


class Drift(NamedTuple):
    """How far streaks have drifted at a time of an animation.

    Attributes
    ----------
    phase : float
        Where they are in their cycle, 0 to 1.
    cycle : float
        The distance of the cycle, relative to `cycle_distance`.
    """

    phase: float = 0.0
    cycle: float = 1.0


#: The start of an animation, and pictures without drift.
NO_DRIFT = Drift()


def noise_channel_count(look: Any) -> int:
    """Return the number of noise channels that a look convolves."""
    if has_flow(look):
        return FLOW_CHANNELS
    return 3 if has_colored_noise(look) else 1


def cycle_distance(length: int, method: str) -> float:
    """Return the pixels that streaks of a length drift in a cycle, unless a loop shortens it."""
    return length * (IBFV_DISTANCE if method == "ibfv" else 1.0)


def drift_at(look: Look, frame: float, loop_frames: int = 0) -> Drift:
    """Return how far the streaks of a look have drifted at a frame of an animation.

    Parameters
    ----------
    look : Look
    frame : float
        Counted from the first one.
    loop_frames : int
        Frames after which the animation is to begin again; 0 if it need not. The distance of a cycle is
        shortened so that the frames are whole cycles.
    """
    if not has_flow(look):
        return NO_DRIFT
    full = distance = cycle_distance(look.length, look.method)
    if loop_frames:
        total = look.flow * loop_frames
        distance = total / max(math.ceil(total / full - 1e-9), 1)
    return Drift(frame * look.flow / distance % 1.0, distance / full)


def _channel_positions(phase: float) -> np.ndarray:
    """Return the (3,) float64 positions of the channels in their cycles, from 0 to 1."""
    return (phase + np.arange(FLOW_CHANNELS) / FLOW_CHANNELS) % 1.0


def channel_weights(phase: float) -> np.ndarray:
    """Return the (3,) float64 weights of the channels. The sum of their squares is 1."""
    position = _channel_positions(phase)
    return math.sqrt(8 / 9) * np.sin(np.pi * position) ** 2


def channel_shifts(phase: float, distance: float) -> np.ndarray:
    """Return the (3,) float64 steps that the streaks of the channels have drifted, either way.

    `distance` is the length of a cycle, in steps.
    """
    return (_channel_positions(phase) - 0.5) * distance


def blend_channels(noise: np.ndarray, phase: float) -> np.ndarray:
    """Return the (P, 1) float32 blend of (P, 3) noise around 0, with the variance of one channel."""
    return noise @ channel_weights(phase).astype(np.float32)[:, None]


def forward_share(cosine: np.ndarray) -> np.ndarray:
    """Return the share of the kernel of a line without direction that drifts forward.

    Parameters
    ----------
    cosine : ndarray
        Cosine of the angle between its forward direction and the guiding angle.
    """
    x = np.clip(0.5 + cosine * (0.5 / ONE_WAY_COSINE), 0.0, 1.0)
    return x * x * (3 - 2 * x)

"""Flow: streaks that drift along the field, by filter kernels that move along the streamlines.

Streaks that have drifted by c steps have at each pixel the value that was c steps upstream. So the kernel
of each streamline is moved c steps against the field. The streaks then move along the field, without a
change of shape and by any fraction of a pixel. No frame depends on another one.

A kernel cannot move on forever. So there are three channels of noise, and each has its own kernel. In a
*cycle*, a kernel moves by the *cycle distance*: from half of it downstream to half of it upstream. The
weight of its channel meanwhile rises from 0 and falls to 0 again, as the square of a sine. Then it begins
again. The three kernels are a third of the cycle apart, so the squares of their weights have a constant
sum, and the contrast is constant. After a cycle the picture is the same, so an animation can loop.

Streaks of a field of odd degree drift along its directions. In a field of even degree, each direction has its
opposite, so a line has no sign. Its streaks drift toward the guiding angle. Where the line is perpendicular
to the guiding angle, half of the kernel moves one way and half the other way.

Cabral and Leedom (Imaging vector fields using line integral convolution, SIGGRAPH 1993) move streaks by
kernels that are periodic along the streamline. Those change their shape, and have no constant contrast.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from .look import Look, has_colored_noise, has_flow

#: Channels of noise. Three is the least number for which the squares of the weights have a constant sum.
FLOW_CHANNELS = 3

#: Cycle distance with the method "ibfv", relative to the length of a streamline in one direction. Its noise
#: varies in time as a wave; with a shorter distance, the wave would cut streaks into pieces.
IBFV_DISTANCE = 4.0

#: The cosine of the angle between a line and the guiding angle above which the line drifts one way only. Of
#: four directions, one is always above it.
ONE_WAY_COSINE = math.sqrt(0.5)

#: Maximum distance along a streamline, in steps, from its nearest sample to the center of a pixel that it
#: passes.
MAX_AXIAL_STEPS = 2


class Drift(NamedTuple):
    """How far streaks have drifted at a time of an animation.

    Attributes
    ----------
    phase : float
        Position of the streaks in their cycle, 0 to 1.
    cycle : float
        Distance that streaks drift in a cycle, relative to `cycle_distance`.
    """

    phase: float = 0.0
    cycle: float = 1.0


#: The drift at the start of an animation, and of pictures without drift.
NO_DRIFT = Drift()


def noise_channel_count(look: Any) -> int:
    """Return the number of noise channels that a look convolves: 3 with flow or colored noise, else 1."""
    if has_flow(look):
        return FLOW_CHANNELS
    return 3 if has_colored_noise(look) else 1


def cycle_distance(length: int, method: str) -> float:
    """Return the distance in pixels that streaks drift in a cycle (before `Drift.cycle` scales it).

    Parameters
    ----------
    length : int
        Steps of streamlines in each direction, of one pixel each.
    method : str
        The LIC method, `Look.method`.
    """
    return length * (IBFV_DISTANCE if method == "ibfv" else 1.0)


def drift_at(look: Look, frame: float, loop_frames: int = 0) -> Drift:
    """Return how far the streaks of a look have drifted at a frame of an animation.

    Parameters
    ----------
    look : Look
    frame : float
        Number of frames since the first frame.
    loop_frames : int
        Number of frames after which the animation repeats, or 0 if it does not loop. The cycle distance is
        shortened so that the loop takes a whole number of cycles.
    """
    if not has_flow(look):
        return NO_DRIFT
    full = distance = cycle_distance(look.length, look.method)
    if loop_frames:
        total = look.flow * loop_frames
        distance = total / max(math.ceil(total / full - 1e-9), 1)
    return Drift(frame * look.flow / distance % 1.0, distance / full)


def _channel_positions(phase: float) -> np.ndarray:
    """Return the (3,) float64 positions of the channels in their cycles, from 0 to 1, at a `Drift.phase`."""
    return (phase + np.arange(FLOW_CHANNELS) / FLOW_CHANNELS) % 1.0


def channel_weights(phase: float) -> np.ndarray:
    """Return the (3,) float64 weights of the channels at a `Drift.phase`. The sum of their squares is 1."""
    return math.sqrt(8 / 9) * np.sin(np.pi * _channel_positions(phase)) ** 2


def channel_shifts(phase: float, distance: float) -> np.ndarray:
    """Return the (3,) float64 steps that the streaks of each channel have drifted from their middle position.

    They are from -`distance` / 2 to `distance` / 2. `distance` is the cycle distance in steps.
    """
    return (_channel_positions(phase) - 0.5) * distance


def blend_channels(noise: np.ndarray, phase: float) -> np.ndarray:
    """Return the (P, 1) float32 sum of the weighted channels of (P, 3) noise with the mean 0.

    It has the variance of one channel.
    """
    return noise @ channel_weights(phase).astype(np.float32)[:, None]


def forward_share(cosine: np.ndarray) -> np.ndarray:
    """Return the share of the kernel that drifts forward, 0 to 1, for lines of a field of even degree.

    Parameters
    ----------
    cosine : ndarray
        Cosine of the angle between the forward direction of the line and the direction at the guiding angle.
    """
    x = np.clip(0.5 + cosine * (0.5 / ONE_WAY_COSINE), 0.0, 1.0)
    return x * x * (3 - 2 * x)

"""How a hand wavers: slow, smooth changes in the course of lines.

They are sums of a few plane waves, in the space in which the body is at rest or in the picture, with
the noise. In space their length follows that of a pixel in octaves of which two are mixed, as in
`anchored`, so that they stay with the surface and yet are as long in the picture from near as from afar.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..projection.gbuffer import GBuffer
from ..projection.rest import rest_places
from ..trigonometry import cosine_sine, phase_of
from .anchored import how_much_larger
from .flow import Flow
from .look import Look
from .scale import unit_of

#: Waves that a wavering is the sum of.
WAVES = 7

#: Mean length of a wave, in grains.
WAVELENGTH = 40.0

#: Deviation of a line's course from the field's at `Look.wobble` 1, radians.
SWAY = 0.09

#: Brings a sum of waves to deviation 1. Each is 4 v (1 - |v|), v from -1 to 1: a sine made of two
#: parabolas, the same bits everywhere, of which 16 / 30 is the variance.
EVENED = (WAVES * 16 / 30) ** -0.5

#: Pixels that are worked on at once.
_BLOCK = 1 << 15


def wavers(look: Look) -> bool:
    """Whether lines are drawn as by hand."""
    return look.ink == "hatch" and look.wobble > 0


def wave_table() -> np.ndarray:
    """(WAVES, 4) float32: how many of each wave there are in a unit along the axes, and its phase.

    Their directions are spread evenly over a half of the sphere, as a spiral, their lengths over an
    octave.
    """
    golden = (5**0.5 - 1) / 2
    number = np.arange(WAVES)
    height = 1 - (number + 0.5) / WAVES
    turn = 2 * np.pi * golden * number
    out = np.sqrt(1 - height**2)
    often = 2.0 ** ((number * 3 % WAVES + 0.5) / WAVES - 0.5)
    along = [out * np.cos(turn), out * np.sin(turn), height]
    table = np.stack([*(often * axis for axis in along), number * golden * 5 % 1], axis=1)
    return table.astype(np.float32)


def waver(gbuffer: GBuffer, look: Look) -> np.ndarray:
    """By how much the course of lines deviates from the field's at `Look.wobble` 1.

    Parameters
    ----------
    gbuffer : GBuffer
        With its bodies, for a look anchored to the surface.
    look : Look
        With its lengths in the pixels of the frame; its `anchor`, `grain` and `unit` count.

    Returns
    -------
    (P,) float32 ndarray
        Radians, with mean 0 and deviation `SWAY`, about.
    """
    if look.anchor == "surface":
        places = rest_places(gbuffer)
        unit = unit_of(look)
        least = unit["smallest"] / look.grain
        larger = how_much_larger(gbuffer, places.size, unit["pixel"], least)
        place, size = places.at(0, 0), places.size * larger
    else:
        row, column = np.divmod(gbuffer.pixel, np.int32(gbuffer.camera.width))
        place = np.stack([column, row, 0 * row]).astype(np.float32)
        size = np.ones(len(row), dtype=np.float32)
    level = np.log2(np.maximum(size, 1e-30) * np.float32(look.grain * WAVELENGTH))
    found = np.empty(len(level), dtype=np.float32)
    for start in range(0, len(level), _BLOCK):
        block = slice(start, start + _BLOCK)
        found[block] = _waves(place[:, block], level[block])
    return np.float32(SWAY) * found


def swayed(flow: Flow, angle: np.ndarray) -> Flow:
    """A flow whose directions are turned in the view plane by (P,) angles, radians."""
    angle = angle.astype(np.float64)
    traits = {
        # Deviations are functions of the member: those of one that was turned are the same.
        (kind, number): values * phase_of(-number * angle) if kind == "deviation" else values
        for (kind, number), values in flow.traits.items()
    }
    turned = flow.representation * phase_of(flow.degree * angle)
    return replace(flow, representation=turned, traits=traits)


def _waves(place: np.ndarray, level: np.ndarray) -> np.ndarray:
    """(P,) sums at (3, P) places, of waves of (P,) lengths, as powers of two; of deviation 1."""
    octave = np.floor(level)
    share = ((level - octave) * np.float32(np.pi / 2)).astype(np.float32)
    total = np.zeros(len(level), dtype=np.float32)
    # The squares of both weights sum to 1, so that the variance is that of one.
    for number, weight in enumerate(cosine_sine(share)):
        x, y, z = place * np.exp2(-(octave + number)).astype(np.float32)
        for along_x, along_y, along_z, phase in wave_table():
            at = along_x * x + along_y * y + along_z * z + phase
            at = 2 * (at - np.floor(at)) - 1
            total += weight * (4 * at * (1 - np.abs(at)))
    return total * np.float32(EVENED)

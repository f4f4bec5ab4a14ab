"""Wobble: slow, smooth variations of the direction of lines, as if drawn by hand.

The angle is a sum of a few plane waves. They are anchored like the noise: to the picture, or to the
rest space of the mesh instances. In rest space the wavelengths come in octaves that follow the size
of a pixel, and two octaves are blended, similar to `surface_noise`. So the waves move with the
surface and keep their wavelength on screen.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from ..core.deterministic_trig import cos_sin, unit_phasor
from ..core.progress import progress
from ..projection.gbuffer import GBuffer
from ..projection.pixel_blocks import part_of, reported_blocks
from ..projection.rest_coordinates import rest_coordinates
from .look import is_hatched
from .look_units import PixelLook
from .pixel_field import PixelField, product
from .surface_noise import cell_scale, instance_units

#: Number of plane waves in the sum.
WAVE_COUNT = 7

#: Mean wavelength, in line widths.
MEAN_WAVELENGTH_WIDTHS = 40.0

#: Standard deviation of the angle between lines and field at `Look.wobble` 1, radians.
WOBBLE_STD = 0.09

#: Factor that gives the sum of waves the standard deviation 1. A wave is 4 v (1 - |v|) for v from
#: -1 to 1: a sine approximated by two parabolas, with the variance 16 / 30. Unlike `sin`, it has
#: the same bits on all platforms.
UNIT_VARIANCE_SCALE = (WAVE_COUNT * 16 / 30) ** -0.5


def has_wobble(look: Any) -> bool:
    """Return whether lines wobble as if drawn by hand."""
    return is_hatched(look) and look.wobble > 0


def wave_table() -> np.ndarray:
    """Return the (WAVE_COUNT, 4) float32 frequency vector and phase of each wave.

    Frequencies are in cycles per octave length along x, y and z, phases in cycles. The octave length is a
    power of two near the mean wavelength, in units of rest space (see `solid_wobble_angle`). The directions
    form a spiral that covers a hemisphere evenly. The wavelengths are spread over one octave.
    """
    golden = (5**0.5 - 1) / 2
    index = np.arange(WAVE_COUNT)
    height = 1 - (index + 0.5) / WAVE_COUNT
    azimuth = 2 * np.pi * golden * index
    radius = np.sqrt(1 - height**2)
    frequency = 2.0 ** ((index * 3 % WAVE_COUNT + 0.5) / WAVE_COUNT - 0.5)
    axes = [radius * np.cos(azimuth), radius * np.sin(azimuth), height]
    table = np.stack([*(frequency * axis for axis in axes), index * golden * 5 % 1], axis=1)
    return table.astype(np.float32)


def wobble_angle(gbuffer: GBuffer, look: PixelLook) -> np.ndarray:
    """Compute the angle between drawn lines and the field at each pixel, for a `Look.wobble` of 1.

    Parameters
    ----------
    gbuffer : GBuffer
        Its `instances` must be set if the look is anchored to the surface.
    look : PixelLook
        Its `anchor`, `line_width` and unit of lengths are used.

    Returns
    -------
    (P,) float32 ndarray
        Radians, with a mean of about 0 and a standard deviation of about `WOBBLE_STD`.
    """
    count = len(gbuffer.pixel)
    line_width = np.float32(look.line_width)
    rest = None
    if look.anchor == "surface":
        units = instance_units(gbuffer, look.pixel_size)
        with progress(0.0, 0.5):
            rest = rest_coordinates(gbuffer)
    angle = np.empty(count, dtype=np.float32)
    for block in reported_blocks(count, "bending lines", 0.5, 1.0):
        if rest is None:
            row, column = np.divmod(gbuffer.pixel[block], np.int32(gbuffer.camera.width))
            position = np.stack([column, row, 0 * row]).astype(np.float32)
            size = np.ones(len(row), dtype=np.float32)
        else:
            block_rest = part_of(rest, (..., block))
            min_scale = look.supersampling / look.line_width
            scale = cell_scale(units, gbuffer.instance_id[block], block_rest.pixel_size, min_scale)
            position, size = block_rest.at_offset(0, 0), block_rest.pixel_size * scale
        angle[block] = solid_wobble_angle(position, np.maximum(size, 1e-30) * line_width)
    return angle


def solid_wobble_angle(position: np.ndarray, line_width: np.ndarray) -> np.ndarray:
    """Compute the angle between drawn lines and the field at 3D positions, for a `Look.wobble` of 1.

    Parameters
    ----------
    position : (3, n) float32 ndarray
        Positions in the rest space of meshes.
    line_width : (n,) or () float32 ndarray
        Width of the lines at these positions, in units of rest space.

    Returns
    -------
    (n,) float32 ndarray
        Radians.
    """
    # The base-2 logarithm of the mean wavelength.
    level = np.log2(line_width * np.float32(MEAN_WAVELENGTH_WIDTHS))
    level = np.broadcast_to(level, position.shape[1:])
    octave = np.floor(level)
    blend_angle = ((level - octave) * np.float32(np.pi / 2)).astype(np.float32)
    total = np.zeros(len(level), dtype=np.float32)
    # The squares of both weights sum to 1, so the blend has the variance of one octave.
    for index, weight in enumerate(cos_sin(blend_angle)):
        x, y, z = position * np.exp2(-(octave + index)).astype(np.float32)
        for frequency_x, frequency_y, frequency_z, phase in wave_table():
            cycle = frequency_x * x + frequency_y * y + frequency_z * z + phase
            cycle = 2 * (cycle - np.floor(cycle)) - 1
            total += weight * (4 * cycle * (1 - np.abs(cycle)))
    return np.float32(WOBBLE_STD) * (total * np.float32(UNIT_VARIANCE_SCALE))


def rotate_pixel_field(field: PixelField, angle: np.ndarray) -> PixelField:
    """Return a pixel field with its directions rotated in the view plane.

    Parameters
    ----------
    field : PixelField
    angle : (P,) ndarray
        Radians, counter-clockwise.

    Returns
    -------
    PixelField
    """
    angle, channels = angle.astype(np.float64), dict(field.channels)
    for kind, order in field.channels:
        if kind == "deviation":
            # A harmonic is a function of the angle of the member. The rotation of its phase gives rotated
            # members the value of the members before.
            channels[kind, order] = product(channels[kind, order], unit_phasor(-order * angle))
    representation = product(field.representation, unit_phasor(field.degree * angle))
    return replace(field, representation=representation, channels=channels)

"""The paper's LIC method: decompose the field into member vector fields, with an image of each.

Palacios and Zhang, "Interactive Visualization of Rotational Symmetry Fields on Surfaces", IEEE
TVCG 17(7), 2011, section 4.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..core.progress import progress
from .lic_images import LicImages
from .look_units import PixelLook
from .per_pixel_lic import (
    DirectionSampler,
    convolve_members,
    direction_table,
    interpolate_direction,
    members_on_screen,
)
from .pixel_field import PixelField, all_members, blend_weights, neighbor_table
from .reported_blocks import reported_blocks


def member_decomposition(field: PixelField, look: PixelLook, noise: np.ndarray) -> LicImages:
    """Compute two sets of member images, and blend them.

    The first set follows V_i, the member nearest to the guiding angle phi + 2 pi i / N. Where two
    members are equally near, V_i jumps. These breaking points are the same for all i. The second
    set follows V'_i, the member nearest to phi + (2 i + 1) pi / N, which has other breaking points.
    The blend shows each set away from its breaking points. A field of degree 1 has no second set.

    Parameters
    ----------
    field : PixelField
    look : PixelLook
        In pixels of the frame.
    noise : (P, K) float32 ndarray

    Returns
    -------
    LicImages
    """
    with progress(0.0):
        neighbors = neighbor_table(field)
    angle = look.guiding_angle
    is_single = field.degree == 1 or look.weights == "none"
    with progress(0.0, 1.0 if is_single else 0.5):
        first = _one_set(field, look, noise, neighbors, angle)
    if is_single:
        return first
    with progress(0.5, 1.0):
        second = _one_set(field, look, noise, neighbors, angle + np.pi / field.degree)
    for block in reported_blocks(len(field.pixel), "blending lines", 1.0, 1.0):
        weight = _first_set_weight(field.part(block), look)
        second.blend[block] += weight[:, None] * (first.blend[block] - second.blend[block])
        second.effective_samples[block] += weight * (
            first.effective_samples[block] - second.effective_samples[block]
        )
    return replace(first, blend=second.blend, effective_samples=second.effective_samples)


def _one_set(
    field: PixelField, look: PixelLook, noise: np.ndarray, neighbors: np.ndarray, angle: float
) -> LicImages:
    """Compute one set of member images, nearest to `angle` and its rotations by 2 pi / N."""
    with progress(0.0):
        if look.view_plane:
            members, directions = members_on_screen(field, look, angle, field.line_count)
        else:
            members = directions = _screen_space_members(field, angle)
        tracers = [
            partial(_member_sampler, direction_table(direction, member, field.degree, neighbors))
            for member, direction in zip(members, directions, strict=True)
        ]
    return convolve_members(field, look, noise, neighbors, tracers)


def _member_sampler(table: np.ndarray, _block: slice) -> DirectionSampler:
    """Make a sampler of one vector field on screen, given its `direction_table`."""
    return lambda entry, offset: interpolate_direction(table.take(entry, axis=0), offset)


def _first_set_weight(field: PixelField, look: PixelLook) -> np.ndarray:
    """(P,) float32 weight of the first set in the blend."""
    if look.view_plane:
        weight = blend_weights(field, look.guiding_angle)
    else:
        member = _screen_space_members(field, look.guiding_angle)[0]
        angle_offset = np.angle(member * np.exp(-1j * look.guiding_angle))
        weight = (0.5 + 0.5 * np.cos(field.degree * angle_offset)).astype(np.float32)
    return (weight > 0.5).astype(np.float32) if look.weights == "binary" else weight


def _screen_space_members(field: PixelField, angle: float) -> np.ndarray:
    """(M, P) complex64 directions, chosen among the members after projection to the screen.

    This reproduces the error in Figure 8 of the paper. On a tilted surface the angles between
    projected members are not 2 pi / N. The two sets of breaking points then come close to each
    other, and the weights do not match them.
    """
    screen_members = np.empty((field.line_count, len(field.pixel)), dtype=np.complex64)
    for block in reported_blocks(len(field.pixel), "finding directions"):
        part = field.part(block)
        members = np.stack(
            [part.to_screen(part.member_direction(member)) for member in all_members(part, 0.0)]
        )
        for line, out in enumerate(screen_members):
            rotation = np.exp(-1j * (angle + 2 * np.pi * line / field.degree))
            best_index = np.argmax((members * rotation).real, axis=0)
            out[block] = np.take_along_axis(members, best_index[None], axis=0)[0]
    return screen_members

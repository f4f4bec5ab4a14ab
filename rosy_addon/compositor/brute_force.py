"""Brute-force LIC: at each step, a streamline follows the best match among the N members.

This is the reference that the paper compares its method with.
"""

from __future__ import annotations

import numpy as np

from ..progress import progress, report
from ..projection.pixel_blocks import pixel_blocks
from .lic_images import LicImages, LineTracer, convolve_members
from .look import Look
from .per_pixel_lic import DirectionSampler, direction_table, interpolate_direction
from .pixel_field import PixelField, all_members, neighbor_table


def brute_force(field: PixelField, look: Look, noise: np.ndarray) -> LicImages:
    """Compute one LIC image for each of the M lines.

    There are no breaking points and no second set of images, but every step of every streamline
    compares all N members.

    Parameters
    ----------
    field : PixelField
    look : Look
        In pixels of the frame.
    noise : (P, K) float32 ndarray

    Returns
    -------
    LicImages
    """
    count, degree = len(field.pixel), field.degree
    with progress(0.0):
        neighbors = neighbor_table(field)
    member_directions = np.zeros((count + 1, degree), dtype=np.complex64)
    screen_directions = np.empty((count, degree), dtype=np.complex64)
    for block in pixel_blocks(count):
        report(0.0, "finding directions")
        part = field.part(block)
        for index, member in enumerate(all_members(part, look.guiding_angle)):
            member_directions[block, index] = member
            in_plane = part.member_direction(member)
            screen_directions[block, index] = part.to_screen(in_plane, look.foreshorten)
    direction_tables = np.zeros((count + 1, degree, 4), dtype=np.float32)
    for index in range(degree):
        with progress(0.0):
            direction_tables[:, index] = direction_table(
                screen_directions[:, index], member_directions[:-1, index], degree, neighbors
            )
    tracers = [
        _best_match_tracer(member_directions, direction_tables, member)
        for member in range(field.line_count)
    ]
    return convolve_members(field, look, noise, neighbors, tracers)


def _best_match_tracer(
    member_directions: np.ndarray, direction_tables: np.ndarray, member: int
) -> LineTracer:
    """Make a tracer that starts along one member and then follows the best match.

    Parameters
    ----------
    member_directions : (P + 1, N) complex64 ndarray
        Members in the view plane, where they are matched. Row P is 0.
    direction_tables : (P + 1, N, 4) float32 ndarray
        The table of `direction_table` of each member, on screen.
    member : int
    """

    def trace(block: slice) -> tuple[DirectionSampler, DirectionSampler]:
        start = member_directions[block, member]
        return _best_match_sampler(
            member_directions, direction_tables, start, 1
        ), _best_match_sampler(member_directions, direction_tables, start, -1)

    return trace


def _best_match_sampler(
    member_directions: np.ndarray, direction_tables: np.ndarray, start: np.ndarray, sign: int
) -> DirectionSampler:
    """Make a sampler that stores the current member of each streamline between calls.

    Parameters
    ----------
    member_directions, direction_tables
        As for `_best_match_tracer`.
    start : (B,) complex64 ndarray
        Members at the seeds, in the view plane.
    sign : {1, -1}
        Whether to trace forward or backward.
    """
    degree = member_directions.shape[1]
    flat_members, flat_tables = member_directions.reshape(-1), direction_tables.reshape(-1, 4)
    heading = start

    def direction_at(entry: np.ndarray, offset: np.ndarray) -> np.ndarray:
        nonlocal heading
        candidates = member_directions.take(entry, axis=0)
        # The maximum is taken member by member. numpy is slow at reducing many short rows.
        x, y = heading.real.copy(), heading.imag.copy()
        best_match = np.full(len(entry), -np.inf, dtype=np.float32)
        best_index = np.zeros(len(entry), dtype=np.int32)
        for index in range(degree):
            match = candidates[:, index].real * x
            match += candidates[:, index].imag * y
            closer = match > best_match
            np.maximum(match, best_match, out=best_match)
            np.copyto(best_index, np.int32(index), where=closer)
        best_entry = entry * degree + best_index
        heading = flat_members.take(best_entry)
        return np.float32(sign) * interpolate_direction(
            flat_tables.take(best_entry, axis=0), offset
        )

    return direction_at

"""LIC with one streamline per pixel, for a block of pixels at once: the method of the paper and brute force.

The method of the paper (Palacios and Zhang, IEEE TVCG 2011) decomposes the field into vector fields and
blends two sets of their LIC images. The paper compares it with brute force, in which a streamline follows at
each step the best match among the N members.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..core.progress import progress, report
from ..projection.pixel_blocks import pixel_blocks
from .contrast import normalize_variance
from .filter_kernel import WEIGHT_SLOPES, kernel_weights
from .lic_images import LicImages, lic_images, magnitude_step_limits
from .look_units import PixelLook
from .pixel_field import NEIGHBOR_OFFSETS, PixelField, all_members, normalized, rotated

#: Function (indices of pixels, offsets) -> directions; see `direction_at` of `integrate_noise`.
DirectionSampler = Callable[[np.ndarray, np.ndarray], np.ndarray]

#: Function that takes a block of pixels, and returns a sampler for one half (forward or backward) of the
#: streamlines of one member.
LineTracer = Callable[[slice], DirectionSampler]


def brute_force(field: PixelField, look: PixelLook, noise: np.ndarray) -> LicImages:
    """Compute one LIC image for each of the M lines.

    There are no breaking points (where one member jumps to another) and no second set of images, but every
    step of every streamline compares all N members.

    Parameters
    ----------
    field : PixelField
    look : PixelLook
        In pixels of the frame.
    noise : (P, K) float32 ndarray
        Noise at the pixels, with the mean `NOISE_MEAN`.

    Returns
    -------
    LicImages
    """
    count, degree = len(field.pixel), field.degree
    neighbors = neighbor_table(field)
    members, directions = _members_on_screen(field, look.guiding_angle, degree)
    tables = np.zeros((count + 1, degree, 4), dtype=np.float32)
    for index, (member, direction) in enumerate(zip(members, directions, strict=True)):
        tables[:, index] = direction_table(direction, member, degree, neighbors)
    candidates = np.zeros((count + 1, degree), dtype=np.complex64)
    candidates[:-1] = members.T
    lines = range(field.line_count)
    tracers = [partial(_best_match_sampler, candidates, tables, line) for line in lines]
    return convolve_members(field, look, noise, neighbors, tracers)


def _best_match_sampler(
    candidates: np.ndarray, direction_tables: np.ndarray, line: int, block: slice
) -> DirectionSampler:
    """Make a function for directions that starts along one member and then follows the best match.

    The function takes the pixels and offsets that streamlines have reached, and returns their directions (see
    `direction_at` of `integrate_noise`). It stores the current member of each streamline between calls.

    Parameters
    ----------
    candidates : (P + 1, N) complex64 ndarray
        Members in the view plane, where they are matched. Row P is 0.
    direction_tables : (P + 1, N, 4) float32 ndarray
        x and y of each member on screen, and the gradient of its angle, from `direction_table`.
    line : int
        Index of the member along which the streamlines start.
    block : slice
        Pixels at which the streamlines start.
    """
    degree = candidates.shape[1]
    flat_members, flat_tables = candidates.reshape(-1), direction_tables.reshape(-1, 4)
    heading = candidates[block, line]

    def direction_at(entry: np.ndarray, offset: np.ndarray) -> np.ndarray:
        nonlocal heading
        rows = candidates.take(entry, axis=0)
        # The best match is found member by member, because numpy is slow at reducing many short rows.
        x, y = heading.real.copy(), heading.imag.copy()
        best_match = np.full(len(entry), -np.inf, dtype=np.float32)
        best_index = np.zeros(len(entry), dtype=np.int32)
        for index in range(degree):
            match = rows[:, index].real * x
            match += rows[:, index].imag * y
            closer = match > best_match
            np.maximum(match, best_match, out=best_match)
            np.copyto(best_index, np.int32(index), where=closer)
        best_entry = entry * degree + best_index
        heading = flat_members.take(best_entry)
        return interpolate_direction(flat_tables.take(best_entry, axis=0), offset)

    return direction_at


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
        Noise at the pixels, with the mean `NOISE_MEAN`.

    Returns
    -------
    LicImages
    """
    neighbors = neighbor_table(field)
    angle = look.guiding_angle
    is_single = field.degree == 1 or look.weights == "none"
    with progress(0.0, 1.0 if is_single else 0.5):
        first = _one_set(field, look, noise, neighbors, angle)
    if is_single:
        return first
    with progress(0.5, 1.0):
        second = _one_set(field, look, noise, neighbors, angle + np.pi / field.degree)
    weight, samples = _first_set_weight(field, look), second.effective_samples
    blend = second.blend + weight[:, None] * (first.blend - second.blend)
    samples = samples + weight * (first.effective_samples - samples)
    return replace(first, blend=blend, effective_samples=samples)


def _one_set(
    field: PixelField, look: PixelLook, noise: np.ndarray, neighbors: np.ndarray, angle: float
) -> LicImages:
    """Compute one set of member images, of the members nearest to `angle` and its rotations by 2 pi / N.

    `angle` is in radians. `neighbors` is the `neighbor_table` of the field.
    """
    if look.view_plane:
        members, directions = _members_on_screen(field, angle, field.line_count)
    else:
        members = directions = _screen_space_members(field, angle)
    pairs = zip(directions, members, strict=True)
    tables = [direction_table(*pair, field.degree, neighbors) for pair in pairs]
    tracers = [partial(_member_sampler, table) for table in tables]
    return convolve_members(field, look, noise, neighbors, tracers)


def _member_sampler(table: np.ndarray, _block: slice) -> DirectionSampler:
    """Make a function that interpolates directions on screen in the `direction_table` of a vector field.

    It takes pixels and offsets and returns directions: `direction_at` of `integrate_noise`.
    """
    return lambda entry, offset: interpolate_direction(table.take(entry, axis=0), offset)


def _first_set_weight(field: PixelField, look: PixelLook) -> np.ndarray:
    """Return the (P,) float32 weight of the first set of member images in the blend, 0 to 1.

    It is from `blend_weights`, and is rounded to 0 or 1 if the `weights` of the look are "binary". If
    `view_plane` is off, it is computed from members on screen.
    """
    if look.view_plane:
        weight = blend_weights(field, look.guiding_angle)
    else:
        member = _screen_space_members(field, look.guiding_angle)[0]
        angle_offset = np.angle(member * np.exp(-1j * look.guiding_angle))
        weight = (0.5 + 0.5 * np.cos(field.degree * angle_offset)).astype(np.float32)
    return (weight > 0.5).astype(np.float32) if look.weights == "binary" else weight


def blend_weights(field: PixelField, guiding_angle: float) -> np.ndarray:
    """Return the (P,) float32 weight of the first set of member images, cos^2(N (t - phi) / 2).

    phi is the guiding angle, and t is the angle of a member. The weight is 0 at the breaking points
    of the first set and 1 at the breaking points of the second.
    """
    relative = rotated(normalized(field.representation), -field.degree * guiding_angle)
    return (0.5 + 0.5 * relative.real).astype(np.float32)


def _screen_space_members(field: PixelField, angle: float) -> np.ndarray:
    """Return (M, P) complex64 directions on screen, chosen among the members after projection to the screen.

    Direction i is the projected member nearest to `angle` + 2 pi i / N, in radians.

    This reproduces the error in Figure 8 of the paper. On a tilted surface the angles between
    projected members are not 2 pi / N. The two sets of breaking points then come close to each
    other, and the weights do not match them.
    """
    _, members = _members_on_screen(field, 0.0, field.degree)
    lines = []
    for line in range(field.line_count):
        rotation = np.exp(-1j * (angle + 2 * np.pi * line / field.degree))
        best_index = np.argmax((members * rotation).real, axis=0)
        lines.append(np.take_along_axis(members, best_index[None], axis=0)[0])
    return np.stack(lines)


def _members_on_screen(
    field: PixelField, angle: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first `count` members of a field, and their directions on screen.

    Parameters
    ----------
    field : PixelField
    angle : float
        The first member is the one nearest to this angle, in radians.
    count : int
        Number of members to return.

    Returns
    -------
    members, directions : (count, P) complex64 ndarray
        Unit vectors in the view plane, and the unit vectors on screen of the same directions.
    """
    members = all_members(field, angle)[:count]
    directions = [field.to_screen(field.member_direction(member)) for member in members]
    return np.stack(members), np.stack(directions)


def convolve_members(
    field: PixelField,
    look: PixelLook,
    noise: np.ndarray,
    neighbors: np.ndarray,
    tracers: Sequence[LineTracer],
) -> LicImages:
    """Trace a streamline of each member through every pixel, and average the noise along it.

    Parameters
    ----------
    field : PixelField
    look : PixelLook
        In pixels of the frame. Its `length`, kernel and `magnitude_length` are used.
    noise : (P, K) float32 ndarray
        Noise at the pixels, with the mean `NOISE_MEAN`.
    neighbors : (9, P + 1) int32 ndarray
        Index of each neighbor of each pixel, from `neighbor_table`.
    tracers : sequence of M LineTracer
        For each member image, a function that takes a block of pixels, and returns the function that
        `integrate_noise` calls for the directions of the streamlines from these pixels.

    Returns
    -------
    LicImages
    """
    count, channels = noise.shape
    step_limit = magnitude_step_limits(field, look)
    padded_noise = np.concatenate([noise, np.zeros((1, channels), dtype=np.float32)])
    members = np.empty((len(tracers), count, channels), dtype=np.float32)
    effective_samples = np.zeros(count, dtype=np.float32)
    kernel = look.kernel
    for member, tracer in enumerate(tracers):
        for block in pixel_blocks(count):
            block_limit = None if step_limit is None else step_limit[block]
            args = block, neighbors, padded_noise, look, block_limit
            forward_sum, forward = integrate_noise(tracer(block), 1, *args)
            backward_sum, backward = integrate_noise(tracer(block), -1, *args)
            full_length = look.length if block_limit is None else block_limit
            weights = kernel_weights(forward, backward, full_length, kernel)
            mean = (noise[block] + forward_sum + backward_sum) / weights.total[:, None]
            members[member, block] = normalize_variance(mean, weights.effective_samples, look)
            effective_samples[block] += weights.effective_samples
            report((member + block.stop / count) / len(tracers), "tracing streamlines")
    effective_samples /= len(tracers)
    return lic_images(members, effective_samples)


def neighbor_table(field: PixelField) -> np.ndarray:
    """Tabulate the neighbors of the pixels of a field.

    Returns
    -------
    (9, P + 1) int32 ndarray
        Index of the neighbor of each pixel at each of `NEIGHBOR_OFFSETS`. The index is P where streamlines
        cannot step to the neighbor, and in column P. There is one row per offset, because a streamline
        mostly steps in one direction and then reads adjacent elements of a row.
    """
    count = len(field.pixel)
    entry = np.full(field.height * field.width, count, dtype=np.int32)
    entry[field.pixel] = np.arange(count, dtype=np.int32)
    table = np.full((9, count + 1), count, dtype=np.int32)
    for bit, (dx, dy) in enumerate(NEIGHBOR_OFFSETS):
        linked = np.flatnonzero(field.neighbor_mask >> bit & 1)
        table[bit, linked] = entry[field.pixel[linked] + (dy * field.width + dx)]
    return table


def direction_table(
    direction: np.ndarray, member: np.ndarray, degree: int, neighbors: np.ndarray
) -> np.ndarray:
    """Build a table of directions and the gradients of their angles, for `interpolate_direction`.

    The gradients are differences between neighbors that streamlines may step to.

    Parameters
    ----------
    direction : (P,) complex64 ndarray
        Directions on screen.
    member : (P,) complex64 ndarray
        The same directions rotated into the view plane, where members are at equal angles. A neighbor that
        differs by more than half the angle between members is on another member, and is ignored.
    degree : int
        Degree of the field.
    neighbors : (9, P + 1) int32 ndarray
        Index of each neighbor of each pixel, from `neighbor_table`.

    Returns
    -------
    (P + 1, 4) float32 ndarray
        x and y of the direction, then of the gradient of its angle: d angle / dx and d angle / dy,
        radians per pixel. Row P is 0.
    """
    count = len(direction)
    table = np.zeros((count + 1, 4), dtype=np.float32)
    table[:-1, 0], table[:-1, 1] = direction.real, direction.imag
    unit_direction, unit_member = np.zeros((2, count + 1), dtype=np.complex64)
    unit_direction[:-1], unit_member[:-1] = normalized(direction), normalized(member)
    min_cosine = np.cos(np.pi / max(degree, 2))
    for block in pixel_blocks(count):
        conjugate, member_conjugate = unit_direction[block].conj(), unit_member[block].conj()
        gradient_sines = []
        for offset in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            neighbor = neighbors[NEIGHBOR_OFFSETS.index(offset), block]
            rotation = unit_direction.take(neighbor) * conjugate
            same_member = (unit_member.take(neighbor) * member_conjugate).real > min_cosine
            gradient_sines.append(np.where(same_member & (rotation.real > 0), rotation.imag, 0))
        left, right, below, above = gradient_sines
        table[block, 2], table[block, 3] = 0.5 * (right - left), 0.5 * (above - below)
    return table


def interpolate_direction(rows: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Compute directions at offsets from the centers of pixels, to first order.

    The arithmetic uses real numbers. Products of complex numbers are rounded differently by some
    versions of numpy and on some processors, which could lead a streamline into another pixel.

    Parameters
    ----------
    rows : (B, 4) float32 ndarray
        Rows of a `direction_table`.
    offset : (B, 2) float32 ndarray
        x and y, in pixels.

    Returns
    -------
    (B, 2) float32 ndarray
        x and y of the directions on screen.
    """
    angle = rows[:, 2] * offset[:, 0] + rows[:, 3] * offset[:, 1]
    direction = np.empty((len(rows), 2), dtype=np.float32)
    np.subtract(rows[:, 0], rows[:, 1] * angle, out=direction[:, 0])
    np.add(rows[:, 1], rows[:, 0] * angle, out=direction[:, 1])
    return direction


def integrate_noise(
    direction_at: DirectionSampler,
    side: int,
    block: slice,
    neighbors: np.ndarray,
    noise: np.ndarray,
    look: PixelLook,
    step_limit: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Sum the noise along one half of each streamline that starts in a block.

    A position is the index of a pixel and an offset from its center. Steps are taken by the two-step
    Adams-Bashforth method, v = 3/2 d - 1/2 d_previous. Like Euler's method, it evaluates the direction once
    per step, but it does not drift out of curves.

    Parameters
    ----------
    direction_at : function
        Takes the (B,) int32 indices of the pixels of the streamlines (P if a streamline has ended) and the
        (B, 2) float32 offsets from the centers of these pixels. Returns the (B, 2) float32 directions on
        screen (0 for P). It is called once per step, in order, and may keep data between calls.
    side : {1, -1}
        1 for the forward half of the streamline, -1 for the backward half.
    block : slice
        Pixels of the field.
    neighbors : (9, P + 1) int32 ndarray
        Index of each neighbor of each pixel, from `neighbor_table`.
    noise : (P + 1, K) float32 ndarray
        Noise at the P pixels; row P is 0.
    look : PixelLook
        In pixels of the frame. Its `length` and kernel are used.
    step_limit : (B,) ndarray or None
        Number of steps after which each streamline ends. If None, it is the `length` of the look.

    Returns
    -------
    total : (B, K) float32 ndarray
        Weighted sum of the noise, without the sample at the start.
    samples : (B,) float32 ndarray
        Number of samples in the sum.
    """
    end = neighbors.shape[1] - 1
    weight_slope = WEIGHT_SLOPES[look.kernel][0 if side > 0 else 1]
    neighbors = neighbors.reshape(-1)
    entry = np.arange(block.start, block.stop, dtype=np.int32)
    offset = np.zeros((len(entry), 2), dtype=np.float32)
    total = np.zeros((len(entry), noise.shape[1]), dtype=np.float32)
    samples = np.zeros(len(entry), dtype=np.float32)
    previous_direction = None
    length = look.length if step_limit is None else step_limit
    weight_step = weight_slope / (1 + np.asarray(length, dtype=np.float32))
    for step_index in range(1, look.length + 1):
        direction = direction_at(entry, offset)
        step = np.float32(side if previous_direction is None else 1.5 * side) * direction
        if previous_direction is not None:
            step -= np.float32(0.5 * side) * previous_direction
        offset += step
        previous_direction = direction
        # At most to a neighbor, even where the direction turns sharply.
        pixel_step = np.clip(np.rint(offset), -1, 1)
        offset -= pixel_step
        neighbor_offset = pixel_step[:, 0] + 3 * pixel_step[:, 1]
        entry = neighbors.take((neighbor_offset.astype(np.intp) + 4) * (end + 1) + entry)
        if step_limit is not None:
            entry[step_limit < step_index] = end
        active = entry != end
        if not active.any():
            break
        noise_sample = noise.take(entry, axis=0)
        if weight_slope:
            noise_sample *= (1 - step_index * weight_step)[..., None]
        total += noise_sample
        samples += active
    return total, samples

"""Pictures of the method "sheets" with one streamline per pixel.

As the shaders do, this averages each streamline separately: streaks that drift by the definition in `flow`,
and those of pixels with several samples by that of `lic_trace.glsl`, with interpolated noise. The method
"sheets" shares streamlines between pixels, so that its streaks are a little different.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np

from .rosy_modules import rosy

lic, per_pixel_lic = rosy("compositor.lic"), rosy("compositor.per_pixel_lic")
covering_module, lic_images = rosy("compositor.covering"), rosy("compositor.lic_images")
filter_kernel, flow = rosy("compositor.filter_kernel"), rosy("compositor.flow")
normalize_variance = rosy("compositor.contrast").normalize_variance
all_members = rosy("compositor.pixel_field").all_members
is_hatched = rosy("compositor.hatching").is_hatched
NOISE_MEAN = rosy("compositor.image_noise").NOISE_MEAN
INTERPOLATED_CONTRAST = rosy("gpu.lic_stage").INTERPOLATED_CONTRAST

#: Weights of the channels at positions of a streamline: from a position and the share of the kernel that drifts
#: forward to (P, K).
Weights = Callable[[int, np.ndarray], np.ndarray]


@contextmanager
def one_streamline_per_pixel() -> Iterator[None]:
    """Let the method "sheets" follow the best of the N directions from each pixel, as "brute" does."""

    def draw_lengths(field, looks, noise, _strip):
        results = []
        for look in looks:
            images = per_pixel_lic.brute_force(field, look, noise)
            if look.is_antialiased and is_hatched(look):
                covering = covering_module.build_covering(field, look, noise)
                images = _smoothed(covering, field, images)
            results.append(images)
        return results

    convolve_still = per_pixel_lic.convolve_members

    def convolve(field, look, *arguments):
        if look.flow or look.is_antialiased:
            return _members(field, look, *arguments)
        return convolve_still(field, look, *arguments)

    with (
        mock.patch.object(lic, "fast_lic", draw_lengths),
        mock.patch.object(per_pixel_lic, "convolve_members", convolve),
    ):
        yield


def _smoothed(covering: Any, field: Any, images: Any) -> Any:
    """Return images that are averaged with those before and behind, with their slopes."""
    lines = covering_module.member_lines(field)
    member_of_line = np.argsort(lines)
    pixel_of_cell = np.full(covering.cell_count, -1)
    pixel_of_cell[covering.cell_of_pixel] = np.arange(images.members.shape[1])

    def at_neighbor(members: np.ndarray, index: int, offset: tuple[int, int]) -> np.ndarray:
        entry = lines[index] * covering.cell_count + covering.cell_of_pixel.astype(np.intp)
        (neighbor,) = covering.neighbor_lines(entry, (offset,))
        line, cell = np.divmod(neighbor, covering.cell_count)
        values = members[member_of_line[line], pixel_of_cell[cell]]
        return np.where((pixel_of_cell[cell] < 0)[:, None], members[index], values)

    smooth, slopes = np.empty_like(images.members), np.empty(images.members.shape[:2], np.float32)
    for index, own in enumerate(images.members):
        ahead, behind = (at_neighbor(images.members, index, (side, 0)) for side in (1, -1))
        smooth[index] = 0.5 * own + 0.25 * (ahead + behind)
    for index in range(len(smooth)):
        left, right = (at_neighbor(smooth, index, (0, side)) for side in (1, -1))
        slopes[index] = 0.5 * (left - right).mean(axis=1)
    return replace(images, members=smooth, slopes=slopes)


def _members(field: Any, look: Any, noise: np.ndarray, neighbors: np.ndarray, tracers: Any) -> Any:
    """Do the same as `per_pixel_lic.convolve_members`, by kernels that move or with interpolated noise."""
    count = len(field.pixel)
    limit = lic_images.magnitude_step_limits(field, look)
    length = np.full(count, look.length) if limit is None else limit
    reach = look.streamline_reach()
    centered = noise.astype(np.float64) - NOISE_MEAN
    sample = _sampler(centered, neighbors, look.is_antialiased)
    weights = _weights(look, length)
    whole = filter_kernel.kernel_weights(*[length.astype(float)] * 3, look.kernel)
    channels = 1 if look.flow else noise.shape[1]
    members = np.empty((len(tracers), count, channels), dtype=np.float32)
    samples = np.empty((len(tracers), count))
    directions = all_members(field, look.guiding_angle)
    for member, tracer in enumerate(tracers):
        forward = np.ones(count)
        if field.symmetry.has_opposites:
            cosine = (directions[member] * np.exp(-1j * look.guiding_angle)).real
            forward = flow.forward_share(cosine).astype(np.float64)
        start = weights(0, forward)
        total, weight_sum = start * centered, start.sum(axis=1)
        available, full = (start**2).sum(axis=1), (start**2).sum(axis=1)
        for side in (1, -1):
            steps = _traced(neighbors, tracer(slice(0, count)), count, reach, side)
            for step, entry, offset in steps:
                weight = weights(side * step, forward)
                energy = (weight**2).sum(axis=1)
                total += weight * sample(entry, offset)
                available += np.where(entry == count, 0, energy)
                weight_sum += np.where(entry == count, 0, weight.sum(axis=1))
                full += energy
        if look.flow:
            samples[member] = np.maximum(whole.effective_samples * available / full, 1e-3)
            scale = np.sqrt(whole.effective_samples / full) / samples[member]
            mean = (total.sum(axis=1) * scale)[:, None]
        else:
            samples[member] = weight_sum**2 / available
            mean = total / weight_sum[:, None]
        if look.is_antialiased and not is_hatched(look):
            mean *= INTERPOLATED_CONTRAST
        mean = (NOISE_MEAN + mean).astype(np.float32)
        number = samples[member].astype(np.float32)
        members[member] = normalize_variance(mean, number, look)
    return lic_images.lic_images(members, samples.mean(axis=0).astype(np.float32))


def _sampler(
    centered: np.ndarray, neighbors: np.ndarray, interpolates: bool
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return a function from (P,) entries and (P, 2) offsets to (P, K) noise; 0 after the end."""
    padded = np.concatenate([centered, np.zeros_like(centered[:1])])
    if not interpolates:
        return lambda entry, _offset: padded.take(entry, axis=0)
    gradients = np.zeros((2, *padded.shape))
    # The neighbors at the right, at the left, above and below.
    for gradient, (ahead, behind) in zip(gradients, ((5, 3), (7, 1)), strict=True):
        for bit, sign in ((ahead, 0.5), (behind, -0.5)):
            neighbor = neighbors[bit, :-1]
            is_linked = (neighbor < len(centered))[:, None]
            gradient[:-1] += sign * np.where(is_linked, padded[neighbor], centered)
    return lambda entry, offset: (
        padded.take(entry, axis=0)
        + gradients[0].take(entry, axis=0) * offset[:, :1]
        + gradients[1].take(entry, axis=0) * offset[:, 1:]
    )


def _weights(look: Any, length: np.ndarray) -> Weights:
    """Return the weights of a kernel that moves, or is at rest without flow."""
    kind, share = look.kernel, length / look.length
    sample_weights = filter_kernel.sample_weights
    if not look.flow:
        return lambda position, _: sample_weights(np.full(len(length), position), length, kind)[
            :, None
        ]
    shifts = flow.channel_shifts(look.flow_phase, look.flow_distance)
    channel_weights = flow.channel_weights(look.flow_phase)

    def weights(position: int, forward: np.ndarray) -> np.ndarray:
        result = np.zeros((len(length), len(shifts)))
        for channel, (shift, weight) in enumerate(zip(shifts, channel_weights, strict=True)):
            for direction, part in ((1, forward), (-1, 1 - forward)):
                place = direction * position + share * shift
                low = np.floor(place)
                for step, amount in ((low, 1 - place + low), (low + 1, place - low)):
                    of_kernel = sample_weights(step, length, kind)
                    result[:, channel] += weight * part * amount * of_kernel
        return result

    return weights


def _traced(
    neighbors: np.ndarray, direction_at: Any, count: int, steps: int, step_length: float
) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield each step, and the entries and offsets that streamlines from all pixels reach, as `integrate_noise`."""
    flat = neighbors.reshape(-1)
    entry = np.arange(count, dtype=np.int32)
    offset, previous = np.zeros((count, 2), dtype=np.float32), None
    for step in range(1, steps + 1):
        direction = direction_at(entry, offset)
        ahead = direction if previous is None else 1.5 * direction - 0.5 * previous
        offset += np.float32(step_length) * ahead
        previous = direction
        pixel_step = np.clip(np.rint(offset), -1, 1)
        offset -= pixel_step
        bit = (pixel_step[:, 0] + 3 * pixel_step[:, 1]).astype(np.intp) + 4
        entry = flat.take(bit * (count + 1) + entry)
        yield step, entry, offset

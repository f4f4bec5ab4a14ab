"""Pictures whose streaks drift, with one streamline per pixel.

As the shaders do, this averages each streamline separately, by the definition in `flow`. The method
"sheets" shares streamlines between pixels, so that its streaks are a little different.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import numpy as np


@contextmanager
def one_streamline_per_pixel(package: str = "rosy_addon") -> Iterator[None]:
    """Let the method "sheets" follow the best of the N directions from each pixel, as "brute" does."""
    brute_force, lic = (
        importlib.import_module(f"{package}.compositor.{name}") for name in ("brute_force", "lic")
    )

    def lengths_task(field, looks, noise, _band, _name):
        images = []
        for look in looks:
            images.append((yield from brute_force.brute_force_task(field, look, noise)))
        return images

    convolve_still_task = brute_force.convolve_members_task

    def convolve_task(field, look, *arguments):
        if not look.flow:
            return (yield from convolve_still_task(field, look, *arguments))
        return (yield from _drifting_members_task(package, field, look, *arguments))

    with (
        mock.patch.object(lic, "fast_lic_lengths_task", lengths_task),
        mock.patch.object(brute_force, "convolve_members_task", convolve_task),
    ):
        yield


def _drifting_members_task(
    package: str, field: Any, look: Any, noise: np.ndarray, neighbors: np.ndarray, tracers: Any
) -> Iterator[Any]:
    """Do the same as `lic_images.convolve_members_task`, by kernels that move."""
    flow, contrast, filter_kernel, lic_images, image_noise, pixel_field = (
        importlib.import_module(f"{package}.compositor.{name}")
        for name in (
            *("flow", "contrast", "filter_kernel", "lic_images", "image_noise"),
            "pixel_field",
        )
    )
    count = len(field.pixel)
    limit = yield from lic_images.step_limits_task(field, look)
    length = np.full(count, look.length) if limit is None else limit
    share = length / look.length
    kind, reach = filter_kernel.kernel_of(look), flow.streamline_reach(look)
    padded_noise = np.zeros((count + 1, noise.shape[1]), dtype=np.float64)
    padded_noise[:-1] = noise - image_noise.NOISE_MEAN
    shifts, weights = flow.channel_shifts(look), flow.channel_weights(look.flow_phase)
    full_samples = filter_kernel.kernel_weights(*[length.astype(float)] * 3, kind).effective_samples

    def channel_weights(position: int, forward: np.ndarray) -> np.ndarray:
        """(P, 3) weights of the samples at a position."""
        result = np.zeros((count, len(shifts)))
        for channel, (shift, weight) in enumerate(zip(shifts, weights, strict=True)):
            for direction, part in ((1, forward), (-1, 1 - forward)):
                place = direction * position + share * shift
                low = np.floor(place)
                for step, amount in ((low, 1 - place + low), (low + 1, place - low)):
                    of_kernel = filter_kernel.sample_weights(step, length, kind)
                    result[:, channel] += weight * part * amount * of_kernel
        return result

    members = np.empty((len(tracers), count, 1), dtype=np.float32)
    samples = np.empty((len(tracers), count))
    everything = slice(0, count)
    directions = pixel_field.all_members(field, look.guiding_angle)
    for member, tracer in enumerate(tracers):
        forward = np.ones(count)
        if field.symmetry.has_opposites:
            cosine = (directions[member] * np.exp(-1j * look.guiding_angle)).real
            forward = flow.forward_share(cosine).astype(np.float64)
        start = channel_weights(0, forward)
        total = (start * padded_noise[:-1]).sum(axis=1)
        available, full = (start**2).sum(axis=1), (start**2).sum(axis=1)
        for side, direction_at in zip((1, -1), tracer(everything), strict=True):
            for step, entry in _traced(neighbors, direction_at, count, reach, look.step):
                sample = channel_weights(side * step, forward)
                energy = (sample**2).sum(axis=1)
                total += (sample * padded_noise.take(entry, axis=0)).sum(axis=1)
                available += np.where(entry == count, 0, energy)
                full += energy
        samples[member] = np.maximum(full_samples * available / full, 1e-3)
        mean = total * np.sqrt(full_samples / full) / samples[member]
        mean = (image_noise.NOISE_MEAN + mean)[:, None].astype(np.float32)
        number = samples[member].astype(np.float32)
        members[member] = contrast.normalize_variance(mean, number, look)
    mean_samples = samples.mean(axis=0).astype(np.float32)
    return (yield from lic_images.lic_images_task(members, mean_samples))


def _traced(
    neighbors: np.ndarray, direction_at: Any, count: int, steps: int, step_length: float
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield each step, and the entries that streamlines from all pixels reach, as `integrate_noise`."""
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
        yield step, entry

"""LIC images, one per line, and their blend."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..field.validate import MIN_COMPONENT
from ..progress import Progress, Task
from .contrast import normalize_variance
from .filter_kernel import kernel_weights
from .look import Look
from .per_pixel_lic import DirectionSampler, integrate_noise, pixel_blocks
from .pixel_field import PixelField

#: Takes a block of pixels, and returns samplers for the directions of the streamlines of one
#: member, forward and backward.
LineTracer = Callable[[slice], tuple[DirectionSampler, DirectionSampler]]


@dataclass(frozen=True, eq=False)
class LicImages:
    """LIC images of the members of a field, before contrast correction.

    Attributes
    ----------
    members : (M, P, K) float32 ndarray
        K is 1 for gray noise and 3 for colored noise.
    blend : (P, K) float32 ndarray
        Their mean.
    effective_samples : (P,) float32 ndarray
        Effective samples of the streamlines of a pixel (see `filter_kernel.KernelWeights`), mean
        over the members.
    first_set_weight : (P,) float32 ndarray
        Weight of `members` in `blend`. The rest is a second set of images.
    """

    members: np.ndarray
    blend: np.ndarray
    effective_samples: np.ndarray
    first_set_weight: np.ndarray

    def part(self, extent: slice) -> LicImages:
        """Return the images at some of the pixels."""
        return LicImages(
            self.members[:, extent],
            self.blend[extent],
            self.effective_samples[extent],
            self.first_set_weight[extent],
        )

    def blended_with(self, other: LicImages, weight: np.ndarray) -> LicImages:
        """Blend with a second set of images, given the (P,) weight of this set, 0 to 1."""
        return replace(
            self,
            blend=other.blend + weight[:, None] * (self.blend - other.blend),
            effective_samples=other.effective_samples
            + weight * (self.effective_samples - other.effective_samples),
            first_set_weight=weight,
        )


def convolve_members_task(
    field: PixelField, look: Look, noise: np.ndarray, tracers: Sequence[LineTracer]
) -> Task[LicImages]:
    """Trace a streamline of each member through every pixel, and average the noise along it.

    Parameters
    ----------
    field : PixelField
    look : Look
        In pixels of the frame. Its `length`, `taper`, `step` and `magnitude` are used.
    noise : (P, K) float32 ndarray
    tracers : sequence of M functions
        One per member image.

    Returns
    -------
    LicImages
    """
    count, channels = noise.shape
    step_limit = step_limits(field, look)
    padded_noise = np.concatenate([noise, np.zeros((1, channels), dtype=np.float32)])
    members = np.empty((len(tracers), count, channels), dtype=np.float32)
    effective_samples = np.zeros(count, dtype=np.float32)
    for member, tracer in enumerate(tracers):
        for block in pixel_blocks(count):
            block_limit = None if step_limit is None else step_limit[block]
            (forward_sum, forward), (backward_sum, backward) = (
                integrate_noise(
                    field,
                    block,
                    direction_at,
                    padded_noise,
                    look.length,
                    look.step,
                    block_limit,
                    look.taper,
                )
                for direction_at in tracer(block)
            )
            full_length = look.length if block_limit is None else block_limit
            weights = kernel_weights(forward, backward, full_length, look.taper)
            mean = (noise[block] + forward_sum + backward_sum) / weights.total[:, None]
            members[member, block] = normalize_variance(mean, weights.effective_samples, look)
            effective_samples[block] += weights.effective_samples
            fraction = (member + block.stop / count) / len(tracers)
            yield Progress(fraction, "tracing streamlines")
    effective_samples /= len(tracers)
    return LicImages(
        members, members.mean(axis=0), effective_samples, np.ones(count, dtype=np.float32)
    )


def step_limits(field: PixelField, look: Look) -> np.ndarray | None:
    """(P,) steps in each direction if they depend on the magnitude, None otherwise."""
    if look.magnitude not in ("length", "both"):
        return None
    return np.rint(look.length * relative_magnitude(field, look)).astype(np.int32)


def relative_magnitude(field: PixelField, look: Look) -> np.ndarray:
    """(P,) float32: rho relative to `Look.magnitude_range`, at most 1."""
    limit = np.float32(with_magnitude_range(look, field).magnitude_range)
    return np.minimum(np.abs(field.representation), limit) / limit


def with_magnitude_range(look: Look, field: PixelField) -> Look:
    """Return a look with the range of magnitudes of a field, if it has none of its own.

    Parts of the field can then be drawn one by one.
    """
    largest = look.magnitude_range
    if not largest:
        largest = float(np.abs(field.representation).max(initial=0.0)) or 1.0
    return replace(look, magnitude_range=max(largest, MIN_COMPONENT))

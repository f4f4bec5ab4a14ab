"""LIC images, one per line, and their blend."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..field.validate import MIN_COMPONENT
from ..progress import progress, report
from ..projection.pixel_blocks import pixel_blocks
from .contrast import normalize_variance
from .filter_kernel import WEIGHT_SLOPES, kernel_of, kernel_weights
from .look import Look
from .per_pixel_lic import DirectionSampler, integrate_noise
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
    slopes : (M, P) float32 ndarray or None
        Derivatives of the members, mean over their channels, to the left of the lines, per pixel. None
        if they were not asked for.
    """

    members: np.ndarray
    blend: np.ndarray
    effective_samples: np.ndarray
    first_set_weight: np.ndarray
    slopes: np.ndarray | None = None

    def part(self, extent: slice) -> LicImages:
        """Return the images at some of the pixels."""
        return LicImages(
            self.members[:, extent],
            self.blend[extent],
            self.effective_samples[extent],
            self.first_set_weight[extent],
            None if self.slopes is None else self.slopes[:, extent],
        )


def lic_images(
    members: np.ndarray, effective_samples: np.ndarray, slopes: np.ndarray | None = None
) -> LicImages:
    """Blend member images. Parameters as in `LicImages`."""
    blend = np.empty(members.shape[1:], dtype=np.float32)
    for block in pixel_blocks(len(blend)):
        report(block.start / len(blend), "blending lines")
        blend[block] = members[:, block].mean(axis=0)
    return LicImages(
        members, blend, effective_samples, np.ones(len(effective_samples), dtype=np.float32), slopes
    )


def convolve_members(
    field: PixelField,
    look: Look,
    noise: np.ndarray,
    neighbors: np.ndarray,
    tracers: Sequence[LineTracer],
) -> LicImages:
    """Trace a streamline of each member through every pixel, and average the noise along it.

    Parameters
    ----------
    field : PixelField
    look : Look
        In pixels of the frame. Its `length`, `step`, kernel and `magnitude` are used.
    noise : (P, K) float32 ndarray
    neighbors : (9, P + 1) int32 ndarray
        From `pixel_field.neighbor_table`.
    tracers : sequence of M functions
        One per member image.

    Returns
    -------
    LicImages
    """
    count, channels = noise.shape
    with progress(0.0):
        step_limit = magnitude_step_limits(field, look)
    padded_noise = np.concatenate([noise, np.zeros((1, channels), dtype=np.float32)])
    members = np.empty((len(tracers), count, channels), dtype=np.float32)
    effective_samples = np.zeros(count, dtype=np.float32)
    kernel = kernel_of(look)
    slopes = WEIGHT_SLOPES[kernel]
    for member, tracer in enumerate(tracers):
        for block in pixel_blocks(count):
            block_limit = None if step_limit is None else step_limit[block]
            (forward_sum, forward), (backward_sum, backward) = (
                integrate_noise(
                    block,
                    neighbors,
                    direction_at,
                    padded_noise,
                    look.length,
                    look.step,
                    block_limit,
                    slope,
                )
                for direction_at, slope in zip(tracer(block), slopes, strict=True)
            )
            full_length = look.length if block_limit is None else block_limit
            weights = kernel_weights(forward, backward, full_length, kernel)
            mean = (noise[block] + forward_sum + backward_sum) / weights.total[:, None]
            members[member, block] = normalize_variance(mean, weights.effective_samples, look)
            effective_samples[block] += weights.effective_samples
            fraction = (member + block.stop / count) / len(tracers)
            report(fraction, "tracing streamlines")
    effective_samples /= len(tracers)
    with progress(1.0):
        return lic_images(members, effective_samples)


def magnitude_step_limits(field: PixelField, look: Look) -> np.ndarray | None:
    """(P,) int32 steps in each direction if they depend on the magnitude, None otherwise."""
    if look.magnitude not in ("length", "both"):
        return None
    look = with_magnitude_range(look, field)
    limits = np.empty(len(field.pixel), dtype=np.int32)
    for block in pixel_blocks(len(limits)):
        report(block.start / len(limits), "tracing streamlines")
        limits[block] = np.rint(look.length * relative_magnitude(field.part(block), look))
    return limits


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
    return replace(look, magnitude_range=fixed_magnitude_range(largest))


def fixed_magnitude_range(largest: float) -> float:
    """Return the magnitude with the last color, given the largest one, or a range that a look sets."""
    return max(largest, MIN_COMPONENT)

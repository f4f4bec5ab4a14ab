"""LIC images, one per line, and their blend."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..field.validate import MIN_COMPONENT
from .look_units import PixelLook
from .pixel_field import PixelField
from .reported_blocks import reported_blocks


@dataclass(frozen=True, eq=False)
class LicImages:
    """LIC images of the members of a field, before contrast correction.

    Attributes
    ----------
    members : (M, P, K) float32 ndarray
        K is 1 for gray noise and 3 for colored noise.
    blend : (P, K) float32 ndarray
        Their mean, in which there may be a second set of images.
    effective_samples : (P,) float32 ndarray
        Effective samples of the streamlines of a pixel (see `filter_kernel.KernelWeights`), mean
        over the members.
    slopes : (M, P) float32 ndarray or None
        Derivatives of the members, mean over their channels, to the left of the lines, per pixel. None
        if they were not asked for.
    """

    members: np.ndarray
    blend: np.ndarray
    effective_samples: np.ndarray
    slopes: np.ndarray | None = None

    def part(self, extent: slice) -> LicImages:
        """Return the images at some of the pixels."""
        return LicImages(
            self.members[:, extent],
            self.blend[extent],
            self.effective_samples[extent],
            None if self.slopes is None else self.slopes[:, extent],
        )


def lic_images(
    members: np.ndarray, effective_samples: np.ndarray, slopes: np.ndarray | None = None
) -> LicImages:
    """Blend member images. Parameters as in `LicImages`."""
    blend = np.empty(members.shape[1:], dtype=np.float32)
    for block in reported_blocks(len(blend), "blending lines"):
        blend[block] = members[:, block].mean(axis=0)
    return LicImages(members, blend, effective_samples, slopes)


def magnitude_step_limits(field: PixelField, look: PixelLook) -> np.ndarray | None:
    """(P,) int32 steps in each direction if they depend on the magnitude, None otherwise."""
    if look.magnitude not in ("length", "both"):
        return None
    look = with_magnitude_range(look, field)
    limits = np.empty(len(field.pixel), dtype=np.int32)
    for block in reported_blocks(len(limits), "tracing streamlines"):
        limits[block] = np.rint(look.length * relative_magnitude(field.part(block), look))
    return limits


def relative_magnitude(field: PixelField, look: PixelLook) -> np.ndarray:
    """(P,) float32: rho relative to `PixelLook.magnitude_range`, at most 1."""
    limit = np.float32(with_magnitude_range(look, field).magnitude_range)
    return np.minimum(np.abs(field.representation), limit) / limit


def with_magnitude_range(look: PixelLook, field: PixelField) -> PixelLook:
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

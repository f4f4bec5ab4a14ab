"""LIC images, one for each line (pair of opposite directions of the field), and their blend."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..field.validate import MIN_COMPONENT
from .look import magnitude_range
from .look_units import PixelLook
from .pixel_field import PixelField

#: Smallest difference between the ends of a range of magnitudes, relative to them. Single precision
#: resolves 1e-7.
MIN_RANGE_RATIO = 1e-6


@dataclass(frozen=True, eq=False)
class LicImages:
    """LIC images of the members of a field, before contrast correction.

    Attributes
    ----------
    members : (M, P, K) float32 ndarray
        Mean of the noise along the streamlines of each of the M lines. K is 1 for gray noise and 3 for
        colored noise.
    blend : (P, K) float32 ndarray
        Mean of the member images. With the method of the paper, a second set of images is blended in.
    effective_samples : (P,) float32 ndarray
        Number of samples of equal weight whose mean has the variance of the averages at a pixel
        (`filter_kernel.KernelWeights`); mean over the M lines.
    slopes : (M, P) float32 ndarray or None
        Derivatives of the member images toward the left of the lines, per pixel, averaged over the channels.
        None if they are not computed; see `fast_lic.has_slopes`.
    """

    members: np.ndarray
    blend: np.ndarray
    effective_samples: np.ndarray
    slopes: np.ndarray | None = None

    def part(self, extent: slice) -> LicImages:
        """Return the LIC images at the pixels `extent`."""
        members, blend = self.members[:, extent], self.blend[extent]
        slopes = None if self.slopes is None else self.slopes[:, extent]
        return LicImages(members, blend, self.effective_samples[extent], slopes)


def lic_images(
    members: np.ndarray, effective_samples: np.ndarray, slopes: np.ndarray | None = None
) -> LicImages:
    """Make `LicImages` whose blend is the mean of the member images.

    The parameters are the other attributes of `LicImages`.
    """
    return LicImages(members, members.mean(axis=0), effective_samples, slopes)


def magnitude_step_limits(field: PixelField, look: PixelLook) -> np.ndarray | None:
    """Return the (P,) int32 length of streamlines at each pixel, as steps in each direction.

    None if the length does not depend on the magnitude of the field.
    """
    if not look.magnitude_length:
        return None
    magnitude = relative_magnitude(field, magnitude_ends(look, field))
    return np.rint(look.length * magnitude).astype(np.int32)


def relative_magnitude(field: PixelField, ends: tuple[float, float]) -> np.ndarray:
    """Return the (P,) float32 magnitudes of a field, scaled from the range `ends` to 0 to 1, and clipped."""
    low, high = np.float32(ends)
    clipped = np.clip(np.abs(field.representation), min(low, high), max(low, high))
    return (clipped - low) / (high - low)


def magnitude_ends(look: PixelLook, field: PixelField) -> tuple[float, float]:
    """Return the magnitudes at the bottom and at the top of the color map.

    If the look sets no range, they are 0 and the largest magnitude of the field.
    """
    ends = magnitude_range(look)
    if ends is None:
        ends = 0.0, float(np.abs(field.representation).max(initial=0.0)) or 1.0
    return distinct_ends(*ends)


def with_magnitude_range(look: PixelLook, field: PixelField) -> PixelLook:
    """Return the look with its `color_range` set to the `magnitude_ends` of the field.

    The field can then be drawn strip by strip with the same range.
    """
    return replace(look, color_range=magnitude_ends(look, field))


def distinct_ends(low: float, high: float) -> tuple[float, float]:
    """Return the ends of a range of magnitudes. If they are equal, the upper one is raised a little."""
    least = max(MIN_COMPONENT, MIN_RANGE_RATIO * max(abs(low), abs(high)))
    return (low, high) if abs(high - low) >= least else (low, low + least)

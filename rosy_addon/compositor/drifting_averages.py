"""Averages of noise along streamlines, by kernels that move; see `flow`.

The sum of the noise around the sample q, with the weights of any kernel here, is a few terms of the sums of
prefix sums E of the noise: those of the second difference of the weights. Sums between two samples are
interpolated.
"""

from __future__ import annotations

import math

import numpy as np

from .filter_kernel import Kernel, kernel_weights, sample_weights
from .flow import MAX_AXIAL_STEPS, channel_shifts, channel_weights
from .look_units import PixelLook

#: Effective samples of a streamline that ends before its kernels begin. It is gray.
MIN_EFFECTIVE_SAMPLES = 1e-3


#: Levels of `MovingKernel.energies`, at most.
MAX_LEVELS = 256


class MovingKernel:
    """The kernels of the channels of a look whose streaks drift.

    Parameters
    ----------
    look : PixelLook
        A look that has flow.
    levels : int
        Number of different lengths of streamlines, if the length depends on the magnitude.

    Attributes
    ----------
    kind : {"box", "taper", "ramp"}
    length : int
        Steps of the kernel at rest, in each direction.
    shifts, weights : (3,) float64 ndarray
        From `channel_shifts` and `channel_weights`.
    reach : int
        R, steps from the pixel to the last sample.
    energies : (3, L, 2 R + 2) float64 ndarray
        Prefix sums over the samples, from -R - 1, of the squares of the weights forward and backward, and
        of their products. Level l is for streamlines of the length times l / (L - 1).
    full_samples : (L,) float64 ndarray
        `filter_kernel.KernelWeights.effective_samples` of the kernels at rest.
    """

    def __init__(self, look: PixelLook, levels: int = 1) -> None:
        self.length, self.kind = look.length, look.kernel
        self.shifts = channel_shifts(look.flow_phase, look.flow_distance)
        self.weights = channel_weights(look.flow_phase)
        self.reach = look.streamline_reach()
        position = np.arange(-self.reach, self.reach + 1)
        self.energies = np.zeros((3, levels, len(position) + 1))
        self.full_samples = np.empty(levels)
        for level in range(levels):
            share = level / (levels - 1) if levels > 1 else 1.0
            length = float(round(share * self.length))
            self.full_samples[level] = kernel_weights(*[length] * 3, self.kind).effective_samples
            rows = np.stack(
                [
                    weight * _shifted_weights(position, share * shift, length, self.kind)
                    for shift, weight in zip(self.shifts, self.weights, strict=True)
                ]
            )
            mirrored = rows[:, ::-1]
            for total, products in zip(
                self.energies[:, level], (rows**2, mirrored**2, rows * mirrored), strict=True
            ):
                np.cumsum(products.sum(axis=0), out=total[1:])

    def effective_samples(
        self, share: np.ndarray, forward: np.ndarray, behind: np.ndarray, ahead: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Count the samples of equal weight whose mean has the variance of the average.

        Parameters
        ----------
        share : (n,) float32 ndarray
            Length of the kernels, relative to `length`.
        forward : (n,) float32 ndarray
            Share of the kernel that drifts forward.
        behind, ahead : (n,) intp ndarray
            Steps to the ends of the streamlines.

        Returns
        -------
        effective_samples : (n,) float64 ndarray
        factor : (n,) float64 ndarray
            By which weighted sums are multiplied to be averages times the effective samples.
        """
        table = self.energies.reshape(3, -1)
        width, levels = self.energies.shape[2], len(self.full_samples)
        level = np.rint(share * (levels - 1)).astype(np.intp)
        center = level * width + (self.reach + 1)
        available = table.take(center + np.minimum(ahead, self.reach), axis=1)
        available -= table.take(center - np.minimum(behind, self.reach) - 1, axis=1)
        shares = np.stack([forward**2, (1 - forward) ** 2, 2 * forward * (1 - forward)])
        full = (shares * self.energies[:, level, -1]).sum(axis=0)
        samples = self.full_samples[level]
        return samples * (shares * available).sum(axis=0) / full, np.sqrt(samples / full)


def _shifted_weights(position: np.ndarray, shift: float, length: float, kind: Kernel) -> np.ndarray:
    """Return the weights of a kernel whose center is `shift` steps backward, interpolated between whole steps."""
    whole = math.floor(shift)
    fraction = shift - whole
    return (1 - fraction) * sample_weights(position + whole, length, kind) + fraction * (
        sample_weights(position + whole + 1, length, kind)
    )


class DriftingAverages:
    """The averages along some streamlines, by the kernels of one look.

    Parameters
    ----------
    kernel : MovingKernel
    second_sums : (3, 2 R + 3, n) complex64 ndarray
        Row i + R + 2 of a channel is the sum of prefix sums of its noise up to step i, from -R - 2 to R.
        The imaginary part is the same sum for the derivative to the left.
    """

    def __init__(self, kernel: MovingKernel, second_sums: np.ndarray) -> None:
        self._kernel = kernel
        self._second_sums = second_sums
        #: Row of step 0.
        self._middle = second_sums.shape[1] // 2 + 1
        #: Sums of kernels of full length around all steps, forward and mirrored.
        self._full_sums: dict[bool, np.ndarray] = {}

    def at(
        self,
        position: int,
        axial: np.ndarray,
        length: np.ndarray | None,
        forward: np.ndarray,
        behind: np.ndarray,
        ahead: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Average the noise around one step of each streamline.

        Parameters
        ----------
        position : int
            The step, negative in the backward half.
        axial : (n,) float32 ndarray
            Steps from there to the center of the pixel, forward.
        length : (n,) ndarray of int or None
            Steps of the kernels in each direction; None for the full length.
        forward : (n,) float32 ndarray
            The share of the kernel by which streaks drift forward.
        behind, ahead : (n,) intp ndarray
            Steps to the ends of the streamlines.

        Returns
        -------
        sums : (n,) complex64 ndarray
            The average of the noise, and of its derivative to the left, times the effective samples.
        effective_samples : (n,) float32 ndarray
        """
        kernel = self._kernel
        share = np.ones(len(forward), dtype=np.float32)
        if length is not None:
            share = (length / np.float32(kernel.length)).astype(np.float32)
        center = np.float32(position) + np.clip(axial, -MAX_AXIAL_STEPS, MAX_AXIAL_STEPS)
        total = np.zeros(len(forward), dtype=np.complex64)
        for direction, weight in ((1, forward), (-1, 1 - forward)):
            columns = np.flatnonzero(weight)
            if not len(columns):
                continue
            part = slice(None) if len(columns) == len(weight) else columns
            drifted = np.zeros(len(columns), dtype=np.complex64)
            for channel, (shift, amount) in enumerate(
                zip(kernel.shifts, kernel.weights, strict=True)
            ):
                if amount:
                    place = center[part] - np.float32(direction * shift) * share[part]
                    lengths = None if length is None else length[part]
                    drifted += np.float32(amount) * self._sums_at(
                        channel, place, columns, lengths, direction < 0
                    )
            total[part] += weight[part] * drifted
        samples, factor = kernel.effective_samples(share, forward, behind, ahead)
        return (
            total * factor.astype(np.float32),
            np.maximum(samples, MIN_EFFECTIVE_SAMPLES).astype(np.float32),
        )

    def _sums_at(
        self,
        channel: int,
        place: np.ndarray,
        columns: np.ndarray,
        length: np.ndarray | None,
        is_mirrored: bool,
    ) -> np.ndarray:
        """Return (n,) complex64 sums around positions between steps, of some streamlines."""
        whole = np.floor(place)
        fraction = place - whole
        step = whole.astype(np.intp)
        if length is None:
            sums = self._full(is_mirrored)[channel]
            index = (step + len(sums) // 2) * sums.shape[1] + columns
            low, high = sums.reshape(-1).take(index), sums.reshape(-1).take(index + sums.shape[1])
        else:
            low, high = (
                self._sums_of_length(channel, each, columns, length, is_mirrored)
                for each in (step, step + 1)
            )
        return low + fraction * (high - low)

    def _full(self, is_mirrored: bool) -> np.ndarray:
        """Return the (3, 2 Q + 1, n) complex64 sums of kernels of full length around the steps from -Q to Q."""
        if is_mirrored not in self._full_sums:
            kernel = self._kernel
            last = self._middle - 2 - kernel.length
            sums = None
            for offset, weight in _kernel_terms(kernel.kind, kernel.length, is_mirrored):
                first = self._middle + offset - last
                rows = np.float32(weight) * self._second_sums[:, first : first + 2 * last + 1]
                sums = rows if sums is None else np.add(sums, rows, out=sums)
            self._full_sums[is_mirrored] = sums
            if kernel.kind != "ramp":
                self._full_sums[not is_mirrored] = sums
        return self._full_sums[is_mirrored]

    def _sums_of_length(
        self,
        channel: int,
        step: np.ndarray,
        columns: np.ndarray,
        length: np.ndarray,
        is_mirrored: bool,
    ) -> np.ndarray:
        """Return (n,) complex64 sums of kernels of their own length around steps of streamlines."""
        flat, stride = self._second_sums[channel].reshape(-1), self._second_sums.shape[2]
        total = np.zeros(len(step), dtype=np.complex64)
        for offset, weight in _kernel_terms(self._kernel.kind, length, is_mirrored):
            index = (self._middle + step + offset) * stride + columns
            total += np.asarray(weight, dtype=np.float32) * flat.take(index)
        return total


def _kernel_terms(kind: Kernel, length, is_mirrored: bool) -> list[tuple]:
    """Return the terms of a weighted sum around the sample q: offsets o and weights of E(q + o).

    With n(i) = E(i) - 2 E(i - 1) + E(i - 2), they are w(d) - 2 w(d + 1) + w(d + 2) at o = d, for the weights w
    of `filter_kernel.sample_weights`.

    Parameters
    ----------
    length : int or ndarray of int
        Steps in each direction.
    is_mirrored : bool
        Whether the weights belong to the opposite direction.
    """
    width = length + 1
    terms = {
        "box": [(length, 1.0), (length - 1, -1.0), (-length - 1, -1.0), (-length - 2, 1.0)],
        "taper": [(length, 1 / width), (-1, -2 / width), (-length - 2, 1 / width)],
        "ramp": [(length, 1 / width), (-length - 1, -2.0), (-length - 2, (2 * width - 1) / width)],
    }[kind]
    return [(-offset - 2, weight) for offset, weight in terms] if is_mirrored else terms

"""Averages of noise along streamlines, by kernels that move; see `flow`.

Let E be the prefix sum of the prefix sum of the noise along a streamline. The weights of every kernel here
are piecewise linear: their second difference is 0 except at a few places. The weighted sum of the noise
around the sample q is therefore a weighted sum of only a few values of E. Between two samples, sums
are interpolated.
"""

import math

import numpy as np

from .filter_kernel import Kernel, kernel_weights, sample_weights
from .flow import MAX_AXIAL_STEPS, channel_shifts, channel_weights
from .look_units import PixelLook

#: Effective samples of a streamline that ends before its kernels begin. Its average is gray.
MIN_EFFECTIVE_SAMPLES = 1e-3


#: Maximum number of levels (different lengths of streamlines) of `MovingKernel.energies`.
MAX_LEVELS = 256


class MovingKernel:
    """The moving filter kernels of drifting streaks, one for each of the three noise channels.

    Parameters
    ----------
    look : PixelLook
        A look that has flow.

    Attributes
    ----------
    kind : {"box", "taper", "ramp"}
    length : int
        Steps of the kernel at rest, in each direction.
    shifts, weights : (3,) float64 ndarray
        For each channel: the steps that its streaks have drifted from their middle position, and the weight
        of the channel in the sum.
    reach : int
        R, the largest number of steps from a pixel to a sample of its kernels.
    energies : (3, L, 2 R + 2) float64 ndarray
        Prefix sums over the samples from -R - 1 to R of three products: the squares of the weights of the
        kernel that drifts forward, the squares for the kernel that drifts backward, and the products of both
        weights. Level l is for kernels of the full length times l / (L - 1). There is one level if the length
        of streamlines does not depend on the magnitude.
    full_samples : (L,) float64 ndarray
        `filter_kernel.KernelWeights.effective_samples` of the kernels at rest.
    """

    def __init__(self, look: PixelLook) -> None:
        self.length, self.kind = look.length, look.kernel
        levels = min(look.length + 1, MAX_LEVELS) if look.magnitude_length else 1
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
            shifts = (share * shift for shift in self.shifts)
            shifted = [_shifted_weights(position, shift, length, self.kind) for shift in shifts]
            rows = self.weights[:, None] * np.stack(shifted)
            mirrored = rows[:, ::-1]
            products = np.stack([rows**2, mirrored**2, rows * mirrored]).sum(axis=1)
            np.cumsum(products, axis=1, out=self.energies[:, level, 1:])

    def effective_samples(
        self, share: np.ndarray, forward: np.ndarray, behind: np.ndarray, ahead: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute the effective samples of each average.

        This is the number of samples of equal weight whose mean has the variance of the average.

        Parameters
        ----------
        share : (n,) float32 ndarray
            Length of each kernel as a fraction of `length`, 0 to 1.
        forward : (n,) float32 ndarray
            Weight of the noise that drifts forward, 0 to 1. The rest of the weight drifts backward.
        behind, ahead : (n,) intp ndarray
            Steps to the backward and the forward end of each streamline. Negative numbers count as 0.

        Returns
        -------
        effective_samples : (n,) float64 ndarray
        factor : (n,) float64 ndarray
            Factor for the weighted sum of the noise of each streamline. The product is the average of the
            noise times its effective samples.
        """
        table = self.energies.reshape(3, -1)
        width, levels = self.energies.shape[2], len(self.full_samples)
        level = np.rint(share * (levels - 1)).astype(np.intp)
        center = level * width + (self.reach + 1)
        available = table.take(center + np.clip(ahead, 0, self.reach), axis=1)
        available -= table.take(center - np.clip(behind, 0, self.reach) - 1, axis=1)
        shares = np.stack([forward**2, (1 - forward) ** 2, 2 * forward * (1 - forward)])
        full = (shares * self.energies[:, level, -1]).sum(axis=0)
        samples = self.full_samples[level]
        return samples * (shares * available).sum(axis=0) / full, np.sqrt(samples / full)


def _shifted_weights(position: np.ndarray, shift: float, length: float, kind: Kernel) -> np.ndarray:
    """Return the weights of a kernel whose center is `shift` steps backward.

    They are the weights at the samples `position`, in whole steps from the pixel. The kernel has `length`
    steps in each direction. Weights are interpolated linearly between whole steps.
    """
    whole = math.floor(shift)
    fraction = shift - whole
    low, high = (sample_weights(position + whole + step, length, kind) for step in (0, 1))
    return (1 - fraction) * low + fraction * high


class DriftingAverages:
    """Averages of noise along the streamlines of a batch, with the kernels of one look.

    Parameters
    ----------
    kernel : MovingKernel
    second_sums : (3, 2 R + 3, n) complex64 ndarray
        E for n streamlines: row i + R + 2 of a channel is the sum up to step i of the prefix sums of its
        noise, for i from -R - 2 to R. The imaginary part has the sums of the derivative of the noise to the
        left.
    """

    def __init__(self, kernel: MovingKernel, second_sums: np.ndarray) -> None:
        self._kernel, self._second_sums = kernel, second_sums
        #: Row of `second_sums` for step 0.
        self._middle = second_sums.shape[1] // 2 + 1
        #: Weighted sums around all steps with kernels of full length. Key: whether the kernel is mirrored.
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
            Distance forward from that step to the center of the pixel, in steps.
        length : (n,) ndarray of int or None
            Steps of the kernels in each direction; None for the full length.
        forward : (n,) float32 ndarray
            Fraction of the kernel that drifts forward, 0 to 1; the rest drifts backward.
        behind, ahead : (n,) intp ndarray
            Steps to the backward and the forward end of each streamline.

        Returns
        -------
        sums : (n,) complex64 ndarray
            The real part is the average of the noise times the effective samples. The imaginary part is the
            same average of the derivative of the noise to the left.
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
            for channel in np.flatnonzero(kernel.weights).tolist():
                shift = np.float32(direction * kernel.shifts[channel])
                place = center[part] - shift * share[part]
                whole = np.floor(place)
                step, fraction = whole.astype(np.intp), place - whole
                if length is None:
                    sums, stride = self._full(direction < 0)[channel], len(forward)
                    index = (step + len(sums) // 2) * stride + columns
                    low, high = sums.take(index), sums.take(index + stride)
                else:
                    terms = _kernel_terms(kernel.kind, length[part], direction < 0)
                    low, high = (
                        self._sums(channel, each, columns, terms) for each in (step, step + 1)
                    )
                drifted += np.float32(kernel.weights[channel]) * (low + fraction * (high - low))
            total[part] += weight[part] * drifted
        samples, factor = kernel.effective_samples(share, forward, behind, ahead)
        samples = np.maximum(samples, MIN_EFFECTIVE_SAMPLES).astype(np.float32)
        return total * factor.astype(np.float32), samples

    def _full(self, is_mirrored: bool) -> np.ndarray:
        """Return the (3, 2 Q + 1, n) complex64 weighted sums of each channel around each step from -Q to Q.

        If `is_mirrored`, the kernels are those that drift backward. They have the full length r. Q is R - r,
        so that no kernel reaches beyond step R of its streamline.
        """
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

    def _sums(
        self, channel: int, step: np.ndarray, columns: np.ndarray, terms: list[tuple]
    ) -> np.ndarray:
        """Return (n,) complex64 weighted sums of the noise of one channel.

        Sum j is around the step `step[j]` of the streamline `columns[j]`. `terms` are the `_kernel_terms` of
        the kernels, whose lengths may differ.
        """
        flat, stride = self._second_sums[channel].reshape(-1), self._second_sums.shape[2]
        total = np.zeros(len(step), dtype=np.complex64)
        for offset, weight in terms:
            index = (self._middle + step + offset) * stride + columns
            total += np.asarray(weight, dtype=np.float32) * flat.take(index)
        return total


def _kernel_terms(kind: Kernel, length, is_mirrored: bool) -> list[tuple]:
    """Return (offset o, factor) pairs: the weighted sum around the sample q is the sum of factor * E(q + o).

    The noise is n(i) = E(i) - 2 E(i - 1) + E(i - 2). So the factor at the offset o is
    w(o) - 2 w(o + 1) + w(o + 2), where w(o) is the weight of the sample o steps from q
    (`filter_kernel.sample_weights`).

    Parameters
    ----------
    length : int or ndarray of int
        Steps of the kernel in each direction.
    is_mirrored : bool
        Whether the kernel belongs to the opposite direction: its weights are reversed.
    """
    width = length + 1
    terms = {
        "box": [(length, 1.0), (length - 1, -1.0), (-length - 1, -1.0), (-length - 2, 1.0)],
        "taper": [(length, 1 / width), (-1, -2 / width), (-length - 2, 1 / width)],
        "ramp": [(length, 1 / width), (-length - 1, -2.0), (-length - 2, (2 * width - 1) / width)],
    }[kind]
    return [(-offset - 2, weight) for offset, weight in terms] if is_mirrored else terms

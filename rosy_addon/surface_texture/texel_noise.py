"""Noise at texels: the noise of the surface, with cells of one size in Blender units."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..compositor.image_noise import BLUR_FACTOR, NOISE_MEAN
from ..compositor.surface_noise import instance_hashes, solid_noise
from ..core.progress import report
from ..projection.pixel_blocks import pixel_blocks
from ..projection.rest_coordinates import RestCoordinates, matrix_scale, rest_positions
from .texels import TexelSurface

#: Smallest side of a cell of the noise, in texels of the coarser direction.
MIN_CELL_TEXELS = 1.0

#: Most points on each side of the grid whose values are the means that a high pass subtracts.
MAX_GRID_SIDE = 256

#: Side of a cell of that grid, in standard deviations of the blur. Values are spread to the corners of
#: their cell and interpolated from them, both linearly.
GRID_CELL_SIGMAS = 3**0.5

#: Of so many texels, one is spread over the grid.
SAMPLE_STRIDE = 3

#: Texels that are spread over the grid at once.
GRID_BLOCK = 1 << 18

#: Label of the progress.
LABEL = "making noise"


def texel_noise(
    on: TexelSurface, cell: float, seed: int, channels: int, density: float, high_pass: float
) -> np.ndarray:
    """Make noise that is anchored to the surface, at its texels.

    Parameters
    ----------
    on : TexelSurface
    cell, high_pass : float
        Size of a cell of the noise, and the width above which variations are removed, in steps of
        streamlines.
    seed, channels, density
        As for `surface_noise`.

    Returns
    -------
    (P, K) float32 ndarray
        With the mean `NOISE_MEAN`.
    """
    surface, charts, texels, step = on.instance.surface, on.charts, on.texels, on.step
    # Blender units of the world in one of object space.
    scale = matrix_scale(on.instance.matrix)
    rest = rest_positions(surface).astype(np.float32)
    triangle_vertex = surface.triangle_vertex
    gradient = (charts.gradient / texels.frame.size).astype(np.complex64)
    stretch = charts.stretch()[1] * (texels.frame.size * scale)
    coarse = np.divide(MIN_CELL_TEXELS, stretch, out=np.zeros(len(stretch)), where=stretch > 0)
    cell_size = np.maximum(cell * step / scale, coarse).astype(np.float32)
    instance_hash = instance_hashes([surface.name])
    total = np.empty((channels, len(texels)), dtype=np.float32)
    for block in pixel_blocks(len(texels)):
        report(0.7 * block.start / len(texels), LABEL)
        triangle = texels.triangle[block]
        corners = triangle_vertex.take(triangle, axis=0).T
        change = gradient.take(triangle, axis=0).T
        size = cell_size.take(triangle)
        coordinates = RestCoordinates(
            texels.barycentric[block].T,
            change.real,
            change.imag,
            tuple(rest.take(corner, axis=0).T for corner in corners),
            size,
        )
        block_hash = np.broadcast_to(instance_hash, len(triangle))
        solid_noise(coordinates, size, block_hash, seed, density, out=total[:, block])
    if high_pass:
        sigma = BLUR_FACTOR * high_pass * step / scale
        _subtract_local_means(on, rest, total, sigma)
    noise = np.empty(total.shape[::-1], dtype=np.float32)
    for block in pixel_blocks(len(noise)):
        report(1.0, LABEL)
        noise[block] = total[:, block].T + np.float32(NOISE_MEAN)
    return noise


def _subtract_local_means(
    on: TexelSurface, rest: np.ndarray, channels: np.ndarray, sigma: float
) -> None:
    """Subtract a blur over the surface from (K, P) values at texels, in place.

    The blur is one in space: values are spread over a grid, and interpolated from it. So it knows no
    charts.

    Parameters
    ----------
    rest : (V, 3) float32 ndarray
        `rest_positions` of the surface.
    sigma : float
        Of the blur, in Blender units of rest space.
    """
    texels = on.texels
    used = rest[on.instance.surface.used_vertices]
    low, extent = used.min(axis=0), float(np.ptp(used, axis=0).max())
    side = max(GRID_CELL_SIGMAS * sigma, extent / (MAX_GRID_SIDE - 2))
    shape = (np.ptp(used, axis=0) / side).astype(np.intp) + 2
    stride = np.array([shape[1] * shape[2], shape[2], 1])
    area = np.abs(on.charts.density)
    area = np.divide(1, area, out=np.zeros(len(area)), where=area > 0)
    count = len(texels)
    blocks = [slice(start, start + GRID_BLOCK) for start in range(0, count, GRID_BLOCK)]

    def cells(block: slice) -> tuple[np.ndarray, np.ndarray]:
        """Return the (n,) lowest points of the cells of texels, and (n, 3) places in the cells."""
        position = (on.interpolated(rest, block) - low) / np.float32(side)
        cell = np.clip(position.astype(np.intp), 0, shape - 2)
        return cell @ stride, np.clip(position - cell, 0, 1).astype(np.float32)

    sums = np.zeros((1 + len(channels), int(shape.prod())))
    for number, block in enumerate(blocks):
        report(0.7 + 0.15 * number / len(blocks), LABEL)
        block = slice(block.start, block.stop, SAMPLE_STRIDE)
        first, place = cells(block)
        weight = area[texels.triangle[block]]
        for offset, share in _corner_shares(place, stride):
            point, share = first + offset, share * weight
            sums[0] += np.bincount(point, share, sums.shape[1])
            for values, out in zip(channels, sums[1:], strict=True):
                out += np.bincount(point, share * values[block], sums.shape[1])
    means = (sums[1:] / np.maximum(sums[0], np.finfo(float).tiny)).astype(np.float32)
    for number, block in enumerate(blocks):
        report(0.85 + 0.15 * number / len(blocks), LABEL)
        first, place = cells(block)
        for offset, share in _corner_shares(place, stride):
            for values, mean in zip(channels, means, strict=True):
                values[block] -= share * mean.take(first + offset)


def _corner_shares(place: np.ndarray, stride: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Iterate over the corners of a cell in the grid: their offsets, and (n,) weights of linear interpolation.

    `place` is (n, 3), from 0 to 1.
    """
    x, y, z = np.stack([1 - place, place]).transpose(2, 0, 1)
    return ((int(np.dot((i, j, k), stride)), x[i] * y[j] * z[k]) for i, j, k in np.ndindex(2, 2, 2))

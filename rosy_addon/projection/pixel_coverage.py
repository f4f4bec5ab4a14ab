"""How much of a pixel each surface covers, from several samples of the pixel.

The visible triangle is found at every sample, but normals and field values are computed once for a pixel,
at its center. Most samples show the same surface as the center. At silhouettes and creases, a sample may
show the surface of a neighboring pixel instead. An entry is the index of a pixel in the G-buffer.
"""

from typing import NamedTuple

import numpy as np

from .barycentrics import LABEL
from .camera import Camera, pixel_rays, z_at_depth
from .gbuffer import GBuffer, PixelCoverage, PixelSamples
from .pixel_blocks import part_of, pixel_blocks, reported_blocks
from .pixel_neighbors import PixelTable, depth_slopes
from .rasterized_samples import SampledTriangles

#: Smallest cosine between the normals of two triangles that show the same surface: 30 degrees.
MIN_NORMAL_COSINE = np.float32(np.sqrt(0.75))

#: Offsets (dx, dy) of the neighbors of a pixel, in the order in which they are tried. If two are equally near to
#: a sample, the first one is taken.
NEIGHBORS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))


class _OtherSamples(NamedTuple):
    """The E samples that show another triangle than the center of their pixel.

    Attributes
    ----------
    entry : (E,) int32 ndarray
        The pixel that contains the sample, as an index into the G-buffer.
    x, y : (E,) float32 ndarray
        Position in the frame, in pixels from the lower left.
    depth : (E,) float32 ndarray
        Depth of the visible triangle, linear on screen: z of camera space if orthographic, -1 / z if
        perspective.
    instance_id : (E,) int32 ndarray
        Mesh instance of the visible triangle.
    normal : (3, E) float32 ndarray
        Unit normals of the triangles in camera space, of either orientation.
    """

    entry: np.ndarray
    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    instance_id: np.ndarray
    normal: np.ndarray


class _Entries(NamedTuple):
    """The P pixels of a G-buffer, as arrays that are compared with `_OtherSamples`.

    `x` and `y` are the centers of the pixels, and `depth`, `instance_id` and `normal` describe the triangles
    visible there, as in `_OtherSamples`. `slope_x` and `slope_y` are the changes of the depth to the next
    column and row, on the tangent plane, and `tolerance` is the permitted deviation from this plane; see
    `pixel_neighbors.depth_slopes`.
    """

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    slope_x: np.ndarray
    slope_y: np.ndarray
    tolerance: np.ndarray
    instance_id: np.ndarray
    normal: np.ndarray

    def shows(self, entry: np.ndarray, sample: _OtherSamples) -> np.ndarray:
        """Return (n,) bool: whether each of n samples is on the surface that a pixel shows.

        `entry`, (n,), is the pixel to which each sample is compared, as an index into the G-buffer.
        """
        x, y = sample.x - self.x.take(entry), sample.y - self.y.take(entry)
        predicted = self.depth.take(entry)
        predicted += x * self.slope_x.take(entry) + y * self.slope_y.take(entry)
        is_near = np.abs(sample.depth - predicted) <= self.tolerance.take(entry)
        is_near &= sample.instance_id == self.instance_id.take(entry)
        cosine = (sample.normal * self.normal.take(entry, axis=1)).sum(axis=0)
        return is_near & (np.abs(cosine) >= MIN_NORMAL_COSINE)


def pixel_coverage(
    gbuffer: GBuffer, sampled: SampledTriangles, side: int, instance: np.ndarray, normal: np.ndarray
) -> tuple[PixelCoverage, PixelSamples]:
    """Find for each sample the pixel of the G-buffer whose surface it shows.

    Parameters
    ----------
    gbuffer : GBuffer
        The G-buffer at the centers of pixels.
    sampled : SampledTriangles
    side : int
        Samples along each side of a pixel.
    instance : (E,) int32 ndarray
        Mesh instance of each triangle in ``sampled.other_triangle``.
    normal : (3, E) float32 ndarray
        Unit normals of these triangles in camera space, of either orientation.
    """
    others = _other_samples(sampled, gbuffer.camera, side, instance, normal)
    count = len(gbuffer.pixel)
    table = PixelTable(gbuffer, 1)
    columns = *_centers(gbuffer.pixel, gbuffer.camera.width, 1), *depth_slopes(gbuffer, slice(None))
    entries = _Entries(*columns, gbuffer.instance_id, gbuffer.geometric_normal.T)
    entry = others.entry.copy()
    elsewhere = []
    for block in reported_blocks(len(entry), LABEL, 0.0, 0.7):
        shown = entries.shows(entry[block], part_of(others, (..., block)))
        elsewhere.append(block.start + np.flatnonzero(~shown))
    elsewhere = np.concatenate([np.empty(0, dtype=np.intp), *elsewhere])
    for block in reported_blocks(len(elsewhere), LABEL, 0.7, 1.0):
        part = elsewhere[block]
        sample, home = part_of(others, (..., part)), entry[part]
        nearest = np.full(len(part), np.inf, dtype=np.float32)
        for dx, dy in NEIGHBORS:
            neighbor = table.beside(home, dx, dy)
            exists = np.flatnonzero(neighbor >= 0)
            exists = exists[entries.shows(neighbor[exists], part_of(sample, (..., exists)))]
            candidate = neighbor[exists]
            x, y = entries.x[candidate] - sample.x[exists], entries.y[candidate] - sample.y[exists]
            distance = x * x + y * y
            closer = distance < nearest[exists]
            nearest[exists[closer]] = distance[closer]
            entry[part[exists[closer]]] = candidate[closer]
    is_own = entry == others.entry
    own = np.bincount(others.entry[is_own], minlength=count)
    for bit in range(side * side):
        own += sampled.own_samples >> np.uint16(bit) & np.uint16(1)
    moved = np.flatnonzero(~is_own)
    moved = moved[np.argsort(others.entry[moved], kind="stable")]
    share = np.float32(1 / side**2)
    own, home = own.astype(np.float32) * share, gbuffer.pixel[others.entry[moved]]
    other = sampled.other_sample, sampled.other_triangle, entry
    coverage = PixelCoverage(own, home, entry[moved], share)
    return coverage, PixelSamples(side, sampled.own_samples, *other)


def _other_samples(
    sampled: SampledTriangles, camera: Camera, side: int, instance: np.ndarray, normal: np.ndarray
) -> _OtherSamples:
    """Return the samples that show another triangle than the center of their pixel.

    `camera` is the camera of the G-buffer, and `side` the number of samples along each side of a pixel.
    `instance` and `normal` are the mesh instances and normals of ``sampled.other_triangle``.
    """
    frame = camera.scaled(side)
    count = len(sampled.other_entry)
    x, y, depth = np.empty((3, count), dtype=np.float32)
    for block in pixel_blocks(count):
        index = sampled.other_sample[block]
        x[block], y[block] = _centers(index, frame.width, side)
        z = z_at_depth(frame, *pixel_rays(frame, index), sampled.other_depth[block])
        depth[block] = -1 / z if camera.is_perspective else z
    return _OtherSamples(sampled.other_entry, x, y, depth, instance, normal)


def _centers(index: np.ndarray, width: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y of the centers of samples in pixels, (n,) float32 each, from their flat indices.

    `index` counts samples row by row in the frame of all samples, which is `width` samples wide. A pixel has
    `samples` of them along each side.
    """
    row, column = np.divmod(index, np.int32(width))
    scale = np.float32(1 / samples)
    half = np.float32(0.5)
    return (column + half) * scale, (row + half) * scale

"""The rasterizer at several samples of each pixel."""

from typing import NamedTuple

import numpy as np

from ..core.progress import progress
from .near_clipping import clip_near
from .rasterizer import MAX_BAND_PIXELS, Rows, rasterize_rows, to_screen


class SampledTriangles(NamedTuple):
    """The visible triangles at S x S samples of each of the P covered pixels, in ascending order of pixel.

    Each pixel has a main triangle. The E samples that show another triangle than the main triangle of
    their pixel are listed.

    Attributes
    ----------
    pixel : (P,) int32 ndarray
        Flat index, ``row * width + column`` from the lower left.
    triangle : (P,) int32 ndarray
        Main triangle: the triangle at the center of the pixel. If there is none, the triangle at the
        sample that is nearest to the center.
    depth : (P,) float64 ndarray
        Depth z / w of the main triangle, at the center or sample where it was found.
    own_samples : (P,) uint16 ndarray
        Bit field of the samples that show the main triangle: bit ``row * S + column``.
    other_entry : (E,) int32 ndarray
        The pixel that contains each of the E samples, as an index into `pixel`.
    other_sample : (E,) int32 ndarray
        Flat index of each of these samples in the frame of all samples.
    other_triangle : (E,) int32 ndarray
        Triangle that each of these samples shows.
    other_depth : (E,) float64 ndarray
        Depth z / w of this triangle at the sample.
    """

    pixel: np.ndarray
    triangle: np.ndarray
    depth: np.ndarray
    own_samples: np.ndarray
    other_entry: np.ndarray
    other_sample: np.ndarray
    other_triangle: np.ndarray
    other_depth: np.ndarray


def rasterize_samples(
    clip_vertices: np.ndarray,
    triangles: np.ndarray,
    is_drawn: np.ndarray,
    width: int,
    height: int,
    samples: int,
    rows: Rows = None,
) -> SampledTriangles:
    """Find the nearest triangle at several samples of each pixel, on a square grid.

    Parameters
    ----------
    clip_vertices : (V, 4) float64 ndarray
        Vertices in clip space, in OpenGL's convention.
    triangles : (T, 3) ndarray of int
        Vertex indices.
    is_drawn : (T,) bool ndarray
        Whether each triangle is drawn. Triangles that are not drawn only hide others.
    width, height : int
        Size of the frame in pixels.
    samples : int
        S, the samples along each side of a pixel.
    rows : (int, int) or None
        First row of pixels to draw, and the row after the last one. None for all rows.
    """
    first_row, stop_row = (0, height) if rows is None else rows
    vertices, clipped = clip_near(clip_vertices, triangles)
    screens = [
        (scale, to_screen(vertices, width * scale, height * scale)) for scale in (1, samples)
    ]
    bands, entry_count = [], 0
    band_rows = max(1, MAX_BAND_PIXELS // (width * samples * samples))
    for row_start in range(first_row, stop_row, band_rows):
        row_stop = min(row_start + band_rows, stop_row)
        buffers = []
        for index, (scale, screen) in enumerate(screens):
            half = (row_stop - row_start) / (2 * height)
            start = row_start / height + index * half
            with progress(start, start + half):
                scaled = width * scale, row_start * scale, row_stop * scale
                triangle, depth = rasterize_rows(screen, clipped, *scaled)
            if not is_drawn.all():
                triangle[~is_drawn.take(triangle, mode="clip")] = -1
            shape = -1, scale, width, scale
            buffers.append((triangle.reshape(shape), depth.reshape(shape)))
        band = _group_samples(*buffers, row_start)
        bands.append(band._replace(other_entry=band.other_entry + np.int32(entry_count)))
        entry_count += len(band.pixel)
    return SampledTriangles(*(np.concatenate(values) for values in zip(*bands, strict=True)))


def _group_samples(
    centers: tuple[np.ndarray, ...], buffers: tuple[np.ndarray, ...], first_row: int
) -> SampledTriangles:
    """Group the samples of h rows of pixels, w pixels wide, by pixels.

    Parameters
    ----------
    centers : (h, 1, w, 1) int32 and float64 ndarrays
        Triangle at the center of each pixel, -1 where there is none, and its depth z / w.
    buffers : (h, S, w, S) int32 and float64 ndarrays
        Triangle at each sample, -1 where there is none, and its depth z / w.
    first_row : int
        The first of the h rows, as a row of the frame.
    """
    triangle, depth = buffers
    samples, width = triangle.shape[1:3]
    offset = np.arange(samples) - (samples - 1) / 2
    order = np.argsort((offset[:, None] ** 2 + offset**2).ravel(), kind="stable").tolist()
    sample_places = [divmod(sample, samples) for sample in order]
    own_triangle, own_depth = (values[:, 0, :, 0].copy() for values in centers)
    for row, column in sample_places:
        empty = np.nonzero(own_triangle < 0)
        own_triangle[empty] = triangle[:, row, :, column][empty]
        own_depth[empty] = depth[:, row, :, column][empty]
    pixel = np.flatnonzero(own_triangle >= 0)
    own_triangle, own_depth = own_triangle.ravel()[pixel], own_depth.ravel()[pixel]
    own_samples = np.zeros(len(pixel), dtype=np.uint16)
    others = []
    pixel_row, pixel_column = np.divmod(pixel.astype(np.int32), np.int32(width))
    pixel_row += np.int32(first_row)
    for row, column in sample_places:
        sample_triangle = triangle[:, row, :, column].ravel()[pixel]
        is_own = sample_triangle == own_triangle
        own_samples |= is_own.astype(np.uint16) << np.uint16(row * samples + column)
        entry = np.flatnonzero((sample_triangle >= 0) & ~is_own)
        sample = pixel_row[entry] * np.int32(samples) + np.int32(row)
        sample *= np.int32(width * samples)
        sample += pixel_column[entry] * np.int32(samples) + np.int32(column)
        sample_depth = depth[:, row, :, column].ravel()[pixel[entry]]
        others.append((entry.astype(np.int32), sample, sample_triangle[entry], sample_depth))
    own = pixel_row * np.int32(width) + pixel_column, own_triangle, own_depth, own_samples
    other = (np.concatenate(values) for values in zip(*others, strict=True))
    return SampledTriangles(*own, *other)

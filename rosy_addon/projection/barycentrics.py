"""Perspective-correct barycentric coordinates of pixel centers."""

import numpy as np

from .pixel_blocks import reported_blocks

#: Largest sum of nonnegative barycentric coordinates that rounding explains. If the sum is larger, some
#: coordinates were negative and set to 0, so the pixel center is outside of the triangle.
MAX_WEIGHT_SUM = 1 + 1e-4

#: Text that the user sees while this step runs.
LABEL = "finding visible pixels"


def barycentrics(
    vertices: np.ndarray,
    triangles: np.ndarray,
    pixel: np.ndarray,
    triangle: np.ndarray,
    width: int,
    height: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute perspective-correct barycentric coordinates at pixel centers, in unclipped triangles.

    Uses homogeneous edge functions (Olano and Greer, "Triangle Scan Conversion using 2D Homogeneous
    Coordinates", 1997), which are also valid for triangles that extend behind the eye. They are
    evaluated relative to the pixel center, so that small triangles lose no precision.

    Parameters
    ----------
    vertices : (V, 4) float64 ndarray
        Clip space.
    triangles : (T, 3) ndarray of int
        Indices into `vertices`.
    pixel : (P,) int32 ndarray
        Flat indices into the frame.
    triangle : (P,) ndarray of int
        For each pixel, the index of the triangle whose coordinates are computed.
    width, height : int
        Size of the frame in pixels.

    Returns
    -------
    weights : (P, 3) float32 ndarray
        Barycentric coordinates, not negative, with sum 1. If the pixel center is outside of the triangle,
        negative coordinates are set to 0, and the others are scaled to the sum 1. The coordinates are
        1 / 3 each for triangles that have no area on screen.
    front_facing : (P,) bool ndarray
        Whether the corners run counter-clockwise on screen.
    """
    w = vertices[:, 3]
    x, y, w = (vertices[:, 0] + w) * (0.5 * width), (vertices[:, 1] + w) * (0.5 * height), w.copy()
    corners = np.ascontiguousarray(triangles.T)
    weights = np.empty((3, len(pixel)), dtype=np.float32)
    front_facing = np.empty(len(pixel), dtype=bool)
    for block in reported_blocks(len(pixel), LABEL):
        row, column = np.divmod(pixel[block], np.int32(width))
        column, row = column + 0.5, row + 0.5
        offsets = []
        for corner in corners:
            vertex = corner.take(triangle[block]).astype(np.intp)
            depth = w.take(vertex)
            offsets.append((x.take(vertex) - column * depth, y.take(vertex) - row * depth))
        (ax, ay), (bx, by), (cx, cy) = offsets
        area_a, area_b, area_c = bx * cy - cx * by, cx * ay - ax * cy, ax * by - bx * ay
        total = area_a + area_b
        total += area_c
        np.greater_equal(total, 0, out=front_facing[block])
        with np.errstate(divide="ignore"):
            np.divide(1, total, out=total)
        # Triangles without area on screen get weights of 1 / 3 below.
        degenerate = np.isinf(total)
        total[degenerate] = 0
        for area, out in zip((area_a, area_b, area_c), weights[:, block], strict=True):
            area *= total
            np.maximum(area, 0, out=area)
            out[:] = area
        found = weights[:, block]
        # Pixels with several samples may see a triangle beside their centers.
        outside = np.flatnonzero(found.sum(axis=0) > MAX_WEIGHT_SUM)
        found[:, outside] /= found[:, outside].sum(axis=0)
        found[:, degenerate] = 1 / 3
    return weights.T, front_facing

"""Measure outlines: the lengths of their marks, and the share of silhouettes that they cover."""

from typing import Any

import numpy as np
from scipy import ndimage

from rosy_addon.line_drawing.visibility import project_to_pixels, rasterize_depth

#: Coverage from which on a pixel belongs to a mark, or a silhouette is covered.
MARK_COVERAGE, LINE_COVERAGE = 0.25, 0.3

#: Largest distance in pixels from a silhouette to a line that covers it.
LINE_DISTANCE = 1.5

#: Least jump of the depth behind a visible silhouette, and its least length, in pixels.
MIN_JUMP, MIN_LENGTH = 6.0, 10

#: Pixels of the depth buffer of the reference along the side of a pixel.
FINE = 4


def to_image(gbuffer: Any, values: np.ndarray) -> np.ndarray:
    """Return values at the pixels of a G-buffer as a picture, with rows from the bottom."""
    camera = gbuffer.camera
    image = np.zeros(camera.width * camera.height, dtype=values.dtype)
    image[gbuffer.pixel] = values
    return image.reshape(camera.height, camera.width)


def mark_lengths(coverage: np.ndarray) -> np.ndarray:
    """Return the longer sides of the bounding boxes of the connected marks of a picture."""
    labels, _ = ndimage.label(coverage > MARK_COVERAGE, np.ones((3, 3)))
    boxes = ndimage.find_objects(labels)
    return np.array([max(side.stop - side.start for side in box) for box in boxes], dtype=int)


def visible_silhouettes(instance: Any, camera: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return points on the visible silhouettes and borders of a mesh, by brute force.

    They are on all edges between front and back faces. A point is visible if the depth buffer of a
    finer picture has its depth nearby, and a depth that is greater by a jump next to it.

    Parameters
    ----------
    instance : MeshInstance
        The only one in the scene.
    camera : Camera

    Returns
    -------
    points : (n, 2) float64 ndarray
        Pixels.
    lengths : (n,) float64 ndarray
        The length in pixels that each point stands for.
    """
    points, triangles = instance.world_points(), instance.surface.triangle_vertex
    screen, depth = project_to_pixels(points, camera)
    ends = _contour_edges(screen, triangles)
    fine_depth = rasterize_depth([instance], camera.scaled(FINE)).depth
    p, q = screen[ends[:, 0]], screen[ends[:, 1]]
    length = np.hypot(*(q - p).T)
    count = np.maximum(np.ceil(length * FINE).astype(int), 1)
    edge = np.repeat(np.arange(len(count)), count)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
    place = p[edge] + (q - p)[edge] * share[:, None]
    near, far = depth[ends[edge, 0]], depth[ends[edge, 1]]
    z = near + share * (far - near)
    if camera.is_perspective:
        z = 1 / ((1 - share) / near + share / far)
    column, row = (place * FINE).astype(int).T
    height, width = fine_depth.shape
    inside = (column > 2) & (row > 2) & (column < width - 3) & (row < height - 3)
    place, z, column, row = place[inside], z[inside], column[inside], row[inside]
    weight = (length / count)[edge][inside]
    pixel_size = camera.pixel_sizes(z)
    around = [fine_depth[row + dy, column + dx] for dy in range(-2, 3) for dx in range(-2, 3)]
    is_near = np.abs(np.stack(around) - z).min(axis=0) < 15 * pixel_size
    is_visible = is_near & (np.max(around, axis=0) > z + MIN_JUMP * pixel_size)
    place, weight = place[is_visible], weight[is_visible]
    picture = np.zeros((camera.height, camera.width), dtype=bool)
    column, row = place.astype(int).T
    picture[row, column] = True
    labels, _ = ndimage.label(picture, np.ones((3, 3)))
    is_long = mark_lengths(picture)[labels[row, column] - 1] >= MIN_LENGTH
    return place[is_long], weight[is_long]


def _contour_edges(screen: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the vertices of edges between front and back faces, and of borders."""
    a, b, c = (screen[triangles[:, corner]] for corner in range(3))
    u, v = b - a, c - a
    is_front = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    ends, edge, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    front_count = np.bincount(edge, np.repeat(is_front, 3))
    return ends[(count != 2) | (front_count == 1)]


def covered_share(coverage: np.ndarray, points: np.ndarray, lengths: np.ndarray) -> float:
    """Return the share of silhouettes, from `visible_silhouettes`, next to lines of a picture."""
    distance = ndimage.distance_transform_edt(coverage <= LINE_COVERAGE)
    column, row = points.astype(int).T
    return float(lengths[distance[row, column] <= LINE_DISTANCE].sum() / lengths.sum())

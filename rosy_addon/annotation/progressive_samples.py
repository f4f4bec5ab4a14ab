"""Points spread evenly over surfaces, as many as a view needs, which stay where they are.

Each triangle has a low-discrepancy sequence of points i = 0, 1, 2, ...: any number of first points is evenly
spread over the triangle. Point i of a triangle of area A has the rank (i + u) / A, where u is a random number
of the triangle. All points up to a rank r are an even sample of the whole mesh, with r points per unit of
area. A view takes the points up to a rank that depends on how large the surface appears on screen. So a
moving camera adds and drops points of high rank, and all others stay.

The sequence is the van der Corput sequence of a triangle. A triangle is divided into four sub-triangles at
the middles of its edges. The lowest digit of i in base 4 chooses one of them, the next digit chooses one of
the four sub-triangles of that sub-triangle, and so on; see Kinjal Basu and Art B. Owen, "Low discrepancy
constructions in the triangle", 2015. Each triangle of the mesh shuffles the sub-triangles in its own way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..field.blocks import numbered_ranges
from ..field.copied_faces import SPLIT_MIX_GAMMA, split_mix
from ..field.surface import Surface
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.pixel_blocks import part_of
from ..projection.project import all_triangles
from ..projection.rest_coordinates import matrix_scale

#: Number of points per square on screen whose side is the given spacing.
POINTS_PER_SPACING = 8

#: Number of base 4 digits of an index that determine its point, and largest number of times that a triangle
#: is divided because it is only partly in the frame, or its scale on screen varies.
DIGITS, MAX_DIVISIONS = 15, 12

#: A triangle is divided if the ratio of the largest and the smallest depth of its corners exceeds the first
#: number, or if it is only partly in the frame and its area, in squares of the spacing, exceeds the second.
MAX_DEPTH_RATIO, MAX_CUT_AREA = 1.4, 16.0

#: Number of triangles whose sizes on screen are computed at a time.
TRIANGLES_PER_BLOCK = 1 << 16

#: Corners of the four sub-triangles of a triangle, in its barycentric coordinates: first of the sub-triangle
#: in the middle, then of the sub-triangles at the three corners.
PARTS = 0.5 * np.array(
    [
        [[0, 1, 1], [1, 0, 1], [1, 1, 0]],
        [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
        [[1, 1, 0], [0, 2, 0], [0, 1, 1]],
        [[1, 0, 1], [0, 1, 1], [0, 0, 2]],
    ]
)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """n sub-triangles of equal depth, each with the points of its triangle's sequence that lie in it.

    The indices of these points share their lowest `depth` digits in base 4.

    Attributes
    ----------
    triangle : (n,) intp ndarray
        Triangle of the mesh that contains each sub-triangle.
    corners : (n, 3, 3) float64 ndarray
        Corners of each sub-triangle, in barycentric coordinates of the triangle.
    first : (n,) int64 ndarray
        Index of the first point in each sub-triangle. The indices of the others follow in steps of
        4 ** `depth`.
    depth : int
        How often the triangles were divided.
    """

    triangle: np.ndarray
    corners: np.ndarray
    first: np.ndarray
    depth: int

    def divided(self, shuffle: np.ndarray) -> _Pieces:
        """Divide each sub-triangle into four, and return them.

        `shuffle` holds the (T,) uint64 random bits of all triangles of the mesh.
        """
        corners = np.einsum("pij,njk->npik", PARTS, self.corners).reshape(-1, 3, 3)
        part = np.tile(np.arange(4), len(self.triangle))
        triangle = np.repeat(self.triangle, 4)
        digit = part ^ _shuffle_bits(shuffle[triangle], self.depth)
        first = np.repeat(self.first, 4) + (digit << (2 * self.depth))
        return _Pieces(triangle, corners, first, self.depth + 1)


def progressive_samples(
    instance: MeshInstance, camera: Camera, spacing: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sample the part of a surface that is in the frame of a camera, visible or not.

    Parameters
    ----------
    instance : MeshInstance
    camera : Camera
    spacing : float
        Pixels. On screen, a square with this side contains about `POINTS_PER_SPACING` points.

    Returns
    -------
    triangle : (P,) int32 ndarray
        Triangle of each point.
    barycentric : (P, 3) float64 ndarray
        Barycentric coordinates of each point in its triangle.
    rank : (P,) float64 ndarray
        Rank of each point, in points per square Blender unit. Areas are measured on the rest shape and
        scaled by the square of `matrix_scale`. All points up to a rank are an even sample of the surface.
    """
    clip, triangles = all_triangles([instance], camera)
    shuffle = _random_bits(len(triangles))
    offset = _random_offsets(shuffle)
    numbers, of_pieces = [np.empty(0, np.int64)], [np.empty(0, np.intp)]
    start = _with_points(clip, triangles, camera, spacing, offset)
    area = np.zeros(len(triangles))
    area[start] = rest_areas(instance.surface, start) * matrix_scale(instance.matrix) ** 2
    start = start[area[start] > 0]
    corners = np.broadcast_to(np.eye(3), (len(start), 3, 3))
    todo = _Pieces(start, corners, np.zeros(len(start), dtype=np.int64), 0)
    while len(todo.triangle):
        corners = clip[triangles[todo.triangle]]
        if todo.depth:
            corners = np.einsum("nij,njk->nik", todo.corners, corners)
        in_frame = _touches_frame(corners)
        todo, corners = part_of(todo, in_frame), corners[in_frame]
        screen_area, is_divided = _screen_areas(corners, camera, spacing)
        is_divided &= todo.depth < MAX_DIVISIONS
        whole = part_of(todo, ~is_divided)
        # The number of points of the triangle, if all of it had the scale of this sub-triangle on screen.
        total = POINTS_PER_SPACING * screen_area[~is_divided] * 4.0**whole.depth / spacing**2
        step = 4**whole.depth
        count = np.ceil((total - offset[whole.triangle] - whole.first) / step)
        count = np.clip(count, 0, (4**DIGITS - 1 - whole.first) // step).astype(np.int64)
        chosen, rank_in_piece = numbered_ranges(np.zeros_like(count), count)
        numbers.append(whole.first[chosen] + rank_in_piece * step)
        of_pieces.append(whole.triangle[chosen])
        todo = part_of(todo, is_divided).divided(shuffle)
    return _points(np.concatenate(numbers), np.concatenate(of_pieces), shuffle, area)


def _with_points(
    clip: np.ndarray, triangles: np.ndarray, camera: Camera, spacing: float, offset: np.ndarray
) -> np.ndarray:
    """Return the (n,) intp indices of the triangles in which there may be points for this view.

    Parameters
    ----------
    clip : (V, 4) float64 ndarray
        Vertices in clip space.
    triangles : (T, 3) int ndarray
        Vertices of the triangles.
    camera : Camera
    spacing : float
        Side, in pixels, of a square on screen that contains about `POINTS_PER_SPACING` points.
    offset : (T,) float64 ndarray
        The random number u of each triangle, 0 to 1; its point i has the rank (i + u) / area.
    """
    w = np.where(clip[:, 3] > 0, clip[:, 3], np.nan)
    x, y = clip[:, 0] / w, clip[:, 1] / w
    points_per_area = POINTS_PER_SPACING * camera.width * camera.height / (8 * spacing**2)
    chosen = []
    for start in range(0, len(triangles), TRIANGLES_PER_BLOCK):
        a, b, c = triangles[start : start + TRIANGLES_PER_BLOCK].T
        left, bottom = x[a], y[a]
        area = (x[b] - left) * (y[c] - bottom) - (x[c] - left) * (y[b] - bottom)
        # The areas of triangles that reach behind the eye are NaN.
        is_empty = np.abs(area) * points_per_area <= offset[start : start + TRIANGLES_PER_BLOCK]
        chosen.append(start + np.flatnonzero(~is_empty))
    return np.concatenate(chosen)


def _touches_frame(corners: np.ndarray) -> np.ndarray:
    """Return (n,) bool: whether triangles with (n, 3, 4) corners in clip space may be in the frame."""
    w = corners[..., 3:]
    is_beyond = np.concatenate([corners[..., :3] > w, corners[..., :3] < -w], axis=2)
    return ~is_beyond.all(axis=1).any(axis=1)


def _screen_areas(
    corners: np.ndarray, camera: Camera, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the areas of triangles on screen, and whether they have to be divided.

    Parameters
    ----------
    corners : (n, 3, 4) float64 ndarray
        Corners in clip space.
    camera : Camera
    spacing : float
        Side, in pixels, of a square on screen that contains about `POINTS_PER_SPACING` points.

    Returns
    -------
    area : (n,) float64 ndarray
        Areas in square pixels; 0 if the triangle reaches behind the eye.
    is_divided : (n,) bool ndarray
        Whether each triangle has to be divided, because its scale on screen varies too much, or it is only
        partly in the frame.
    """
    w = corners[..., 3]
    nearest, farthest = w.min(axis=1), w.max(axis=1)
    is_in_front = nearest > 0
    ndc = corners[..., :2] / np.where(is_in_front[:, None], w, 1.0)[..., None]
    (ax, ay), (bx, by) = (np.moveaxis(ndc[:, k] - ndc[:, 0], 1, 0) for k in (1, 2))
    area = np.abs(ax * by - ay * bx) * (camera.width * camera.height / 8)
    area[~is_in_front] = 0.0
    is_cut = (np.abs(ndc) > 1).any(axis=(1, 2)) & (area > MAX_CUT_AREA * spacing**2)
    is_divided = is_cut | (farthest > MAX_DEPTH_RATIO * nearest)
    return area, ~is_in_front | (is_divided & (area > spacing**2 / POINTS_PER_SPACING))


def rest_areas(surface: Surface, triangle: np.ndarray | None = None) -> np.ndarray:
    """Return the (n,) areas of triangles in the rest shape, in object space.

    `triangle` holds the indices of the triangles; by default, they are all triangles of the surface.
    """
    vertices = surface.in_rest_shape().vertices
    corners = surface.triangle_vertex if triangle is None else surface.triangle_vertex[triangle]
    a, b, c = (np.ascontiguousarray(vertices[corner].T) for corner in corners.T)
    (x, y, z), (u, v, w) = b - a, c - a
    normal = y * w - z * v, z * u - x * w, x * v - y * u
    return 0.5 * np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)


def surface_samples(surface: Surface, density: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sample the whole rest shape of a surface evenly.

    Parameters
    ----------
    surface : Surface
    density : float
        Points per square unit of object space.

    Returns
    -------
    triangle : (P,) int32 ndarray
        Triangle of each point.
    barycentric : (P, 3) float64 ndarray
        Barycentric coordinates of each point in its triangle.
    rank : (P,) float64 ndarray
        Rank of each point, in points per square unit of object space, at most `density`. All points up to a
        rank are an even sample of the surface.
    """
    area = rest_areas(surface)
    shuffle = _random_bits(len(area))
    count = np.maximum(np.ceil(area * density - _random_offsets(shuffle)), 0).astype(np.int64)
    triangle, number = numbered_ranges(np.zeros_like(count), count)
    return _points(number, triangle, shuffle, area)


def _points(
    number: np.ndarray, triangle: np.ndarray, shuffle: np.ndarray, area: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the triangles, barycentric coordinates and ranks of points, as `progressive_samples` does.

    `triangle` holds the (P,) triangles of the points, and `number` their (P,) indices in the sequences of
    these triangles. `shuffle` and `area` are the random bits and areas of all triangles.
    """
    shuffle, area = shuffle[triangle], area[triangle]
    rank = (number + _random_offsets(shuffle)) / area
    return triangle.astype(np.int32), _barycentric(number, shuffle), rank


def _random_offsets(shuffle: np.ndarray) -> np.ndarray:
    """Return the random number u of triangles, (n,) float64 from 0 to 1: the upper half of their bits."""
    return (shuffle >> np.uint64(32)).astype(np.float64) / 2.0**32


def _random_bits(count: int) -> np.ndarray:
    """Return (count,) uint64 pseudorandom numbers: the sequence of SplitMix64 from the seed 0."""
    return split_mix(np.arange(count, dtype=np.uint64) * SPLIT_MIX_GAMMA)


def _shuffle_bits(shuffle: np.ndarray, depth: int) -> np.ndarray:
    """Return (n,) int64 numbers from 0 to 3, with which triangles shuffle sub-triangles of one depth.

    `shuffle`, (n,), holds the random bits of the triangles. A digit of an index, XOR the result, is the
    number of the sub-triangle in `PARTS`.
    """
    return (shuffle >> np.uint64(2 * depth) & np.uint64(3)).astype(np.int64)


def _barycentric(index: np.ndarray, shuffle: np.ndarray) -> np.ndarray:
    """Return the (n, 3) barycentric coordinates of points, given their (n,) indices in the sequences.

    `shuffle` holds the random bits of the (n,) triangles that contain the points.
    """
    result = np.full((len(index), 3), 1 / 3)
    for depth in reversed(range(DIGITS)):
        part = index >> (2 * depth) & 3 ^ _shuffle_bits(shuffle, depth)
        result *= 0.5
        middle = part == 0
        result[middle] = 0.5 - result[middle]
        corner = np.flatnonzero(~middle)
        result[corner, part[corner] - 1] += 0.5
    return result

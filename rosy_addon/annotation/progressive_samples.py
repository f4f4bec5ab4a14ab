"""Points spread evenly over surfaces, as many as a view needs, which stay where they are.

Triangle t with the area A has the points i = 0, 1, 2, ... of a sequence that fills it evenly from its first
point on. A point has the rank (i + u) / A, where u is a random number of the triangle: all points up to a
rank r are an even sample of the whole mesh, with the density r. A view takes them up to a rank that depends on
how large a part of the surface is on screen. So a moving camera adds and drops points of high rank, and
all others stay.

The sequence is the van der Corput sequence of triangles: the digits of i to the base 4 choose one of the four
parts of a triangle, then one of the four parts of that part, and so on; see Kinjal Basu and Art B. Owen, "Low
discrepancy constructions in the triangle", 2015. Each triangle shuffles the parts in its own way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..field.blocks import concatenated_ranges
from ..field.surface import Surface
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.project import all_triangles

#: Points in the area of a square whose side is the spacing.
POINTS_PER_SPACING = 8

#: Digits to the base 4 that place a point, and divisions of a triangle that is seen in part or in perspective.
DIGITS, MAX_DIVISIONS = 15, 12

#: Largest ratio of the depths of the corners of a triangle that is not divided, and its largest area if it
#: is only partly in the frame, in squares of the spacing.
MAX_DEPTH_RATIO, MAX_CUT_AREA = 1.4, 16.0

#: Triangles whose sizes on screen are computed at a time.
TRIANGLES_PER_BLOCK = 1 << 16

#: The corners of the parts of a triangle, in its barycentric coordinates: the middle, then those at its corners.
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
    """n parts of triangles, each with the points of its sequence whose first digits are the same.

    Attributes
    ----------
    triangle : (n,) intp ndarray
    corners : (n, 3, 3) float64 ndarray
        Barycentric coordinates of the corners of each part.
    first : (n,) int64 ndarray
        The first of its points. The others follow in steps of 4 ** `depth`.
    depth : int
        How often the triangle was divided.
    """

    triangle: np.ndarray
    corners: np.ndarray
    first: np.ndarray
    depth: int

    def part(self, chosen: np.ndarray) -> _Pieces:
        """Return those that a mask chooses."""
        return _Pieces(self.triangle[chosen], self.corners[chosen], self.first[chosen], self.depth)

    def divided(self, shuffle: np.ndarray) -> _Pieces:
        """Return the four parts of each piece, given the (T,) uint64 random bits of triangles."""
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
        There are `POINTS_PER_SPACING` points in a square of this side, pixels.

    Returns
    -------
    triangle : (P,) int32 ndarray
    barycentric : (P, 3) float64 ndarray
    rank : (P,) float64 ndarray
        The points up to a rank are an even sample of the surface. In points per square unit.
    """
    clip, triangles = all_triangles([instance], camera)
    shuffle = _random_bits(len(triangles))
    offset = _random_offsets(shuffle)
    numbers, of_pieces = [np.empty(0, np.int64)], [np.empty(0, np.intp)]
    start = _with_points(clip, triangles, camera, spacing, offset)
    area = np.zeros(len(triangles))
    area[start] = rest_areas(instance.surface, start) * matrix_scale(instance) ** 2
    start = start[area[start] > 0]
    todo = _Pieces(
        start,
        np.broadcast_to(np.eye(3), (len(start), 3, 3)),
        np.zeros(len(start), dtype=np.int64),
        0,
    )
    while len(todo.triangle):
        corners = clip[triangles[todo.triangle]]
        if todo.depth:
            corners = np.einsum("nij,njk->nik", todo.corners, corners)
        in_frame = _touches_frame(corners)
        todo, corners = todo.part(in_frame), corners[in_frame]
        screen_area, is_divided = _screen_areas(corners, camera, spacing)
        is_divided &= todo.depth < MAX_DIVISIONS
        whole = todo.part(~is_divided)
        # The points of the triangle, if all of it had the scale of this part.
        total = POINTS_PER_SPACING * screen_area[~is_divided] * 4.0**whole.depth / spacing**2
        step = 4**whole.depth
        count = np.ceil((total - offset[whole.triangle] - whole.first) / step)
        count = np.clip(count, 0, (4**DIGITS - 1 - whole.first) // step).astype(np.int64)
        chosen = np.repeat(np.arange(len(count)), count)
        rank_in_piece = concatenated_ranges(np.zeros(len(count), dtype=np.intp), count)
        numbers.append(whole.first[chosen] + rank_in_piece * step)
        of_pieces.append(whole.triangle[chosen])
        todo = todo.part(is_divided).divided(shuffle)
    return _points(np.concatenate(numbers), np.concatenate(of_pieces), shuffle, area)


def _with_points(
    clip: np.ndarray,
    triangles: np.ndarray,
    camera: Camera,
    spacing: float,
    offset: np.ndarray,
) -> np.ndarray:
    """Return the triangles that may have points: (n,) intp.

    Parameters
    ----------
    clip : (V, 4) float64 ndarray
        Vertices in clip space.
    triangles : (T, 3) int ndarray
    camera : Camera
    spacing : float
        Pixels.
    offset : (T,) float64 ndarray
        u of each triangle.
    """
    w = np.where(clip[:, 3] > 0, clip[:, 3], np.nan)
    x, y = clip[:, 0] / w, clip[:, 1] / w
    points_per_area = POINTS_PER_SPACING * camera.width * camera.height / (8 * spacing**2)
    chosen = []
    for start in range(0, len(triangles), TRIANGLES_PER_BLOCK):
        a, b, c = triangles[start : start + TRIANGLES_PER_BLOCK].T
        left, bottom = x[a], y[a]
        area = (x[b] - left) * (y[c] - bottom) - (x[c] - left) * (y[b] - bottom)
        # Those that reach behind the eye are not numbers.
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
        Clip space.
    camera : Camera
    spacing : float
        Pixels.

    Returns
    -------
    area : (n,) float64 ndarray
        Square pixels; 0 if the triangle reaches behind the eye.
    is_divided : (n,) bool ndarray
    """
    w = corners[..., 3]
    nearest, farthest = w.min(axis=1), w.max(axis=1)
    is_in_front = nearest > 0
    ndc = corners[..., :2] / np.where(is_in_front[:, None], w, 1.0)[..., None]
    (ax, ay), (bx, by) = (np.moveaxis(ndc[:, k] - ndc[:, 0], 1, 0) for k in (1, 2))
    area = np.abs(ax * by - ay * bx) * (camera.width * camera.height / 8)
    area[~is_in_front] = 0.0
    is_cut = (np.abs(ndc) > 1).any(axis=(1, 2))
    is_large = area > spacing**2 / POINTS_PER_SPACING
    return area, ~is_in_front | (
        is_large
        & ((farthest > MAX_DEPTH_RATIO * nearest) | (is_cut & (area > MAX_CUT_AREA * spacing**2)))
    )


def matrix_scale(instance: MeshInstance) -> float:
    """Return the factor by which the matrix of an instance scales lengths, as a mean of all directions."""
    a, b, c = np.asarray(instance.matrix, dtype=np.float64)[:3, :3]
    return float(np.abs((np.cross(a, b) * c).sum()) ** (1 / 3))


def rest_areas(surface: Surface, triangle: np.ndarray | None = None) -> np.ndarray:
    """Return the (n,) areas of triangles, by default of all, before they deform."""
    vertices = surface.in_rest_shape().vertices
    corners = surface.triangle_vertex if triangle is None else surface.triangle_vertex[triangle]
    a, b, c = (np.ascontiguousarray(vertices[corner].T) for corner in corners.T)
    (x, y, z), (u, v, w) = b - a, c - a
    normal = y * w - z * v, z * u - x * w, x * v - y * u
    return 0.5 * np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)


def surface_samples(surface: Surface, density: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sample all of a surface in its rest shape, evenly.

    Parameters
    ----------
    surface : Surface
    density : float
        Points per square unit.

    Returns
    -------
    triangle : (P,) int32 ndarray
    barycentric : (P, 3) float64 ndarray
    rank : (P,) float64 ndarray
        See `progressive_samples`; at most the density.
    """
    area = rest_areas(surface)
    shuffle = _random_bits(len(area))
    count = np.maximum(np.ceil(area * density - _random_offsets(shuffle)), 0).astype(np.int64)
    triangle = np.repeat(np.arange(len(area)), count)
    number = concatenated_ranges(np.zeros(len(area), dtype=np.intp), count)
    return _points(number, triangle, shuffle, area)


def _points(
    number: np.ndarray, triangle: np.ndarray, shuffle: np.ndarray, area: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points, given their (P,) numbers in the sequences of triangles; see `progressive_samples`.

    `shuffle` and `area` are the random bits and the areas of all triangles.
    """
    shuffle, area = shuffle[triangle], area[triangle]
    rank = (number + _random_offsets(shuffle)) / area
    return triangle.astype(np.int32), _barycentric(number, shuffle), rank


def _random_offsets(shuffle: np.ndarray) -> np.ndarray:
    """Return u of triangles, (n,) float64 from 0 to 1: the upper half of their random bits."""
    return (shuffle >> np.uint64(32)).astype(np.float64) / 2.0**32


def _random_bits(count: int) -> np.ndarray:
    """Return (count,) uint64 hashes of the numbers from 0 on (SplitMix64)."""
    bits = np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        bits ^= bits >> np.uint64(shift)
        bits *= np.uint64(factor)
    return bits ^ (bits >> np.uint64(31))


def _shuffle_bits(shuffle: np.ndarray, depth: int) -> np.ndarray:
    """Return the (n,) int64 numbers, 0 to 3, by which triangles shuffle their parts after `depth` divisions."""
    return (shuffle >> np.uint64(2 * depth) & np.uint64(3)).astype(np.int64)


def _barycentric(index: np.ndarray, shuffle: np.ndarray) -> np.ndarray:
    """Return the (n, 3) barycentric coordinates of points, given their indices in the sequences of
    triangles and the random bits of these triangles.
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

"""Which points of surfaces a camera sees, by testing the rays from the points to the eye exactly.

No depth buffer is used. A triangle hides a point if it is nearer to the eye and covers the projection of
the point. Barycentric coordinates come from homogeneous clip coordinates, so triangles that reach behind
the eye need no clipping; see Marc Olano and Trey Greer, "Triangle Scan Conversion Using 2D Homogeneous
Coordinates", 1997.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..core.progress import report
from ..field.blocks import blocks_of_ranges, mask, numbered_ranges
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import transformed
from .camera import Camera
from .gbuffer import MeshInstances, SurfacePoints
from .pixel_blocks import reported_blocks
from .project import all_triangles, first_triangles

#: Surfaces that are nearer to a point than this fraction of the size of the scene do not hide it.
SAME_POINT = 1e-6

#: Number of triangles, and of pairs of a triangle and a point, that are tested at a time.
TRIANGLES_PER_BLOCK, PAIRS_PER_BLOCK = 1 << 15, 1 << 20

#: Texts that the user sees while vertices, or points in triangles, are tested.
LABEL, POINTS_LABEL = "finding visible singularities", "finding places of arrowheads"


class ProjectedPoints(NamedTuple):
    """K points in a picture.

    Attributes
    ----------
    world : (K, 3) float64 ndarray
        Positions in world space.
    position : (K, 2) float64 ndarray
        Positions in the picture, in pixels from the lower left. NaN if the point is not in front of the
        camera.
    depth : (K,) float64 ndarray
        Distances along the axis of the camera, in Blender units.
    is_in_view : (K,) bool ndarray
        Whether the point is between the near and the far plane of the camera, and no clip plane cuts it
        away. It may be beside the frame.
    is_visible : (K,) bool ndarray
        Whether the point is in view and in the frame, and no surface hides it.
    """

    world: np.ndarray
    position: np.ndarray
    depth: np.ndarray
    is_in_view: np.ndarray
    is_visible: np.ndarray


def project_vertices(
    instances: MeshInstances,
    camera: Camera,
    vertices: Sequence[np.ndarray],
    clip_planes: np.ndarray | None = None,
) -> ProjectedPoints:
    """Project vertices, and find those that no triangle hides.

    Parameters
    ----------
    instances : sequence of MeshInstance
        All of them hide vertices.
    camera : Camera
    vertices : sequence of (n,) int ndarray
        For each instance, the indices of the vertices to project.
    clip_planes : (6, 4) float64 ndarray, optional
        Planes (a, b, c, d) in world space. Points with a x + b y + c z + d < 0 are cut away.

    Returns
    -------
    ProjectedPoints
        The vertices of all instances, one instance after the other.
    """
    report(0.0, LABEL)
    scene = _Scene.of(instances, camera, clip_planes)
    first = offsets_from_sizes([len(instance.surface.vertices) for instance in instances])[:-1]
    pairs = zip(first, vertices, strict=True)
    vertex = np.concatenate([start + np.asarray(part, np.intp) for start, part in pairs])

    def touches(triangle: np.ndarray, point: np.ndarray) -> np.ndarray:
        return (scene.triangles[triangle] == vertex[point][:, None]).any(axis=1)

    return _project(scene, scene.clip[vertex], scene.world[vertex], touches, LABEL)


def project_points(
    instances: MeshInstances,
    camera: Camera,
    points: SurfacePoints,
    clip_planes: np.ndarray | None = None,
    *,
    finds_hidden: bool = True,
) -> ProjectedPoints:
    """Project points in triangles, and find those that no other triangle hides.

    Parameters
    ----------
    instances : sequence of MeshInstance
        All of them hide points.
    camera : Camera
    points : SurfacePoints
        K points.
    clip_planes : (6, 4) float64 ndarray, optional
        Planes (a, b, c, d) in world space. Points with a x + b y + c z + d < 0 are cut away.
    finds_hidden : bool
        Whether hidden points are found. If not, all points in the frame count as visible.

    Returns
    -------
    ProjectedPoints
        The points in their order.
    """
    report(0.0, POINTS_LABEL)
    scene = _Scene.of(instances, camera, clip_planes)
    triangle = points.triangle + first_triangles(instances)[points.instance_id]
    corners = scene.triangles[triangle]
    point_clip, point_world = (
        sum(points.barycentric[:, k, None] * values[corners[:, k]] for k in range(3))
        for values in (scene.clip, scene.world)
    )

    def touches(other: np.ndarray, point: np.ndarray) -> np.ndarray:
        return other == triangle[point]

    if not finds_hidden:
        scene = replace(scene, triangles=scene.triangles[:0])
    return _project(scene, point_clip, point_world, touches, POINTS_LABEL)


def _project(
    scene: _Scene,
    clip: np.ndarray,
    world: np.ndarray,
    touches: Callable[[np.ndarray, np.ndarray], np.ndarray],
    label: str,
) -> ProjectedPoints:
    """Project K points, and find the visible ones.

    `clip`, (K, 4), and `world`, (K, 3), are their positions in clip space and in world space. `label` is the
    text that the user sees meanwhile.

    `touches(triangle, point)` returns (n,) bool for (n,) indices of triangles of the scene and of points:
    whether the triangle contains the point. A triangle does not hide the points that it contains.
    """
    camera = scene.camera
    x, y, z, w = clip.T
    is_in_view = (w > 0) & (np.abs(z) <= w) & ~is_cut_away(world, scene.clip_planes)
    ndc = np.full((len(clip), 2), np.nan)
    np.divide(np.stack([x, y], axis=1), w[:, None], out=ndc, where=(w > 0)[:, None])
    position = (ndc + 1) * (0.5 * np.array(camera.size))
    is_visible = is_in_view & (np.abs(ndc) <= 1).all(axis=1)
    distance = camera.depths(world)
    # A triangle nearer than the near plane, or beyond the far one, hides nothing.
    number = np.arange(len(scene.triangles))
    for is_outside in (scene.clip[:, 2] < -scene.clip[:, 3], scene.clip[:, 2] > scene.clip[:, 3]):
        if is_outside.any():
            number = number[~is_outside[scene.triangles[number]].all(axis=1)]
    for block in reported_blocks(len(number), label, size=TRIANGLES_PER_BLOCK):
        left = np.flatnonzero(is_visible)
        for triangle, chosen in scene.pairs(number[block], ndc[left]):
            point = left[chosen]
            others = np.flatnonzero(~touches(triangle, point))
            triangle, point = triangle[others], point[others]
            is_visible[point[scene.hides(triangle, ndc[point], distance[point])]] = False
    return ProjectedPoints(world, position, distance, is_in_view, is_visible)


@dataclass(frozen=True, eq=False)
class _Scene:
    """All triangles of a scene in the view of a camera.

    Attributes
    ----------
    clip : (V, 4) float64 ndarray
        Vertices in clip space.
    world : (V, 3) float64 ndarray
        Vertices in world space.
    distance : (V,) float64 ndarray
        Depths of the vertices, along the axis of the camera.
    triangles : (T, 3) int ndarray
        Triangles that can hide points, as indices of vertices.
    camera : Camera
    clip_planes : (6, 4) float64 ndarray or None
        Planes (a, b, c, d) in world space. Points with a x + b y + c z + d < 0 are cut away.
    tolerance : float
        A surface hides a point only if it is nearer to the camera by more than this depth, in Blender units.
    """

    clip: np.ndarray
    world: np.ndarray
    distance: np.ndarray
    triangles: np.ndarray
    camera: Camera
    clip_planes: np.ndarray | None
    tolerance: float

    @classmethod
    def of(cls, instances: MeshInstances, camera: Camera, clip_planes: np.ndarray | None) -> _Scene:
        """Return a scene of all triangles of mesh instances, as seen by a camera."""
        clip, triangles = all_triangles(instances, camera)
        world = np.concatenate([instance.world_points() for instance in instances])
        tolerance = SAME_POINT * float(np.ptp(world, axis=0).max(initial=0.0))
        return cls(clip, world, camera.depths(world), triangles, camera, clip_planes, tolerance)

    def pairs(
        self, triangle: np.ndarray, ndc: np.ndarray
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Return pairs of a triangle and a point in its bounding box on screen.

        Parameters
        ----------
        triangle : (t,) intp ndarray
            Indices of the triangles to test.
        ndc : (n, 2) float64 ndarray
            Positions of the points on screen, from -1 to 1.

        Returns
        -------
        iterator of (triangle, point)
            Indices of triangles and of points, (m,) intp ndarrays, block by block.
        """
        row_count = max(int(len(ndc) ** 0.5), 1)
        point_row = _grid_rows(ndc[:, 1], row_count)
        # Points are sorted by rows of a grid, and by x in each row: x is below 2, so rows are 4 apart.
        key = 4.0 * point_row + ndc[:, 0]
        order = np.argsort(key, kind="stable")
        key = key[order]
        corners = self.clip[self.triangles[triangle].T]
        w = corners[..., 3]
        is_in_front = (w > 0).all(axis=0)[:, None]
        # The projection of a triangle that reaches behind the eye is not bounded by its corners.
        xy = corners[..., :2] / np.where(is_in_front[:, 0], w, 1.0)[..., None]
        low = np.where(is_in_front, xy.min(axis=0), -1.0)
        high = np.where(is_in_front, xy.max(axis=0), 1.0)
        kept = np.flatnonzero((low <= 1).all(axis=1) & (high >= -1).all(axis=1))
        low, high = np.maximum(low[kept], -1.0), np.minimum(high[kept], 1.0)
        first_row, last_row = (_grid_rows(edge[:, 1], row_count) for edge in (low, high))
        height = last_row - first_row + 1
        box, row = numbered_ranges(first_row, height)
        first = np.searchsorted(key, 4.0 * row + low[box, 0])
        count = np.searchsorted(key, 4.0 * row + high[box, 0], side="right") - first
        box, first, count = (array[count > 0] for array in (box, first, count))
        triangle = triangle[kept[box]]
        for number, place in blocks_of_ranges(first, count, PAIRS_PER_BLOCK):
            yield triangle[number], order[place]

    def hides(self, triangle: np.ndarray, ndc: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Return (n,) bool: whether each triangle hides its point. The point must not be on the triangle.

        Parameters
        ----------
        triangle : (n,) ndarray of int
            Triangles to test, one for each point.
        ndc : (n, 2) float64 ndarray
            Positions of the points on screen, from -1 to 1.
        distance : (n,) float64 ndarray
            Depths of the points, along the axis of the camera.
        """
        corner = self.triangles[triangle]
        a, b, c = np.moveaxis(self.clip[corner][..., (0, 1, 3)], 1, 0)
        point = np.concatenate([ndc, np.ones((len(ndc), 1))], axis=1)
        area = (a * np.cross(b, c)).sum(axis=1)
        edges = (b, c), (c, a), (a, b)
        weights = np.stack([(point * np.cross(*edge)).sum(axis=1) for edge in edges], axis=1)
        weights = np.divide(weights, area[:, None], out=weights, where=area[:, None] != 0)
        covers = np.flatnonzero((weights >= 0).all(axis=1) & (area != 0))
        corner, weights = corner[covers], weights[covers]
        # These weights are the barycentric coordinates divided by w.
        z = (weights * self.clip[corner, 2]).sum(axis=1)
        weights /= weights.sum(axis=1, keepdims=True)
        hit_distance = (weights * self.distance[corner]).sum(axis=1)
        hides = (np.abs(z) <= 1) & (hit_distance < distance[covers] - self.tolerance)
        if self.clip_planes is not None:
            hit = np.einsum("nk,nki->ni", weights, self.world[corner])
            hides &= ~is_cut_away(hit, self.clip_planes)
        return mask(len(triangle), covers[hides])


def _grid_rows(y: np.ndarray, row_count: int) -> np.ndarray:
    """Return the row of each of (n,) y coordinates from -1 to 1 in a grid with `row_count` rows."""
    return np.clip((0.5 * (y + 1) * row_count).astype(np.intp), 0, row_count - 1)


def is_cut_away(points: np.ndarray, clip_planes: np.ndarray | None) -> np.ndarray:
    """Return whether each point is on the negative side of at least one clip plane.

    Parameters
    ----------
    points : (n, 3) ndarray
    clip_planes : (6, 4) ndarray or None
        Coefficients (a, b, c, d) of clip planes a x + b y + c z + d = 0, in the space of the points. The
        negative side is cut away. If it is None, no point is cut away.

    Returns
    -------
    (n,) bool ndarray
    """
    if clip_planes is None:
        return np.zeros(len(points), dtype=bool)
    return (transformed(points, clip_planes) < 0).any(axis=1)

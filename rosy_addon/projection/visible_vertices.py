"""Which vertices a camera sees: exact rays from each of them to the eye, without a depth buffer.

A triangle hides a vertex if it covers its projection, nearer to the eye. Barycentric coordinates come
from homogeneous clip coordinates, so triangles that reach behind the eye need no clipping; see Marc Olano
and Trey Greer, "Triangle Scan Conversion Using 2D Homogeneous Coordinates", 1997.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..field.blocks import concatenated_ranges
from ..progress import Progress, Task
from .camera import Camera
from .clip_planes import is_cut_away
from .gbuffer import MeshInstance
from .project import all_triangles

#: Surfaces that are nearer to a vertex than this fraction of the size of the scene do not hide it.
SAME_POINT = 1e-6

#: Triangles in a step, and pairs of triangles and vertices that are tested at a time.
TRIANGLES_PER_STEP, PAIRS_PER_STEP = 1 << 15, 1 << 20

#: Label of all steps.
STEP_LABEL = "finding visible singularities"


@dataclass(frozen=True, eq=False)
class ProjectedVertices:
    """K vertices in a picture.

    Attributes
    ----------
    position : (K, 2) float64 ndarray
        Pixels from the lower left of the picture. NaN if the vertex is not in front of the camera.
    depth : (K,) float64 ndarray
        Distance along the axis of the camera, Blender units.
    is_in_view : (K,) bool ndarray
        Whether the vertex is between the near and the far plane of the camera, in front of it, and not
        cut away. It may be beside the frame.
    is_visible : (K,) bool ndarray
        Whether it is in the frame, too, and no surface is in front of it.
    """

    position: np.ndarray
    depth: np.ndarray
    is_in_view: np.ndarray
    is_visible: np.ndarray


def project_vertices_task(
    instances: Sequence[MeshInstance],
    camera: Camera,
    vertices: Sequence[np.ndarray],
    clip_planes: np.ndarray | None = None,
) -> Task[ProjectedVertices]:
    """Project vertices, and find those that no triangle hides.

    Parameters
    ----------
    instances : sequence of MeshInstance
        All of them hide vertices.
    camera : Camera
    vertices : sequence of (n,) int ndarray
        For each instance, the indices of vertices.
    clip_planes : (6, 4) float64 ndarray, optional
        World space. The negative side of each plane is cut away.

    Yields
    ------
    Progress

    Returns
    -------
    ProjectedVertices
        Of the vertices of all instances, in their order.
    """
    yield Progress(0.0, STEP_LABEL)
    clip, triangles, _ = all_triangles(instances, camera)
    world = np.concatenate([instance.world_points() for instance in instances])
    distance = -(world @ camera.view[2, :3] + camera.view[2, 3])
    first = np.cumsum([0, *(len(instance.surface.vertices) for instance in instances[:-1])])
    vertex = np.concatenate(
        [start + np.asarray(part, np.intp) for start, part in zip(first, vertices, strict=True)]
    )
    x, y, z, w = clip[vertex].T
    is_in_view = (w > 0) & (np.abs(z) <= w) & ~is_cut_away(world[vertex], clip_planes)
    ndc = np.full((len(vertex), 2), np.nan)
    np.divide(np.stack([x, y], axis=1), w[:, None], out=ndc, where=(w > 0)[:, None])
    position = (ndc + 1) * (0.5 * np.array([camera.width, camera.height]))
    is_visible = is_in_view & (np.abs(ndc) <= 1).all(axis=1)
    # A triangle nearer than the near plane, or beyond the far one, hides nothing.
    for is_outside in (clip[:, 2] < -clip[:, 3], clip[:, 2] > clip[:, 3]):
        triangles = triangles[~is_outside[triangles].all(axis=1)]
    tolerance = SAME_POINT * float(np.ptp(world, axis=0).max(initial=0.0))
    occluders = _Occluders(clip, world, distance, triangles, clip_planes, tolerance)
    for start in range(0, len(triangles), TRIANGLES_PER_STEP):
        yield Progress(start / len(triangles), STEP_LABEL)
        left = np.flatnonzero(is_visible)
        for triangle, point in occluders.pairs(start, start + TRIANGLES_PER_STEP, ndc[left]):
            hidden = occluders.hides(triangle, vertex[left[point]], ndc[left[point]])
            is_visible[left[point[hidden]]] = False
    return ProjectedVertices(position, distance[vertex], is_in_view, is_visible)


@dataclass(frozen=True, eq=False)
class _Occluders:
    """T triangles that may hide vertices.

    Attributes
    ----------
    clip : (V, 4) float64 ndarray
    world : (V, 3) float64 ndarray
    distance : (V,) float64 ndarray
        Along the axis of the camera.
    triangles : (T, 3) int ndarray
    clip_planes : (6, 4) float64 ndarray or None
    tolerance : float
        Distance in front of a vertex at which surfaces begin to hide it.
    """

    clip: np.ndarray
    world: np.ndarray
    distance: np.ndarray
    triangles: np.ndarray
    clip_planes: np.ndarray | None
    tolerance: float

    def pairs(
        self, start: int, stop: int, ndc: np.ndarray
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Find the points in the bounding boxes of some triangles.

        Parameters
        ----------
        start, stop : int
            The triangles.
        ndc : (n, 2) float64 ndarray
            From -1 to 1.

        Yields
        ------
        triangle, point : (m,) intp ndarray
        """
        row_count = max(int(len(ndc) ** 0.5), 1)
        point_row = _grid_rows(ndc[:, 1], row_count)
        # Points are sorted by rows of a grid, and by x in each row: x is below 2, so rows are 4 apart.
        key = 4.0 * point_row + ndc[:, 0]
        order = np.argsort(key, kind="stable")
        key = key[order]
        corners = self.clip[self.triangles[start:stop]]
        w = corners[..., 3]
        is_in_front = (w > 0).all(axis=1)[:, None]
        # The projection of a triangle that reaches behind the eye is not bounded by its corners.
        xy = corners[..., :2] / np.where(is_in_front, w, 1.0)[..., None]
        low = np.where(is_in_front, xy.min(axis=1), -1.0)
        high = np.where(is_in_front, xy.max(axis=1), 1.0)
        kept = np.flatnonzero((low <= 1).all(axis=1) & (high >= -1).all(axis=1))
        low, high = np.maximum(low[kept], -1.0), np.minimum(high[kept], 1.0)
        first_row, last_row = (_grid_rows(edge[:, 1], row_count) for edge in (low, high))
        height = last_row - first_row + 1
        box = np.repeat(np.arange(len(kept)), height)
        row = concatenated_ranges(first_row, height)
        first = np.searchsorted(key, 4.0 * row + low[box, 0])
        count = np.searchsorted(key, 4.0 * row + high[box, 0], side="right") - first
        box, first, count = (array[count > 0] for array in (box, first, count))
        total = np.cumsum(count)
        done = 0
        while done < len(count):
            limit = (total[done - 1] if done else 0) + PAIRS_PER_STEP
            until = max(int(np.searchsorted(total, limit, side="right")), done + 1)
            part = slice(done, until)
            triangle = start + kept[np.repeat(box[part], count[part])]
            yield triangle, order[concatenated_ranges(first[part], count[part])]
            done = until

    def hides(self, triangle: np.ndarray, vertex: np.ndarray, ndc: np.ndarray) -> np.ndarray:
        """(n,) bool: whether triangles hide vertices that are not their own.

        Parameters
        ----------
        triangle, vertex : (n,) ndarray of int
        ndc : (n, 2) float64 ndarray
            Of the vertices.
        """
        corner = self.triangles[triangle]
        other = np.flatnonzero((corner != vertex[:, None]).all(axis=1))
        corner, vertex = corner[other], vertex[other]
        a, b, c = np.moveaxis(self.clip[corner][..., (0, 1, 3)], 1, 0)
        point = np.concatenate([ndc[other], np.ones((len(other), 1))], axis=1)
        area = (a * np.cross(b, c)).sum(axis=1)
        weights = np.stack(
            [(point * np.cross(*pair)).sum(axis=1) for pair in ((b, c), (c, a), (a, b))], axis=1
        )
        weights = np.divide(weights, area[:, None], out=weights, where=area[:, None] != 0)
        covers = (weights >= 0).all(axis=1) & (area != 0)
        other, corner, vertex, weights = (
            array[covers] for array in (other, corner, vertex, weights)
        )
        # These weights are the barycentric coordinates divided by w.
        z = (weights * self.clip[corner, 2]).sum(axis=1)
        weights /= weights.sum(axis=1, keepdims=True)
        distance = (weights * self.distance[corner]).sum(axis=1)
        hides = (np.abs(z) <= 1) & (distance < self.distance[vertex] - self.tolerance)
        if self.clip_planes is not None:
            hit = np.einsum("nk,nki->ni", weights, self.world[corner])
            hides &= ~is_cut_away(hit, self.clip_planes)
        result = np.zeros(len(triangle), dtype=bool)
        result[other[hides]] = True
        return result


def _grid_rows(y: np.ndarray, row_count: int) -> np.ndarray:
    """Return the rows of (n,) heights from -1 to 1, of a grid of so many rows."""
    return np.clip((0.5 * (y + 1) * row_count).astype(np.intp), 0, row_count - 1)

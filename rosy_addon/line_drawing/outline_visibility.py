"""Visibility of outlines: they lie where surfaces turn away, so nearly hidden by their own surface."""

from __future__ import annotations

import numpy as np

from ..field.frames import dot, normalize
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.vector_components import cofactor_matrix
from .outline import OUTLINE_KINDS
from .stroke_set import Strokes
from .visibility import (
    DepthBuffer,
    pixel_size,
    planes_around,
    project_to_pixels,
    visible_runs,
)

#: A silhouette is also visible if it would be after a move outward by one of these distances, in pixels:
#: it passes behind the edges of the triangles, where these stand out of the smooth surface.
OUTWARD_STEPS_PX = (1.0, 2.0)

#: A silhouette is not hidden by triangles that share a vertex with its own and are in front of it by less
#: than this fraction of the longest edge of its own.
MAX_RING_DEPTH = 1.0

#: Shorter gaps in outlines are closed, and shorter outlines are left out, in pixels.
MAX_GAP_PX, MIN_MARK_PX = 4.0, 6.0


def clip_outline(
    lines: Strokes,
    instance: MeshInstance,
    index: int,
    camera: Camera,
    depth_buffer: DepthBuffer | None,
) -> Strokes:
    """Return the parts of outlines that are in the frame and not hidden.

    The depth test of strokes fails for silhouettes, which lie on triangles that may face away from the
    camera although the smooth surface does not.

    Parameters
    ----------
    lines : Strokes
        The `outline` of an instance.
    instance : MeshInstance
    index : int
        The number of the instance among those of the depth buffer.
    camera : Camera
    depth_buffer : DepthBuffer or None
        If None, lines are only clipped to the frame.

    Returns
    -------
    Strokes
        Without marks shorter than `MIN_MARK_PX`.
    """
    test = None if depth_buffer is None else _OutlineTest(instance, index, depth_buffer).is_visible
    return visible_runs(lines, camera, test, MAX_GAP_PX, MIN_MARK_PX)


class _OutlineTest:
    """The depth test of an outline: the triangles of its instance in world space, and what occludes.

    Attributes
    ----------
    depth_buffer : DepthBuffer
    first_triangle : int
        Number of the first triangle of the instance in the depth buffer.
    triangle_vertex, triangles : (T, 3) int32 ndarray
        Vertices and corners of the triangles.
    points, normals : (n, 3) float64 ndarray
        Vertices, and shading normals at the corners.
    """

    def __init__(self, instance: MeshInstance, index: int, depth_buffer: DepthBuffer) -> None:
        surface = instance.surface
        self.depth_buffer = depth_buffer
        self.first_triangle = depth_buffer.start[index]
        self.triangle_vertex, self.triangles = surface.triangle_vertex, surface.triangles
        self.points = instance.world_points()
        matrix = np.asarray(instance.matrix, dtype=np.float64)
        self.normals = surface.corner_normal @ cofactor_matrix(matrix[:3, :3]).T

    def is_visible(self, block: Strokes, point: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """Return (m,) bool: which points are visible; see `visible_runs`."""
        camera, triangle = self.depth_buffer.camera, block.triangle[point]
        ring_depth = np.full(len(point), -1.0)
        contour = np.flatnonzero(
            block.family[block.stroke[point]] == OUTLINE_KINDS.index("silhouettes")
        )
        crossed, inverse = np.unique(triangle[contour], return_inverse=True)
        ring_depth[contour] = self._ring_depth(crossed)[inverse]
        visible = ~self._is_hidden(block.points[point], pixels, triangle, ring_depth)
        for step in OUTWARD_STEPS_PX:
            pending = np.flatnonzero(~visible & (ring_depth > 0))
            points, normal = block.points[point[pending]], block.normal[point[pending]]
            to_eye = camera.view_directions(points)
            outward = normalize(normal - dot(normal, to_eye)[:, None] * to_eye)
            moved = points + step * pixel_size(points, camera)[:, None] * outward
            pixels = np.nan_to_num(project_to_pixels(moved, camera)[0])
            visible[pending] = ~self._is_hidden(
                moved, pixels, triangle[pending], ring_depth[pending]
            )
        return visible

    def _ring_depth(self, triangle: np.ndarray) -> np.ndarray:
        """Return (n,) float64: `MAX_RING_DEPTH` as a length, for silhouettes that bend outward.

        The radial curvature of the surface is positive there: n . w grows toward the camera. Where
        it is negative, the surface hides its silhouette. The result is negative there, and for lines
        on triangles that no silhouette crosses.
        """
        a, b, c = (self.points[self.triangle_vertex[triangle, k]] for k in range(3))
        to_eye = self.depth_buffer.camera.view_directions((a + b + c) / 3)
        normal = normalize(self.normals[self.triangles[triangle]])
        fa, fb, fc = facing = np.stack([dot(normal[:, k], to_eye) for k in range(3)])
        u, v = b - a, c - a
        uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
        along_u, along_v = dot(u, to_eye), dot(v, to_eye)
        # The derivative along the projection of the direction to the eye, times a positive factor.
        slope = (vv * along_u - uv * along_v) * (fb - fa) + (uu * along_v - uv * along_u) * (
            fc - fa
        )
        longest = np.sqrt(np.maximum(np.maximum(uu, vv), dot(c - b, c - b)))
        crossed = (facing.min(axis=0) < 0) & (facing.max(axis=0) > 0)
        return np.where((slope > 0) & crossed, MAX_RING_DEPTH * longest, -1.0)

    def _is_hidden(
        self, points: np.ndarray, pixels: np.ndarray, triangle: np.ndarray, ring_depth: np.ndarray
    ) -> np.ndarray:
        """Return (n,) bool: which points are behind the planes of all four pixels around them."""
        hidden = np.ones(len(points), dtype=bool)
        for plane in planes_around(points, pixels, self.depth_buffer):
            behind = plane.hides.copy()
            near = np.flatnonzero(behind & (plane.distance < ring_depth))
            behind[near] = ~self._shares_vertex(triangle[near], plane.triangle[near])
            hidden &= behind
        return hidden

    def _shares_vertex(self, triangle: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return (n,) bool: whether triangles of the depth buffer touch (n,) triangles of its own."""
        local = other - self.first_triangle
        is_own = (local >= 0) & (local < len(self.triangle_vertex))
        vertex = self.triangle_vertex[np.where(is_own, local, 0)]
        own_vertex = self.triangle_vertex[triangle]
        return is_own & (vertex[:, :, None] == own_vertex[:, None, :]).any(axis=(1, 2))

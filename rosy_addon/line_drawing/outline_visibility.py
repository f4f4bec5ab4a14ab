"""Visibility of outlines: they lie where surfaces turn away, so nearly hidden by their own surface."""

from __future__ import annotations

from collections.abc import Sequence

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

#: A silhouette is visible if it would be after a move outward by one of these distances, in pixels: it
#: passes behind the edges of the triangles, where these stand out of the smooth surface.
OUTWARD_STEPS_PX = (0.0, 1.0, 2.0)

#: A silhouette is not hidden by triangles that share a vertex with its own and are in front of it by less
#: than this fraction of the longest edge of its own.
MAX_RING_DEPTH = 1.0

#: Shorter gaps in outlines are closed, and shorter outlines are left out, in pixels.
MAX_GAP_PX, MIN_MARK_PX = 4.0, 6.0


def clip_outline(
    lines: Strokes,
    index: int,
    instances: Sequence[MeshInstance],
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
    index : int
        The number of this instance.
    instances : sequence of MeshInstance
        As for `clip_to_visible`.
    camera : Camera
    depth_buffer : DepthBuffer or None
        Of the instances. If None, lines are only clipped to the frame.

    Returns
    -------
    Strokes
        Without marks shorter than `MIN_MARK_PX`.
    """
    own = _OwnSurface(instances, index, camera)

    def find_visible(block: Strokes, pixels: np.ndarray, inside: np.ndarray) -> np.ndarray:
        visible = inside.copy()
        if depth_buffer is not None:
            visible[visible] = _is_visible(block.points, block, visible, own, depth_buffer, camera)
        return visible

    return visible_runs(lines, camera, find_visible, MAX_GAP_PX, MIN_MARK_PX)


class _OwnSurface:
    """The triangles of the instance that an outline belongs to, in world space.

    Attributes
    ----------
    first_triangle : int
        Number of its first triangle in the depth buffer.
    triangle_vertex : (T, 3) int32 ndarray
    points, normals : (T, 3, 3) float64 ndarray
        Corners, and shading normals there.
    """

    def __init__(self, instances: Sequence[MeshInstance], index: int, camera: Camera) -> None:
        instance = instances[index]
        surface = instance.surface
        self.first_triangle = sum(len(other.surface.triangles) for other in instances[:index])
        self.triangle_vertex = surface.triangle_vertex
        self.points = instance.world_points()
        matrix = np.asarray(instance.matrix, dtype=np.float64)
        self.normals = surface.corner_normal @ cofactor_matrix(matrix[:3, :3]).T
        self.corners = surface.triangles
        self.camera = camera

    def ring_depth(self, triangle: np.ndarray) -> np.ndarray:
        """Return (n,) float64: `MAX_RING_DEPTH` as a length, for silhouettes that bend outward.

        The radial curvature of the surface is positive there: n . w grows toward the camera. Where
        it is negative, the surface hides its silhouette. The result is negative there, and for lines
        on triangles that no silhouette crosses.
        """
        a, b, c = (self.points[self.triangle_vertex[triangle, k]] for k in range(3))
        to_eye = self.camera.view_directions((a + b + c) / 3)
        normal = normalize(self.normals[self.corners[triangle]])
        fa, fb, fc = (dot(normal[:, k], to_eye) for k in range(3))
        u, v = b - a, c - a
        uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
        along_u, along_v = dot(u, to_eye), dot(v, to_eye)
        # The derivative along the projection of the direction to the eye, times a positive factor.
        slope = (vv * along_u - uv * along_v) * (fb - fa) + (uu * along_v - uv * along_u) * (
            fc - fa
        )
        longest = np.sqrt(np.maximum(np.maximum(uu, vv), dot(c - b, c - b)))
        crossed = np.minimum(np.minimum(fa, fb), fc) < 0
        crossed &= np.maximum(np.maximum(fa, fb), fc) > 0
        return np.where((slope > 0) & crossed, MAX_RING_DEPTH * longest, -1.0)

    def shares_vertex(self, triangle: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return (n,) bool: whether triangles of the depth buffer touch (n,) triangles of its own."""
        local = other - self.first_triangle
        is_own = (local >= 0) & (local < len(self.triangle_vertex))
        vertex = self.triangle_vertex[np.where(is_own, local, 0)]
        own_vertex = self.triangle_vertex[triangle]
        return is_own & (vertex[:, :, None] == own_vertex[:, None, :]).any(axis=(1, 2))


def _is_visible(
    points: np.ndarray,
    block: Strokes,
    in_view: np.ndarray,
    own: _OwnSurface,
    depth_buffer: DepthBuffer,
    camera: Camera,
) -> np.ndarray:
    """Return (m,) bool: which of the m points in the frame are visible."""
    chosen = np.flatnonzero(in_view)
    triangle = block.triangle[chosen]
    ring_depth = np.full(len(chosen), -1.0)
    contour = np.flatnonzero(
        block.family[block.stroke[chosen]] == OUTLINE_KINDS.index("silhouettes")
    )
    crossed, inverse = np.unique(triangle[contour], return_inverse=True)
    ring_depth[contour] = own.ring_depth(crossed)[inverse]
    visible = ~_is_hidden(points[chosen], triangle, ring_depth, own, depth_buffer, camera)
    for step in OUTWARD_STEPS_PX[1:]:
        pending = np.flatnonzero(~visible & (ring_depth > 0))
        point = points[chosen[pending]]
        to_eye = camera.view_directions(point)
        normal = block.normal[chosen[pending]]
        outward = normalize(normal - dot(normal, to_eye)[:, None] * to_eye)
        moved = point + step * pixel_size(point, camera)[:, None] * outward
        visible[pending] = ~_is_hidden(
            moved, triangle[pending], ring_depth[pending], own, depth_buffer, camera
        )
    return visible


def _is_hidden(
    points: np.ndarray,
    triangle: np.ndarray,
    ring_depth: np.ndarray,
    own: _OwnSurface,
    depth_buffer: DepthBuffer,
    camera: Camera,
) -> np.ndarray:
    """Return (n,) bool: which points are behind the planes of all four pixels around them."""
    view = camera.view
    camera_points = points @ view[:3, :3].T + view[:3, 3]
    pixels, _ = project_to_pixels(points, camera)
    footprint = pixel_size(points, camera)
    hidden = np.ones(len(points), dtype=bool)
    for plane in planes_around(
        camera_points, np.nan_to_num(pixels), footprint, depth_buffer, camera
    ):
        behind = (plane.triangle >= 0) & (plane.distance > plane.bias)
        near = np.flatnonzero(behind & (plane.distance < ring_depth))
        behind[near] = ~own.shares_vertex(triangle[near], plane.triangle[near])
        hidden &= behind
    return hidden

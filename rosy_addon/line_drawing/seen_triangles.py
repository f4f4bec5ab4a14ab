"""The triangles on which strokes can be seen, and those so near to them that strokes there matter.

Strokes that nobody sees need not be traced: on most models, that is half of them. Strokes keep their
distances only from those beside them, so those in view are as if the hidden part had strokes, too, if
tracing goes on a little beyond what is seen.
"""

from __future__ import annotations

import numpy as np

from ..field.blocks import row_blocks
from ..field.frames import dot
from ..progress import report
from ..projection.gbuffer import MeshInstance
from .tangent_mesh import TangentMesh
from .visibility import (
    BLOCK_POINTS,
    DepthBuffer,
    in_frame,
    planes_around,
    project_to_pixels,
)

#: Distance from triangles that are seen up to which strokes are traced, in spacings.
HIDDEN_MARGIN = 6.0


def seen_triangles(instance: MeshInstance, index: int, depth_buffer: DepthBuffer) -> np.ndarray:
    """Find the triangles of an instance that the camera sees.

    Parameters
    ----------
    instance : MeshInstance
    index : int
        The number of the instance among those of the depth buffer.
    depth_buffer : DepthBuffer

    Returns
    -------
    (T,) bool ndarray
        Triangles that are nearest at a pixel, or have a corner that is not hidden. A corner out of
        the frame counts as not hidden.
    """
    label = "finding the part in view"
    triangle_vertex = instance.surface.triangle_vertex
    owner = depth_buffer.triangle[depth_buffer.triangle >= 0]
    pixel_counts = np.bincount(owner, minlength=len(depth_buffer.normal))
    seen = pixel_counts[depth_buffer.start[index] : depth_buffer.start[index + 1]] > 0
    points = instance.world_points()
    hidden = np.zeros(len(points), dtype=bool)
    pending = np.unique(triangle_vertex[~seen])
    for part in row_blocks(len(pending), BLOCK_POINTS):
        report(part.start / max(len(pending), 1), label)
        hidden[pending[part]] = _is_hidden(points[pending[part]], depth_buffer)
    return seen | ~hidden[triangle_vertex].all(axis=1)


def _is_hidden(points: np.ndarray, depth_buffer: DepthBuffer) -> np.ndarray:
    """Return (n,) bool: which points are in the frame, and behind all triangles around them."""
    pixels, _ = project_to_pixels(points, depth_buffer.camera)
    hidden = in_frame(pixels, depth_buffer.camera)
    chosen = np.flatnonzero(hidden)
    for plane in planes_around(points[chosen], pixels[chosen], depth_buffer):
        hidden[chosen] &= plane.hides
    return hidden


def triangles_near(mesh: TangentMesh, seen: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Return the triangles that are within `HIDDEN_MARGIN` spacings of those that are seen.

    The distance of a triangle is that of the edge at which it is entered from the nearest edge of one
    that is seen, in a straight line.

    Parameters
    ----------
    mesh : TangentMesh
    seen : (T,) bool ndarray
    spacing : (T, 3) float64 ndarray
        Spacing at the corners, in world space.

    Returns
    -------
    (T,) bool ndarray
        Includes those that are seen.
    """
    spacing = spacing.mean(axis=1)
    distance = np.where(seen, 0.0, np.inf)
    # The edge of a triangle that is seen from which each triangle was reached.
    origin = np.zeros((len(seen), 2, 3))
    front = np.flatnonzero(seen)
    while len(front):
        source, edge = np.nonzero(mesh.neighbor[front] >= 0)
        source = front[source]
        target = mesh.neighbor[source, edge]
        beyond = ~seen[target]
        source, edge, target = source[beyond], edge[beyond], target[beyond]
        entered = np.stack(
            [mesh.points[source, (edge + 1) % 3], mesh.points[source, (edge + 2) % 3]], axis=1
        )
        start = np.where(seen[source, None, None], entered, origin[source])
        reached = _edge_distance(start, entered) / spacing[target]
        nearer = np.flatnonzero((reached < distance[target]) & (reached <= HIDDEN_MARGIN))
        # Of several ways to one triangle, the shortest is written last.
        nearer = nearer[np.argsort(-reached[nearer], kind="stable")]
        distance[target[nearer]], origin[target[nearer]] = reached[nearer], start[nearer]
        front = np.unique(target[nearer])
    return np.isfinite(distance)


def _edge_distance(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the (n,) distances between (n, 2, 3) edges in one plane that do not cross."""
    distances = [
        _distance_to_edge(point, edge)
        for one, edge in ((first, second), (second, first))
        for point in (one[:, 0], one[:, 1])
    ]
    return np.min(distances, axis=0)


def _distance_to_edge(point: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Return the (n,) distances of (n, 3) points from (n, 2, 3) edges."""
    along, offset = edge[:, 1] - edge[:, 0], point - edge[:, 0]
    length_squared = np.maximum(dot(along, along), 1e-300)
    fraction = np.clip(dot(offset, along) / length_squared, 0, 1)
    return np.linalg.norm(offset - fraction[:, None] * along, axis=1)

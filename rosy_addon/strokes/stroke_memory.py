"""The memory that strokes take, estimated before it is taken."""

from __future__ import annotations

import numpy as np

from ..field.directional_field import field_symmetry
from ..memory import check_memory
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from .visibility import pixel_size, project_to_pixels

#: Bytes of a square of the surface as wide as the spacing, for each family of lines: of strokes that
#: are not clipped, and of those that are, which take more for each pixel of their length. Fitted to
#: measurements.
SQUARE_BYTES, CLIPPED_SQUARE_BYTES, CLIPPED_PIXEL_BYTES = 2200, 850, 350

#: Pixels of the spacing from which on the points of strokes do not get denser: close to the camera.
MAX_SPACING_PIXELS = 4096


def check_stroke_memory(
    instance: MeshInstance, spacing: np.ndarray, camera: Camera, clipped: bool
) -> None:
    """Check that the strokes of a mesh instance can take the memory that they need.

    Parameters
    ----------
    instance, spacing, camera, clipped
        As for `stroke_memory`.

    Raises
    ------
    RosyError
        If they need more than `available_memory`.
    """
    check_memory(
        stroke_memory(instance, spacing, camera, clipped),
        f"{instance.surface.name}: a drawing of strokes with this spacing",
        "increase the spacing, or choose a smaller size",
    )


def stroke_memory(
    instance: MeshInstance, spacing: np.ndarray, camera: Camera, clipped: bool
) -> float:
    """Estimate the memory that the strokes of a mesh instance take at the peak.

    Parameters
    ----------
    instance : MeshInstance
        With a field.
    spacing : (V,) float64 ndarray
        Spacing at the vertices, in world space.
    camera : Camera
    clipped : bool
        Whether strokes are clipped to the frame or by what hides them.

    Returns
    -------
    float
        Bytes.
    """
    points = instance.world_points()
    triangle_vertex = instance.surface.triangle_vertex
    a, b, c = (points.take(corner, axis=0) for corner in triangle_vertex.T)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    triangle_spacing = spacing[triangle_vertex].mean(axis=1)
    squares = area / triangle_spacing**2
    if clipped:
        centroid = (a + b + c) / 3
        is_in_front = np.isfinite(project_to_pixels(centroid, camera)[0]).all(axis=1)
        pixels = triangle_spacing / pixel_size(centroid, camera)
        pixels = np.minimum(pixels, MAX_SPACING_PIXELS) * is_in_front
        needed = squares * (CLIPPED_SQUARE_BYTES + CLIPPED_PIXEL_BYTES * pixels)
    else:
        needed = squares * SQUARE_BYTES
    return float(needed.sum()) * field_symmetry(instance.field).line_count

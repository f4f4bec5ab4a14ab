"""The memory that strokes take, estimated before it is taken."""

from __future__ import annotations

import numpy as np

from ..memory import check_memory
from ..projection.camera import Camera
from .tangent_mesh import TangentMesh
from .visibility import pixel_size, project_to_pixels

#: Bytes of a square of the surface as wide as the spacing, and of a length of one spacing across a
#: triangle, for each family of lines: of strokes that are not clipped, and of those that are, which take
#: more for each pixel of their length. Fitted to measurements.
SQUARE_BYTES, CROSSING_BYTES = 2300, 4700
CLIPPED_SQUARE_BYTES, CLIPPED_CROSSING_BYTES, CLIPPED_PIXEL_BYTES = 1320, 3200, 70

#: Pixels of the spacing from which on the points of strokes do not get denser: close to the camera.
MAX_SPACING_PIXELS = 4096


def check_stroke_memory(
    mesh: TangentMesh, spacing: np.ndarray, camera: Camera, clipped: bool, surface_name: str
) -> None:
    """Check that the strokes of a mesh can take the memory that they need.

    Parameters
    ----------
    mesh, spacing, camera, clipped
        As for `stroke_memory`.
    surface_name : str
        For the error message.

    Raises
    ------
    RosyError
        If they need more than `available_memory`.
    """
    check_memory(
        stroke_memory(mesh, spacing, camera, clipped),
        f"{surface_name}: a drawing of strokes with this spacing",
        "increase the spacing, or choose a smaller size",
    )


def stroke_memory(mesh: TangentMesh, spacing: np.ndarray, camera: Camera, clipped: bool) -> float:
    """Estimate the memory that the strokes of a mesh take at the peak.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : (T, 3) float64 ndarray
        Spacing at the corners, in world space.
    camera : Camera
    clipped : bool
        Whether strokes are clipped to the frame or by what hides them.

    Returns
    -------
    float
        Bytes.
    """
    triangle_spacing = spacing.mean(axis=1)
    squares = mesh.area / triangle_spacing**2
    # Strokes have a point wherever they cross an edge.
    crossings = np.sqrt(squares)
    if clipped:
        centroid = mesh.points.mean(axis=1)
        is_in_front = np.isfinite(project_to_pixels(centroid, camera)[0]).all(axis=1)
        pixels = triangle_spacing / pixel_size(centroid, camera)
        pixels = np.minimum(pixels, MAX_SPACING_PIXELS) * is_in_front
        needed = squares * (CLIPPED_SQUARE_BYTES + CLIPPED_PIXEL_BYTES * pixels)
        needed += crossings * CLIPPED_CROSSING_BYTES
    else:
        needed = squares * SQUARE_BYTES + crossings * CROSSING_BYTES
    return float(needed.sum()) * mesh.family_count

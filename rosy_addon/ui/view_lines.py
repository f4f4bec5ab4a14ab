"""Lines over 3D views, and the places of points in them."""

from __future__ import annotations

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader


def to_pixels(
    region: bpy.types.Region, view: bpy.types.RegionView3D, points: np.ndarray
) -> np.ndarray:
    """Return the (..., 2) positions in the region of (..., 3) points of world space.

    They are infinite behind the camera.
    """
    matrix = np.array(view.perspective_matrix)
    clip = points @ matrix[:, :3].T + matrix[:, 3]
    size = np.array([region.width, region.height])
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = (clip[..., :2] / clip[..., 3:] + 1) / 2 * size
    pixels[clip[..., 3] <= 0] = np.inf
    return pixels


def draw_lines(kind: str, points: np.ndarray, color: tuple[float, ...], width: float) -> None:
    """Draw lines of a width in pixels between (n, 2) finite positions in the region or the window.

    The kind is "LINES", for pairs of points, or "LINE_STRIP".
    """
    if len(points) < 2:  # Blender makes no batch without vertices
        return
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", width)
    shader.uniform_float("color", color)
    points_3d = np.column_stack([points, np.zeros(len(points))]).astype(np.float32)
    gpu.state.blend_set("ALPHA")
    batch_for_shader(shader, kind, {"pos": points_3d}).draw(shader)
    gpu.state.blend_set("NONE")

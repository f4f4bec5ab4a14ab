"""Project points to pixels of a 3D view, and draw lines over it."""

import gpu
import numpy as np
from bpy.types import Region, RegionView3D
from gpu_extras.batch import batch_for_shader


def to_pixels(region: Region, view: RegionView3D, points: np.ndarray) -> np.ndarray:
    """Project (..., 3) points in world space to (..., 2) pixels of a region of a 3D view.

    The pixels of points behind the camera are infinite.
    """
    matrix = np.array(view.perspective_matrix)
    clip = points @ matrix[:, :3].T + matrix[:, 3]
    size = np.array([region.width, region.height])
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = (clip[..., :2] / clip[..., 3:] + 1) / 2 * size
    pixels[clip[..., 3] <= 0] = np.inf
    return pixels


def draw_lines(kind: str, points: np.ndarray, color: tuple[float, ...], width: float) -> None:
    """Draw lines between (n, 2) finite positions in pixels of the region or window.

    `kind` is "LINES" (one line for each pair of points) or "LINE_STRIP" (a polyline). `color` is RGBA,
    display values, and `width` is in pixels.
    """
    if len(points) < 2:  # Blender cannot make an empty batch
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

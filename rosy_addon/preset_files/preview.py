"""Draw preview pictures of looks. They all show the same trefoil knot."""

from functools import cache

import numpy as np

from ..compositor.compose import compose
from ..compositor.look import Look, colors_values, is_hatched
from ..core.color import from_hex, to_linear
from ..field.curvature import curvature_field
from ..field.rosy_field import RosyField
from ..field.surface import Surface, build_surface
from ..projection.camera import orbit_camera
from ..projection.gbuffer import MeshInstance
from ..projection.project import project

#: Side of a preview in pixels: twice the size in the panel, for high-resolution displays.
PREVIEW_SIZE = 256

#: Azimuth and elevation of the camera in degrees.
VIEW_ANGLES = (0.0, 68.0)

#: Background of looks without paper, a display color (sRGB) as dark as Blender's panels.
BACKGROUND = "#292929"


def draw_preview(look: Look) -> np.ndarray:
    """Draw the preview picture of a look: a trefoil knot with a field along its principal curvatures.

    The tone always comes from the light, even if the look has another source of the tone. The values for the
    color map increase from left to right. A preview takes about a second for any look, because expensive
    settings are reduced.

    Parameters
    ----------
    look : Look

    Returns
    -------
    (PREVIEW_SIZE, PREVIEW_SIZE, 4) float32 ndarray
        Picture: linear, opaque, rows from the bottom.
    """
    look = _fast_look(look)
    surface, field = _trefoil_mesh()
    render_size = PREVIEW_SIZE * look.supersampling
    camera = orbit_camera(surface.vertices, *VIEW_ANGLES, render_size, render_size, margin=0.03)
    across = surface.vertices[surface.corner_vertex, 0].astype(np.float32)
    instance = MeshInstance(surface, np.eye(4), field, color_values=across)
    gbuffer = project([instance], camera, look.display)
    return _over_background(compose(gbuffer, look).rgba, look)


def _fast_look(look: Look) -> Look:
    """Return a look that is drawn fast and without a scene, and looks nearly the same in a small picture.

    The LIC method "brute" is replaced by the method "sheets", which follows the same streamlines. The method
    "members" is drawn without supersampling, as its cost is proportional to the number of samples.
    Lengths are limited to fractions of the size of the preview. Settings that refer to a scene are replaced.
    """
    return look.with_settings(
        {
            "method": "sheets" if look.method == "brute" else look.method,
            "supersampling": 1 if look.method == "members" else 2,
            "unit": "pixels",
            "tone": "light",
            "color_range": (0.0, 0.0) if colors_values(look) else look.color_range,
            "length": min(look.length, PREVIEW_SIZE // 2),
            "line_width": min(look.line_width, PREVIEW_SIZE / 2),
            "line_distance": min(look.line_distance, PREVIEW_SIZE),
            "high_pass": min(look.high_pass, PREVIEW_SIZE / 4),
        }
    )


def _over_background(rgba: np.ndarray, look: Look) -> np.ndarray:
    """Composite an (H, W, 4) linear picture over the color of the paper, or `BACKGROUND` without hatching."""
    background = to_linear(from_hex(look.paper_color if is_hatched(look) else BACKGROUND))
    alpha = rgba[..., 3:]
    opaque = np.ones_like(rgba)
    opaque[..., :3] = rgba[..., :3] * alpha + background * (1 - alpha)
    return opaque


@cache
def _trefoil_mesh() -> tuple[Surface, RosyField]:
    """Build a thick tube around a trefoil knot, and its field of principal curvature directions (degree 4).

    The tube has positive and negative curvature, occludes itself, and has normals in all
    directions.
    """
    tube_radius, segments, sides = 0.66, 300, 40
    t = np.arange(segments) * (2 * np.pi / segments)
    curve, tangent = _trefoil_curve(t)
    # The knot winds around a circle of radius 2. The vector from the nearest point of that circle
    # is never parallel to the tangent, so it serves as the normal of the curve.
    normal = curve - 2 * np.stack([np.cos(2 * t), np.sin(2 * t), 0 * t], axis=1)
    normal -= np.sum(normal * tangent, axis=1, keepdims=True) * tangent
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    angle = np.arange(sides)[None, :, None] * (2 * np.pi / sides)
    ring = np.cos(angle) * normal[:, None] + np.sin(angle) * np.cross(tangent, normal)[:, None]
    points = (curve[:, None] + tube_radius * ring).reshape(-1, 3)
    index = np.arange(len(points), dtype=np.int32).reshape(segments, sides)
    next_segment, next_side = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1)
    corners = np.stack([index, next_segment, np.roll(next_segment, -1, axis=1), next_side], axis=-1)
    start = np.arange(index.size + 1) * 4
    surface = build_surface(points, corners.ravel(), start, name="knot")
    return surface, curvature_field(surface, 4)


def _trefoil_curve(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (n, 3) points and unit tangents of a trefoil knot at (n,) curve parameters, 0 to 2 pi."""
    radius, height = 2 + np.cos(3 * t), 1.1
    slope = -3 * np.sin(3 * t)  # of the radius
    cos, sin = np.cos(2 * t), np.sin(2 * t)
    curve = np.column_stack([radius * cos, radius * sin, height * np.sin(3 * t)])
    x, y = slope * cos - 2 * radius * sin, slope * sin + 2 * radius * cos
    tangent = np.column_stack([x, y, 3 * height * np.cos(3 * t)])
    return curve, tangent / np.linalg.norm(tangent, axis=1, keepdims=True)

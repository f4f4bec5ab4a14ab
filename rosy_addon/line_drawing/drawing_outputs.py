"""Draw meshes with strokes, and return the drawing as the contents of a file or as curves in world space."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..core.cache import BAKE_CACHE
from ..core.progress import progress
from ..field.frames import dot
from ..field.up_axis import UP_AXIS_BY_SUFFIX
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from .pipeline import StrokeDrawing, draw_instances
from .polyline_files import polyline_file, simplify_strokes
from .stroke_set import Strokes
from .style import StrokeStyle
from .svg import Pen, svg_text
from .visibility import pixel_size

#: Fraction of the progress at which all strokes are drawn, and label of the progress from then on.
OUTPUT_START, OUTPUT_LABEL = 0.95, "storing the strokes"

#: The offset of strokes toward the camera grows with the angle between the normal of the surface and the
#: direction to the camera, until the tangent of this angle has this value.
MAX_OFFSET_STEEPNESS = 12.0


class SurfaceAttachment(NamedTuple):
    """Positions of n points of curves relative to a mesh, so that they can follow it when it deforms.

    Attributes
    ----------
    vertices : (n, 3) int32 ndarray
        Vertices of the triangle on which each point is.
    weights : (n, 3) float64 ndarray
        Barycentric coordinates of the point in this triangle.
    height : (n,) float64 ndarray
        Height of the point above the triangle, along the interpolated normals of its vertices, in world
        space.
    """

    vertices: np.ndarray
    weights: np.ndarray
    height: np.ndarray


@dataclass(frozen=True, eq=False)
class StrokeGeometry:
    """Strokes as curves in world space with radii and colors, ready for a Blender object.

    Attributes
    ----------
    strokes : Strokes
        The S strokes, simplified. They have n points in all.
    instance_index : (S,) int32 ndarray
        Index of the mesh instance on which each stroke is.
    points : (n, 3) float64 ndarray
        Points of the curves in world space, offset from the surface.
    radius : (n,) float64 ndarray
        Radii in world space.
    colors : list of str
        The color of each family of strokes, in the order of the families, as a color of SVG (see `Pen`).
    attachment : SurfaceAttachment or None
        Positions of the points relative to the surface that they follow; None if they follow no surface.
    """

    strokes: Strokes
    instance_index: np.ndarray
    points: np.ndarray
    radius: np.ndarray
    colors: list[str]
    attachment: SurfaceAttachment | None = None


class StrokeInput(NamedTuple):
    """What a drawing of strokes shows, and how it is drawn.

    Attributes
    ----------
    instances : sequence of MeshInstance
        All meshes of the scene. Strokes are drawn on the meshes with a field.
    camera : Camera
        Camera of the drawing.
    style : StrokeStyle
        Settings of the strokes, such as their spacing.
    pen : Pen
        Width, in pixels of the camera, and colors of the strokes.
    lights : sequence of compositor.shading.Light
        Lights in camera space, from which the tone is computed.
    """

    instances: Sequence[MeshInstance]
    camera: Camera
    style: StrokeStyle
    pen: Pen
    lights: Sequence[Any]


def drawing_file(suffix: str, inputs: StrokeInput) -> tuple[StrokeDrawing, bytes]:
    """Draw mesh instances with strokes. Return the drawing and the contents of its file.

    Parameters
    ----------
    suffix : str
        Suffix that sets the format of the file: .svg, or a format of `polyline_file`.
    inputs : StrokeInput
    """
    is_svg = suffix == ".svg"
    drawing = _draw(inputs, clip_to_frame=is_svg)
    with progress(OUTPUT_START, 1.0, OUTPUT_LABEL):
        if is_svg:
            text = svg_text(drawing.strokes, inputs.camera, inputs.pen, drawing.marks)
            return drawing, text.encode()
        up = UP_AXIS_BY_SUFFIX.get(suffix, "z")
        return drawing, polyline_file(suffix, drawing.strokes, inputs.camera, inputs.pen, up)


def drawing_curves(
    inputs: StrokeInput, follows: MeshInstance | None
) -> tuple[StrokeDrawing, StrokeGeometry]:
    """Draw mesh instances with strokes. Return the drawing and its strokes as curves in world space.

    The curves follow the surface of the instance `follows` when it deforms, or no surface if it is None.
    """
    drawing = _draw(inputs, clip_to_frame=False)
    with progress(OUTPUT_START, 1.0, OUTPUT_LABEL):
        return drawing, stroke_geometry(drawing, inputs.camera, inputs.pen, follows)


def _draw(inputs: StrokeInput, *, clip_to_frame: bool) -> StrokeDrawing:
    """Draw mesh instances with strokes, using the cache that all bakes of this process share."""
    instances, camera, style, _, lights = inputs
    shared = {"clip_to_frame": clip_to_frame, "cache": BAKE_CACHE}
    with progress(0.0, OUTPUT_START):
        drawing = draw_instances(instances, camera, style, lights=lights, **shared)
    BAKE_CACHE.evict_over_limit()
    return drawing


def stroke_geometry(
    drawing: StrokeDrawing, camera: Camera, pen: Pen, follows: MeshInstance | None = None
) -> StrokeGeometry:
    """Return the strokes of a drawing as curves in world space, with radii and colors.

    Parameters
    ----------
    drawing : StrokeDrawing
    camera : Camera
    pen : Pen
        Width, in pixels of the camera, and colors of the strokes.
    follows : MeshInstance, optional
        The instance whose surface all curves follow when it deforms. All strokes must be on it. Without it,
        the curves follow no surface.
    """
    strokes = simplify_strokes(drawing.strokes, camera)
    # Hidden strokes may face away from the camera. An offset toward it would move them into the
    # surface.
    attachment = None
    if drawing.hidden or follows is not None:
        height = pen.width * pixel_size(strokes.points, camera)
        points = strokes.points + height[:, None] * strokes.normal
        if follows is not None:
            attachment = attach(strokes, height, follows)
    else:
        points = offset_toward_camera(strokes, camera, pen.width)
    radius = pen.width / 2 * pixel_size(points, camera) * strokes.width
    colors = pen.family_colors(strokes.names)
    return StrokeGeometry(strokes, drawing.instance_index, points, radius, colors, attachment)


def offset_toward_camera(strokes: Strokes, camera: Camera, width: float) -> np.ndarray:
    """Return the points of strokes, offset toward the camera that sees them.

    Their positions in the picture do not change. Ribbons of the given width that face the camera
    are then in front of the surface. The offset along the view ray grows with the angle between the surface
    and the image plane, so that points are between 1 and 1.5 ribbon widths above the surface. Only where
    the surface is seen almost edge-on, they are lower; see `MAX_OFFSET_STEEPNESS`.

    Parameters
    ----------
    strokes : Strokes
    camera : Camera
    width : float
        Width of the ribbons, in pixels of the camera.

    Returns
    -------
    (n, 3) float64 ndarray
        Offset points in world space.
    """
    to_camera = camera.view_directions(strokes.points)
    facing = np.abs(dot(strokes.normal, to_camera))
    steepness = np.sqrt(np.maximum(1 - facing**2, 0)) / np.maximum(facing, 1 / MAX_OFFSET_STEEPNESS)
    offset = width * (1 + steepness) * pixel_size(strokes.points, camera)
    return strokes.points + offset[:, None] * to_camera


def attach(strokes: Strokes, height: np.ndarray, instance: MeshInstance) -> SurfaceAttachment:
    """Return the positions of the points of strokes relative to the surface of an instance.

    Parameters
    ----------
    strokes : Strokes
    height : (n,) float64 ndarray
        Heights of the points above the surface, in world space.
    instance : MeshInstance
        The instance of all strokes.
    """
    corners = instance.surface.triangle_vertex[strokes.triangle]
    a, b, c = instance.world_points()[corners].transpose(1, 0, 2)
    u, v, offset = b - a, c - a, strokes.points - a
    # Find the nearest point of the plane by least squares.
    uu, uv, vv, pu, pv = dot(u, u), dot(u, v), dot(v, v), dot(offset, u), dot(offset, v)
    determinant = uu * vv - uv * uv
    is_flat = determinant <= 0
    determinant = np.where(is_flat, 1.0, determinant)
    along_u, along_v = (vv * pu - uv * pv) / determinant, (uu * pv - uv * pu) / determinant
    weights = np.stack([1 - along_u - along_v, along_u, along_v], axis=1)
    weights[is_flat] = 1 / 3
    return SurfaceAttachment(corners.astype(np.int32), weights, height)

"""Drawings in strokes as files and as curves in world space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.cache import BAKE_CACHE
from ..core.progress import progress
from ..field.frames import dot
from ..field.up_axis import UP_AXIS_BY_SUFFIX, UP_AXIS_MATRIX
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from .pipeline import LightSource, StrokeDrawing, draw_instances
from .polyline_files import polyline_file, simplify_strokes
from .stroke_set import Strokes
from .style import StrokeStyle
from .svg import Pen, svg_text
from .visibility import pixel_size

#: Share of the time after which all strokes are drawn, and label of the progress from then on.
OUTPUT_START, OUTPUT_LABEL = 0.95, "storing the strokes"

#: Largest tangent of the angle between the normal and the direction to the camera for which the
#: offset toward the camera grows.
MAX_OFFSET_STEEPNESS = 12.0


class SurfaceAttachment(NamedTuple):
    """Where n points of curves are on a mesh, so that they can follow it when it deforms.

    Attributes
    ----------
    vertices : (n, 3) int32 ndarray
        Vertices of the triangles.
    weights : (n, 3) float64 ndarray
        Barycentric coordinates.
    height : (n,) float64 ndarray
        Height above the triangle along the normals of its vertices, in world space.
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
        Simplified strokes; n points in all.
    instance_index : (S,) int32 ndarray
        As in `StrokeDrawing`.
    points : (n, 3) float64 ndarray
        Points of the curves in world space, offset from the surface.
    radius : (n,) float64 ndarray
        Radii in world space.
    colors : list of str
        The color of each family.
    attachment : SurfaceAttachment or None
        Where the points are on their surface, if they are to follow it.
    """

    strokes: Strokes
    instance_index: np.ndarray
    points: np.ndarray
    radius: np.ndarray
    colors: list[str]
    attachment: SurfaceAttachment | None = None


def drawing_file(
    suffix: str,
    instances: Sequence[MeshInstance],
    camera: Camera,
    style: StrokeStyle,
    pen: Pen,
    lights: Sequence[LightSource],
) -> tuple[StrokeDrawing, bytes]:
    """Return a drawing of mesh instances in strokes, and the contents of its file.

    Parameters
    ----------
    suffix : str
        Suffix of the file: .svg, or one of `polyline_file`.
    instances, camera, style, lights
        As for `draw_instances`.
    pen : Pen
    """
    is_svg = suffix == ".svg"
    drawing = _draw(instances, camera, style, lights, clip_to_frame=is_svg)
    with progress(OUTPUT_START, 1.0, OUTPUT_LABEL):
        if is_svg:
            return drawing, svg_text(drawing.strokes, camera, pen, drawing.marks).encode()
        matrix = UP_AXIS_MATRIX[UP_AXIS_BY_SUFFIX.get(suffix, "z")].T
        return drawing, polyline_file(suffix, drawing.strokes, camera, pen, matrix)


def drawing_curves(
    instances: Sequence[MeshInstance],
    camera: Camera,
    style: StrokeStyle,
    pen: Pen,
    lights: Sequence[LightSource],
    follows: MeshInstance | None,
) -> tuple[StrokeDrawing, StrokeGeometry]:
    """Return a drawing of mesh instances in strokes, and its curves; see `stroke_geometry`."""
    drawing = _draw(instances, camera, style, lights, clip_to_frame=False)
    with progress(OUTPUT_START, 1.0, OUTPUT_LABEL):
        return drawing, stroke_geometry(drawing, camera, pen, follows)


def _draw(
    instances: Sequence[MeshInstance],
    camera: Camera,
    style: StrokeStyle,
    lights: Sequence[LightSource],
    *,
    clip_to_frame: bool,
) -> StrokeDrawing:
    """Draw with the cache of bakes of this process."""
    with progress(0.0, OUTPUT_START):
        drawing = draw_instances(
            instances, camera, style, lights=lights, clip_to_frame=clip_to_frame, cache=BAKE_CACHE
        )
    BAKE_CACHE.evict_over_limit()
    return drawing


def stroke_geometry(
    drawing: StrokeDrawing, camera: Camera, pen: Pen, follows: MeshInstance | None = None
) -> StrokeGeometry:
    """Return the curves of a drawing.

    Parameters
    ----------
    drawing : StrokeDrawing
    camera : Camera
    pen : Pen
        Its width is in pixels of the camera.
    follows : MeshInstance, optional
        The instance of all strokes, if they are to follow its surface.
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
    are then in front of the surface. The offset grows with the angle between the surface and the
    image plane, but the height above the surface hardly does.

    Parameters
    ----------
    strokes : Strokes
    camera : Camera
    width : float
        Width of the ribbons in pixels at the depth of each point.

    Returns
    -------
    (n, 3) float64 ndarray
        World space.
    """
    to_camera = camera.view_directions(strokes.points)
    facing = np.abs(dot(strokes.normal, to_camera))
    steepness = np.sqrt(np.maximum(1 - facing**2, 0)) / np.maximum(facing, 1 / MAX_OFFSET_STEEPNESS)
    offset = width * (1 + steepness) * pixel_size(strokes.points, camera)
    return strokes.points + offset[:, None] * to_camera


def attach(strokes: Strokes, height: np.ndarray, instance: MeshInstance) -> SurfaceAttachment:
    """Return where the points of strokes are on the surface of an instance.

    Parameters
    ----------
    strokes : Strokes
    height : (n,) float64 ndarray
        Heights of the points above the surface, in world space.
    instance : MeshInstance
        The instance of all strokes.
    """
    surface = instance.surface
    corners = surface.triangle_vertex[strokes.triangle]
    a, b, c = instance.world_points()[corners].transpose(1, 0, 2)
    u, v, offset = b - a, c - a, strokes.points - a
    # Least squares: the nearest point of the plane.
    uu, uv, vv, pu, pv = dot(u, u), dot(u, v), dot(v, v), dot(offset, u), dot(offset, v)
    determinant = uu * vv - uv * uv
    is_flat = determinant <= 0
    determinant = np.where(is_flat, 1.0, determinant)
    along_u, along_v = (vv * pu - uv * pv) / determinant, (uu * pv - uv * pu) / determinant
    weights = np.stack([1 - along_u - along_v, along_u, along_v], axis=1)
    weights[is_flat] = 1 / 3
    return SurfaceAttachment(corners.astype(np.int32), weights, height)

"""Strokes on a mesh instance, from its field to their families, and their files."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rosy_addon.field.generate import axis_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.line_drawing.families import label_families
from rosy_addon.line_drawing.spacing import CornerSpacing
from rosy_addon.line_drawing.stroke_set import Strokes
from rosy_addon.line_drawing.svg import svg_text
from rosy_addon.line_drawing.tangent_mesh import CREASE_ANGLE, build_tangent_mesh
from rosy_addon.line_drawing.trace import trace_on_mesh
from rosy_addon.line_drawing.visibility import clip_to_visible, project_to_pixels, rasterize_depth
from rosy_addon.projection.camera import Camera
from rosy_addon.projection.gbuffer import MeshInstance


def trace_strokes(
    instance: MeshInstance, spacing: np.ndarray | float, *, cross_creases: bool = False
) -> Strokes:
    """Cover a mesh instance with evenly spaced strokes along its field.

    `spacing` is one value in world space, or (V,) values at vertices or (T, 3) at corners of triangles.
    """
    mesh = build_tangent_mesh(instance, crease_angle=None if cross_creases else CREASE_ANGLE)
    corners, values = instance.surface.triangle_vertex, np.asarray(spacing, dtype=np.float64)
    values = np.broadcast_to(values[corners] if values.ndim == 1 else values, corners.shape)
    strokes = trace_on_mesh(mesh, CornerSpacing(values), instance.surface.name)
    return label_families(strokes, mesh)


def visible_strokes(strokes: Strokes, instances: Sequence[MeshInstance], camera: Camera) -> Strokes:
    """Return the parts of strokes that are in the frame and not hidden by mesh instances."""
    return clip_to_visible(strokes, camera, rasterize_depth(instances, camera))


def pixel_lengths(strokes: Strokes, camera: Camera) -> np.ndarray:
    """Return the (S,) lengths of strokes in pixels."""
    pixels, _ = project_to_pixels(strokes.points, camera)
    segment_length = np.hypot(*np.diff(pixels, axis=0).T)
    same = np.diff(strokes.stroke) == 0
    return np.bincount(strokes.stroke[1:][same], segment_length[same])


def write_svg(path: Path, *drawing: object) -> None:
    """Write a file; the other parameters are those of `svg_text`."""
    path.write_text(svg_text(*drawing), encoding="utf-8")


def turned(surface, degree, angle=0.0):
    """Return an instance with a field at an angle to the first edges of its faces."""
    x, y = surface.face_frames
    field = RosyField(degree, np.cos(angle) * x + np.sin(angle) * y)
    return MeshInstance(surface, np.eye(4), field)


def latitudes(surface):
    """Return an instance with lines that run around the z axis."""
    around = np.cross(surface.face_normal, axis_field(surface, 2).vectors)
    return MeshInstance(surface, np.eye(4), RosyField(2, around))


def planar_strokes(points, directions, spacing):
    """Return strokes in a plane from (S, n, 3) points and (S n, 3) directions."""
    stroke_count, point_count = len(points), points.shape[0] * points.shape[1]
    return Strokes(
        points=points.reshape(-1, 3),
        start=np.arange(stroke_count + 1) * points.shape[1],
        family=np.zeros(stroke_count, dtype=np.int32),
        names=("family 1",),
        face=np.zeros(point_count, dtype=np.int32),
        triangle=np.zeros(point_count, dtype=np.int32),
        weights=np.full((point_count, 3), 1 / 3),
        normal=np.tile((0, 0, 1.0), (point_count, 1)),
        member=directions,
        spacing=np.full(point_count, spacing),
        width=np.ones(point_count),
        closed=np.zeros(stroke_count, dtype=bool),
    )

"""Strokes on a mesh instance, from its field to their families, and their files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rosy_addon.line_drawing.families import label_families
from rosy_addon.line_drawing.lateral_neighbors import SeparationRules
from rosy_addon.line_drawing.spacing import CornerSpacing
from rosy_addon.line_drawing.stroke_set import Strokes
from rosy_addon.line_drawing.svg import svg_text
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.line_drawing.trace import trace_on_mesh
from rosy_addon.line_drawing.visibility import clip_to_visible, rasterize_depth
from rosy_addon.projection.camera import Camera
from rosy_addon.projection.gbuffer import MeshInstance


def trace_strokes(
    instance: MeshInstance,
    spacing: np.ndarray | float,
    *,
    rules: SeparationRules | None = None,
    cross_creases: bool = False,
) -> Strokes:
    """Cover a mesh instance with evenly spaced strokes along its field.

    `spacing` is one value in world space, or (V,) values at vertices or (T, 3) at corners of triangles.
    """
    mesh = build_tangent_mesh(instance, cross_creases=cross_creases)
    values = np.asarray(spacing, dtype=np.float64)
    if values.ndim == 1:
        values = values[mesh.triangle_vertex]
    values = np.broadcast_to(values, mesh.triangle_vertex.shape)
    strokes = trace_on_mesh(mesh, CornerSpacing(values), rules, instance.surface.name)
    return label_families(strokes, mesh)


def visible_strokes(strokes: Strokes, instances: Sequence[MeshInstance], camera: Camera) -> Strokes:
    """Return the parts of strokes that are in the frame and not hidden by mesh instances."""
    return clip_to_visible(strokes, camera, rasterize_depth(instances, camera))


def write_svg(path: Path, *drawing: object) -> None:
    """Write a file; the other parameters are those of `svg_text`."""
    path.write_text(svg_text(*drawing), encoding="utf-8")

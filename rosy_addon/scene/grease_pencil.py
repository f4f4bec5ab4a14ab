"""Strokes as Grease Pencil data, for Blender 4.3 and later and for earlier versions."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ..core.color import from_hex, to_linear
from ..line_drawing.drawing_outputs import StrokeGeometry
from ..line_drawing.outline import OUTLINE_KINDS
from .compat import has_grease_pencil_drawings
from .curves import RegisterDatablock, set_attribute

#: Name of the layer for outlines: silhouettes, creases and borders.
OUTLINE_LAYER = "Outline"

#: Before Blender 4.3, a stroke has an integer line width: its units for one unit of radius, and its
#: largest value.
LEGACY_WIDTH_PER_UNIT = 2000
MAX_LEGACY_WIDTH = 1000


def new_grease_pencil(
    name: str, geometry: StrokeGeometry, frame: int, register: RegisterDatablock
) -> bpy.types.ID:
    """Create Grease Pencil data from strokes, with one layer and one material for each family.

    All kinds of outline share one layer.

    Parameters
    ----------
    name : str
    geometry : StrokeGeometry
    frame : int
        The frame from which on the strokes are visible.
    register : callable
        Called with each new datablock and its name.
    """
    collection = getattr(bpy.data, "grease_pencils_v3", bpy.data.grease_pencils)
    data = collection.new(name)
    register(data, name)
    data.stroke_depth_order = "3D"
    add_strokes = _add_to_drawing if has_grease_pencil_drawings() else _add_to_frame
    strokes = geometry.strokes
    layer_names = [
        OUTLINE_LAYER if family_name in OUTLINE_KINDS else family_name.capitalize()
        for family_name in strokes.names
    ]
    for material_index, layer_name in enumerate(dict.fromkeys(layer_names)):
        material = _new_material(
            f"RoSy {layer_name}", geometry.colors[layer_names.index(layer_name)]
        )
        register(material, f"RoSy {layer_name}")
        data.materials.append(material)
        layer = data.layers.new(layer_name)
        layer.use_lights = False
        stroke_mask = (np.array(layer_names) == layer_name)[strokes.family]
        layer_frame = layer.frames.new(frame)
        if not stroke_mask.any():
            continue
        point_mask = np.repeat(stroke_mask, np.diff(strokes.start))
        add_strokes(
            layer_frame,
            np.diff(strokes.start)[stroke_mask],
            geometry.points[point_mask].astype(np.float32),
            geometry.radius[point_mask].astype(np.float32),
            np.ones(int(point_mask.sum()), dtype=np.float32),
            material_index,
        )
    return data


def _add_to_drawing(
    frame: Any,
    point_counts: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    opacity: np.ndarray,
    material_index: int,
) -> None:
    """Add strokes to a frame in Blender 4.3 and later."""
    drawing = frame.drawing
    drawing.add_strokes(point_counts.tolist())
    set_attribute(drawing, "position", "FLOAT_VECTOR", "POINT", points)
    set_attribute(drawing, "radius", "FLOAT", "POINT", radius)
    set_attribute(drawing, "opacity", "FLOAT", "POINT", opacity)
    materials = np.full(len(point_counts), material_index)
    set_attribute(drawing, "material_index", "INT", "CURVE", materials)
    drawing.tag_positions_changed()


def _add_to_frame(
    frame: Any,
    point_counts: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    opacity: np.ndarray,
    material_index: int,
) -> None:
    """Add strokes to a frame before Blender 4.3.

    There, the width at a point is the integer width of the stroke times the pressure at the point.
    """
    line_width = int(np.clip(np.ceil(LEGACY_WIDTH_PER_UNIT * radius.max()), 1, MAX_LEGACY_WIDTH))
    ends = np.cumsum(point_counts)
    for start, end in zip((ends - point_counts).tolist(), ends.tolist(), strict=True):
        stroke = frame.strokes.new()
        stroke.points.add(end - start)
        stroke.points.foreach_set("co", points[start:end].ravel())
        stroke.points.foreach_set(
            "pressure", radius[start:end] * (LEGACY_WIDTH_PER_UNIT / line_width)
        )
        stroke.points.foreach_set("strength", opacity[start:end])
        stroke.line_width, stroke.material_index = line_width, material_index


def _new_material(name: str, color: str) -> bpy.types.Material:
    """Create a Grease Pencil material with a hex color."""
    material = bpy.data.materials.new(name)
    bpy.data.materials.create_gpencil_data(material)
    material.grease_pencil.color = (*to_linear(from_hex(color)).tolist(), 1.0)
    return material

"""Strokes as Grease Pencil: that of Blender 4.3 and later, and that before."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ..compositor.colour import from_hex, to_linear
from ..strokes.draw import Lines
from ..strokes.outline import KINDS
from .capabilities import has_drawings
from .curves import Keep

#: The layer of silhouettes, creases and borders.
OUTLINE = "Outline"

#: Widths that the earlier Grease Pencil keeps for a stroke as a whole number, for a unit of radius.
PER_UNIT = 2000
WIDEST = 1000


def new_pencil(name: str, lines: Lines, frame: int, keep: Keep) -> bpy.types.ID:
    """Grease Pencil data with a layer, and a material, for each family.

    Parameters
    ----------
    name : str
    lines : Lines
    frame : int
        From which on they are there.
    keep : callable
        Is given each datablock that is made, and its name.
    """
    store = getattr(bpy.data, "grease_pencils_v3", bpy.data.grease_pencils)
    data = store.new(name)
    keep(data, name)
    data.stroke_depth_order = "3D"
    add = _add_to_drawing if has_drawings() else _add_to_frame
    strokes = lines.strokes
    titles = [OUTLINE if name in KINDS else name.capitalize() for name in strokes.names]
    for number, title in enumerate(dict.fromkeys(titles)):
        material = _new_material(f"RoSy {title}", lines.colours[titles.index(title)])
        keep(material, f"RoSy {title}")
        data.materials.append(material)
        layer = data.layers.new(title)
        layer.use_lights = False
        chosen = (np.array(titles) == title)[strokes.family]
        drawn = layer.frames.new(frame)
        if not chosen.any():
            continue
        point = np.repeat(chosen, np.diff(strokes.start))
        add(
            drawn,
            np.diff(strokes.start)[chosen],
            lines.points[point].astype(np.float32),
            lines.radius[point].astype(np.float32),
            strokes.opacity[point].astype(np.float32),
            number,
        )
    return data


def _add_to_drawing(
    frame: Any,
    sizes: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    opacity: np.ndarray,
    material: int,
) -> None:
    """Of Blender 4.3 and later."""
    drawing = frame.drawing
    drawing.add_strokes(sizes.tolist())
    for name, kind, domain, key, values in (
        ("position", "FLOAT_VECTOR", "POINT", "vector", points),
        ("radius", "FLOAT", "POINT", "value", radius),
        ("opacity", "FLOAT", "POINT", "value", opacity),
        ("material_index", "INT", "CURVE", "value", np.full(len(sizes), material, np.int32)),
    ):
        attribute = drawing.attributes.get(name) or drawing.attributes.new(name, kind, domain)
        attribute.data.foreach_set(key, values.ravel())
    drawing.tag_positions_changed()


def _add_to_frame(
    frame: Any,
    sizes: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    opacity: np.ndarray,
    material: int,
) -> None:
    """Before Blender 4.3: width is a whole number for the stroke, times the pressure at a point."""
    widest = int(np.clip(np.ceil(PER_UNIT * radius.max()), 1, WIDEST))
    ends = np.cumsum(sizes)
    for start, end in zip((ends - sizes).tolist(), ends.tolist(), strict=True):
        stroke = frame.strokes.new()
        stroke.points.add(end - start)
        stroke.points.foreach_set("co", points[start:end].ravel())
        stroke.points.foreach_set("pressure", radius[start:end] * (PER_UNIT / widest))
        stroke.points.foreach_set("strength", opacity[start:end])
        stroke.line_width, stroke.material_index = widest, material


def _new_material(name: str, colour: str) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    bpy.data.materials.create_gpencil_data(material)
    material.grease_pencil.color = (*to_linear(from_hex(colour)).tolist(), 1.0)
    return material

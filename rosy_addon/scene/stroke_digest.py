"""A digest of the strokes of an object, which shows whether the user has edited them."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ..cache import content_hash
from .compat import has_grease_pencil_drawings
from .curves import INK_ATTRIBUTE
from .meshes import read_collection

#: Attributes that make up a stroke. Others, such as selections, may change without an edit.
STROKE_ATTRIBUTES = ("position", "radius", "opacity", "material_index", INK_ATTRIBUTE)

#: Properties of the points of a stroke before Blender 4.3, with their numbers of values.
LEGACY_POINT_PROPERTIES = {"co": 3, "pressure": 1, "strength": 1}

#: Names of the values in the items of attributes, and their numbers, by data type.
_VALUES_BY_TYPE = {"FLOAT_VECTOR": ("vector", 3), "FLOAT_COLOR": ("color", 4)}


def stroke_digest(data: bpy.types.ID) -> str:
    """Return a digest of the strokes in Grease Pencil or Curves data.

    It depends on layers, points, widths and inks, and not on what only Blender itself changes.
    """
    return content_hash(*_parts(data)).hex()


def _parts(data: bpy.types.ID) -> list[object]:
    """Return everything that the digest depends on."""
    if isinstance(data, bpy.types.Curves):
        return _attribute_parts(data.attributes, data.curve_offset_data)
    styles = [None if material is None else material.grease_pencil for material in data.materials]
    parts: list[object] = [None if style is None else tuple(style.color) for style in styles]
    for layer in data.layers:
        parts.append(layer.name if has_grease_pencil_drawings() else layer.info)
        for frame in layer.frames:
            parts.append(frame.frame_number)
            if has_grease_pencil_drawings():
                parts += _attribute_parts(frame.drawing.attributes, frame.drawing.curve_offsets)
            else:
                parts += _legacy_parts(frame)
    return parts


def _attribute_parts(attributes: Any, offsets: Any) -> list[object]:
    """Return the values of `STROKE_ATTRIBUTES`, and where each stroke starts."""
    position = attributes.get("position")
    if position is None or not len(position.data):  # the offsets of an empty drawing are unreadable
        return []
    parts: list[object] = [read_collection(offsets, "value", np.float32)]
    for name in STROKE_ATTRIBUTES:
        attribute = attributes.get(name)
        if attribute is not None:
            key, columns = _VALUES_BY_TYPE.get(attribute.data_type, ("value", 1))
            parts += [name, read_collection(attribute.data, key, np.float32, columns)]
    return parts


def _legacy_parts(frame: Any) -> list[object]:
    """Return the strokes of a frame before Blender 4.3."""
    parts: list[object] = []
    for stroke in frame.strokes:
        parts.append((stroke.line_width, stroke.material_index))
        for name, columns in LEGACY_POINT_PROPERTIES.items():
            parts.append(read_collection(stroke.points, name, np.float32, columns))
    return parts

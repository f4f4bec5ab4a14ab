"""A digest of the strokes of an object, which shows whether the user has edited them."""

from __future__ import annotations

from collections.abc import Iterator
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


def _parts(data: bpy.types.ID) -> Iterator[object]:
    """Yield everything that the digest depends on."""
    if isinstance(data, bpy.types.Curves):
        yield from _attribute_parts(data.attributes, data.curve_offset_data)
        return
    for material in data.materials:
        style = None if material is None else material.grease_pencil
        yield None if style is None else tuple(style.color)
    for layer in data.layers:
        yield layer.name if has_grease_pencil_drawings() else layer.info
        for frame in layer.frames:
            yield frame.frame_number
            if has_grease_pencil_drawings():
                yield from _attribute_parts(frame.drawing.attributes, frame.drawing.curve_offsets)
            else:
                yield from _legacy_parts(frame)


def _attribute_parts(attributes: Any, offsets: Any) -> Iterator[object]:
    """Yield the values of `STROKE_ATTRIBUTES`, and where each stroke starts."""
    position = attributes.get("position")
    if position is None or not len(position.data):  # the offsets of an empty drawing are unreadable
        return
    yield read_collection(offsets, "value", np.float32)
    for name in STROKE_ATTRIBUTES:
        attribute = attributes.get(name)
        if attribute is not None:
            yield name
            key, columns = _VALUES_BY_TYPE.get(attribute.data_type, ("value", 1))
            yield read_collection(attribute.data, key, np.float32, columns)


def _legacy_parts(frame: Any) -> Iterator[object]:
    """Yield the strokes of a frame before Blender 4.3."""
    for stroke in frame.strokes:
        yield stroke.line_width, stroke.material_index
        for name, columns in LEGACY_POINT_PROPERTIES.items():
            yield read_collection(stroke.points, name, np.float32, columns)

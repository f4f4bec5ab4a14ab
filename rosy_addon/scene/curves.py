"""Strokes as Curves data, with attributes for Geometry Nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from ..core.color import from_hex, to_linear
from ..line_drawing.drawing_outputs import StrokeGeometry
from .node_builder import new_emissive_material
from .surface_strokes import attribute_values

#: Called with each datablock that is created and the name that it should have.
RegisterDatablock = Callable[[bpy.types.ID, str], None]

#: Attribute of the curves: the color of the family, RGBA, linear.
INK_ATTRIBUTE = "ink"

#: Value of Blender's ``curve_type`` attribute for polylines.
POLY_CURVE_TYPE = 1


def new_curves(
    name: str, geometry: StrokeGeometry, frame: int, register: RegisterDatablock
) -> bpy.types.ID:
    """Create Curves data from strokes: polylines with a radius, and a material with the ink colors.

    Parameters
    ----------
    name : str
    geometry : StrokeGeometry
    frame : int
        Not used: curves have no frames. The signature is the same as that of `new_grease_pencil`.
    register : callable
        Called with each new datablock and its name.
    """
    data = bpy.data.hair_curves.new(name)
    register(data, name)
    strokes = geometry.strokes
    data.add_curves(np.diff(strokes.start).tolist())
    colors = np.array([[*to_linear(from_hex(color)), 1.0] for color in geometry.colors])
    set_attribute(data, "position", "FLOAT_VECTOR", "POINT", geometry.points)
    set_attribute(data, "radius", "FLOAT", "POINT", geometry.radius)
    set_attribute(data, "curve_type", "INT8", "CURVE", np.full(len(strokes), POLY_CURVE_TYPE))
    # Blender caches the number of curves of each type when curves are added. If these counts are
    # out of date, it writes past the end of its arrays. Adding no curves updates them.
    data.add_curves([])
    set_attribute(data, "family", "INT", "CURVE", strokes.family)
    set_attribute(data, "object", "INT", "CURVE", geometry.instance_index)
    set_attribute(data, INK_ATTRIBUTE, "FLOAT_COLOR", "CURVE", colors[strokes.family])
    set_attribute(data, "opacity", "FLOAT", "POINT", np.ones(len(geometry.points)))
    set_attribute(data, "spacing", "FLOAT", "POINT", strokes.spacing)
    set_attribute(data, "member", "FLOAT_VECTOR", "POINT", strokes.member)
    set_attribute(data, "surface_normal", "FLOAT_VECTOR", "POINT", strokes.normal)
    set_attribute(data, "face_index", "INT", "POINT", strokes.face)
    if geometry.attachment is not None:
        for key, (data_type, column) in attribute_values(geometry.attachment).items():
            set_attribute(data, key, data_type, "POINT", column)
    material = new_emissive_material(name, INK_ATTRIBUTE)
    register(material, name)
    data.materials.append(material)
    return data


def set_attribute(data: Any, name: str, data_type: str, domain: str, values: np.ndarray) -> None:
    """Write the values of an attribute of Curves or of a drawing, and create it if it is missing."""
    attribute = data.attributes.get(name) or data.attributes.new(name, data_type, domain)
    key = {"FLOAT_VECTOR": "vector", "FLOAT_COLOR": "color"}.get(data_type, "value")
    dtype = {"INT": np.int32, "INT8": np.int8}.get(data_type, np.float32)
    attribute.data.foreach_set(key, np.ascontiguousarray(values, dtype=dtype).ravel())

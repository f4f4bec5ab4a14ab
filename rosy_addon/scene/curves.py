"""Strokes as Curves data, with attributes for Geometry Nodes."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from ..color import from_hex, to_linear
from ..line_drawing.drawing_outputs import StrokeGeometry
from .compat import has_nodes_by_default
from .surface_strokes import attribute_values

#: Called with each datablock that is created and the name that it should have.
RegisterDatablock = Callable[[bpy.types.ID, str], None]

#: Attributes of the points besides position and radius: name and data type.
POINT_ATTRIBUTES = {
    "opacity": "FLOAT",
    "spacing": "FLOAT",
    "member": "FLOAT_VECTOR",
    "surface_normal": "FLOAT_VECTOR",
    "face_index": "INT",
}

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
    _set_attribute(data, "position", "FLOAT_VECTOR", "POINT", geometry.points)
    _set_attribute(data, "radius", "FLOAT", "POINT", geometry.radius)
    _set_attribute(data, "curve_type", "INT8", "CURVE", np.full(len(strokes), POLY_CURVE_TYPE))
    # Blender caches the number of curves of each type when curves are added. If these counts are
    # out of date, it writes past the end of its arrays. Adding no curves updates them.
    data.add_curves([])
    _set_attribute(data, "family", "INT", "CURVE", strokes.family)
    _set_attribute(data, "object", "INT", "CURVE", geometry.instance_index)
    _set_attribute(data, INK_ATTRIBUTE, "FLOAT_COLOR", "CURVE", colors[strokes.family])
    values = {
        "opacity": np.ones(len(geometry.points)),
        "spacing": strokes.spacing,
        "member": strokes.member,
        "surface_normal": strokes.normal,
        "face_index": strokes.face,
    }
    for key, data_type in POINT_ATTRIBUTES.items():
        _set_attribute(data, key, data_type, "POINT", values[key])
    if geometry.places is not None:
        for key, (data_type, column) in attribute_values(geometry.places).items():
            _set_attribute(data, key, data_type, "POINT", column)
    material = _new_material(name)
    register(material, name)
    data.materials.append(material)
    return data


def _set_attribute(
    data: bpy.types.ID, name: str, data_type: str, domain: str, values: np.ndarray
) -> None:
    """Write the values of an attribute, and create it if it is missing."""
    attribute = data.attributes.get(name) or data.attributes.new(name, data_type, domain)
    key = {"FLOAT_VECTOR": "vector", "FLOAT_COLOR": "color"}.get(data_type, "value")
    dtype = {"INT": np.int32, "INT8": np.int8}.get(data_type, np.float32)
    attribute.data.foreach_set(key, np.ascontiguousarray(values, dtype=dtype).ravel())


def _new_material(name: str) -> bpy.types.Material:
    """Create an emissive material with the color of `INK_ATTRIBUTE`."""
    material = bpy.data.materials.new(name)
    if not has_nodes_by_default(material):
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    ink_color = nodes.new("ShaderNodeAttribute")
    ink_color.attribute_name = INK_ATTRIBUTE
    emission = nodes.new("ShaderNodeEmission")
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(ink_color.outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs["Emission"], output.inputs["Surface"])
    ink_color.location, emission.location, output.location = (-400, 0), (-200, 0), (0, 0)
    return material

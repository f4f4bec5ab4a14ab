"""Strokes as a Curves object, with all that is known of them as attributes for Geometry Nodes."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from ..compositor.colour import from_hex, to_linear
from ..strokes.draw import Lines
from .capabilities import can_show_nodes_by_default

#: What is told of each datablock that is made, and the name that it is to have.
Keep = Callable[[bpy.types.ID, str], None]

#: What a point and a stroke carry besides the radius: name, type, domain.
POINT_ATTRIBUTES = {
    "opacity": "FLOAT",
    "spacing": "FLOAT",
    "member": "FLOAT_VECTOR",
    "surface_normal": "FLOAT_VECTOR",
    "face_index": "INT",
}
INK = "ink"

#: The number by which Blender knows polylines among types of curves.
POLY = 1


def new_curves(name: str, lines: Lines, frame: int, keep: Keep) -> bpy.types.ID:
    """Hair curves, polylines with a radius, and a material that shows each family's ink.

    Parameters
    ----------
    name : str
    lines : Lines
    frame : int
        Curves have no frames: they are there at all.
    keep : callable
        Is given each datablock that is made, and its name.
    """
    data = bpy.data.hair_curves.new(name)
    keep(data, name)
    strokes = lines.strokes
    data.add_curves(np.diff(strokes.start).tolist())
    colours = np.array([[*to_linear(from_hex(colour)), 1.0] for colour in lines.colours])
    _set(data, "position", "FLOAT_VECTOR", "POINT", lines.points)
    _set(data, "radius", "FLOAT", "POINT", lines.radius)
    _set(data, "curve_type", "INT8", "CURVE", np.full(len(strokes), POLY))
    # Blender counts the types when curves are added, and writes past its arrays if the counts are
    # of the types before.
    data.add_curves([])
    _set(data, "family", "INT", "CURVE", strokes.family)
    _set(data, "object", "INT", "CURVE", lines.body)
    _set(data, INK, "FLOAT_COLOR", "CURVE", colours[strokes.family])
    values = {
        "opacity": strokes.opacity,
        "spacing": strokes.spacing,
        "member": strokes.member,
        "surface_normal": strokes.normal,
        "face_index": strokes.face,
    }
    for key, kind in POINT_ATTRIBUTES.items():
        _set(data, key, kind, "POINT", values[key])
    material = _new_material(name)
    keep(material, name)
    data.materials.append(material)
    return data


def _set(data: bpy.types.ID, name: str, kind: str, domain: str, values: np.ndarray) -> None:
    attribute = data.attributes.get(name) or data.attributes.new(name, kind, domain)
    key = {"FLOAT_VECTOR": "vector", "FLOAT_COLOR": "color"}.get(kind, "value")
    dtype = {"INT": np.int32, "INT8": np.int8}.get(kind, np.float32)
    attribute.data.foreach_set(key, np.ascontiguousarray(values, dtype=dtype).ravel())


def _new_material(name: str) -> bpy.types.Material:
    """Ink that neither needs light nor gives any away."""
    material = bpy.data.materials.new(name)
    if not can_show_nodes_by_default(material):
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    ink = nodes.new("ShaderNodeAttribute")
    ink.attribute_name = INK
    shine = nodes.new("ShaderNodeEmission")
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(ink.outputs["Color"], shine.inputs["Color"])
    links.new(shine.outputs["Emission"], output.inputs["Surface"])
    ink.location, shine.location, output.location = (-400, 0), (-200, 0), (0, 0)
    return material

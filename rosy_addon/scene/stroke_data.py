"""Convert strokes to data of Blender: Curves with attributes for Geometry Nodes, or Grease Pencil.

A modifier with a node group lets Curves follow the surface that they were drawn on.
"""

from collections.abc import Callable
from functools import partial, reduce
from itertools import pairwise
from typing import Any

import bpy
import numpy as np
from bpy.types import ID, Material, Modifier, Node, NodeSocket, NodeTree, Object

from ..core.color import from_hex, to_linear
from ..field.formats.polygons import offsets_from_sizes
from ..line_drawing.drawing_outputs import StrokeGeometry
from ..line_drawing.outline import OUTLINE_KINDS
from .datablocks import OWNED_TAG, STROKES_TAG
from .meshes import write_attribute
from .node_builder import NodeBuilder, enabled_output, new_emissive_material, new_modifier_group

#: A function that is called with each new datablock and the name that it should have. It returns the datablock.
Register = Callable[[Any, str], Any]

#: Name of the attribute of curves with the color of their family of strokes, linear RGBA.
INK_ATTRIBUTE = "ink"

#: Value of Blender's ``curve_type`` attribute for polylines.
POLY_CURVE_TYPE = 1


def new_curves(name: str, geometry: StrokeGeometry, frame: int, register: Register) -> ID:
    """Create Curves data from strokes: polylines with a radius, and a material with the ink colors.

    Parameters
    ----------
    name : str
    geometry : StrokeGeometry
    frame : int
        Not used, as curves have no frames. It is here because `new_grease_pencil` is called in the same way.
    register : callable
        Called with each new datablock and its name.
    """
    data = register(bpy.data.hair_curves.new(name), name)
    strokes = geometry.strokes
    data.add_curves(np.diff(strokes.start).tolist())
    colors = np.array([[*to_linear(from_hex(color)), 1.0] for color in geometry.colors])
    set_attribute(data, "position", "FLOAT_VECTOR", "POINT", geometry.points)
    set_attribute(data, "radius", "FLOAT", "POINT", geometry.radius)
    set_attribute(data, "curve_type", "INT8", "CURVE", np.full(len(strokes), POLY_CURVE_TYPE))
    # Blender caches the number of curves of each type when curves are added. With outdated counts it writes
    # past the end of its arrays. To add no curves updates the counts.
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
        for key, vertices in zip(VERTEX_ATTRIBUTES, geometry.attachment.vertices.T, strict=True):
            set_attribute(data, key, "INT", "POINT", vertices)
        weights, height = geometry.attachment.weights, geometry.attachment.height
        set_attribute(data, WEIGHTS_ATTRIBUTE, "FLOAT_VECTOR", "POINT", weights)
        set_attribute(data, HEIGHT_ATTRIBUTE, "FLOAT", "POINT", height)
    data.materials.append(register(new_emissive_material(name, INK_ATTRIBUTE), name))
    return data


def set_attribute(data: Any, name: str, data_type: str, domain: str, values: np.ndarray) -> None:
    """Write an attribute of Curves or of a Grease Pencil drawing, and create it if it is missing.

    `values` has one row, or one number, per element of the domain: "POINT" or "CURVE".
    """
    attribute = data.attributes.get(name) or data.attributes.new(name, data_type, domain)
    write_attribute(attribute, values)


#: Name of the Grease Pencil layer for outlines: silhouettes, creases and borders.
OUTLINE_LAYER = "Outline"

#: Before Blender 4.3, a stroke of Grease Pencil has an integer line width. First: the line width of a radius
#: of one Blender unit. Second: the largest line width.
LEGACY_WIDTH_PER_UNIT = 2000
MAX_LEGACY_WIDTH = 1000


def has_grease_pencil_drawings() -> bool:
    """Return whether frames of Grease Pencil have drawings with attributes (Blender 4.3 and later)."""
    return hasattr(bpy.types, "GreasePencilDrawing")


def new_grease_pencil(name: str, geometry: StrokeGeometry, frame: int, register: Register) -> ID:
    """Create Grease Pencil data from strokes, with one layer and one material for each family.

    All kinds of outlines (silhouettes, creases, borders) share one layer.

    Parameters
    ----------
    name : str
    geometry : StrokeGeometry
    frame : int
        First frame at which the strokes are visible.
    register : callable
        Called with each new datablock and its name.
    """
    collection = getattr(bpy.data, "grease_pencils_v3", bpy.data.grease_pencils)
    data = register(collection.new(name), name)
    data.stroke_depth_order = "3D"
    add_strokes = _add_to_drawing if has_grease_pencil_drawings() else _add_to_frame
    strokes = geometry.strokes
    layer_names = [
        OUTLINE_LAYER if name in OUTLINE_KINDS else name.capitalize() for name in strokes.names
    ]
    for material_index, layer_name in enumerate(dict.fromkeys(layer_names)):
        color = geometry.colors[layer_names.index(layer_name)]
        material_name = f"RoSy {layer_name}"
        data.materials.append(register(_new_material(material_name, color), material_name))
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
            material_index,
        )
    return data


def _add_to_drawing(
    frame: Any, counts: np.ndarray, points: np.ndarray, radius: np.ndarray, material_index: int
) -> None:
    """Add strokes to a frame of a Grease Pencil layer, in Blender 4.3 and later.

    Parameters
    ----------
    frame : GreasePencilFrame or GPencilFrame
    counts : (S,) ndarray
        Number of points of each stroke.
    points : (n, 3) float32 ndarray
        The points of all strokes, stroke by stroke; see `StrokeGeometry`.
    radius : (n,) float32 ndarray
        Radius at each point, in Blender units.
    material_index : int
    """
    drawing = frame.drawing
    drawing.add_strokes(counts.tolist())
    set_attribute(drawing, "position", "FLOAT_VECTOR", "POINT", points)
    set_attribute(drawing, "radius", "FLOAT", "POINT", radius)
    set_attribute(drawing, "opacity", "FLOAT", "POINT", np.ones(len(points)))
    materials = np.full(len(counts), material_index)
    set_attribute(drawing, "material_index", "INT", "CURVE", materials)
    drawing.tag_positions_changed()


def _add_to_frame(
    frame: Any, counts: np.ndarray, points: np.ndarray, radius: np.ndarray, material_index: int
) -> None:
    """Add strokes to a frame of a Grease Pencil layer, before Blender 4.3; see `_add_to_drawing`.

    In these versions, the width at a point is the integer width of the stroke times the pressure at the
    point.
    """
    line_width = int(np.clip(np.ceil(LEGACY_WIDTH_PER_UNIT * radius.max()), 1, MAX_LEGACY_WIDTH))
    pressure = radius * (LEGACY_WIDTH_PER_UNIT / line_width)
    for start, end in pairwise(offsets_from_sizes(counts).tolist()):
        stroke = frame.strokes.new()
        stroke.points.add(end - start)
        stroke.points.foreach_set("co", points[start:end].ravel())
        stroke.points.foreach_set("pressure", pressure[start:end])
        stroke.points.foreach_set("strength", np.ones(end - start, dtype=np.float32))
        stroke.line_width, stroke.material_index = line_width, material_index


def _new_material(name: str, color: str) -> Material:
    """Create a Grease Pencil material with a hex color."""
    material = bpy.data.materials.new(name)
    bpy.data.materials.create_gpencil_data(material)
    material.grease_pencil.color = (*to_linear(from_hex(color)).tolist(), 1.0)
    return material


#: Name of the modifier with which strokes follow a surface.
MODIFIER_NAME = "Follow Surface"

#: Names of attributes that attach a point to a triangle of the surface: its three vertices, their barycentric
#: weights, and the height of the point above the triangle.
VERTEX_ATTRIBUTES = ("surface_vertex_0", "surface_vertex_1", "surface_vertex_2")
WEIGHTS_ATTRIBUTE, HEIGHT_ATTRIBUTE = "surface_weights", "surface_height"


def follow_surface(obj: Object, surface: Object, vertex_count: int) -> None:
    """Add a modifier to strokes with which they follow the surface of an object. It replaces an earlier one.

    Parameters
    ----------
    obj : bpy.types.Object
        The strokes: Curves with `VERTEX_ATTRIBUTES`, `WEIGHTS_ATTRIBUTE` and `HEIGHT_ATTRIBUTE`.
    surface : bpy.types.Object
        The object that the strokes were drawn on.
    vertex_count : int
        Number of vertices of the evaluated mesh of `surface`. While the mesh has another number of vertices,
        the strokes stay where they were drawn.
    """
    group = _new_group(f"{obj.name} {MODIFIER_NAME}", surface, vertex_count)
    modifier = _modifier_of(obj)
    if modifier is None:
        modifier = obj.modifiers.new(MODIFIER_NAME, "NODES")
        obj.modifiers.move(obj.modifiers.find(modifier.name), 0)
    old_group, modifier.node_group = modifier.node_group, group
    _delete_unused(old_group)


def stop_following(obj: Object) -> None:
    """Remove the modifier of `follow_surface`, if there is one."""
    modifier = _modifier_of(obj)
    if modifier is not None:
        group = modifier.node_group
        obj.modifiers.remove(modifier)
        _delete_unused(group)


def _modifier_of(obj: Object) -> Modifier | None:
    """Return the modifier of `follow_surface`; None if there is none."""
    for modifier in obj.modifiers:
        group = modifier.node_group if modifier.type == "NODES" else None
        if group is not None and group.get(STROKES_TAG):
            return modifier
    return None


def _delete_unused(group: NodeTree | None) -> None:
    if group is not None and not group.users:
        bpy.data.node_groups.remove(group)


def _new_group(name: str, surface: Object, vertex_count: int) -> NodeTree:
    """Create a node group that moves the points of strokes to their triangles on the evaluated surface."""
    group, build, strokes = new_modifier_group(name)
    group[OWNED_TAG] = group[STROKES_TAG] = True
    info = build("GeometryNodeObjectInfo", {"Object": surface}, transform_space="RELATIVE")
    mesh = info.outputs["Geometry"]
    weights = build("ShaderNodeSeparateXYZ", {0: _named(build, WEIGHTS_ATTRIBUTE, "FLOAT_VECTOR")})
    position = _weighted_mean(build, mesh, "GeometryNodeInputPosition", weights)
    normal = _weighted_mean(build, mesh, "GeometryNodeInputNormal", weights)
    unit_normal = build.vector_math("NORMALIZE", normal)
    height = build.scaled(unit_normal, _named(build, HEIGHT_ATTRIBUTE, "FLOAT"))
    size = build("GeometryNodeAttributeDomainSize", {0: mesh}).outputs["Point Count"]
    inputs = {"A": size, "B": vertex_count}
    is_same = build("FunctionNodeCompare", inputs, data_type="INT", operation="EQUAL")
    place = build.vector_math("ADD", position, height)
    inputs = {"Geometry": strokes, "Selection": is_same.outputs[0], "Position": place}
    moved = build("GeometryNodeSetPosition", inputs)
    build("NodeGroupOutput", {"Geometry": moved.outputs["Geometry"]})
    return group


def _named(build: NodeBuilder, name: str, data_type: str) -> NodeSocket:
    """Add a node that reads a named attribute, and return its output."""
    kind = "GeometryNodeInputNamedAttribute"
    return enabled_output(build(kind, {"Name": name}, data_type=data_type))


def _weighted_mean(build: NodeBuilder, mesh: NodeSocket, kind: str, weights: Node) -> NodeSocket:
    """Add nodes that interpolate a vector of a mesh in the triangle of each point, and return their output.

    `kind` is the type of the node that reads the vector on the mesh, such as "GeometryNodeInputNormal". The
    outputs of the node `weights` are the barycentric coordinates of the point.
    """
    value, terms = build(kind).outputs[0], []
    types = {"data_type": "FLOAT_VECTOR", "domain": "POINT"}
    for name, weight in zip(VERTEX_ATTRIBUTES, weights.outputs, strict=True):
        inputs = {"Geometry": mesh, "Value": value, "Index": _named(build, name, "INT")}
        sample = build("GeometryNodeSampleIndex", inputs, **types)
        terms.append(build.scaled(enabled_output(sample), weight))
    return reduce(partial(build.vector_math, "ADD"), terms)

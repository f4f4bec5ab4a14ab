"""Strokes that follow the surface of an object: attributes of their points, and a node group."""

from __future__ import annotations

import bpy

from ..line_drawing.drawing_outputs import SurfacePoints
from .node_builder import NodeBuilder
from .owned_data import OWNED_TAG, STROKES_TAG

#: Name of the modifier.
MODIFIER_NAME = "Follow Surface"

#: Attributes of the points: the vertices of their triangles, the weights of these, and the height.
VERTEX_ATTRIBUTES = ("surface_vertex_0", "surface_vertex_1", "surface_vertex_2")
WEIGHTS_ATTRIBUTE, HEIGHT_ATTRIBUTE = "surface_weights", "surface_height"


def attribute_values(places: SurfacePoints) -> dict[str, tuple[str, object]]:
    """Return the data types and values of the attributes of the points, by their names."""
    values: dict[str, tuple[str, object]] = {
        name: ("INT", places.vertices[:, index]) for index, name in enumerate(VERTEX_ATTRIBUTES)
    }
    values[WEIGHTS_ATTRIBUTE] = ("FLOAT_VECTOR", places.weights)
    values[HEIGHT_ATTRIBUTE] = ("FLOAT", places.height)
    return values


def follow_surface(obj: bpy.types.Object, surface: bpy.types.Object, vertex_count: int) -> None:
    """Let strokes follow the surface of an object by a modifier. An older one is replaced.

    Parameters
    ----------
    obj : bpy.types.Object
        Curves with the attributes of `attribute_values`.
    surface : bpy.types.Object
        The object that the strokes were drawn on.
    vertex_count : int
        Number of vertices of its evaluated mesh. If it changes, the strokes stay where they are.
    """
    group = _new_group(f"{obj.name} {MODIFIER_NAME}", surface, vertex_count)
    modifier = _modifier_of(obj)
    if modifier is None:
        modifier = obj.modifiers.new(MODIFIER_NAME, "NODES")
        obj.modifiers.move(obj.modifiers.find(modifier.name), 0)
    old_group, modifier.node_group = modifier.node_group, group
    _delete_unused(old_group)


def stop_following(obj: bpy.types.Object) -> None:
    """Remove the modifier of `follow_surface`, if there is one."""
    modifier = _modifier_of(obj)
    if modifier is not None:
        group = modifier.node_group
        obj.modifiers.remove(modifier)
        _delete_unused(group)


def _modifier_of(obj: bpy.types.Object) -> bpy.types.Modifier | None:
    """Return the modifier of `follow_surface`; None if there is none."""
    for modifier in obj.modifiers:
        group = modifier.node_group if modifier.type == "NODES" else None
        if group is not None and group.get(STROKES_TAG):
            return modifier
    return None


def _delete_unused(group: bpy.types.NodeTree | None) -> None:
    if group is not None and not group.users:
        bpy.data.node_groups.remove(group)


def _new_group(name: str, surface: bpy.types.Object, vertex_count: int) -> bpy.types.NodeTree:
    """Create the node group, which moves points to their places on the evaluated surface."""
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group[OWNED_TAG] = group[STROKES_TAG] = True
    group.is_modifier = True
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    build, links = NodeBuilder(group), group.links
    strokes = build("NodeGroupInput").outputs["Geometry"]
    info = build("GeometryNodeObjectInfo", transform_space="RELATIVE")
    info.inputs["Object"].default_value = surface
    mesh = info.outputs["Geometry"]
    weights = build("ShaderNodeSeparateXYZ")
    links.new(_named(build, WEIGHTS_ATTRIBUTE, "FLOAT_VECTOR"), weights.inputs[0])
    position, normal = (
        _weighted_mean(build, mesh, build(kind).outputs[0], weights)
        for kind in ("GeometryNodeInputPosition", "GeometryNodeInputNormal")
    )
    unit_normal = build("ShaderNodeVectorMath", operation="NORMALIZE")
    links.new(normal, unit_normal.inputs[0])
    height = build("ShaderNodeVectorMath", operation="SCALE")
    links.new(unit_normal.outputs[0], height.inputs[0])
    links.new(_named(build, HEIGHT_ATTRIBUTE, "FLOAT"), height.inputs["Scale"])
    size = build("GeometryNodeAttributeDomainSize")
    links.new(mesh, size.inputs[0])
    is_same = build("FunctionNodeCompare", data_type="INT", operation="EQUAL")
    first, second = (socket for socket in is_same.inputs if socket.enabled)
    links.new(size.outputs["Point Count"], first)
    second.default_value = vertex_count
    moved = build("GeometryNodeSetPosition")
    links.new(strokes, moved.inputs["Geometry"])
    links.new(is_same.outputs[0], moved.inputs["Selection"])
    links.new(_vector(build, "ADD", position, height.outputs[0]), moved.inputs["Position"])
    links.new(moved.outputs["Geometry"], build("NodeGroupOutput").inputs["Geometry"])
    return group


def _vector(
    build: NodeBuilder, operation: str, a: bpy.types.NodeSocket, b: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    """Add a vector math node, and return its output."""
    node = build("ShaderNodeVectorMath", operation=operation)
    build.tree.links.new(a, node.inputs[0])
    build.tree.links.new(b, node.inputs[1])
    return node.outputs[0]


def _named(build: NodeBuilder, name: str, data_type: str) -> bpy.types.NodeSocket:
    """Add a node that reads an attribute of the points, and return its output."""
    node = build("GeometryNodeInputNamedAttribute", data_type=data_type)
    node.inputs["Name"].default_value = name
    return next(socket for socket in node.outputs if socket.enabled)


def _weighted_mean(
    build: NodeBuilder,
    mesh: bpy.types.NodeSocket,
    value: bpy.types.NodeSocket,
    weights: bpy.types.Node,
) -> bpy.types.NodeSocket:
    """Add nodes that interpolate a vector of the vertices of the triangle of a point."""
    links, total = build.tree.links, None
    for name, weight in zip(VERTEX_ATTRIBUTES, weights.outputs, strict=True):
        sample = build("GeometryNodeSampleIndex", data_type="FLOAT_VECTOR", domain="POINT")
        links.new(mesh, sample.inputs["Geometry"])
        links.new(value, next(s for s in sample.inputs if s.name == "Value" and s.enabled))
        links.new(_named(build, name, "INT"), sample.inputs["Index"])
        term = build("ShaderNodeVectorMath", operation="SCALE")
        links.new(next(socket for socket in sample.outputs if socket.enabled), term.inputs[0])
        links.new(weight, term.inputs["Scale"])
        total = term.outputs[0] if total is None else _vector(build, "ADD", total, term.outputs[0])
    return total

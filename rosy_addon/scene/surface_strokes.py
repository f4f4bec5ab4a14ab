"""Strokes that follow the surface of an object: attributes of their points, and a node group."""

from __future__ import annotations

from functools import partial, reduce

import bpy

from ..line_drawing.drawing_outputs import SurfaceAttachment
from .node_builder import NodeBuilder, enabled_output, new_modifier_group
from .owned_data import OWNED_TAG, STROKES_TAG

#: Name of the modifier.
MODIFIER_NAME = "Follow Surface"

#: Attributes of the points: the vertices of their triangles, the weights of these, and the height.
VERTEX_ATTRIBUTES = ("surface_vertex_0", "surface_vertex_1", "surface_vertex_2")
WEIGHTS_ATTRIBUTE, HEIGHT_ATTRIBUTE = "surface_weights", "surface_height"


def attribute_values(attachment: SurfaceAttachment) -> dict[str, tuple[str, object]]:
    """Return the data types and values of the attributes of the points, by their names."""
    values: dict[str, tuple[str, object]] = {
        name: ("INT", attachment.vertices[:, index]) for index, name in enumerate(VERTEX_ATTRIBUTES)
    }
    values[WEIGHTS_ATTRIBUTE] = ("FLOAT_VECTOR", attachment.weights)
    values[HEIGHT_ATTRIBUTE] = ("FLOAT", attachment.height)
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
    group, build, strokes = new_modifier_group(name)
    group[OWNED_TAG] = group[STROKES_TAG] = True
    info = build("GeometryNodeObjectInfo", {"Object": surface}, transform_space="RELATIVE")
    mesh = info.outputs["Geometry"]
    weights = build("ShaderNodeSeparateXYZ", {0: _named(build, WEIGHTS_ATTRIBUTE, "FLOAT_VECTOR")})
    position, normal = (
        _weighted_mean(build, mesh, build(kind).outputs[0], weights)
        for kind in ("GeometryNodeInputPosition", "GeometryNodeInputNormal")
    )
    unit_normal = build.vector_math("NORMALIZE", normal)
    height = build.scaled(unit_normal, _named(build, HEIGHT_ATTRIBUTE, "FLOAT"))
    size = build("GeometryNodeAttributeDomainSize", {0: mesh}).outputs["Point Count"]
    inputs = {"A": size, "B": vertex_count}
    is_same = build("FunctionNodeCompare", inputs, data_type="INT", operation="EQUAL")
    moved = build(
        "GeometryNodeSetPosition",
        {
            "Geometry": strokes,
            "Selection": is_same.outputs[0],
            "Position": build.vector_math("ADD", position, height),
        },
    )
    build("NodeGroupOutput", {"Geometry": moved.outputs["Geometry"]})
    return group


def _named(build: NodeBuilder, name: str, data_type: str) -> bpy.types.NodeSocket:
    """Add a node that reads an attribute of the points, and return its output."""
    kind = "GeometryNodeInputNamedAttribute"
    return enabled_output(build(kind, {"Name": name}, data_type=data_type))


def _weighted_mean(
    build: NodeBuilder,
    mesh: bpy.types.NodeSocket,
    value: bpy.types.NodeSocket,
    weights: bpy.types.Node,
) -> bpy.types.NodeSocket:
    """Add nodes that interpolate a vector of the vertices of the triangle of a point."""
    terms = []
    for name, weight in zip(VERTEX_ATTRIBUTES, weights.outputs, strict=True):
        inputs = {"Geometry": mesh, "Value": value, "Index": _named(build, name, "INT")}
        kind = "GeometryNodeSampleIndex"
        sample = build(kind, inputs, data_type="FLOAT_VECTOR", domain="POINT")
        terms.append(build.scaled(enabled_output(sample), weight))
    return reduce(partial(build.vector_math, "ADD"), terms)

"""The nodes that put a picture on objects: one material a camera, one modifier an object."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from .capabilities import can_show_nodes_by_default
from .images import NEUTRAL

#: Point attribute: clip-space (x, y, w) of each vertex, as the baking camera saw it.
PROJECTION = "rosy_projection"


def new_material(
    name: str,
    image: bpy.types.Image,
    view_projection: np.ndarray,
    *,
    window: bool = False,
    emission: float = 1.0,
    diffuse: float = 0.0,
) -> bpy.types.Material:
    """A material that shows a picture, the same in Cycles and EEVEE.

    Where a pixel of the picture belongs is told by the attribute `PROJECTION`; things without it,
    such as instances that share a mesh but not a place, go by where they are in the world. Neutral
    grey is shown outside the frame.

    Parameters
    ----------
    name : str
    image : bpy.types.Image
    view_projection : (4, 4) ndarray
        World to clip space.
    window : bool
        Let the picture fill the frame of whatever camera looks, instead.
    emission, diffuse : float
        How much of the picture is sent out, and how much of the scene's light it reflects.
    """
    material = bpy.data.materials.new(name)
    if not can_show_nodes_by_default(material):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    build = _Builder(tree)
    picture = build("ShaderNodeTexImage", image=image, interpolation="Closest", extension="EXTEND")
    if window:
        tree.links.new(build("ShaderNodeTexCoord").outputs["Window"], picture.inputs["Vector"])
        colour = picture.outputs["Color"]
    else:
        clip = _clip_position(build, view_projection)
        x, y, w = (clip.outputs[axis] for axis in "XYZ")
        widest = build.math("MAXIMUM", build.math("ABSOLUTE", x), build.math("ABSOLUTE", y))
        place = build("ShaderNodeCombineXYZ")
        for axis, value in (("X", x), ("Y", y)):
            ratio = build.math("DIVIDE", value, w)
            tree.links.new(build.math("MULTIPLY_ADD", ratio, 0.5, 0.5), place.inputs[axis])
        tree.links.new(place.outputs[0], picture.inputs["Vector"])
        inside = build.math("LESS_THAN", widest, w)
        colour = build.mix("RGBA", inside, (NEUTRAL,) * 3 + (1.0,), picture.outputs["Color"])
    glow, matt = build("ShaderNodeEmission"), build("ShaderNodeBsdfDiffuse")
    glow.inputs["Strength"].default_value = emission
    tree.links.new(colour, glow.inputs["Color"])
    # The diffuse share darkens the colour: a BSDF has no strength of its own.
    share = build("ShaderNodeVectorMath", operation="SCALE")
    share.inputs["Scale"].default_value = diffuse
    tree.links.new(colour, share.inputs[0])
    tree.links.new(share.outputs[0], matt.inputs["Color"])
    both, out = build("ShaderNodeAddShader"), build("ShaderNodeOutputMaterial")
    tree.links.new(glow.outputs[0], both.inputs[0])
    tree.links.new(matt.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], out.inputs["Surface"])
    return material


def play(material: bpy.types.Material, first: int, last: int) -> None:
    """Have a material show the frames of its image, each at its own number."""
    for node in material.node_tree.nodes:
        if node.bl_idname == "ShaderNodeTexImage":
            user = node.image_user
            user.frame_start, user.frame_offset = first, first - 1
            user.frame_duration = last - first + 1
            user.use_auto_refresh = True


def _clip_position(build: _Builder, view_projection: np.ndarray) -> bpy.types.Node:
    """A node with outputs X, Y and Z: clip-space x, y and w."""
    links = build.tree.links
    baked = build("ShaderNodeAttribute", attribute_name=PROJECTION)
    world = build("ShaderNodeNewGeometry").outputs["Position"]
    here = build.transformed(world, _rows(view_projection))
    length = build("ShaderNodeVectorMath", operation="LENGTH")
    links.new(baked.outputs["Vector"], length.inputs[0])
    there = build.math("GREATER_THAN", length.outputs["Value"], 0.0)
    split = build("ShaderNodeSeparateXYZ")
    links.new(build.mix("VECTOR", there, here, baked.outputs["Vector"]), split.inputs[0])
    return split


def new_group(
    name: str, material: bpy.types.Material, matrix: np.ndarray | None
) -> bpy.types.NodeTree:
    """A geometry node group that gives an object a material and the attribute `PROJECTION`.

    The user's mesh, material slots and other modifiers are left as they are.

    Parameters
    ----------
    name : str
    material : bpy.types.Material
    matrix : (4, 4) ndarray or None
        Object to clip space; None for things that stand in several places.
    """
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group.is_modifier = True
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    build = _Builder(group)
    entry = build("NodeGroupInput")
    paint = build("GeometryNodeSetMaterial")
    paint.inputs["Material"].default_value = material
    group.links.new(entry.outputs["Geometry"], paint.inputs["Geometry"])
    geometry = paint.outputs["Geometry"]
    if matrix is not None:
        clip = build.transformed(build("GeometryNodeInputPosition").outputs[0], _rows(matrix))
        store = build("GeometryNodeStoreNamedAttribute", data_type="FLOAT_VECTOR", domain="POINT")
        store.inputs["Name"].default_value = PROJECTION
        group.links.new(geometry, store.inputs["Geometry"])
        value = next(socket for socket in store.inputs if socket.name == "Value" and socket.enabled)
        group.links.new(clip, value)
        geometry = store.outputs["Geometry"]
    group.links.new(geometry, build("NodeGroupOutput").inputs["Geometry"])
    return group


def material_of_group(group: bpy.types.NodeTree) -> bpy.types.Material | None:
    """The material that a group of `new_group` gives."""
    for node in group.nodes:
        if node.bl_idname == "GeometryNodeSetMaterial":
            return node.inputs["Material"].default_value
    return None


def _rows(matrix: np.ndarray) -> np.ndarray:
    """(3, 4): the rows of a matrix that give clip-space x, y and w."""
    return np.asarray(matrix)[[0, 1, 3]]


class _Builder:
    """Adds nodes to a tree, from left to right."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        self.count = 0

    def __call__(self, kind: str, **settings: Any) -> bpy.types.Node:
        node = self.tree.nodes.new(kind)
        node.location = (180 * (self.count % 12), -220 * (self.count // 12))
        self.count += 1
        for name, value in settings.items():
            setattr(node, name, value)
        return node

    def connect(self, value: Any, socket: bpy.types.NodeSocket) -> None:
        """A link from a socket, or a constant."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        node = self("ShaderNodeMath", operation=operation)
        for value, socket in zip(values, node.inputs, strict=False):
            self.connect(value, socket)
        return node.outputs["Value"]

    def mix(self, kind: str, factor: Any, a: Any, b: Any) -> bpy.types.NodeSocket:
        node = self("ShaderNodeMix", data_type=kind)
        enabled = {socket.name: socket for socket in node.inputs if socket.enabled}
        for name, value in (("Factor", factor), ("A", a), ("B", b)):
            self.connect(value, enabled[name])
        return next(socket for socket in node.outputs if socket.enabled)

    def transformed(self, point: bpy.types.NodeSocket, rows: np.ndarray) -> bpy.types.NodeSocket:
        """Three rows of a matrix times a point."""
        joined = self("ShaderNodeCombineXYZ")
        for axis, row in zip("XYZ", rows.tolist(), strict=True):
            product = self("ShaderNodeVectorMath", operation="DOT_PRODUCT")
            self.connect(point, product.inputs[0])
            product.inputs[1].default_value = row[:3]
            total = self.math("ADD", product.outputs["Value"], row[3])
            self.tree.links.new(total, joined.inputs[axis])
        return joined.outputs[0]

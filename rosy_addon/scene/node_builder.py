"""`NodeBuilder`: adds nodes to node trees of materials and of Geometry Nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import bpy
import numpy as np
from bpy.types import Image, Material, Node, NodeSocket, NodeTree


def first_node(tree: NodeTree | None, kind: str) -> Node | None:
    """Return the first node of a type in a node tree; None if there is none, or no tree."""
    nodes = () if tree is None else tree.nodes
    return next((node for node in nodes if node.bl_idname == kind), None)


class NodeBuilder:
    """A builder that adds nodes to a node tree, laid out in rows from left to right.

    ``build(type, inputs, **properties)`` adds a node, sets its properties, and connects its inputs to sockets
    or sets them to constants. The keys of `inputs` are indices of input sockets, or their names; a name means
    the socket with this name that the properties of the node enable.
    """

    def __init__(self, tree: NodeTree) -> None:
        self.tree = tree
        self.node_count = 0

    def __call__(
        self, kind: str, inputs: Mapping[str | int, Any] | None = None, /, **settings: Any
    ) -> Node:
        node = self.tree.nodes.new(kind)
        node.location = (180 * (self.node_count % 12), -220 * (self.node_count // 12))
        self.node_count += 1
        for name, value in settings.items():
            setattr(node, name, value)
        enabled = {socket.name: socket for socket in node.inputs if socket.enabled}
        for key, value in (inputs or {}).items():
            self.connect(value, node.inputs[key] if isinstance(key, int) else enabled[key])
        return node

    def connect(self, value: Any, socket: NodeSocket) -> None:
        """Link `value` to an input socket if it is an output socket; else set the input to this constant."""
        if isinstance(value, NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *values: Any) -> NodeSocket:
        """Add a math node, and return its output. Values are sockets or constants."""
        node = self("ShaderNodeMath", dict(enumerate(values)), operation=operation)
        return node.outputs["Value"]

    def vector_math(self, operation: str, *values: Any) -> NodeSocket:
        """Add a vector math node, and return its output. Values are sockets or constants."""
        node = self("ShaderNodeVectorMath", dict(enumerate(values)), operation=operation)
        return enabled_output(node)

    def scaled(self, vector: NodeSocket, factor: Any) -> NodeSocket:
        """Add a node that scales a vector, and return its output."""
        inputs = {0: vector, "Scale": factor}
        return self("ShaderNodeVectorMath", inputs, operation="SCALE").outputs[0]

    def mix(self, kind: str, factor: Any, a: Any, b: Any) -> NodeSocket:
        """Add a mix node of a data type, and return its output: it is `a` for factor 0, `b` for factor 1."""
        inputs = {"Factor": factor, "A": a, "B": b}
        return enabled_output(self("ShaderNodeMix", inputs, data_type=kind))

    def mix_shaders(self, factor: Any, a: Any, b: Any) -> NodeSocket:
        """Add a node that mixes shaders, and return its output: it is `a` for factor 0, `b` for factor 1."""
        return self("ShaderNodeMixShader", {0: factor, 1: a, 2: b}).outputs["Shader"]

    def frame_image(self, image: Image, vector: NodeSocket) -> Node:
        """Add a node with the pixels of an image, not interpolated, mapped to coordinates from 0 to 1."""
        settings = {"image": image, "interpolation": "Closest", "extension": "EXTEND"}
        return self("ShaderNodeTexImage", {"Vector": vector}, **settings)

    def stored_attribute(
        self, geometry: NodeSocket, name: str, data_type: str, domain: str, value: NodeSocket
    ) -> NodeSocket:
        """Add a node that stores a named attribute, and return the geometry with the attribute."""
        inputs = {"Geometry": geometry, "Name": name, "Value": value}
        kind = "GeometryNodeStoreNamedAttribute"
        return self(kind, inputs, data_type=data_type, domain=domain).outputs["Geometry"]

    def projected(self, point: NodeSocket, matrix: np.ndarray) -> NodeSocket:
        """Add nodes that transform a point to clip space by a (4, 4) matrix.

        Return their output, the vector (x, y, w) in clip space.
        """
        components = {
            axis: self.math("ADD", self.vector_math("DOT_PRODUCT", point, row[:3]), row[3])
            for axis, row in zip("XYZ", matrix[[0, 1, 3]].tolist(), strict=True)
        }
        return self("ShaderNodeCombineXYZ", components).outputs[0]


def enabled_output(node: Node) -> NodeSocket:
    """Return the first output socket of a node that is enabled by its properties."""
    return next(socket for socket in node.outputs if socket.enabled)


def _operator(operation: str) -> Callable[[Number, Number | float], Number]:
    """Return a method of `Number` that adds a math node with the number and another one as its inputs."""
    return lambda number, other: number._math(operation, number, other)


class Number:
    """A number that nodes compute. Arithmetic with it adds math nodes to the tree.

    Parameters
    ----------
    build : NodeBuilder
    socket : bpy.types.NodeSocket
    """

    def __init__(self, build: NodeBuilder, socket: NodeSocket) -> None:
        self.build, self.socket = build, socket

    def _math(self, operation: str, *values: Any) -> Number:
        sockets = [value.socket if isinstance(value, Number) else value for value in values]
        return Number(self.build, self.build.math(operation, *sockets))

    __add__ = _operator("ADD")
    __sub__ = _operator("SUBTRACT")
    __mul__ = _operator("MULTIPLY")
    __truediv__ = _operator("DIVIDE")
    __pow__ = _operator("POWER")
    __gt__ = _operator("GREATER_THAN")

    def __rsub__(self, other: float) -> Number:
        return self._math("SUBTRACT", other, self)

    def __rtruediv__(self, other: float) -> Number:
        return self._math("DIVIDE", other, self)

    #: The larger, and the smaller, of this number and another.
    at_least, at_most = _operator("MAXIMUM"), _operator("MINIMUM")

    def square_root(self) -> Number:
        """Return the square root of this number, which must not be negative."""
        return self._math("SQRT", self)

    def smoothstep(self, low: Number | float, high: Number | float) -> Number:
        """Return the smoothstep function of this number: 0 up to `low`, 1 from `high`."""
        low, high = (end.socket if isinstance(end, Number) else end for end in (low, high))
        inputs = {"Value": self.socket, "From Min": low, "From Max": high}
        node = self.build("ShaderNodeMapRange", inputs, interpolation_type="SMOOTHSTEP")
        return Number(self.build, node.outputs["Result"])


def new_empty_material(name: str) -> tuple[Material, NodeBuilder]:
    """Create a material without nodes. Return it with the builder of its node tree."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:  # before Blender 5.0
        material.use_nodes = True
    material.node_tree.nodes.clear()
    return material, NodeBuilder(material.node_tree)


def new_emissive_material(name: str, color: Any, strength: float = 1.0) -> Material:
    """Create a material that emits a color: a constant, or the name of an attribute with the color."""
    material, build = new_empty_material(name)
    if isinstance(color, str):
        color = build("ShaderNodeAttribute", attribute_name=color).outputs["Color"]
    emission = build("ShaderNodeEmission", {"Color": color, "Strength": strength})
    build("ShaderNodeOutputMaterial", {"Surface": emission.outputs["Emission"]})
    return material


def new_modifier_group(name: str) -> tuple[NodeTree, NodeBuilder, NodeSocket]:
    """Create a geometry node group for a modifier.

    Return it with its builder and the socket of its input geometry.
    """
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group.is_modifier = True
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    build = NodeBuilder(group)
    return group, build, build("NodeGroupInput").outputs["Geometry"]

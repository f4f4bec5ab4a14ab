"""`NodeBuilder`: adds nodes to trees of materials and geometry."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from .compat import has_nodes_by_default


class NodeBuilder:
    """Adds nodes to a tree, laid out in rows from left to right.

    Calling it adds a node of a type, and sets its properties.
    """

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        self.node_count = 0

    def __call__(self, kind: str, **settings: Any) -> bpy.types.Node:
        node = self.tree.nodes.new(kind)
        node.location = (180 * (self.node_count % 12), -220 * (self.node_count // 12))
        self.node_count += 1
        for name, value in settings.items():
            setattr(node, name, value)
        return node

    def connect(self, value: Any, socket: bpy.types.NodeSocket) -> None:
        """Link a socket to an input, or set the input to a constant."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """Add a math node, and return its output. Values are sockets or constants."""
        node = self("ShaderNodeMath", operation=operation)
        for value, socket in zip(values, node.inputs, strict=False):
            self.connect(value, socket)
        return node.outputs["Value"]

    def mix(self, kind: str, factor: Any, a: Any, b: Any) -> bpy.types.NodeSocket:
        """Add a mix node for a data type, and return its output: a for factor 0, b for factor 1."""
        node = self("ShaderNodeMix", data_type=kind)
        enabled = {socket.name: socket for socket in node.inputs if socket.enabled}
        for name, value in (("Factor", factor), ("A", a), ("B", b)):
            self.connect(value, enabled[name])
        return next(socket for socket in node.outputs if socket.enabled)

    def stored_attribute(
        self,
        geometry: bpy.types.NodeSocket,
        name: str,
        data_type: str,
        domain: str,
        value: bpy.types.NodeSocket,
    ) -> bpy.types.NodeSocket:
        """Add a node that stores a named attribute, and return the geometry with it."""
        node = self("GeometryNodeStoreNamedAttribute", data_type=data_type, domain=domain)
        node.inputs["Name"].default_value = name
        self.tree.links.new(geometry, node.inputs["Geometry"])
        enabled = (socket for socket in node.inputs if socket.name == "Value" and socket.enabled)
        self.tree.links.new(value, next(enabled))
        return node.outputs["Geometry"]

    def transformed(self, point: bpy.types.NodeSocket, rows: np.ndarray) -> bpy.types.NodeSocket:
        """Add nodes that multiply a point by a (3, 4) matrix, and return the output."""
        combined = self("ShaderNodeCombineXYZ")
        for axis, row in zip("XYZ", rows.tolist(), strict=True):
            product = self("ShaderNodeVectorMath", operation="DOT_PRODUCT")
            self.connect(point, product.inputs[0])
            product.inputs[1].default_value = row[:3]
            component = self.math("ADD", product.outputs["Value"], row[3])
            self.tree.links.new(component, combined.inputs[axis])
        return combined.outputs[0]


class Number:
    """A number of a node tree. Arithmetic with it adds math nodes.

    Parameters
    ----------
    build : NodeBuilder
    socket : bpy.types.NodeSocket
    """

    def __init__(self, build: NodeBuilder, socket: bpy.types.NodeSocket) -> None:
        self.build, self.socket = build, socket

    def _math(self, operation: str, *values: Any) -> Number:
        sockets = [value.socket if isinstance(value, Number) else value for value in values]
        return Number(self.build, self.build.math(operation, *sockets))

    def __add__(self, other: Number | float) -> Number:
        return self._math("ADD", self, other)

    def __sub__(self, other: Number | float) -> Number:
        return self._math("SUBTRACT", self, other)

    def __rsub__(self, other: float) -> Number:
        return self._math("SUBTRACT", other, self)

    def __mul__(self, other: Number | float) -> Number:
        return self._math("MULTIPLY", self, other)

    def __truediv__(self, other: Number | float) -> Number:
        return self._math("DIVIDE", self, other)

    def __rtruediv__(self, other: float) -> Number:
        return self._math("DIVIDE", other, self)

    def __pow__(self, other: Number | float) -> Number:
        return self._math("POWER", self, other)

    def __gt__(self, other: Number | float) -> Number:
        return self._math("GREATER_THAN", self, other)

    def at_least(self, other: Number | float) -> Number:
        """Return the larger of two numbers."""
        return self._math("MAXIMUM", self, other)

    def at_most(self, other: Number | float) -> Number:
        """Return the smaller of two numbers."""
        return self._math("MINIMUM", self, other)

    def square_root(self) -> Number:
        """Return the square root of a number of at least 0."""
        return self._math("SQRT", self)

    def smoothstep(self, low: Number | float, high: Number | float) -> Number:
        """Return a smooth step from 0 at `low` to 1 at `high`."""
        node = self.build("ShaderNodeMapRange", interpolation_type="SMOOTHSTEP")
        for name, value in (("Value", self), ("From Min", low), ("From Max", high)):
            socket = value.socket if isinstance(value, Number) else value
            self.build.connect(socket, node.inputs[name])
        return Number(self.build, node.outputs["Result"])


def new_empty_material(name: str) -> tuple[bpy.types.Material, NodeBuilder]:
    """Create a material without nodes, and return what adds them."""
    material = bpy.data.materials.new(name)
    if not has_nodes_by_default(material):
        material.use_nodes = True
    material.node_tree.nodes.clear()
    return material, NodeBuilder(material.node_tree)

"""Find the transparent faces of meshes, which do not occlude other meshes in pictures."""

import numpy as np
from bpy.types import Material, Mesh, Node, NodeTree, Object

from ..field.surface import Surface
from .meshes import material_indices

#: Types of shader nodes that are transparent.
_TRANSPARENT_NODES = ("BSDF_TRANSPARENT", "BSDF_GLASS", "BSDF_REFRACTION")

#: Inputs of *Principled BSDF*, and the values with which it is opaque.
_OPAQUE_INPUTS = {"Alpha": 1.0, "Transmission Weight": 0.0}


def transparent_slots(mesh: Mesh, owner: Object) -> tuple[bool, ...]:
    """Return for each material slot of an evaluated mesh whether its material is transparent, at least in parts.

    `owner` is the original object, whose slots can replace the materials of the mesh.
    """
    materials = list(mesh.materials)
    for index, slot in enumerate(owner.material_slots):
        if slot.link == "OBJECT" and index < len(materials):
            materials[index] = slot.material
    return tuple(material is not None and _is_transparent(material) for material in materials)


def opaque_triangles(surface: Surface, mesh: Mesh, owner: Object) -> np.ndarray:
    """Return the indices of the triangles of an evaluated mesh whose materials are opaque, (n,) int64.

    `surface` is the surface of the mesh, and `owner` its original object; see `transparent_slots`.
    """
    is_transparent = np.array(transparent_slots(mesh, owner) or (False,))
    slot = np.clip(material_indices(mesh), 0, len(is_transparent) - 1)
    return np.flatnonzero(~is_transparent[slot[surface.triangle_face]])


def _is_transparent(material: Material) -> bool:
    """Return whether a material has a transparent shader, a Principled BSDF that is not opaque, or no surface."""
    tree = material.node_tree
    if tree is None:
        return False
    output = tree.get_output_node("ALL")
    has_surface = output is not None and output.inputs["Surface"].is_linked
    return not has_surface or any(map(_lets_light_through, _all_nodes(tree)))


def _all_nodes(tree: NodeTree) -> list[Node]:
    """Return the nodes of a tree and of the groups in it that are not muted."""
    nodes = [node for node in tree.nodes if not node.mute]
    groups = {node.node_tree for node in nodes if node.type == "GROUP" and node.node_tree}
    return [*nodes, *(node for group in groups for node in _all_nodes(group))]


def _lets_light_through(node: Node) -> bool:
    """Return whether a shader node shows what is behind the surface."""
    if node.type in _TRANSPARENT_NODES:
        return any(output.is_linked for output in node.outputs)
    return node.type == "BSDF_PRINCIPLED" and any(
        node.inputs[name].is_linked or node.inputs[name].default_value != value
        for name, value in _OPAQUE_INPUTS.items()
    )

"""What this Blender can do, asked of it rather than told from its version."""

from __future__ import annotations

import bpy


def has_properties() -> bool:
    """Whether RoSy's own properties are registered, as they are while the extension is on."""
    return hasattr(bpy.types.Scene, "rosy") and hasattr(bpy.types.Mesh, "rosy")


def is_editable(thing: bpy.types.ID) -> bool:
    """Whether a datablock may be changed: local, or a library override."""
    return thing.library is None and getattr(thing, "is_editable", True)


def can_show_nodes_by_default(material: bpy.types.Material) -> bool:
    """Whether a material has nodes without being told so (from 5.0 on telling it is deprecated)."""
    return material.node_tree is not None and len(material.node_tree.nodes) > 0


def folder_options() -> set[str]:
    """Options of a property for a path that may begin with ``//``, the .blend file's folder.

    Since 5.0 such a property has to say so; before, every one may.
    """
    known = "is_path_supports_blend_relative" in bpy.types.Property.bl_rna.properties
    return {"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"} if known else {"ANIMATABLE"}


def has_drawings() -> bool:
    """Whether a frame of Grease Pencil holds a drawing with attributes, as from 4.3 on."""
    return hasattr(bpy.types, "GreasePencilDrawing")

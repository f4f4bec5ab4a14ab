"""Differences between Blender versions, found by testing for features, not version numbers."""

from __future__ import annotations

from typing import Any

import bpy


def has_rosy_properties() -> bool:
    """Whether RoSy's properties are registered. They are while the extension is enabled."""
    return hasattr(bpy.types.Scene, "rosy") and hasattr(bpy.types.Mesh, "rosy")


def is_editable(datablock: bpy.types.ID) -> bool:
    """Whether a datablock can be changed: it is local, or a library override."""
    return datablock.library is None and getattr(datablock, "is_editable", True)


def has_nodes_by_default(material: bpy.types.Material) -> bool:
    """Whether a new material has nodes already. ``use_nodes`` is deprecated since Blender 5.0."""
    return material.node_tree is not None and len(material.node_tree.nodes) > 0


def path_property_options() -> set[str]:
    """Return the ``options`` of a path property that may start with ``//``, the .blend's folder.

    Blender 5.0 and later need an option for this. Earlier versions allow it for all path properties.
    """
    is_supported = "is_path_supports_blend_relative" in bpy.types.Property.bl_rna.properties
    return {"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"} if is_supported else {"ANIMATABLE"}


def has_grease_pencil_drawings() -> bool:
    """Whether Grease Pencil frames hold drawings with attributes (Blender 4.3 and later)."""
    return hasattr(bpy.types, "GreasePencilDrawing")


def scene_annotation(scene: bpy.types.Scene) -> bpy.types.ID | None:
    """Return the annotations of a scene, or None. The property was renamed in Blender 5.0."""
    return scene.annotation if hasattr(scene, "annotation") else scene.grease_pencil


def is_annotation_in_space(stroke: Any) -> bool:
    """Whether a stroke of an annotation has coordinates of the scene. Blender 4.3 does not tell."""
    return getattr(stroke, "display_mode", "3DSPACE") == "3DSPACE"

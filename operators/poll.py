"""Helpers that operators share: poll functions, selected meshes, storing fields."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.field.rosy_field import RosyField
from ..rosy_addon.scene.compat import is_editable
from ..rosy_addon.scene.field_attributes import (
    DEFAULT_FIELD_NAME,
    attribute_name,
    has_field,
    is_face_vector_field,
    write_mesh_field,
)
from ..rosy_addon.scene.scene_reader import field_objects
from ..rosy_addon.scene.singularity_points import read_singularities
from ..rosy_addon.ui import job_status, overlay
from ..rosy_addon.ui.preferences import apply_preferences


def selected_mesh_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the selected mesh objects, the active one first.

    If none is selected, only the active object is returned, if it is a mesh.
    """
    active = context.view_layer.objects.active
    selected = [obj for obj in context.selected_objects if obj.type == "MESH"]
    if not selected and active is not None and active.type == "MESH":
        return [active]
    return sorted(selected, key=lambda obj: obj != active)


def poll_editable(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether a mesh is selected that can get a field. Sets the poll message if not."""
    if not poll_idle(operator):
        return False
    if not selected_mesh_objects(context):
        operator.poll_message_set("Select a mesh object first")
        return False
    if context.mode != "OBJECT":
        operator.poll_message_set("Switch to Object Mode first (Tab)")
        return False
    return True


def poll_idle(operator: type[bpy.types.Operator]) -> bool:
    """Whether no modal task is running. Sets the poll message if one is."""
    if job_status.current is not None:
        operator.poll_message_set("RoSy is busy: wait, or press ESC to cancel")
        return False
    return True


def poll_active_field(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether the active mesh has a field. Sets the poll message if not."""
    objects = selected_mesh_objects(context)
    if not objects or not has_field(objects[0]):
        operator.poll_message_set("The active mesh has no field: make or import one first")
        return False
    return True


def poll_has_field(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether there is a field to draw, and no modal task. Sets the poll message if not."""
    if not poll_idle(operator):
        return False
    if not field_objects(context.view_layer):
        operator.poll_message_set("No visible mesh has a field: make or import one first")
        return False
    return True


def sync_suffix(operator: bpy.types.Operator, suffix: str) -> bool:
    """Set the suffix of an operator's file path. Return whether the path has changed."""
    filepath = str(Path(operator.filepath).with_suffix(suffix))
    changed = filepath != operator.filepath
    operator.filepath = filepath
    return changed


def assign_fields(
    operator: bpy.types.Operator,
    context: bpy.types.Context,
    fields: dict[bpy.types.Mesh, RosyField],
    name: str | None = None,
) -> None:
    """Store fields on meshes, all or none of them, and apply the preferences to the scene.

    The overlay of singularities is updated where it is shown.

    Parameters
    ----------
    operator : bpy.types.Operator
        Reports errors in the preferences.
    context : bpy.types.Context
    fields : dict of bpy.types.Mesh to RosyField
    name : str, optional
        Name of the attribute. By default the existing field of each mesh is replaced.

    Raises
    ------
    RosyError
        If a field cannot be stored on its mesh. Nothing is changed in this case.
    """
    # Meshes that cannot accept a field come first, so that an error is raised before any change.
    names = {mesh: name or _target_attribute(mesh) for mesh in fields}
    for mesh in sorted(fields, key=lambda mesh: _accepts_field(mesh, names[mesh])):
        write_mesh_field(mesh, fields[mesh], names[mesh])
    _refresh_overlay(context, fields)
    try:
        apply_preferences(context)
    except RosyError as error:
        operator.report({"WARNING"}, f"RoSy's preferences: {error}")


def _target_attribute(mesh: bpy.types.Mesh) -> str:
    """Return the attribute of a mesh's field, or a default if that has another form."""
    name = attribute_name(mesh)
    return (
        name
        if name not in mesh.attributes or is_face_vector_field(mesh, name)
        else DEFAULT_FIELD_NAME
    )


def _refresh_overlay(context: bpy.types.Context, meshes: Iterable[bpy.types.Mesh]) -> None:
    """Update the singularities in the overlay for meshes with new fields."""
    for obj in context.view_layer.objects:
        if obj.data in meshes and overlay.is_shown(obj.name):
            overlay.show(obj.name, read_singularities(obj, context.evaluated_depsgraph_get()))


def _accepts_field(mesh: bpy.types.Mesh, name: str) -> bool:
    """Whether a field can be stored on a mesh under a name as vectors on faces."""
    return is_editable(mesh) and (name not in mesh.attributes or is_face_vector_field(mesh, name))

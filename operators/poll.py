"""Helpers that operators share: poll functions, selected meshes, storing fields."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.field.rosy_field import RosyField
from ..rosy_addon.scene.field_attributes import has_field
from ..rosy_addon.scene.visible_objects import field_objects
from ..rosy_addon.scene.write_field import assign_fields
from ..rosy_addon.ui import job_status, live_views, overlay
from ..rosy_addon.ui.preferences import apply_preferences
from .reports import report_warning


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
    """Return whether a mesh is selected that can get a field. Set the poll message if not."""
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
    """Return whether no job is running in a window. Set the poll message if one is."""
    if job_status.current is not None:
        operator.poll_message_set("RoSy is busy: wait, or press ESC to cancel")
        return False
    return True


def poll_view_3d(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Return whether the context has a 3D view. Set the poll message if not."""
    if context.space_data is None or context.space_data.type != "VIEW_3D":
        operator.poll_message_set("Available only in a 3D view")
        return False
    return True


def poll_active_field(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Return whether the active mesh has a field. Set the poll message if not."""
    objects = selected_mesh_objects(context)
    if not objects or not has_field(objects[0]):
        operator.poll_message_set("The active mesh has no field: make or import one first")
        return False
    return True


def poll_has_field(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Return whether there is a field to draw, and no job is running. Set the poll message if not."""
    if not poll_idle(operator):
        return False
    if not field_objects(context.view_layer):
        operator.poll_message_set("No visible mesh has a field: make or import one first")
        return False
    return True


def sync_suffix(operator: bpy.types.Operator, suffix: str) -> bool:
    """Set the suffix of an operator's file path. Return whether the path has changed.

    A path without a name is left alone.
    """
    path = Path(operator.filepath)
    if not path.name or path.suffix == suffix:
        return False
    operator.filepath = str(path.with_suffix(suffix))
    return True


def store_fields(
    operator: bpy.types.Operator,
    context: bpy.types.Context,
    fields: dict[bpy.types.Mesh, RosyField],
    name: str | None = None,
) -> None:
    """Store fields on meshes as `assign_fields`, and apply the preferences to the scene.

    The overlay of singularities is updated where it is shown. The first field of a scene is shown
    live.

    Parameters
    ----------
    operator : bpy.types.Operator
        Reports what the preferences ask for and cannot be done.
    context : bpy.types.Context
    fields : dict of bpy.types.Mesh to RosyField
    name : str, optional
        Name of the attribute. By default the existing field of each mesh is replaced.

    Raises
    ------
    RosyError
        If a field cannot be stored on its mesh. Nothing is changed in this case.
    """
    is_first = not any(has_field(obj) for obj in context.scene.objects)
    assign_fields(fields, name)
    overlay.refresh(context, fields)
    try:
        apply_preferences(context)
    except RosyError as error:
        report_warning(operator, f"RoSy's preferences: {error}")
    if is_first:
        try:
            live_views.start_with_first_field(context)
        except RosyError as error:
            report_warning(operator, f"no live view: {error}")

"""Which meshes an operator is about, and why it cannot be used where there is none."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.field.rosy_field import RosyField
from ..rosy_addon.scene.attributes import (
    DEFAULT_NAME,
    attribute_name,
    has_field,
    is_native,
    write_mesh_field,
)
from ..rosy_addon.scene.bodies import rosy_objects
from ..rosy_addon.scene.capabilities import is_editable
from ..rosy_addon.scene.singular import singular_vertices
from ..rosy_addon.ui import overlay, status
from ..rosy_addon.ui.preferences import start_scene


def selected_meshes(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The selected mesh objects, the active one first; the active one alone if none is selected."""
    active = context.view_layer.objects.active
    selected = [thing for thing in context.selected_objects if thing.type == "MESH"]
    if not selected and active is not None and active.type == "MESH":
        return [active]
    return sorted(selected, key=lambda thing: thing != active)


def can_change_fields(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether there is a mesh to give a field to; says why if not."""
    if not is_idle(operator):
        return False
    if not selected_meshes(context):
        operator.poll_message_set("Select a mesh object first")
        return False
    if context.mode != "OBJECT":
        operator.poll_message_set("Leave this mode first: press Tab or choose Object Mode")
        return False
    return True


def is_idle(operator: type[bpy.types.Operator]) -> bool:
    """Whether no work is under way; says so if there is."""
    if status.now is not None:
        operator.poll_message_set("RoSy is at work: wait, or press ESC to cancel")
        return False
    return True


def has_field_selected(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether the active mesh has a field; says so if not."""
    meshes = selected_meshes(context)
    if not meshes or not has_field(meshes[0]):
        operator.poll_message_set("The active mesh has no field: make or import one first")
        return False
    return True


def can_draw(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Whether there is a field to draw; says why not."""
    if not is_idle(operator):
        return False
    if not rosy_objects(context.view_layer):
        operator.poll_message_set("No visible mesh has a field: make or import one first")
        return False
    return True


def with_ending(operator: bpy.types.Operator, ending: str) -> bool:
    """Keep the name in a file browser in step with the kind of file; whether it was changed."""
    name = str(Path(operator.filepath).with_suffix(ending))
    changed = name != operator.filepath
    operator.filepath = name
    return changed


def give_fields(
    operator: bpy.types.Operator,
    context: bpy.types.Context,
    made: dict[bpy.types.Mesh, RosyField],
    name: str | None = None,
) -> None:
    """Write fields to meshes, all or none of them, and start the scene's settings.

    Under the name given; if none is, in place of the field that is there.

    Raises
    ------
    RosyError
        If a field cannot be written to its mesh; nothing is changed then.
    """
    # Those that will refuse come first.
    names = {mesh: name or _own_name(mesh) for mesh in made}
    for mesh in sorted(made, key=lambda mesh: _will_take(mesh, names[mesh])):
        write_mesh_field(mesh, made[mesh], names[mesh])
    _refresh_overlay(context, made)
    try:
        start_scene(context)
    except RosyError as error:
        operator.report({"WARNING"}, f"RoSy's preferences: {error}")


def _own_name(mesh: bpy.types.Mesh) -> str:
    """Where a field takes the place of the mesh's own; a new one if that is in another form."""
    name = attribute_name(mesh)
    return name if name not in mesh.attributes or is_native(mesh, name) else DEFAULT_NAME


def _refresh_overlay(context: bpy.types.Context, meshes: Iterable[bpy.types.Mesh]) -> None:
    """Show the singularities of new fields where those of the old ones were shown."""
    for thing in context.view_layer.objects:
        if thing.data in meshes and overlay.is_shown(thing.name):
            overlay.show(thing.name, singular_vertices(thing, context.evaluated_depsgraph_get()))


def _will_take(mesh: bpy.types.Mesh, name: str) -> bool:
    return is_editable(mesh) and (name not in mesh.attributes or is_native(mesh, name))

"""What operators share: conditions, reports, selected meshes, storing fields."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import bpy

from ..rosy_addon.core.errors import REPORTED_ERRORS, RosyError, as_sentence, error_text
from ..rosy_addon.field.rosy_field import RosyField
from ..rosy_addon.scene.field_attributes import has_field
from ..rosy_addon.scene.mesh_fields import assign_fields
from ..rosy_addon.scene.visible_objects import field_objects
from ..rosy_addon.ui import job_status, live_views, overlay
from ..rosy_addon.ui.preferences import apply_preferences


class Condition(NamedTuple):
    """What must hold so that an operator can run, and what the user is told if it does not."""

    holds: Callable[[bpy.types.Context], object]
    message: str


def selected_mesh_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the selected mesh objects, the active one first.

    If none is selected, only the active object is returned, if it is a mesh.
    """
    active = context.view_layer.objects.active
    selected = [obj for obj in context.selected_objects if obj.type == "MESH"]
    if not selected and active is not None and active.type == "MESH":
        return [active]
    return sorted(selected, key=lambda obj: obj != active)


IDLE = Condition(lambda _: job_status.current is None, "RoSy is busy: wait, or press ESC to cancel")
OBJECT_MODE = Condition(
    lambda context: context.mode == "OBJECT", "Switch to Object Mode first (Tab)"
)
IN_3D_VIEW = Condition(
    lambda context: context.space_data is not None and context.space_data.type == "VIEW_3D",
    "Available only in a 3D view",
)
ACTIVE_FIELD = Condition(
    lambda context: any(map(has_field, selected_mesh_objects(context)[:1])),
    "The active mesh has no field: make or import one first",
)
VISIBLE_FIELD = Condition(
    lambda context: field_objects(context.view_layer),
    "No visible mesh has a field: make or import one first",
)

#: Conditions of operators that give fields to the selected meshes, and of those that change them.
EDITABLE = (IDLE, Condition(selected_mesh_objects, "Select a mesh object first"), OBJECT_MODE)
EDITABLE_FIELD = (*EDITABLE, ACTIVE_FIELD)


class RosyOperator:
    """Mixin of all operators: checks their conditions, and reports errors as sentences."""

    #: Checked in this order.
    conditions: tuple[Condition, ...] = ()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether all conditions hold. Set the poll message if not."""
        for condition in cls.conditions:
            if not condition.holds(context):
                cls.poll_message_set(condition.message)
                return False
        return True

    def act(self, context: bpy.types.Context) -> None:
        """Do all the work, in operators that are no jobs.

        Raises
        ------
        RosyError
            Reported to the user.
        """
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            self.act(context)
        except REPORTED_ERRORS as error:
            return self.report_error(error)
        return {"FINISHED"}

    def chosen(self, name: str, default: object) -> object:
        """Return the property of a name if it was set for this operator, and else the default."""
        return getattr(self, name) if self.properties.is_property_set(name) else default

    def report_error(self, error: Exception) -> set[str]:
        """Report one of `REPORTED_ERRORS`. Return the result of an operator that has failed."""
        self.report({"ERROR"}, as_sentence(error_text(error)))
        return {"CANCELLED"}

    def report_operator_error(self, error: RuntimeError) -> set[str]:
        """Report the error of another operator that was called. Return the result of one that has failed."""
        self.report({"ERROR"}, str(error).strip().removeprefix("Error: "))
        return {"CANCELLED"}

    def report_done(self, message: str) -> None:
        """Report what the operator has done."""
        self.report({"INFO"}, message)

    def report_warnings(self, *messages: str) -> None:
        """Report what the user should know about a result, each message once."""
        for message in dict.fromkeys(messages):
            self.report({"WARNING"}, as_sentence(message))

    def store_fields(
        self,
        context: bpy.types.Context,
        fields: dict[bpy.types.Mesh, RosyField],
        name: str | None = None,
    ) -> None:
        """Store fields on meshes as `assign_fields`, and apply the preferences to the scene.

        The overlay of singularities is updated where it is shown. The first field of a scene is
        shown live. What the preferences ask for and cannot be done is reported.

        Parameters
        ----------
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
            self.report_warnings(f"RoSy's preferences: {error}")
        if is_first:
            try:
                live_views.start_with_first_field(context)
            except RosyError as error:
                self.report_warnings(f"no live view: {error}")


def sync_suffix(operator: bpy.types.Operator, suffix: str) -> bool:
    """Set the suffix of an operator's file path. Return whether the path has changed.

    A path without a name is left alone.
    """
    path = Path(operator.filepath)
    if not path.name or path.suffix == suffix:
        return False
    operator.filepath = str(path.with_suffix(suffix))
    return True

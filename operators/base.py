"""Base class and functions of operators: conditions, reports, selected meshes, storing of fields."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from bpy.types import Context, Event, Mesh, Object, Operator

from ..rosy_addon.core.errors import (
    REPORTED_ERRORS,
    RosyError,
    as_sentence,
    error_text,
    telling_warnings,
)
from ..rosy_addon.field.rosy_field import RosyField
from ..rosy_addon.scene.field_attributes import has_field
from ..rosy_addon.scene.field_meshes import FieldTargets, hold_fields
from ..rosy_addon.scene.mesh_fields import assign_fields
from ..rosy_addon.scene.visible_objects import field_objects
from ..rosy_addon.ui import job_status, live_views, overlay
from ..rosy_addon.ui.preferences import apply_preferences
from ..rosy_addon.ui.translations import translated


class Condition(NamedTuple):
    """A condition for an operator to run, and the message to the user if the condition does not hold."""

    holds: Callable[[Context], object]
    message: str


def selected_mesh_objects(context: Context) -> list[Object]:
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
    # An object that is hidden may be shown by instances of Geometry Nodes.
    lambda context: field_objects(context.view_layer) or any(map(has_field, context.scene.objects)),
    "No visible mesh has a field: make or import one first",
)

#: Conditions of operators that make fields on the selected meshes, and of operators that change fields.
EDITABLE = (IDLE, Condition(selected_mesh_objects, "Select a mesh object first"), OBJECT_MODE)
EDITABLE_FIELD = (*EDITABLE, ACTIVE_FIELD)


class RosyOperator:
    """Mixin of all operators. It sets their names, checks their conditions, and reports errors as sentences.

    The class ``ROSY_OT_bake`` is the operator ``bpy.ops.rosy.bake``.
    """

    #: Blender's options: the operator is listed in the info editor, and can be undone.
    bl_options = {"REGISTER", "UNDO"}

    #: The conditions, which are checked in this order.
    conditions: tuple[Condition, ...] = ()

    #: The warnings that were reported.
    _reported: frozenset[str] = frozenset()

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        cls.bl_idname = f"rosy.{cls.__name__.removeprefix('ROSY_OT_')}"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Return whether all conditions hold.

        If not, set the message that Blender shows for a disabled button.
        """
        for condition in cls.conditions:
            if not condition.holds(context):
                cls.poll_message_set(translated(condition.message))
                return False
        return True

    def act(self, context: Context) -> None:
        """Do the work of the operator. Operators that run a job implement `ModalJobMixin.begin` instead.

        Raises
        ------
        RosyError
            The message is reported to the user.
        """
        raise NotImplementedError

    def execute(self, context: Context) -> set[str]:
        try:
            with telling_warnings(self.report_warnings):
                self.act(context)
        except REPORTED_ERRORS as error:
            return self.report_error(error)
        return {"FINISHED"}

    def chosen(self, name: str, default: object) -> object:
        """Return the value of a property if it was set for this call of the operator, else `default`."""
        return getattr(self, name) if self.properties.is_property_set(name) else default

    def report_error(self, error: Exception) -> set[str]:
        """Report an error of a type in `REPORTED_ERRORS`.

        Return the result of an operator that has failed.
        """
        self.report({"ERROR"}, as_sentence(error_text(error)))
        return {"CANCELLED"}

    def call(self, operator: Callable[..., set[str]], **settings: object) -> set[str]:
        """Call another operator, as a click on its button does, and report its errors.

        Return the result of this operator, which is cancelled if the other one is.
        """
        try:
            result = operator("INVOKE_DEFAULT", **settings)
        except RuntimeError as error:  # the called operator has reported it
            self.report({"ERROR"}, str(error).strip().removeprefix("Error: "))
            return {"CANCELLED"}
        return {"CANCELLED"} if result == {"CANCELLED"} else {"FINISHED"}

    def ask_to_confirm(
        self, context: Context, event: Event, question: str, message: str, verb: str
    ) -> set[str]:
        """Open a dialog that asks for a confirmation. Return the result of the operator while it is open.

        `question` is the title of the dialog, and `verb` is the label of the button that confirms.
        """
        texts = {"title": question, "message": message, "confirm_text": verb}
        return context.window_manager.invoke_confirm(self, event, icon="WARNING", **texts)

    def report_done(self, message: str) -> None:
        """Report what the operator has done."""
        self.report({"INFO"}, message)

    def report_warnings(self, *messages: str) -> None:
        """Report what the user should know about a result, each message once."""
        for message in dict.fromkeys(messages):
            if message not in self._reported:
                self.report({"WARNING"}, as_sentence(message))
        self._reported |= {*messages}

    def store_fields(
        self,
        context: Context,
        fields: dict[Mesh, RosyField],
        name: str = "",
        targets: FieldTargets | None = None,
    ) -> None:
        """Store fields on meshes with `assign_fields`, and apply the preferences to the scene.

        Shown singularities are updated. With the first field of a scene, the 3D view is made live if the
        preferences say so. If the preferences cannot be applied, or the view cannot be made live, the user
        gets a warning, and the field is stored all the same.

        Parameters
        ----------
        context : bpy.types.Context
        fields : dict of bpy.types.Mesh to RosyField
        name : str, optional
            Name of the attribute. By default the existing field of each mesh is replaced.
        targets : dict of bpy.types.Mesh to list of bpy.types.Object, optional
            For each mesh, the objects whose fields it will hold; see `field_targets`.

        Raises
        ------
        RosyError
            If a field cannot be stored on its mesh. Nothing is changed in this case.
        """
        is_first = not any(has_field(obj) for obj in context.scene.objects)
        assign_fields(fields, name)
        hold_fields({mesh: objs for mesh, objs in (targets or {}).items() if mesh in fields})
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


def sync_suffix(operator: Operator, suffix: str) -> bool:
    """Set the suffix, such as ".svg", of an operator's file path. Return whether the path has changed.

    A path without a file name is not changed.
    """
    path = Path(operator.filepath)
    if not path.name or path.suffix == suffix:
        return False
    operator.filepath = str(path.with_suffix(suffix))
    return True

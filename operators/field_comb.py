"""Operator: comb a field along a stroke, with the mouse in the 3D view or from a script."""

from __future__ import annotations

from contextlib import suppress

import bpy
import numpy as np

from ..rosy_addon.core.errors import REPORTED_ERRORS, RosyError
from ..rosy_addon.field.combing import EFFECTS, GuideBrush
from ..rosy_addon.jobs.comb_field import CombStroke
from ..rosy_addon.ui import comb_brush, overlay
from ..rosy_addon.ui.property_makers import brush_strength, choice, fraction, real, toggle
from ..rosy_addon.ui.sidebar import use_property_columns
from ..rosy_addon.viewport.brush_mouse import current_mouse, release_mouse
from ..rosy_addon.worker.job import Steps, part, reverting
from .base import ACTIVE_FIELD, IDLE, Condition
from .modal_job import ActiveMeshMixin, Job, ModalJobMixin, deleted_object

#: Modes of the view in which the field can be combed.
MODES = ("OBJECT", "SCULPT")


class RosyStrokePoint(bpy.types.PropertyGroup):
    """A point of a stroke: its location on the mesh in object space, and the pressure of the pen."""

    location: bpy.props.FloatVectorProperty(
        name="Location",
        description="Place on the mesh without modifiers, in object space",
        subtype="XYZ",
    )
    pressure: real("Pressure", "Pressure of the pen", min=0.0, max=1.0, default=1.0)
    is_start: toggle("Start", "Whether another line begins here, as after the pen left the mesh")


class ROSY_OT_field_comb(ActiveMeshMixin, ModalJobMixin, bpy.types.Operator):
    """Turn the field of the active mesh along a stroke, and keep the stroke as guides on the mesh"""

    bl_label = "Comb Field"
    conditions = (
        IDLE,
        Condition(
            lambda context: context.mode in MODES, "Switch to Object Mode or Sculpt Mode first"
        ),
        ACTIVE_FIELD,
    )

    stroke: bpy.props.CollectionProperty(
        type=RosyStrokePoint,
        name="Stroke",
        description="The points of the stroke",
        options={"HIDDEN", "SKIP_SAVE"},
    )
    effect: choice(
        "Effect",
        "What the brush does",
        [(name.upper(), name.capitalize(), text) for name, text in EFFECTS.items()],
    )
    radius: real(
        "Radius", "Radius of the brush", subtype="DISTANCE", min=1e-6, soft_max=10.0, default=0.2
    )
    strength: brush_strength()
    exact: toggle("Exact", "Let the field follow the stroke exactly, in the whole radius")
    front_faces: toggle(
        "Front Faces Only",
        "Leave out faces that are turned away from those under the brush",
        default=True,
    )
    mirror: bpy.props.BoolVectorProperty(
        name="Mirror",
        description="Repeat the stroke on the other side along each axis of the object",
        subtype="XYZ",
    )
    reach: fraction(
        "Reach",
        "Distance from the stroke at which the field stays what it is, as a fraction of the size of the "
        "mesh, when the mesh has no guides yet",
        soft_max=0.5,
        default=0.1,
    )

    #: The stroke that is drawn with the mouse. None until the mouse has been over the mesh.
    _line = None

    def begin(self, context: bpy.types.Context) -> Steps[None]:
        """Comb along all points of the property `stroke`.

        Return the steps of the job that solves for the field.
        """
        if not len(self.stroke):
            raise RosyError("the stroke has no points: give some, or drag in the 3D view")
        line = self._start_line()
        for point in self.stroke:
            if point.is_start:
                line.lift()
            line.extend(np.array([point.location]), np.array([point.pressure]))
        line.lift()
        return part(self._settle(context, line), 0.4, 1.0)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if len(self.stroke) or context.region_data is None:
            return super().invoke(context, event)
        self._is_away = False
        self.resolve_objects(context)
        try:
            self._mouse = current_mouse(context, self.objects[0], holds=True)
            self._add(context, event)
        except REPORTED_ERRORS as error:
            release_mouse()
            return self.report_error(error)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self._job is None:
            result = self._drag(context, event)
            if result != {"RUNNING_MODAL"} or self._job is not None:
                release_mouse()
            return result
        # If the next stroke begins, the job of this one is completed at once.
        is_next = event.type == "LEFTMOUSE" and event.value == "PRESS"
        result = super().modal(context, event, runs_to_end=is_next)
        return result | {"PASS_THROUGH"} if is_next else result

    def _drag(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Handle an event while the mouse button is down. Return the operator's result for this event."""
        try:
            if event.type in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"}:
                if self._add(context, event) and event.type == "MOUSEMOVE":
                    self._line.show()
            elif event.type in {"ESC", "RIGHTMOUSE"}:
                self._take_back()
                return {"CANCELLED"}
            elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
                if self._line is None:
                    self._click_beside(context, event)
                    return {"CANCELLED"}
                self._line.lift()
                self._line.show()
                steps = reverting(self._settle(context, self._line), self._line.restore)
                self._job = Job(context, steps, self._objects)
        except REPORTED_ERRORS as error:
            self._take_back()
            return self.report_error(error)
        except ReferenceError:
            return self.report_error(RosyError(f"'{deleted_object(self._objects)}' was deleted"))
        return {"RUNNING_MODAL"}

    def _take_back(self) -> None:
        """Restore the field as it was before the stroke, if it was changed and the mesh still exists."""
        with suppress(ReferenceError):
            if self._line is not None:
                self._line.restore()

    def _click_beside(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        """Select the object under the mouse after a click beside the mesh. Do nothing after a drag."""
        moved = np.hypot(
            event.mouse_x - event.mouse_prev_press_x, event.mouse_y - event.mouse_prev_press_y
        )
        is_click = moved <= context.preferences.inputs.drag_threshold_mouse
        if is_click and context.mode == "OBJECT" and self.effect == "COMB":
            mouse = event.mouse_region_x, event.mouse_region_y
            bpy.ops.view3d.select("EXEC_DEFAULT", True, deselect_all=True, location=mouse)

    def _add(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Extend the stroke to the point under the mouse. Return whether the field has changed."""
        place = self._mouse.place((event.mouse_region_x, event.mouse_region_y))
        if place is None:
            self._is_away = True
            return self._line is not None and self._line.lift()
        if self._line is None:
            comb = context.scene.rosy.comb
            self.radius, self.strength = self._mouse.radius(place, comb.size), comb.strength
            self._line = self._start_line()
        point = self.stroke.add()
        point.location, point.pressure = place, event.pressure
        point.is_start = len(self.stroke) > 1 and self._is_away
        self._is_away = False
        return self._line.extend(np.array([point.location]), np.array([point.pressure]))

    def _start_line(self) -> CombStroke:
        effect = self.effect.lower()
        brush = GuideBrush(
            self.radius, self.strength, effect, self.exact, self.front_faces, self.mirror
        )
        return CombStroke(self.meshes[0], brush, self.reach)

    def _settle(self, context: bpy.types.Context, line: CombStroke) -> Steps[None]:
        """Return the steps of the job that solves for the field after the stroke `line`, and stores it."""
        yield from line.settle()
        field = line.store()
        overlay.refresh(context, {line.mesh: field})

    def cancel(self, context: bpy.types.Context) -> None:
        """Cancel the stroke and its job, and restore the field.

        Blender calls this if the window is closed or a file is opened.
        """
        release_mouse()
        super().cancel(context)
        self._take_back()

    def draw(self, context: bpy.types.Context) -> None:
        use_property_columns(self.layout)
        comb_brush.draw_settings(self.layout, self)
        self.layout.prop(self, "radius")

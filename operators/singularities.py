"""Operators: show the singularities of fields, and move them, by vertex numbers or with the mouse."""

from __future__ import annotations

from dataclasses import replace

import bpy

from ..rosy_addon.core.errors import REPORTED_ERRORS, RosyError, counted
from ..rosy_addon.field.singularities import format_index
from ..rosy_addon.field.singularity_changes import OUTSIDE, move_index
from ..rosy_addon.scene import singularity_points
from ..rosy_addon.scene.datablocks import field_mesh
from ..rosy_addon.scene.field_attributes import has_field
from ..rosy_addon.scene.mesh_fields import read_mesh_field
from ..rosy_addon.scene.meshes import mesh_surface
from ..rosy_addon.ui import overlay, singularity_handles
from ..rosy_addon.ui.operator_settings import draw_settings
from ..rosy_addon.ui.property_makers import choice, fraction, integer, toggle
from ..rosy_addon.worker.job import Call, Steps
from .base import ACTIVE_FIELD, IDLE, IN_3D_VIEW, Condition, RosyOperator, selected_mesh_objects
from .modal_job import ActiveMeshMixin, ModalJobMixin

#: The property for the distance over which directions change, relative to `Surface.extent`.
#: ``rosy.drag_singularity`` passes its value on to ``rosy.field_singularities``.
REACH = fraction(
    "Reach",
    "Distance over which directions change, as a fraction of the size of the mesh. At least as "
    "far as the singularity moves",
    soft_max=0.5,
    default=0.1,
)


#: The condition for showing and hiding singularities. An object whose field was removed may still show them.
FIELD_OR_DOTS = Condition(
    lambda context: any(
        has_field(obj) or overlay.shown(obj) for obj in selected_mesh_objects(context)[:1]
    ),
    ACTIVE_FIELD.message,
)


class ROSY_OT_singularities(RosyOperator, bpy.types.Operator):
    """Show the singularities of the fields of the selected meshes: orange for positive index, blue for negative index"""

    bl_label = "Singularities"
    conditions = (IDLE, FIELD_OR_DOTS)

    show: choice(
        "Show",
        "How the singularities are shown",
        [
            ("OVERLAY", "Overlay", "Dots and indices in the 3D view"),
            ("POINTS", "Points", "A point object with an attribute 'index', in units of 1/N"),
            ("BOTH", "Both", "Overlay and points"),
            ("NONE", "Hide", "Remove the overlay and the points"),
        ],
    )

    def act(self, context: bpy.types.Context) -> None:
        if self.show == "NONE":
            _hide(context, selected_mesh_objects(context))
            return
        objects = [obj for obj in selected_mesh_objects(context) if has_field(obj)]
        depsgraph = context.evaluated_depsgraph_get()
        singularities_by_object = {
            obj: singularity_points.read_singularities(obj, depsgraph) for obj in objects
        }
        _hide(context, objects)
        for obj, singularities in singularities_by_object.items():
            if self.show in ("OVERLAY", "BOTH"):
                overlay.show(obj, singularities)
            if self.show in ("POINTS", "BOTH"):
                singularity_points.add_singularity_points(context.scene, obj, singularities)
        count = sum(map(len, singularities_by_object.values()))
        total = "; ".join(
            f"'{obj.name}': sum of the indices "
            f"{format_index(int(singularities.index.sum()), singularities.degree)}"
            for obj, singularities in singularities_by_object.items()
        )
        self.report_done(f"{counted(count, 'singularity', 'singularities')}; {total}")


def _hide(context: bpy.types.Context, objects: list[bpy.types.Object]) -> None:
    """Hide the singularities of objects in the overlay, and remove the point objects that show them."""
    for obj in objects:
        overlay.hide(obj)
        singularity_points.remove_singularity_points(context.scene, obj)


class ROSY_OT_field_singularities(ActiveMeshMixin, ModalJobMixin, bpy.types.Operator):
    """Move a singularity of the active mesh's field to another vertex, merge it with another one, split it, or make a pair"""

    bl_label = "Move Singularity"

    source: integer(
        "From",
        "Vertex whose index is moved. Without a singularity, it gets the opposite index. "
        "-1: beyond the border",
        min=OUTSIDE,
        default=OUTSIDE,
    )
    target: integer(
        "To",
        "Vertex to which the index is added. -1: beyond the border",
        min=OUTSIDE,
        default=OUTSIDE,
    )
    index: integer(
        "Index", "What is moved, in units of 1/N. 0: the whole index", soft_min=-4, soft_max=4
    )
    reach: REACH

    def begin(self, context: bpy.types.Context) -> Steps[None]:
        """Return the steps of the job that changes the singularities of the field of the active mesh."""
        mesh = field_mesh(self.objects[0])
        surface = mesh_surface(mesh)
        field = read_mesh_field(mesh, surface=surface)
        reach = self.reach * surface.extent
        inputs = surface, field, self.source, self.target, self.index, reach
        field = yield Call(move_index, inputs)
        self.store_fields(context, {mesh: replace(field, source_directions=None)})

    def draw(self, context: bpy.types.Context) -> None:
        draw_settings(self.layout, self, "source", "target", "index", "reach")


class ROSY_OT_drag_singularity(RosyOperator, bpy.types.Operator):
    """Drag a singularity along the surface, onto another one to merge them, or with Ctrl from any vertex to make a pair"""

    bl_label = "Drag Singularity"
    bl_options = {"INTERNAL"}
    conditions = (IN_3D_VIEW, *ActiveMeshMixin.conditions)

    make_pair: toggle(
        "Make Pair",
        "Start at any vertex, and leave the opposite index there",
        options={"SKIP_SAVE"},
    )
    reach: REACH

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._obj = selected_mesh_objects(context)[0]
        self._name = self._obj.name
        mouse = event.mouse_region_x, event.mouse_region_y
        try:
            self._drag = singularity_handles.start_drag(context, self._obj, mouse, self.make_pair)
        except REPORTED_ERRORS as error:
            return self.report_error(error)
        if self._drag is None:
            return {"CANCELLED", "PASS_THROUGH"}
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            return self._follow(context, event)
        except ReferenceError:
            self.cancel(context)
            return self.report_error(RosyError(f"'{self._name}' was deleted"))

    def _follow(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Handle an event of the drag. Return the operator's result for this event."""
        mouse = event.mouse_region_x, event.mouse_region_y
        if event.type in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"}:
            self._drag.move(context, mouse)
        elif event.type in {"ESC", "RIGHTMOUSE"}:
            self.cancel(context)
            return {"CANCELLED"}
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            # If Blender was busy, it may have skipped the last events of the mouse.
            self._drag.move(context, mouse)
            source, target = self._drag.source, self._drag.target
            self.cancel(context)
            if target is None or target == source:
                return {"CANCELLED"}
            with context.temp_override(selected_objects=[self._obj]):
                return self.call(
                    bpy.ops.rosy.field_singularities,
                    source=source,
                    target=target,
                    index=1 if self.make_pair else 0,
                    reach=self.reach,
                )
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Remove the drawing of the drag from the view.

        Blender also calls this if the window is closed or a file is opened during a drag.
        """
        self._drag.stop()

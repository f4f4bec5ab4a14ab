"""Operators: draw strokes along the fields of the scene, and remove them."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..rosy_addon.draw_strokes import StrokeResult, draw_strokes_task
from ..rosy_addon.progress import Task
from ..rosy_addon.scene.cameras import CameraSource
from ..rosy_addon.scene.stroke_objects import remove_strokes, stroke_objects, target_objects
from ..rosy_addon.ui.properties import STROKE_CAMERA_ITEMS, STROKE_KIND_ITEMS
from .bake import view_camera
from .modal_task import ModalTaskMixin
from .poll import poll_has_field, poll_idle


class ROSY_OT_strokes(ModalTaskMixin, bpy.types.Operator):
    """Cover the meshes that have a field with evenly spaced strokes along it, as the camera sees them"""

    bl_idname = "rosy.strokes"
    bl_label = "Draw Strokes"
    bl_options = {"UNDO"}

    kind: bpy.props.EnumProperty(
        name="Make",
        description="What the strokes are made into; as the scene says if not given",
        items=STROKE_KIND_ITEMS,
    )
    camera: bpy.props.EnumProperty(
        name="Camera",
        description="From where strokes are seen; as the scene says if not given",
        items=STROKE_CAMERA_ITEMS,
    )
    filepath: bpy.props.StringProperty(
        name="File", description="The .svg file; as the scene says if not given"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave this mode first: press Tab or choose Object Mode")
            return False
        return poll_has_field(cls, context)

    def make_task(self, context: bpy.types.Context) -> Task[StrokeResult]:
        is_set = self.properties.is_property_set
        return draw_strokes_task(
            context.scene,
            kind=self.kind if is_set("kind") else None,
            path=self.filepath if is_set("filepath") else None,
            objects=target_objects(context.scene, context.view_layer),
            camera=self._camera(context),
        )

    def required_data(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return target_objects(context.scene, context.view_layer)

    def finish(self, context: bpy.types.Context, result: StrokeResult) -> None:
        destination = f"'{result.obj.name}'" if result.path is None else str(result.path)
        self.report(
            {"INFO"},
            f"{len(result.drawing.strokes):,} strokes from '{result.camera}': {destination}",
        )
        for note in result.notes:
            self.report({"WARNING"}, note)

    def _camera(self, context: bpy.types.Context) -> CameraSource | None:
        """Return the camera of the current view if it is chosen; None for the scene's camera."""
        is_set = self.properties.is_property_set("camera")
        source = self.camera if is_set else context.scene.rosy.strokes.camera
        return view_camera(context) if source == "VIEW" else None


class ROSY_OT_strokes_remove(bpy.types.Operator):
    """Take away the strokes that RoSy put into this scene; fields, pictures and files stay"""

    bl_idname = "rosy.strokes_remove"
    bl_label = "Remove Strokes"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not poll_idle(cls):
            return False
        if not stroke_objects(context.scene):
            cls.poll_message_set("There are no strokes in this scene")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        count = remove_strokes(context.scene)
        self.report({"INFO"}, f"Removed {count} object{'s' if count > 1 else ''} of strokes")
        return {"FINISHED"}


CLASSES = (ROSY_OT_strokes, ROSY_OT_strokes_remove)

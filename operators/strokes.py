"""Draw strokes along the fields of the scene, and take them away."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..rosy_addon.bake import Source
from ..rosy_addon.progress import Work
from ..rosy_addon.scene.strokes import remove_strokes, stroke_objects, wanted_objects
from ..rosy_addon.sketch import Sketch, sketching
from ..rosy_addon.ui.properties import STROKE_CAMERAS, STROKE_KINDS
from .bake import view_camera
from .meshes import can_draw, is_idle
from .ticking import Ticking


class ROSY_OT_strokes(Ticking, bpy.types.Operator):
    """Cover the meshes that have a field with evenly spaced strokes along it, as the camera sees them"""

    bl_idname = "rosy.strokes"
    bl_label = "Draw Strokes"
    bl_options = {"UNDO"}

    kind: bpy.props.EnumProperty(
        name="Make",
        description="What the strokes are made into; as the scene says if not given",
        items=STROKE_KINDS,
    )
    camera: bpy.props.EnumProperty(
        name="Camera",
        description="From where strokes are seen; as the scene says if not given",
        items=STROKE_CAMERAS,
    )
    filepath: bpy.props.StringProperty(
        name="File", description="The .svg file; as the scene says if not given"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave this mode first: press Tab or choose Object Mode")
            return False
        return can_draw(cls, context)

    def work(self, context: bpy.types.Context) -> Work[Sketch]:
        given = self.properties.is_property_set
        return sketching(
            context.scene,
            kind=self.kind if given("kind") else None,
            path=self.filepath if given("filepath") else None,
            objects=wanted_objects(context.scene, context.view_layer),
            camera=self._camera(context),
        )

    def needed(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return wanted_objects(context.scene, context.view_layer)

    def finish(self, context: bpy.types.Context, result: Sketch) -> None:
        where = f"'{result.thing.name}'" if result.path is None else str(result.path)
        self.report(
            {"INFO"}, f"{len(result.drawn.strokes):,} strokes from '{result.camera}': {where}"
        )
        for note in result.notes:
            self.report({"WARNING"}, note)

    def _camera(self, context: bpy.types.Context) -> Source | None:
        given = self.properties.is_property_set("camera")
        chosen = self.camera if given else context.scene.rosy.strokes.camera
        return view_camera(context) if chosen == "VIEW" else None


class ROSY_OT_strokes_remove(bpy.types.Operator):
    """Take away the strokes that RoSy put into this scene; fields, pictures and files stay"""

    bl_idname = "rosy.strokes_remove"
    bl_label = "Remove Strokes"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not is_idle(cls):
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

"""Draw the fields of the scene as a camera or the view sees them."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..rosy_addon.bake import Baked, Source, baking
from ..rosy_addon.errors import RosyError
from ..rosy_addon.progress import Work
from ..rosy_addon.projection.camera import Camera
from ..rosy_addon.scene.bodies import rosy_objects
from ..rosy_addon.scene.cameras import camera_of_view, render_camera, scene_cameras
from ..rosy_addon.ui.properties import CAMERAS
from .meshes import can_draw
from .ticking import Ticking


class ROSY_OT_bake(Ticking, bpy.types.Operator):
    """Draw the fields of the scene as the chosen camera sees them, and put the picture on the meshes"""

    bl_idname = "rosy.bake"
    bl_label = "Bake"
    bl_options = {"UNDO"}

    camera: bpy.props.EnumProperty(
        name="Camera", description="From where the fields are drawn", items=CAMERAS
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_draw(cls, context)

    def work(self, context: bpy.types.Context) -> Work[list[Baked]]:
        return baking(context.scene, cameras=self._cameras(context))

    def needed(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return rosy_objects(context.view_layer)

    def finish(self, context: bpy.types.Context, result: list[Baked]) -> None:
        names = ", ".join(f"'{baked.camera}'" for baked in result)
        self.report({"INFO"}, f"Baked from {names}")
        for note in dict.fromkeys(note for baked in result for note in baked.notes):
            self.report({"WARNING"}, note)

    def _cameras(self, context: bpy.types.Context) -> list[Source]:
        scene = context.scene
        chosen = self.camera if self.properties.is_property_set("camera") else scene.rosy.camera
        if chosen == "VIEW":
            return [view_camera(context)]
        return scene_cameras(scene) if chosen == "ALL" else [render_camera(scene)]


def view_camera(context: bpy.types.Context) -> Camera:
    area = context.area
    if area is None or area.type != "VIEW_3D":
        raise RosyError("the current view is that of a 3D view: start this from one")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return camera_of_view(region, area.spaces.active.region_3d)


CLASSES = (ROSY_OT_bake,)

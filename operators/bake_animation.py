"""Draw the fields of the scene at every frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import bpy

from ..rosy_addon.animation import Frames, baking_animation
from ..rosy_addon.errors import RosyError
from ..rosy_addon.progress import Work
from ..rosy_addon.scene.apply import folder_of, settings_of
from ..rosy_addon.scene.bodies import rosy_objects
from ..rosy_addon.scene.cameras import scene_cameras
from .meshes import can_draw
from .ticking import Ticking


class ROSY_OT_bake_animation(Ticking, bpy.types.Operator):
    """Draw the fields at every frame of the scene into a folder, and let materials play the pictures back. Frames that are there and up to date stay; stopped with ESC, it goes on there next time"""

    bl_idname = "rosy.bake_animation"
    bl_label = "Bake Animation"
    bl_options = {"UNDO"}
    if_stopped = "frames that are done stay"

    first: bpy.props.IntProperty(name="First", description="Frame", default=1)
    last: bpy.props.IntProperty(name="Last", description="Frame", default=250)
    step: bpy.props.IntProperty(name="Step", description="From frame to frame", default=1, min=1)
    all_cameras: bpy.props.BoolProperty(
        name="All Cameras",
        description="A sequence of pictures from each camera, instead of one from the camera that "
        "renders each frame",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_draw(cls, context)

    def work(self, context: bpy.types.Context) -> Work[list[Frames]]:
        scene = context.scene
        chosen = {
            name: getattr(self, name) if self.properties.is_property_set(name) else usual
            for name, usual in (
                ("first", scene.frame_start),
                ("last", scene.frame_end),
                ("step", scene.frame_step),
            )
        }
        frames = range(chosen["first"], chosen["last"] + 1, chosen["step"])
        if not len(frames):
            raise RosyError(f"frames {chosen['first']} to {chosen['last']}: there are none")
        cameras = scene_cameras(scene) if self.all_cameras else None
        # Frames go to the scene's folder even if single pictures are packed.
        settings = replace(settings_of(scene), folder=folder_of(scene))
        return baking_animation(scene, frames, cameras=cameras, settings=settings)

    def needed(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return rosy_objects(context.view_layer)

    def finish(self, context: bpy.types.Context, result: list[Frames]) -> None:
        for each in result:
            self.report(
                {"INFO"},
                f"{len(each.drawn)} frames drawn, {len(each.kept)} were there: {each.strip.path}",
            )


CLASSES = (ROSY_OT_bake_animation,)

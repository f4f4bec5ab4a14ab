"""Operator: bake pictures of the fields at every frame, as image sequences."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import bpy

from ..rosy_addon.animation import SequenceResult, bake_animation_task
from ..rosy_addon.errors import RosyError
from ..rosy_addon.progress import Task
from ..rosy_addon.scene.cameras import scene_cameras
from ..rosy_addon.scene.pictures import output_folder, read_output_settings
from ..rosy_addon.scene.scene_reader import field_objects
from .modal_task import ModalTaskMixin
from .poll import poll_has_field


class ROSY_OT_bake_animation(ModalTaskMixin, bpy.types.Operator):
    """Draw the fields at every frame of the scene into a folder, and let materials play the pictures back. Frames that are up to date are kept; after a stop with ESC, the next run continues from there"""

    bl_idname = "rosy.bake_animation"
    bl_label = "Bake Animation"
    bl_options = {"UNDO"}
    cancel_note = "frames that are done stay"

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
        return poll_has_field(cls, context)

    def make_task(self, context: bpy.types.Context) -> Task[list[SequenceResult]]:
        scene = context.scene
        frame_settings = {
            name: getattr(self, name) if self.properties.is_property_set(name) else default
            for name, default in (
                ("first", scene.frame_start),
                ("last", scene.frame_end),
                ("step", scene.frame_step),
            )
        }
        frames = range(frame_settings["first"], frame_settings["last"] + 1, frame_settings["step"])
        if not len(frames):
            raise RosyError(
                f"frames {frame_settings['first']} to {frame_settings['last']}: there are none"
            )
        cameras = scene_cameras(scene) if self.all_cameras else None
        # Frames are saved in the scene's folder, even if single pictures are packed.
        settings = replace(read_output_settings(scene), folder=output_folder(scene))
        return bake_animation_task(scene, frames, cameras=cameras, settings=settings)

    def required_data(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return field_objects(context.view_layer)

    def finish(self, context: bpy.types.Context, result: list[SequenceResult]) -> None:
        for sequence in result:
            self.report(
                {"INFO"},
                f"{len(sequence.rendered)} frames drawn, {len(sequence.skipped)} were there: {sequence.sequence.path}",
            )


CLASSES = (ROSY_OT_bake_animation,)

"""Operator: bake pictures of the fields at every frame, as image sequences."""

from __future__ import annotations

from dataclasses import replace

import bpy

from ..rosy_addon.core.errors import RosyError, counted
from ..rosy_addon.jobs.animation import SequenceResult, bake_animation
from ..rosy_addon.scene.cameras import scene_cameras
from ..rosy_addon.scene.files import output_folder
from ..rosy_addon.scene.pictures import read_output_settings
from ..rosy_addon.ui.preferences import worker_count
from ..rosy_addon.ui.property_makers import integer, text, toggle
from ..rosy_addon.worker.job import Steps
from .base import IDLE, VISIBLE_FIELD
from .modal_job import DialogJobMixin


class ROSY_OT_bake_animation(DialogJobMixin, bpy.types.Operator):
    """Draw the fields at every frame, save the pictures to a folder, and play them back on the meshes. Frames that are up to date are kept, so a run that was stopped with ESC can be continued"""

    bl_idname = "rosy.bake_animation"
    bl_label = "Bake Animation"
    bl_options = {"UNDO"}
    conditions = (IDLE, VISIBLE_FIELD)
    cancel_note = "completed frames were kept"

    first: integer("First", "First frame", default=1)
    last: integer("Last", "Last frame", default=250)
    step: integer("Step", "Step between frames", default=1, min=1)
    all_cameras: toggle(
        "All Cameras",
        "A sequence of pictures from each camera, instead of one from the camera that "
        "renders each frame",
    )

    directory: text(
        "Folder",
        "Folder that was chosen in the file browser",
        subtype="DIR_PATH",
        options={"HIDDEN", "SKIP_SAVE"},
    )
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def ask(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str] | None:
        """Ask for a folder if the scene has none, as in a file that was never saved."""
        try:
            output_folder(context.scene)
        except RosyError:
            for name, value in self._frame_settings(context.scene).items():
                setattr(self, name, value)
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}
        return None

    def take_answer(self, context: bpy.types.Context) -> None:
        context.scene.rosy.directory = self.directory

    def begin(self, context: bpy.types.Context) -> Steps[list[SequenceResult]]:
        scene = context.scene
        frame_settings = self._frame_settings(scene)
        frames = range(frame_settings["first"], frame_settings["last"] + 1, frame_settings["step"])
        if not len(frames):
            raise RosyError(
                f"the last frame, {frame_settings['last']}, is before the first, "
                f"{frame_settings['first']}"
            )
        cameras = scene_cameras(scene) if self.all_cameras else None
        # Frames are saved in the scene's folder, even if single pictures are packed.
        settings = replace(read_output_settings(scene), folder=output_folder(scene))
        return bake_animation.begin(
            scene,
            frames,
            cameras=cameras,
            settings=settings,
            workers=worker_count(context),
        )

    def _frame_settings(self, scene: bpy.types.Scene) -> dict[str, int]:
        """Return the first and last frame and the step: the operator's, by default the scene's."""
        return {
            "first": self.chosen("first", scene.frame_start),
            "last": self.chosen("last", scene.frame_end),
            "step": self.chosen("step", scene.frame_step),
        }

    def finish(self, context: bpy.types.Context, result: list[SequenceResult]) -> None:
        for sequence in result:
            self.report_done(
                f"{counted(len(sequence.rendered), 'frame')} drawn, {len(sequence.skipped)} up to date: {sequence.sequence.path}"
            )
        self.report_warnings(*(text for sequence in result for text in sequence.warnings))

"""Operators: bake pictures of fields and ambient occlusion; show and remove baked pictures."""

from __future__ import annotations

import bpy

from ..rosy_addon.core.errors import RosyError, counted
from ..rosy_addon.jobs.animation import SequenceResult, bake_animation
from ..rosy_addon.jobs.bake import bake
from ..rosy_addon.projection.ambient_occlusion import DIRECTION_COUNT
from ..rosy_addon.projection.camera import Camera
from ..rosy_addon.scene.bake_records import has_pictures, remove_bakes
from ..rosy_addon.scene.cameras import CameraSource, camera_of_view, render_camera, scene_cameras
from ..rosy_addon.scene.computed_attributes import OCCLUSION_ATTRIBUTE, store_occlusion
from ..rosy_addon.scene.files import output_folder
from ..rosy_addon.scene.pictures import BakeResult, read_output_settings, show_bake
from ..rosy_addon.ui.main_panel import SHADING_WITHOUT_MATERIALS
from ..rosy_addon.ui.preferences import worker_count
from ..rosy_addon.ui.properties import CAMERA_ITEMS
from ..rosy_addon.ui.property_makers import choice, integer, text, toggle
from ..rosy_addon.viewport import session
from ..rosy_addon.worker.job import Steps
from .base import IDLE, IN_3D_VIEW, VISIBLE_FIELD, Condition, RosyOperator
from .modal_job import ModalJobMixin


class ROSY_OT_bake(ModalJobMixin, bpy.types.Operator):
    """Draw the fields of the scene from the chosen camera, and apply the picture to the meshes"""

    bl_label = "Bake"
    bl_options = {"UNDO"}
    conditions = (IDLE, VISIBLE_FIELD)

    camera: choice("Camera", "Camera to draw from", CAMERA_ITEMS)

    def find_objects(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        cameras = [camera for camera in self._cameras(context) if not isinstance(camera, Camera)]
        return [*super().find_objects(context), *cameras]

    def begin(self, context: bpy.types.Context) -> Steps[list[BakeResult]]:
        return bake.begin(
            context.scene, cameras=self._cameras(context), workers=worker_count(context)
        )

    def finish(self, context: bpy.types.Context, result: list[BakeResult]) -> None:
        names = ", ".join(f"'{picture.camera}'" for picture in result)
        self.report_done(f"Baked from {names}")
        self.report_warnings(*(text for picture in result for text in picture.warnings))

    def _cameras(self, context: bpy.types.Context) -> list[CameraSource]:
        """Return the cameras to bake from, as set for the operator, or else in the settings of the scene."""
        scene = context.scene
        source = self.chosen("camera", scene.rosy.camera)
        if source == "VIEW":
            return [view_camera(context)]
        return scene_cameras(scene) if source == "ALL" else [render_camera(scene)]


def view_camera(context: bpy.types.Context) -> Camera:
    """Return the camera of the current 3D view.

    Raises
    ------
    RosyError
        If the current area is not a 3D view.
    """
    area = context.area
    if area is None or area.type != "VIEW_3D":
        raise RosyError("there is no current view: run the operator in a 3D view")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return camera_of_view(region, area.spaces.active.region_3d)


class ROSY_OT_bake_animation(ModalJobMixin, bpy.types.Operator):
    """Draw the fields at every frame, save the pictures to a folder, and play them back on the meshes. Frames that are up to date are kept, so a run that was stopped with ESC can be continued"""

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
        """Ask for a folder if the scene has none, such as in a file that was never saved.

        Return the result of the operator; None if nothing is asked.
        """
        try:
            output_folder(context.scene)
        except RosyError:
            self.first, self.last, self.step = self._frame_settings(context.scene)
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}
        return None

    def take_answer(self, context: bpy.types.Context) -> None:
        context.scene.rosy.directory = self.directory

    def find_objects(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        cameras = scene_cameras(context.scene) if self.all_cameras else []
        return [*super().find_objects(context), *cameras]

    def begin(self, context: bpy.types.Context) -> Steps[list[SequenceResult]]:
        scene = context.scene
        first, last, step = self._frame_settings(scene)
        frames = range(first, last + 1, step)
        if not len(frames):
            raise RosyError(f"the last frame, {last}, is before the first, {first}")
        cameras = scene_cameras(scene) if self.all_cameras else None
        # Frames are saved to the folder of the scene, even if single pictures are packed into the .blend
        # file.
        settings = read_output_settings(scene, output_folder(scene))
        return bake_animation.begin(
            scene, frames, cameras=cameras, settings=settings, workers=worker_count(context)
        )

    def _frame_settings(self, scene: bpy.types.Scene) -> tuple[int, int, int]:
        """Return the first and last frame and the step, as set for the operator, or else in the scene."""
        first = self.chosen("first", scene.frame_start)
        last = self.chosen("last", scene.frame_end)
        return first, last, self.chosen("step", scene.frame_step)

    def finish(self, context: bpy.types.Context, result: list[SequenceResult]) -> None:
        for sequence in result:
            self.report_done(
                f"{counted(len(sequence.rendered), 'frame')} drawn, {len(sequence.skipped)} up to date: {sequence.path}"
            )
        self.report_warnings(*(text for sequence in result for text in sequence.warnings))


class ROSY_OT_occlusion(ModalJobMixin, bpy.types.Operator):
    """Compute the ambient occlusion of all meshes with a field, store it as an attribute, and use it as the tone"""

    bl_label = "Tone by Occlusion"
    conditions = (IDLE, VISIBLE_FIELD)

    directions: integer(
        "Directions",
        "Number of sampled directions of light. More are smoother and take longer",
        default=DIRECTION_COUNT,
        min=1,
        soft_min=32,
        max=65536,
    )

    def begin(self, context: bpy.types.Context) -> Steps[None]:
        depsgraph = context.evaluated_depsgraph_get()
        return store_occlusion.begin(depsgraph, self.objects, direction_count=self.directions)

    def finish(self, context: bpy.types.Context, result: None) -> None:
        settings = context.scene.rosy
        settings.tone_attribute, settings.look.tone = OCCLUSION_ATTRIBUTE, "attribute"
        self.report_done(
            f"Stored ambient occlusion as attribute '{OCCLUSION_ATTRIBUTE}', the source of the tone"
        )


class ROSY_OT_show(RosyOperator, bpy.types.Operator):
    """Show the picture that was baked from this camera on the meshes"""

    bl_label = "Show Picture"
    conditions = (IDLE,)

    camera: text("Camera", "Name of the camera")

    def act(self, context: bpy.types.Context) -> None:
        show_bake(context.scene, self.camera)


class ROSY_OT_show_here(RosyOperator, bpy.types.Operator):
    """Show the baked pictures in this 3D view as in renders: with materials, in the light of the scene, without live fields"""

    bl_label = "Show the Picture Here"
    bl_options = {"REGISTER"}
    conditions = (IN_3D_VIEW,)

    def act(self, context: bpy.types.Context) -> None:
        space = context.space_data
        session.stop(space)
        if space.shading.type in SHADING_WITHOUT_MATERIALS:
            space.shading.type = "MATERIAL"
        space.shading.use_scene_lights = space.shading.use_scene_world = True


class ROSY_OT_remove(RosyOperator, bpy.types.Operator):
    """Remove the pictures of this scene, and the modifiers and materials that show them. Fields are kept"""

    bl_label = "Remove Pictures"
    conditions = (
        IDLE,
        Condition(lambda context: has_pictures(context.scene), "This scene has no baked pictures"),
    )

    def act(self, context: bpy.types.Context) -> None:
        removed = remove_bakes(context.scene)
        self.report_done(
            f"Removed {counted(removed.images, 'picture')} from {counted(removed.objects, 'object')}"
        )

"""Operator: bake pictures of the fields from a camera, all cameras or the current view."""

from __future__ import annotations

import bpy

from ..rosy_addon.core.errors import RosyError
from ..rosy_addon.jobs.bake import BakeResult, bake
from ..rosy_addon.projection.camera import Camera
from ..rosy_addon.scene.cameras import CameraSource, camera_of_view, render_camera, scene_cameras
from ..rosy_addon.ui.preferences import worker_count
from ..rosy_addon.ui.properties import CAMERA_ITEMS
from ..rosy_addon.ui.property_makers import choice
from ..rosy_addon.worker.job import Steps
from .base import IDLE, VISIBLE_FIELD
from .modal_job import ModalJobMixin


class ROSY_OT_bake(ModalJobMixin, bpy.types.Operator):
    """Draw the fields of the scene from the chosen camera, and apply the picture to the meshes"""

    bl_idname = "rosy.bake"
    bl_label = "Bake"
    bl_options = {"UNDO"}
    conditions = (IDLE, VISIBLE_FIELD)

    camera: choice("Camera", "Camera to draw from", CAMERA_ITEMS)

    def begin(self, context: bpy.types.Context) -> Steps[list[BakeResult]]:
        return bake.begin(
            context.scene, cameras=self._cameras(context), workers=worker_count(context)
        )

    def finish(self, context: bpy.types.Context, result: list[BakeResult]) -> None:
        names = ", ".join(f"'{picture.camera}'" for picture in result)
        self.report_done(f"Baked from {names}")
        self.report_warnings(*(text for picture in result for text in picture.warnings))

    def _cameras(self, context: bpy.types.Context) -> list[CameraSource]:
        """Return the cameras to bake from: the operator's choice, by default the scene's."""
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

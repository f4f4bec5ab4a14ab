"""Operators: draw strokes along the fields of the scene, and remove them."""

from __future__ import annotations

import bpy

from ..rosy_addon.core.errors import counted
from ..rosy_addon.jobs.draw_strokes import StrokeResult, draw_strokes
from ..rosy_addon.line_drawing.polyline_files import DRAWING_SUFFIXES
from ..rosy_addon.scene import stroke_objects
from ..rosy_addon.scene.cameras import CameraSource
from ..rosy_addon.ui.properties import STROKE_CAMERA_ITEMS, STROKE_KIND_ITEMS
from ..rosy_addon.ui.property_makers import choice, file_filter, text
from ..rosy_addon.worker.job import Steps
from .bake import view_camera
from .base import IDLE, OBJECT_MODE, VISIBLE_FIELD, Condition, RosyOperator, sync_suffix
from .modal_job import ModalJobMixin


class ROSY_OT_strokes(ModalJobMixin, bpy.types.Operator):
    """Draw evenly spaced strokes along the fields of the meshes, as seen from the camera"""

    bl_label = "Draw Strokes"
    bl_options = {"UNDO"}
    conditions = (OBJECT_MODE, IDLE, VISIBLE_FIELD)

    kind: choice(
        "Make", "Type of object or file. Default: the setting of the scene", STROKE_KIND_ITEMS
    )
    camera: choice(
        "Camera", "Viewpoint of the strokes. Default: the setting of the scene", STROKE_CAMERA_ITEMS
    )
    filepath: text(
        "File",
        "Path of the .svg, .ply, .obj or .csv file. Default: the setting of the scene",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    filter_glob: file_filter(*DRAWING_SUFFIXES)
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def ask(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str] | None:
        """Ask for the path if strokes go to a file. Return the result of the operator; None if nothing is asked."""
        if self._kind(context) != "FILE" or self.properties.is_property_set("filepath"):
            return None
        self.filepath = bpy.path.abspath(context.scene.rosy.strokes.filepath)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def take_answer(self, context: bpy.types.Context) -> None:
        context.scene.rosy.strokes.filepath = self.filepath

    def check(self, context: bpy.types.Context) -> bool:
        """Give the file name the suffix .svg, unless it ends with .svg, .ply, .obj or .csv.

        Return whether the name has changed. The file browser calls this.
        """
        return not self.filepath.lower().endswith(DRAWING_SUFFIXES) and sync_suffix(self, ".svg")

    def draw(self, context: bpy.types.Context) -> None:
        """Show no settings in the file browser: the settings of the panel apply."""

    def begin(self, context: bpy.types.Context) -> Steps[StrokeResult]:
        return draw_strokes.begin(
            context.scene,
            kind=self._kind(context),
            collection=context.collection,
            path=self.chosen("filepath", None),
            objects=stroke_objects.target_objects(context.scene, context.view_layer),
            camera=self._camera(context),
        )

    def finish(self, context: bpy.types.Context, result: StrokeResult) -> None:
        destination = f"'{result.obj.name}'" if result.path is None else str(result.path)
        self.report_done(
            f"{counted(len(result.drawing.strokes), 'stroke')} from '{result.camera}': {destination}"
        )
        self.report_warnings(*result.notes)

    def _kind(self, context: bpy.types.Context) -> str:
        """Return the kind of object or file to make, as set for the operator, or else in the scene."""
        return self.chosen("kind", context.scene.rosy.strokes.kind)

    def _camera(self, context: bpy.types.Context) -> CameraSource | None:
        """Return the camera of the current 3D view if the view is chosen.

        None means the camera of the scene.
        """
        source = self.chosen("camera", context.scene.rosy.strokes.camera)
        return view_camera(context) if source == "VIEW" else None


class ROSY_OT_strokes_remove(RosyOperator, bpy.types.Operator):
    """Remove the stroke objects of this scene. Fields, pictures and files are kept"""

    bl_label = "Remove Strokes"
    conditions = (
        IDLE,
        Condition(
            lambda context: stroke_objects.stroke_objects(context.scene),
            "This scene has no strokes",
        ),
    )

    def act(self, context: bpy.types.Context) -> None:
        count = stroke_objects.remove_strokes(context.scene)
        self.report_done(f"Removed {counted(count, 'object')} with strokes")

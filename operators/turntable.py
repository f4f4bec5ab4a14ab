"""Operator: render a turntable video of the active object."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from math import degrees
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..rosy_addon.cache import Cache
from ..rosy_addon.file_io import check_writable
from ..rosy_addon.gpu.select import select_renderer
from ..rosy_addon.progress import Task, as_task, subtask
from ..rosy_addon.projection.camera import check_size
from ..rosy_addon.rendering.band_workers import BandWorkers
from ..rosy_addon.scene.look_properties import read_look
from ..rosy_addon.scene.read_view import read_turntable
from ..rosy_addon.scene.video import encode_video
from ..rosy_addon.turntable_video import (
    check_still,
    check_video_path,
    evicting,
    turntable,
    turntable_views,
)
from ..rosy_addon.ui.preferences import worker_count
from .modal_task import ModalTaskMixin
from .poll import poll_active_field, poll_idle, selected_mesh_objects, sync_suffix

#: Properties that are passed on from the file browser to the operator that does the work.
VIDEO_SETTINGS = ("filepath", "film", "pictures", "rate", "width", "height", "elevation", "still")


class ROSY_OT_turntable(ModalTaskMixin, bpy.types.Operator, ExportHelper):
    """Render a turntable video of the active mesh with its field, with the look of the scene"""

    bl_idname = "rosy.turntable"
    bl_label = "Turntable"
    bl_options = {"REGISTER"}
    cancel_note = "no video was written"

    _in_browser = False

    filename_ext = ".mp4"
    filter_glob: bpy.props.StringProperty(default="*.mp4;*.gif", options={"HIDDEN"})
    film: bpy.props.EnumProperty(
        name="Format",
        description="Format of the video",
        items=[(".mp4", "MP4", "H.264"), (".gif", "GIF", "256 colors, for web pages")],
    )
    pictures: bpy.props.IntProperty(
        name="Pictures", description="Pictures in a full turn", default=72, min=2, max=10_000
    )
    rate: bpy.props.FloatProperty(
        name="Rate", description="Pictures per second", default=24.0, min=0.1, max=120.0
    )
    width: bpy.props.IntProperty(
        name="Width",
        description="Width of the video",
        subtype="PIXEL",
        default=512,
        min=16,
        max=8192,
    )
    height: bpy.props.IntProperty(
        name="Height",
        description="Height of the video",
        subtype="PIXEL",
        default=512,
        min=16,
        max=8192,
    )
    elevation: bpy.props.FloatProperty(
        name="Elevation",
        description="Angle of the camera above the horizon",
        subtype="ANGLE",
        default=0.35,
        min=-1.5,
        max=1.5,
    )
    still: bpy.props.BoolProperty(
        name="Still Camera",
        description="Leave the camera where it is, so that only streaks drift: a look with Flow",
    )
    skip_browser: bpy.props.BoolProperty(
        name="Skip Browser",
        description="Start without a file browser",
        options={"HIDDEN", "SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls) and poll_active_field(cls, context)

    def check(self, context: bpy.types.Context) -> bool:
        """Set the suffix of the file name to the video format's in the file browser."""
        return sync_suffix(self, self.film)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.skip_browser:
            return ModalTaskMixin.invoke(self, context, event)
        self._in_browser = True
        return ExportHelper.invoke(self, context, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._in_browser:
            return ModalTaskMixin.execute(self, context)
        # Blender frees an operator when its file browser is confirmed. A second one does the work.
        settings = {name: getattr(self, name) for name in VIDEO_SETTINGS}
        try:
            result = bpy.ops.rosy.turntable("INVOKE_DEFAULT", skip_browser=True, **settings)
        except RuntimeError as error:  # reported by the second operator
            self.report({"ERROR"}, str(error).strip().removeprefix("Error: "))
            return {"CANCELLED"}
        return {"CANCELLED"} if result == {"CANCELLED"} else {"FINISHED"}

    def make_task(self, context: bpy.types.Context) -> Task[Path]:
        path = Path(bpy.path.abspath(self.filepath))
        check_writable(path)
        check_video_path(path)
        return self._turntable_task(context, path)

    def _turntable_task(self, context: bpy.types.Context, path: Path) -> Task[Path]:
        """Read the mesh, and draw and write the video."""
        scene = context.scene
        look = read_look(scene.rosy)
        look = replace(look, supersampling=max(look.supersampling, 2))
        obj = selected_mesh_objects(context)[0]
        check_still(look, self.still, obj.name)
        depsgraph = context.evaluated_depsgraph_get()
        reading = as_task(read_turntable, scene, depsgraph, obj, look)
        instance, lights = yield from subtask(reading, 0.0, 0.0)
        size, view_angles = check_size(self.width, self.height), (-25.0, degrees(self.elevation))
        views = turntable_views(
            instance, look, self.pictures, size, view_angles, lights=lights, still=self.still
        )
        cache = Cache()
        with BandWorkers(worker_count(context)) as pool:
            renderer = select_renderer(
                scene.rosy.device.lower(), look, cache, keep_gbuffers=self.still, workers=pool
            )
            task = as_task(
                turntable,
                renderer,
                evicting(views, cache),
                self.pictures,
                path,
                self.rate,
                partial(as_task, encode_video),
            )
            return (yield from task)

    def required_data(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return selected_mesh_objects(context)[:1]

    def finish(self, context: bpy.types.Context, result: Path) -> None:
        self.report({"INFO"}, f"Wrote {result}")


CLASSES = (ROSY_OT_turntable,)

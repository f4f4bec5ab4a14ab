"""Operator: render a turntable video of the active object."""

from __future__ import annotations

from collections.abc import Iterable
from math import degrees
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..rosy_addon.file_io import check_writable
from ..rosy_addon.projection.camera import check_size
from ..rosy_addon.render_turntable import render_turntable
from ..rosy_addon.turntable_video import check_video_path
from ..rosy_addon.ui.preferences import worker_count
from ..rosy_addon.worker.job import Steps
from .modal_job import ModalJobMixin
from .poll import poll_active_field, poll_idle, selected_mesh_objects, sync_suffix
from .reports import report_operator_error

#: Azimuth of the first picture, in degrees.
AZIMUTH = -25.0

#: Properties that are passed on from the file browser to the operator that does the work.
VIDEO_SETTINGS = ("filepath", "film", "pictures", "rate", "width", "height", "elevation", "still")


class ROSY_OT_turntable(ModalJobMixin, bpy.types.Operator, ExportHelper):
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
            return ModalJobMixin.invoke(self, context, event)
        self._in_browser = True
        return ExportHelper.invoke(self, context, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._in_browser:
            return ModalJobMixin.execute(self, context)
        # Blender frees an operator when its file browser is confirmed. A second one does the work.
        settings = {name: getattr(self, name) for name in VIDEO_SETTINGS}
        try:
            result = bpy.ops.rosy.turntable("INVOKE_DEFAULT", skip_browser=True, **settings)
        except RuntimeError as error:  # reported by the second operator
            return report_operator_error(self, error)
        return {"CANCELLED"} if result == {"CANCELLED"} else {"FINISHED"}

    def begin(self, context: bpy.types.Context) -> Steps[Path]:
        path = Path(bpy.path.abspath(self.filepath))
        check_writable(path)
        check_video_path(path)
        return render_turntable.begin(
            context.scene,
            selected_mesh_objects(context)[0],
            path,
            count=self.pictures,
            rate=self.rate,
            size=check_size(self.width, self.height),
            view_angles=(AZIMUTH, degrees(self.elevation)),
            still=self.still,
            workers=worker_count(context),
        )

    def required_data(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return selected_mesh_objects(context)[:1]

    def finish(self, context: bpy.types.Context, result: Path) -> None:
        self.report({"INFO"}, f"Wrote {result}")


CLASSES = (ROSY_OT_turntable,)

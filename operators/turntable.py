"""Operator: render a turntable video of the active object."""

from __future__ import annotations

from math import degrees
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..rosy_addon.core.file_io import check_writable
from ..rosy_addon.jobs.render_turntable import render_turntable
from ..rosy_addon.projection.camera import check_size
from ..rosy_addon.rendering.turntable import check_video_path
from ..rosy_addon.ui.preferences import worker_count
from ..rosy_addon.ui.property_makers import choice, file_filter, integer, real, toggle
from ..rosy_addon.worker.job import Steps
from .base import ACTIVE_FIELD, IDLE, sync_suffix
from .modal_job import ActiveMeshMixin, FileJobMixin

#: Azimuth of the first picture, in degrees.
AZIMUTH = -25.0

#: Keyword arguments of the properties for the width and the height.
SIDE = {"subtype": "PIXEL", "default": 512, "min": 16, "max": 8192}


class ROSY_OT_turntable(ActiveMeshMixin, FileJobMixin, bpy.types.Operator, ExportHelper):
    """Render a turntable video of the active mesh with its field and its look"""

    bl_label = "Turntable"
    bl_options = {"REGISTER"}
    conditions = (IDLE, ACTIVE_FIELD)
    cancel_note = "no video was written"

    filename_ext = ".mp4"
    filter_glob: file_filter(".mp4", ".gif")
    film: choice(
        "Format",
        "Format of the video",
        [(".mp4", "MP4", "H.264"), (".gif", "GIF", "256 colors, for web pages")],
    )
    pictures: integer("Pictures", "Pictures in a full turn", default=72, min=2, max=10_000)
    rate: real("Rate", "Pictures per second", default=24.0, min=0.1, max=120.0)
    width: integer("Width", "Width of the video", **SIDE)
    height: integer("Height", "Height of the video", **SIDE)
    elevation: real(
        "Elevation",
        "Angle of the camera above the horizon",
        subtype="ANGLE",
        default=0.35,
        min=-1.5,
        max=1.5,
    )
    still: toggle(
        "Still Camera", "Leave the camera where it is, so that only streaks drift: a look with Flow"
    )

    def check(self, context: bpy.types.Context) -> bool:
        """Give the file name the suffix of the video format. Return whether the name has changed.

        The file browser calls this.
        """
        return sync_suffix(self, self.film)

    def begin(self, context: bpy.types.Context) -> Steps[Path]:
        path = Path(bpy.path.abspath(self.filepath))
        check_writable(path, follow_links=True)
        check_video_path(path)
        return render_turntable.begin(
            context.scene,
            self.objects[0],
            path,
            count=self.pictures,
            rate=self.rate,
            size=check_size(self.width, self.height),
            view_angles=(AZIMUTH, degrees(self.elevation)),
            still=self.still,
            workers=worker_count(context),
        )

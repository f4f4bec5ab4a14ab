"""A film of the active object from all around."""

from __future__ import annotations

from dataclasses import replace
from math import degrees
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..rosy_addon.errors import RosyError
from ..rosy_addon.files import check_writable
from ..rosy_addon.projection.camera import check_size
from ..rosy_addon.scene.bodies import read_scene
from ..rosy_addon.scene.looks import look_of
from ..rosy_addon.scene.movie import encode
from ..rosy_addon.scene.tones import tone_wish
from ..rosy_addon.turntable import check_film, has_ffmpeg, pictures, write_film
from .meshes import has_field_selected, is_idle, selected_meshes, with_ending


class ROSY_OT_turntable(bpy.types.Operator, ExportHelper):
    """Draw the active mesh with its field from all around, by the scene's look, as a film"""

    bl_idname = "rosy.turntable"
    bl_label = "Turntable"
    bl_options = {"REGISTER"}

    filename_ext = ".mp4"
    filter_glob: bpy.props.StringProperty(default="*.mp4;*.gif", options={"HIDDEN"})
    film: bpy.props.EnumProperty(
        name="Film",
        items=[(".mp4", "MP4", "H.264"), (".gif", "GIF", "256 colours, for web pages")],
    )
    pictures: bpy.props.IntProperty(
        name="Pictures", description="Of a full turn", default=72, min=2, max=10_000
    )
    rate: bpy.props.FloatProperty(
        name="Rate", description="Pictures a second", default=24.0, min=0.1, max=120.0
    )
    width: bpy.props.IntProperty(name="Width", subtype="PIXEL", default=512, min=16, max=8192)
    height: bpy.props.IntProperty(name="Height", subtype="PIXEL", default=512, min=16, max=8192)
    elevation: bpy.props.FloatProperty(
        name="Elevation",
        description="From how far above it is looked at",
        subtype="ANGLE",
        default=0.35,
        min=-1.5,
        max=1.5,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return is_idle(cls) and has_field_selected(cls, context)

    def check(self, context: bpy.types.Context) -> bool:
        """Keep the name's ending in step with the kind of film, in the file browser."""
        return with_ending(self, self.film)

    def execute(self, context: bpy.types.Context) -> set[str]:
        thing = selected_meshes(context)[0]
        path = Path(bpy.path.abspath(self.filepath))
        manager = context.window_manager
        try:
            check_writable(path)
            check_film(path)
            look = look_of(context.scene.rosy)
            look = replace(look, supersampling=max(look.supersampling, 2))
            wish = tone_wish(context.scene, look)
            body = read_scene(context.evaluated_depsgraph_get(), [thing], wish=wish).bodies[0]
            view = -25.0, degrees(self.elevation)
            size = check_size(self.width, self.height)
            manager.progress_begin(0, self.pictures)
            frames = pictures(body, look, self.pictures, size, view)
            counted = (self._count(manager, number, frame) for number, frame in enumerate(frames))
            write_film(path, counted, self.rate, None if has_ffmpeg() else encode)
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            manager.progress_end()
        self.report({"INFO"}, f"Wrote {path}")
        return {"FINISHED"}

    def _count(self, manager: bpy.types.WindowManager, number: int, frame):
        manager.progress_update(number)
        return frame


CLASSES = (ROSY_OT_turntable,)

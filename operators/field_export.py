"""Operator: export the field of the active mesh to a file."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..rosy_addon.errors import RosyError
from ..rosy_addon.field.field_io import write_field
from ..rosy_addon.scene.meshes import mesh_surface
from ..rosy_addon.scene.read_field import read_mesh_field
from .poll import poll_active_field, poll_editable, selected_mesh_objects, sync_suffix
from .reports import report_error

#: File formats by suffix: label and description in the user interface.
FIELD_FORMATS = {
    ".rosy": ("RoSy", "One member vector per face"),
    ".rawfield": ("Raw Field", "One row per face with all directions, for Directional"),
    ".txt": ("Text", "One row per face with all directions, without a header"),
    ".npy": ("NumPy", "An array with one row per face with all directions"),
    ".obj": ("Fieldgen OBJ", "The mesh, with one direction per vertex, as written by fieldgen"),
    ".sings": ("Singularities", "Singular vertices and their indices, for Directional"),
}


class ROSY_OT_field_export(bpy.types.Operator, ExportHelper):
    """Write the field of the active mesh to a file"""

    bl_idname = "rosy.field_export"
    bl_label = "Export Field"
    bl_options = {"REGISTER"}

    filename_ext = ".rosy"
    filter_glob: bpy.props.StringProperty(
        default=";".join(f"*{suffix}" for suffix in FIELD_FORMATS), options={"HIDDEN"}
    )
    file_format: bpy.props.EnumProperty(
        name="Format",
        description="Format of the file",
        items=[(suffix, name, text) for suffix, (name, text) in FIELD_FORMATS.items()],
        default=".rosy",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_editable(cls, context) and poll_active_field(cls, context)

    def check(self, context: bpy.types.Context) -> bool:
        """Set the suffix of the file name to the format's in the file browser."""
        return sync_suffix(self, self.file_format)

    def execute(self, context: bpy.types.Context) -> set[str]:
        obj = selected_mesh_objects(context)[0]
        path = Path(bpy.path.abspath(self.filepath))
        try:
            surface = mesh_surface(obj.data)
            field = read_mesh_field(obj.data, surface=surface)
            write_field(path, field, surface)
        except RosyError as error:
            return report_error(self, error)
        self.report({"INFO"}, f"Wrote {path}")
        return {"FINISHED"}


CLASSES = (ROSY_OT_field_export,)

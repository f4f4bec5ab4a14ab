"""Write the field of the active mesh to a file."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..rosy_addon.errors import RosyError
from ..rosy_addon.field.fieldfile import write_field
from ..rosy_addon.scene.attributes import read_mesh_field
from ..rosy_addon.scene.meshes import mesh_surface
from .meshes import can_change_fields, has_field_selected, selected_meshes, with_ending

#: The kinds of files, by the end of their name.
FORMATS = {
    ".rosy": ("RoSy", "One member vector a face"),
    ".rawfield": ("Raw Field", "All directions of a face in a row, as Directional reads them"),
    ".txt": ("Text", "All directions of a face in a row, numbers alone"),
    ".npy": ("NumPy", "An array with all directions of a face in a row"),
    ".obj": ("fieldgen OBJ", "The mesh, and a direction at each vertex, as fieldgen writes it"),
    ".sings": ("Singularities", "Vertices and their indices, as Directional reads them"),
}


class ROSY_OT_field_export(bpy.types.Operator, ExportHelper):
    """Write the field of the active mesh to a file, one row a face"""

    bl_idname = "rosy.field_export"
    bl_label = "Export Field"
    bl_options = {"REGISTER"}

    filename_ext = ".rosy"
    filter_glob: bpy.props.StringProperty(
        default=";".join(f"*{kind}" for kind in FORMATS), options={"HIDDEN"}
    )
    file_format: bpy.props.EnumProperty(
        name="Format",
        items=[(kind, name, text) for kind, (name, text) in FORMATS.items()],
        default=".rosy",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_change_fields(cls, context) and has_field_selected(cls, context)

    def check(self, context: bpy.types.Context) -> bool:
        """Keep the name's ending in step with the format, in the file browser."""
        return with_ending(self, self.file_format)

    def execute(self, context: bpy.types.Context) -> set[str]:
        thing = selected_meshes(context)[0]
        path = Path(bpy.path.abspath(self.filepath))
        try:
            surface = mesh_surface(thing.data)
            field = read_mesh_field(thing.data, surface=surface)
            write_field(path, field, surface)
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {path}")
        return {"FINISHED"}


CLASSES = (ROSY_OT_field_export,)

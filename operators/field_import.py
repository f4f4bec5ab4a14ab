"""Operator: import a field from a file to the active mesh."""

from __future__ import annotations

import bpy
from bpy_extras.io_utils import ImportHelper

from ..rosy_addon.errors import REPORTED_ERRORS, counted
from ..rosy_addon.field.field_io import READ_SUFFIXES, load_field
from ..rosy_addon.field.rosy_field import MAX_DEGREE
from ..rosy_addon.scene.meshes import mesh_surface
from .poll import poll_editable, selected_mesh_objects, store_fields
from .reports import report_error, report_warning


class ROSY_OT_field_import(bpy.types.Operator, ImportHelper):
    """Read the field of the active mesh from a file"""

    bl_idname = "rosy.field_import"
    bl_label = "Import Field"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".rosy"
    filter_glob: bpy.props.StringProperty(
        default=";".join(f"*{suffix}" for suffix in READ_SUFFIXES), options={"HIDDEN"}
    )
    degree: bpy.props.IntProperty(
        name="Degree",
        description="Degree that the file must have, or degree of files that do not state it. 0: any, or 4",
        min=0,
        max=MAX_DEGREE,
        default=0,
    )
    mesh_file: bpy.props.StringProperty(
        name="Mesh File",
        description="Mesh file that the field was made for, if its faces differ from those of this "
        "mesh. The field is transferred by position. If the numbers of faces differ, a mesh file "
        "of the same name in the same folder is used by default",
        subtype="FILE_PATH",
    )
    undefined: bpy.props.EnumProperty(
        name="Bad Vectors",
        description="Treatment of vectors that are NaN or infinite",
        items=[
            ("error", "Refuse", "Report the first one, and import nothing"),
            ("zero", "Skip", "Treat the field as undefined on those faces"),
        ],
        default="error",
    )
    attribute: bpy.props.StringProperty(
        name="Attribute",
        description="Name of the mesh attribute that stores the field. An existing field is replaced",
        default="rosy",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_editable(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        # A dialog if a file was dropped on the view, so that the path is set; else a file browser.
        return self.invoke_popup(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        obj = selected_mesh_objects(context)[0]
        try:
            field, note = load_field(
                bpy.path.abspath(self.filepath),
                mesh_surface(obj.data),
                self.degree or None,
                self.undefined,
                mesh=bpy.path.abspath(self.mesh_file) if self.mesh_file else None,
            )
            store_fields(self, context, {obj.data: field}, self.attribute)
        except REPORTED_ERRORS as error:
            return report_error(self, error)
        if note:
            report_warning(self, note)
        self.report(
            {"INFO"},
            f"Read a field of degree {field.degree} on {counted(len(field.vectors), 'face')} of '{obj.name}'",
        )
        return {"FINISHED"}


class ROSY_FH_field(bpy.types.FileHandler):
    """Import field files that are dropped on the 3D view."""

    bl_idname = "ROSY_FH_field"
    bl_label = "RoSy field"
    bl_import_operator = "rosy.field_import"
    bl_file_extensions = ".rosy;.rawfield"

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


CLASSES = (ROSY_OT_field_import, ROSY_FH_field)

"""Operator: import a field from a file to the active mesh."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import bpy
from bpy_extras.io_utils import ImportHelper

from ..rosy_addon.core.errors import counted
from ..rosy_addon.field.directional_field import field_directions
from ..rosy_addon.field.field_io import READ_SUFFIXES, LoadedField, load_field
from ..rosy_addon.field.rosy_field import MAX_DEGREE
from ..rosy_addon.scene.meshes import mesh_surface
from ..rosy_addon.ui.property_makers import choice, file_filter, integer, text
from ..rosy_addon.worker.job import Call, Steps
from .base import EDITABLE, selected_mesh_objects
from .modal_job import ActiveMeshMixin, FileJobMixin


class ROSY_OT_field_import(ActiveMeshMixin, FileJobMixin, bpy.types.Operator, ImportHelper):
    """Read the field of the active mesh from a file"""

    bl_idname = "rosy.field_import"
    bl_label = "Import Field"
    bl_options = {"REGISTER", "UNDO"}
    conditions = EDITABLE

    filename_ext = ".rosy"
    filter_glob: file_filter(*READ_SUFFIXES)
    degree: integer(
        "Degree",
        "Degree that the file must have, or degree of files that do not state it. 0: any, or 4",
        min=0,
        max=MAX_DEGREE,
    )
    mesh_file: text(
        "Mesh File",
        "Mesh file that the field was made for, if its faces differ from those of this "
        "mesh. The field is transferred by position. If the numbers of faces differ, a mesh file "
        "of the same name in the same folder is used by default",
        subtype="FILE_PATH",
    )
    undefined: choice(
        "Bad Vectors",
        "Treatment of vectors that are NaN or infinite",
        [
            ("error", "Refuse", "Report the first one, and import nothing"),
            ("zero", "Skip", "Treat the field as undefined on those faces"),
        ],
    )
    attribute: text(
        "Attribute",
        "Name of the mesh attribute that stores the field. An existing field is replaced",
        default="rosy",
    )

    def ask(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str] | None:
        """Ask for the settings of a file that was dropped on the view, or for a file."""
        return None if self.skip_browser else self.invoke_popup(context)

    def begin(self, context: bpy.types.Context) -> Steps[LoadedField]:
        """Read the field, then store it."""
        mesh = selected_mesh_objects(context)[0].data
        surface = mesh_surface(mesh)
        mesh_file = bpy.path.abspath(self.mesh_file) if self.mesh_file else None
        path = bpy.path.abspath(self.filepath)
        inputs = path, surface, self.degree or None, self.undefined
        field, note = yield Call(partial(load_field, mesh=mesh_file), inputs, 0.0, 0.9)
        if field.direction_ratios is not None and field.source_directions is None:
            directions = yield Call(
                field_directions, (surface, field), 0.9, label="computing directions"
            )
            field = replace(field, source_directions=directions)
        self.store_fields(context, {mesh: field}, self.attribute)
        return LoadedField(field, note)

    def finish(self, context: bpy.types.Context, result: LoadedField) -> None:
        if result.note:
            self.report_warnings(result.note)
        obj = selected_mesh_objects(context)[0]
        faces = counted(len(result.field.vectors), "face")
        self.report_done(f"Read a field of degree {result.field.degree} on {faces} of '{obj.name}'")


class ROSY_FH_field(bpy.types.FileHandler):
    """Import field files that are dropped on the 3D view."""

    bl_idname = "ROSY_FH_field"
    bl_label = "RoSy field"
    bl_import_operator = "rosy.field_import"
    bl_file_extensions = ".rosy;.rawfield"

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"

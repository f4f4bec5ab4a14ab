"""Operators: read the field of the active mesh from a file, and write it to a file."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..rosy_addon.core.errors import RosyError, RowCountError, counted
from ..rosy_addon.core.file_io import check_writable, write_bytes
from ..rosy_addon.field.directional_field import field_directions
from ..rosy_addon.field.field_io import READ_SUFFIXES, field_file, load_field
from ..rosy_addon.field.formats.feature_edges import EDGE_SUFFIXES, read_edges
from ..rosy_addon.field.rosy_field import MAX_DEGREE, RosyField
from ..rosy_addon.field.validate import VectorPolicy
from ..rosy_addon.scene.datablocks import field_mesh
from ..rosy_addon.scene.field_attributes import field_degree
from ..rosy_addon.scene.field_meshes import field_targets
from ..rosy_addon.scene.guides import read_combed_guides
from ..rosy_addon.scene.mesh_fields import check_writable as check_writable_mesh
from ..rosy_addon.scene.mesh_fields import read_mesh_field
from ..rosy_addon.scene.meshes import mark_sharp, mesh_label, mesh_surface
from ..rosy_addon.ui.property_makers import choice, file_filter, integer, text
from ..rosy_addon.worker.job import Call, Steps
from .base import EDITABLE, sync_suffix
from .modal_job import ActiveMeshMixin, FileJobMixin


class ROSY_OT_field_import(ActiveMeshMixin, FileJobMixin, bpy.types.Operator, ImportHelper):
    """Read the field of the active mesh from a file, or mark the edges of a .sharp or .feature file as sharp"""

    bl_label = "Import Field"
    conditions = EDITABLE

    #: Blender's popup for a dropped file counts the files of this property. Only one is read.
    files = ()
    filename_ext = ".rosy"
    filter_glob: file_filter(*READ_SUFFIXES, *EDGE_SUFFIXES)
    degree: integer(
        "Degree",
        "Degree that the file must have, or degree of files that do not state it. 0: any, or 4",
        min=0,
        max=MAX_DEGREE,
    )
    second_file: text(
        "Second File",
        "File with the second direction of each cross, if each of two files has one",
        subtype="FILE_PATH",
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
    off_surface: choice(
        "Off the Surface",
        "Treatment of vectors that do not lie on the surface",
        [
            ("error", "Refuse", "Import nothing if they are more than 1 in 100"),
            ("project", "Project", "Rotate them into the surface"),
            ("undefined", "Skip", "Treat the field as undefined there"),
        ],
    )
    attribute: text(
        "Attribute",
        "Name of the mesh attribute that stores the field. An existing field is replaced",
        default="rosy",
    )

    def ask(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str] | None:
        """Ask for the settings if a file was dropped on the 3D view; otherwise ask for a file.

        Return the result of the operator; None if `skip_browser` is set.
        """
        return None if self.skip_browser else self.invoke_popup(context)

    def begin(self, context: bpy.types.Context) -> Steps[str]:
        """Read the field or the edges from the file, then store them. The result is a message to the user."""
        obj = self.objects[0]
        mesh, surface = obj.data, mesh_surface(obj.data)
        path = bpy.path.abspath(self.filepath)
        if Path(path).suffix.lower() in EDGE_SUFFIXES:
            check_writable_mesh(mesh)
            count = mark_sharp(mesh, (yield Call(read_edges, (path, surface))))
            return f"Marked {counted(count, 'edge')} of '{obj.name}' as sharp: Features can follow them"
        mesh_file = bpy.path.abspath(self.mesh_file) if self.mesh_file else None
        paths = [path, *([bpy.path.abspath(self.second_file)] if self.second_file else [])]
        policy = VectorPolicy(self.undefined, self.off_surface)
        load, settings = partial(load_field, mesh=mesh_file), (self.degree or None, policy)
        errors: list[RosyError] = []
        with field_targets([obj], context.evaluated_depsgraph_get()) as targets:
            for mesh in dict.fromkeys([obj.data, *targets]):  # the rows may fit either
                surface = mesh_surface(mesh, f"object '{obj.name}'")
                try:
                    field, note = yield Call(load, (paths, surface, *settings), 0.0, 0.9)
                    break
                except RowCountError as error:
                    errors.append(error)
            else:
                raise errors[0]
            if field.direction_ratios is not None and field.source_directions is None:
                directions = yield Call(
                    field_directions, (surface, field), 0.9, label="computing directions"
                )
                field = replace(field, source_directions=directions)
            self.store_fields(context, {mesh: field}, self.attribute, {mesh: [obj]})
        if note:
            self.report_warnings(note)
        faces = counted(len(field.vectors), "face")
        return f"Read a field of degree {field.degree} on {faces} of '{obj.name}'"


class ROSY_FH_field(bpy.types.FileHandler):
    """Import field files that are dropped on the 3D view."""

    bl_label = "RoSy field"
    bl_import_operator = "rosy.field_import"
    bl_file_extensions = ".rosy;.rawfield"

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


#: Labels and descriptions of file formats in the user interface, by suffix.
FIELD_FORMATS = {
    ".rosy": ("RoSy", "One member vector per face"),
    ".rawfield": ("Raw Field", "One row per face with all directions, for Directional"),
    ".txt": ("Text", "One row per face with all directions, without a header"),
    ".npy": ("NumPy", "An array with one row per face with all directions"),
    ".npz": ("NumPy Archive", "The mesh, all directions, magnitudes and singularities"),
    ".vtp": ("VTK PolyData", "The mesh with all directions, magnitudes and indices, for ParaView"),
    ".vtu": ("VTK Grid", "The same as an unstructured grid"),
    ".ply": ("PLY", "The same as properties of faces and vertices"),
    ".obj": (
        "Fieldgen OBJ",
        "The mesh, with one direction per vertex, as written by fieldgen; directions of faces are not kept exactly",
    ),
    ".sings": ("Singularities", "Singular vertices and their indices, for Directional"),
}

#: Suffixes of formats that keep the length of the vector on each face.
GUIDE_FORMATS = (".rosy", ".rawfield", ".txt", ".npy")


class ROSY_OT_field_export(ActiveMeshMixin, FileJobMixin, bpy.types.Operator, ExportHelper):
    """Write the field of the active mesh to a file"""

    bl_label = "Export Field"
    bl_options = {"REGISTER"}
    cancel_note = "no file was written"

    filename_ext = ".rosy"
    filter_glob: file_filter(*FIELD_FORMATS)
    file_format: choice(
        "Format",
        "Format of the file",
        [(suffix, name, text) for suffix, (name, text) in FIELD_FORMATS.items()],
    )
    content: choice(
        "Content",
        "What is written",
        [
            ("FIELD", "Field", "The field"),
            (
                "GUIDES",
                "Combed Guides",
                "The guides that were combed; the lengths of the vectors, from 0 to 1, are their firmness",
            ),
        ],
    )

    def check(self, context: bpy.types.Context) -> bool:
        """Give the file name the suffix of the chosen format. Return whether the name has changed.

        The file browser calls this.
        """
        return sync_suffix(self, self.file_format)

    def begin(self, context: bpy.types.Context) -> Steps[Path]:
        """Read the field or the combed guides of the active mesh, and write them to the file."""
        mesh = field_mesh(self.objects[0])
        surface, path = mesh_surface(mesh), Path(bpy.path.abspath(self.filepath))
        if self.content == "GUIDES":
            if path.suffix.lower() not in GUIDE_FORMATS:
                formats = f"{', '.join(GUIDE_FORMATS[:-1])} or {GUIDE_FORMATS[-1]}"
                raise RosyError(
                    f"{path}: cannot keep the firmness of guides: write a {formats} file"
                )
            field = RosyField(field_degree(mesh), read_combed_guides(mesh, surface))
            if not field.vectors.any():
                raise RosyError(
                    f"{mesh_label(mesh)}: its field has no combed guides: comb it first"
                )
        else:
            field = read_mesh_field(mesh, surface=surface)
        check_writable(path, follow_links=True)
        contents = yield Call(field_file, (path, field, surface))
        write_bytes(path, contents, follow_links=True)
        return path

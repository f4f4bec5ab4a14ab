"""Operator: export the field of the active mesh to a file."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..rosy_addon.core.errors import RosyError
from ..rosy_addon.core.file_io import check_writable, write_bytes
from ..rosy_addon.field.field_io import field_file
from ..rosy_addon.field.rosy_field import RosyField
from ..rosy_addon.scene.field_attributes import field_degree
from ..rosy_addon.scene.guides import read_combed_guides
from ..rosy_addon.scene.mesh_fields import read_mesh_field
from ..rosy_addon.scene.meshes import mesh_label, mesh_surface
from ..rosy_addon.ui.property_makers import choice, file_filter
from ..rosy_addon.worker.job import Call, Steps
from .base import selected_mesh_objects, sync_suffix
from .modal_job import ActiveMeshMixin, FileJobMixin

#: File formats by suffix: label and description in the user interface.
FIELD_FORMATS = {
    ".rosy": ("RoSy", "One member vector per face"),
    ".rawfield": ("Raw Field", "One row per face with all directions, for Directional"),
    ".txt": ("Text", "One row per face with all directions, without a header"),
    ".npy": ("NumPy", "An array with one row per face with all directions"),
    ".obj": ("Fieldgen OBJ", "The mesh, with one direction per vertex, as written by fieldgen"),
    ".sings": ("Singularities", "Singular vertices and their indices, for Directional"),
}

#: Formats that keep the lengths of the vectors of each face.
GUIDE_FORMATS = (".rosy", ".rawfield", ".txt", ".npy")


class ROSY_OT_field_export(ActiveMeshMixin, FileJobMixin, bpy.types.Operator, ExportHelper):
    """Write the field of the active mesh to a file"""

    bl_idname = "rosy.field_export"
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
        """Set the suffix of the file name to the format's in the file browser."""
        return sync_suffix(self, self.file_format)

    def begin(self, context: bpy.types.Context) -> Steps[Path]:
        path = Path(bpy.path.abspath(self.filepath))
        is_guides = self.content == "GUIDES"
        if is_guides and path.suffix.lower() not in GUIDE_FORMATS:
            raise RosyError(
                f"{path}: cannot keep the firmness of guides: write a {', '.join(GUIDE_FORMATS[:-1])} or "
                f"{GUIDE_FORMATS[-1]} file"
            )
        return _export(selected_mesh_objects(context)[0].data, path, is_guides)

    def finish(self, context: bpy.types.Context, result: Path) -> None:
        self.report_done(f"Wrote {result}")


def _export(mesh: bpy.types.Mesh, path: Path, is_guides: bool) -> Steps[Path]:
    """Read the field or the combed guides of a mesh, and write them to a file."""
    surface = mesh_surface(mesh)
    if is_guides:
        field = RosyField(field_degree(mesh), read_combed_guides(mesh, surface))
        if not field.vectors.any():
            raise RosyError(f"{mesh_label(mesh)}: its field has no combed guides: comb it first")
    else:
        field = read_mesh_field(mesh, surface=surface)
    check_writable(path)
    write_bytes(path, (yield Call(field_file, (path, field, surface))))
    return path

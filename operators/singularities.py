"""Show where fields are singular."""

from __future__ import annotations

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.scene.attributes import has_field
from ..rosy_addon.scene.singular import add_points, remove_points, singular_vertices
from ..rosy_addon.ui import overlay
from .meshes import has_field_selected, is_idle, selected_meshes


class ROSY_OT_singularities(bpy.types.Operator):
    """Show where the fields of the selected meshes are singular: orange dots of positive index, blue ones of negative"""

    bl_idname = "rosy.singularities"
    bl_label = "Singularities"
    bl_options = {"REGISTER", "UNDO"}

    show: bpy.props.EnumProperty(
        name="Show",
        items=[
            ("OVERLAY", "Overlay", "Dots and indices in the 3D view"),
            ("POINTS", "Points", "An object of points with an attribute 'index', in units of 1/N"),
            ("BOTH", "Both", "Overlay and points"),
            ("NONE", "Hide", "Neither: take away what was shown"),
        ],
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return is_idle(cls) and has_field_selected(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        things = [thing for thing in selected_meshes(context) if has_field(thing)]
        depsgraph = context.evaluated_depsgraph_get()
        try:
            found = {thing: singular_vertices(thing, depsgraph) for thing in things}
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for thing, singular in found.items():
            overlay.hide(thing.name)
            remove_points(context.scene, thing)
            if self.show in ("OVERLAY", "BOTH"):
                overlay.show(thing.name, singular)
            if self.show in ("POINTS", "BOTH"):
                add_points(context.scene, thing, singular)
        if self.show != "NONE":
            count = sum(map(len, found.values()))
            total = "; ".join(
                f"'{thing.name}': indices add up to "
                f"{overlay.index_text(int(singular.index.sum()), singular.degree)}"
                for thing, singular in found.items()
            )
            self.report({"INFO"}, f"{count} singularities; {total}")
        return {"FINISHED"}


CLASSES = (ROSY_OT_singularities,)

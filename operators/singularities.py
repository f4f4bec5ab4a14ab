"""Operator: show the singularities of fields, in the overlay or as points."""

from __future__ import annotations

import bpy

from ..rosy_addon.core.errors import counted
from ..rosy_addon.field.singularities import format_index
from ..rosy_addon.scene.field_attributes import has_field
from ..rosy_addon.scene.singularity_points import (
    add_singularity_points,
    read_singularities,
    remove_singularity_points,
)
from ..rosy_addon.ui import overlay
from ..rosy_addon.ui.property_makers import choice
from .base import ACTIVE_FIELD, IDLE, RosyOperator, selected_mesh_objects


class ROSY_OT_singularities(RosyOperator, bpy.types.Operator):
    """Show the singularities of the fields of the selected meshes: orange for positive index, blue for negative index"""

    bl_idname = "rosy.singularities"
    bl_label = "Singularities"
    bl_options = {"REGISTER", "UNDO"}
    conditions = (IDLE, ACTIVE_FIELD)

    show: choice(
        "Show",
        "How the singularities are shown",
        [
            ("OVERLAY", "Overlay", "Dots and indices in the 3D view"),
            ("POINTS", "Points", "A point object with an attribute 'index', in units of 1/N"),
            ("BOTH", "Both", "Overlay and points"),
            ("NONE", "Hide", "Remove the overlay and the points"),
        ],
    )

    def act(self, context: bpy.types.Context) -> None:
        objects = [obj for obj in selected_mesh_objects(context) if has_field(obj)]
        if self.show == "NONE":
            _hide(context, objects)
            return
        depsgraph = context.evaluated_depsgraph_get()
        singularities_by_object = {obj: read_singularities(obj, depsgraph) for obj in objects}
        _hide(context, objects)
        for obj, singularities in singularities_by_object.items():
            if self.show in ("OVERLAY", "BOTH"):
                overlay.show(obj.name, singularities)
            if self.show in ("POINTS", "BOTH"):
                add_singularity_points(context.scene, obj, singularities)
        count = sum(map(len, singularities_by_object.values()))
        total = "; ".join(
            f"'{obj.name}': sum of the indices "
            f"{format_index(int(singularities.index.sum()), singularities.degree)}"
            for obj, singularities in singularities_by_object.items()
        )
        self.report_done(f"{counted(count, 'singularity', 'singularities')}; {total}")


def _hide(context: bpy.types.Context, objects: list[bpy.types.Object]) -> None:
    """Remove the overlay and the points of objects."""
    for obj in objects:
        overlay.hide(obj.name)
        remove_singularity_points(context.scene, obj)

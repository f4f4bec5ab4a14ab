"""Make a field on the selected meshes."""

from __future__ import annotations

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.field.generate import KINDS, generate
from ..rosy_addon.field.rosy_field import MAX_DEGREE
from ..rosy_addon.scene.meshes import mesh_surface
from .meshes import can_change_fields, give_fields, selected_meshes


class ROSY_OT_field_generate(bpy.types.Operator):
    """Make a field on the selected meshes, one direction and its rotations a face"""

    bl_idname = "rosy.field_generate"
    bl_label = "Make Field"
    bl_options = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(
        name="From",
        description="Where the directions come from",
        items=[(kind, kind.capitalize(), text) for kind, text in KINDS.items()],
        default="curvature",
    )
    degree: bpy.props.IntProperty(
        name="Degree",
        description="In how many directions the field looks the same: 2 lines, 4 crosses, 6 "
        "triangles and hexagons",
        min=1,
        max=MAX_DEGREE,
        default=4,
    )
    axis: bpy.props.FloatVectorProperty(
        name="Axis",
        description="Direction in the object's own space that is projected to the surface",
        subtype="XYZ",
        default=(0.0, 0.0, 1.0),
    )
    attribute: bpy.props.StringProperty(
        name="Attribute",
        description="Name of the mesh attribute that holds the field; one that is there is replaced",
        default="rosy",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_change_fields(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        meshes = dict.fromkeys(thing.data for thing in selected_meshes(context))
        axis = tuple(self.axis)
        try:
            made = {
                mesh: generate(mesh_surface(mesh), self.kind, self.degree, axis=axis)
                for mesh in meshes
            }
            give_fields(self, context, made, self.attribute)
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        faces = sum(len(field.vectors) for field in made.values())
        self.report({"INFO"}, f"Made a field of degree {self.degree} on {faces:,} faces")
        return {"FINISHED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "kind")
        layout.prop(self, "degree")
        if self.kind == "axis":
            layout.prop(self, "axis")
        layout.prop(self, "attribute")


CLASSES = (ROSY_OT_field_generate,)

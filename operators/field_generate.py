"""Make a field on the selected meshes."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..rosy_addon.field.generate import KINDS, generating
from ..rosy_addon.field.rosy_field import MAX_DEGREE
from ..rosy_addon.progress import Work, part
from ..rosy_addon.scene.meshes import mesh_surface
from .meshes import can_change_fields, give_fields, selected_meshes
from .ticking import Ticking


class ROSY_OT_field_generate(Ticking, bpy.types.Operator):
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

    def work(self, context: bpy.types.Context) -> Work[int]:
        """Make all fields, then give them to the meshes; the number of faces comes back."""
        meshes = list(self.needed(context))
        surfaces = [mesh_surface(mesh) for mesh in meshes]
        made = {}
        for number, (mesh, surface) in enumerate(zip(meshes, surfaces, strict=True)):
            making = generating(surface, self.kind, self.degree, axis=tuple(self.axis))
            made[mesh] = yield from part(making, number / len(meshes), (number + 1) / len(meshes))
        give_fields(self, context, made, self.attribute)
        return sum(len(field.vectors) for field in made.values())

    def needed(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return dict.fromkeys(thing.data for thing in selected_meshes(context))

    def finish(self, context: bpy.types.Context, result: int) -> None:
        self.report({"INFO"}, f"Made a field of degree {self.degree} on {result:,} faces")

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

"""Make a field on the selected meshes."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi

import bpy

from ..rosy_addon.field.generate import KINDS, Recipe, generating
from ..rosy_addon.field.rosy_field import MAX_DEGREE
from ..rosy_addon.progress import Work, part
from ..rosy_addon.scene.meshes import MARKS, marked_edges, mesh_surface
from ..rosy_addon.ui.generators import settings_of_generator
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
    reach: bpy.props.FloatProperty(
        name="Reach",
        description="How far clearly curved parts reach into those that are hardly curved, as a "
        "share of the size of the mesh; at 0 every face has its own curvature's directions",
        min=0.0,
        max=10.0,
        soft_max=0.2,
        precision=3,
        step=1,
        default=0.0,
    )
    edges: bpy.props.EnumProperty(
        name="Edges",
        description="Which edges the field runs along",
        items=[
            ("FEATURES", "By Angle", "Borders, and where the surface bends sharply"),
            *((mark, name, text) for mark, (_, name, text) in MARKS.items()),
        ],
    )
    sharp_angle: bpy.props.FloatProperty(
        name="Sharp Angle",
        description="By how much the surface bends at a sharp edge, at least",
        subtype="ANGLE",
        min=0.0,
        max=pi,
        default=pi / 6,
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
            making = generating(surface, self._recipe(mesh), self.degree)
            made[mesh] = yield from part(making, number / len(meshes), (number + 1) / len(meshes))
        give_fields(self, context, made, self.attribute)
        return sum(len(field.vectors) for field in made.values())

    def _recipe(self, mesh: bpy.types.Mesh) -> Recipe:
        marked = self.kind == "features" and self.edges != "FEATURES"
        edges = marked_edges(mesh, self.edges) if marked else None
        return Recipe(self.kind, tuple(self.axis), self.reach, self.sharp_angle, edges)

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
        for name in settings_of_generator(self):
            layout.prop(self, name)
        layout.prop(self, "attribute")


CLASSES = (ROSY_OT_field_generate,)

"""Make a field on the selected meshes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import pi

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.field.generate import KINDS, Recipe, generating
from ..rosy_addon.field.guides import feature_edges
from ..rosy_addon.field.rosy_field import MAX_DEGREE
from ..rosy_addon.field.surface import Surface, cut_note
from ..rosy_addon.progress import Work, part
from ..rosy_addon.scene.guides import (
    guide_objects,
    guiding_vectors,
    strokes_and_handles,
    uv_of_corners,
)
from ..rosy_addon.scene.meshes import MARKS, marked_edges, mesh_surface
from ..rosy_addon.ui.generators import settings_of_generator
from .meshes import can_change_fields, give_fields, selected_meshes
from .ticking import Ticking

#: Kinds whose name is not their word with a capital.
NAMES = {"uv": "UV Map"}


def _names_on_mesh(context: bpy.types.Context, kind: str) -> list[str]:
    """Names of the active mesh's UV maps or attributes."""
    meshes = selected_meshes(context)
    return [each.name for each in getattr(meshes[0].data, kind)] if meshes else []


class ROSY_OT_field_generate(Ticking, bpy.types.Operator):
    """Make a field on the selected meshes, one direction and its rotations a face"""

    bl_idname = "rosy.field_generate"
    bl_label = "Make Field"
    bl_options = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(
        name="From",
        description="Where the directions come from",
        items=[(kind, NAMES.get(kind, kind.capitalize()), text) for kind, text in KINDS.items()],
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
    guides: bpy.props.EnumProperty(
        name="Follow",
        description="What the field follows, one or several",
        options={"ENUM_FLAG"},
        items=[
            ("OBJECTS", "Objects", "Strokes, curves and empties: the one named, or the selected"),
            ("EDGES", "Edges", "Borders and sharp edges, or marked ones"),
            ("UV", "UV Map", "The axes of a UV map"),
            ("ATTRIBUTE", "Vectors", "An attribute of vectors, where they are not zero"),
        ],
        default={"OBJECTS"},
    )
    guide: bpy.props.StringProperty(
        name="Object",
        description="Grease Pencil, curves or an empty that the field follows; empty: all of these "
        "that are selected. Empties guide along their z axis, as far as they are drawn",
        search=lambda self, context, typed: [
            thing.name for thing in guide_objects(context.scene.objects)
        ],
    )
    uv_map: bpy.props.StringProperty(
        name="UV Map",
        description="Empty: the active one",
        search=lambda self, context, typed: _names_on_mesh(context, "uv_layers"),
    )
    vectors: bpy.props.StringProperty(
        name="Vectors",
        description="Attribute of vectors on faces, points or corners",
        search=lambda self, context, typed: _names_on_mesh(context, "attributes"),
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
        recipes = [
            self._recipe(context, mesh, surface)
            for mesh, surface in zip(meshes, surfaces, strict=True)
        ]
        made = {}
        for number, (mesh, surface) in enumerate(zip(meshes, surfaces, strict=True)):
            if note := cut_note(surface):
                self.report({"WARNING"}, note)
            making = generating(surface, recipes[number], self.degree)
            made[mesh] = yield from part(making, number / len(meshes), (number + 1) / len(meshes))
        give_fields(self, context, made, self.attribute)
        return sum(len(field.vectors) for field in made.values())

    def _recipe(self, context: bpy.types.Context, mesh: bpy.types.Mesh, surface: Surface) -> Recipe:
        recipe = Recipe(self.kind, tuple(self.axis), self.reach, self.sharp_angle)
        if self.kind == "uv":
            return replace(recipe, uv=uv_of_corners(mesh, self.uv_map))
        if self.kind == "features" and self.edges != "FEATURES":
            return replace(recipe, edges=marked_edges(mesh, self.edges))
        if self.kind != "guided":
            return recipe
        if "EDGES" in self.guides:
            by_angle = self.edges == "FEATURES"
            ends = feature_edges(surface, self.sharp_angle) if by_angle else None
            recipe = replace(recipe, edges=marked_edges(mesh, self.edges) if ends is None else ends)
        if "OBJECTS" in self.guides:
            owner = next(thing for thing in selected_meshes(context) if thing.data == mesh)
            strokes, handles = strokes_and_handles(self._guides(context), owner)
            recipe = replace(recipe, strokes=strokes, handles=handles)
        if "UV" in self.guides:
            recipe = replace(recipe, uv=uv_of_corners(mesh, self.uv_map))
        if "ATTRIBUTE" in self.guides:
            recipe = replace(recipe, vectors=guiding_vectors(mesh, self.vectors))
        return recipe

    def _guides(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        """The objects to follow."""
        if not self.guide:
            found = guide_objects(context.selected_objects)
            if not found:
                raise RosyError(
                    "there is nothing to follow: name an object, or select Grease Pencil, curves "
                    "or empties beside the mesh"
                )
            return found
        thing = context.scene.objects.get(self.guide)
        if thing is None or not guide_objects([thing]):
            raise RosyError(f"object '{self.guide}' is no Grease Pencil, curve or empty here")
        return [thing]

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

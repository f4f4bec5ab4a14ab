"""Make another field of the one that is there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import pi

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.field.convert import Conversion, converting
from ..rosy_addon.field.generate import MAGNITUDES
from ..rosy_addon.field.rosy_field import MAX_DEGREE
from ..rosy_addon.progress import Work, part
from ..rosy_addon.scene.attributes import (
    FORMS,
    attribute_name,
    has_field,
    read_mesh_field,
    read_scalars,
    write_mesh_field,
)
from ..rosy_addon.scene.meshes import mesh_surface
from .meshes import can_change_fields, give_fields, has_field_selected, selected_meshes
from .ticking import Ticking


class _OnFields:
    """An operator on the fields of the selected meshes."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_change_fields(cls, context) and has_field_selected(cls, context)

    def needed(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return dict.fromkeys(thing.data for thing in selected_meshes(context) if has_field(thing))


class ROSY_OT_field_convert(_OnFields, Ticking, bpy.types.Operator):
    """Give the fields of the selected meshes another degree, turn them, smooth them, or give them other magnitudes"""

    bl_idname = "rosy.field_convert"
    bl_label = "Convert Field"
    bl_options = {"REGISTER", "UNDO"}

    degree: bpy.props.IntProperty(
        name="Degree",
        description="A multiple or a divisor of the field's; 0: the same",
        min=0,
        max=MAX_DEGREE,
        default=0,
    )
    angle: bpy.props.FloatProperty(
        name="Turn",
        description="Counter-clockwise, all directions",
        subtype="ANGLE",
        min=-2 * pi,
        max=2 * pi,
        default=0.0,
    )
    smooth: bpy.props.FloatProperty(
        name="Smooth",
        description="Let the field diffuse over this share of the size of the mesh",
        min=0.0,
        max=10.0,
        soft_max=0.2,
        precision=3,
        step=1,
        default=0.0,
    )
    magnitude: bpy.props.EnumProperty(
        name="Magnitude",
        description="What lengths the directions get",
        items=[
            ("keep", "Keep", "As they are"),
            *((kind, kind.capitalize(), text) for kind, text in MAGNITUDES.items()),
            ("values", "Values", "Of an attribute or a vertex group: painted weights, a colour"),
        ],
    )
    values: bpy.props.StringProperty(
        name="Values",
        description="Name of the attribute or vertex group",
        search=lambda self, context, typed: _names_of_values(context),
    )

    def work(self, context: bpy.types.Context) -> Work[int]:
        """Convert all fields, then give them to the meshes; the number of meshes comes back."""
        meshes = list(self.needed(context))
        made = {}
        for number, mesh in enumerate(meshes):
            surface = mesh_surface(mesh)
            field = read_mesh_field(mesh, surface=surface)
            values = read_scalars(mesh, self.values) if self.magnitude == "values" else None
            if values is not None and values.min() < 0:
                raise RosyError(f"{surface.name}: '{self.values}' has values below 0, no lengths")
            kept = values if self.magnitude in ("keep", "values") else self.magnitude
            wished = Conversion(self.degree or None, self.angle, self.smooth, kept)
            work = converting(surface, field, wished)
            field = yield from part(work, number / len(meshes), (number + 1) / len(meshes))
            made[mesh] = replace(field, given=None)
        give_fields(self, context, made)
        return len(made)

    def finish(self, context: bpy.types.Context, result: int) -> None:
        self.report({"INFO"}, f"Converted the fields of {result} meshes")

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("degree", "angle", "smooth", "magnitude"):
            layout.prop(self, name)
        if self.magnitude == "values":
            layout.prop(self, "values")


class ROSY_OT_field_store(_OnFields, bpy.types.Operator):
    """Store the fields of the selected meshes in another form, for Geometry Nodes and other programs"""

    bl_idname = "rosy.field_store"
    bl_label = "Store Field"
    bl_options = {"REGISTER", "UNDO"}

    form: bpy.props.EnumProperty(
        name="As", items=[(form, name, text) for form, (name, text) in FORMS.items()]
    )
    attribute: bpy.props.StringProperty(
        name="Attribute",
        description="Name of the attribute, of vectors or angles; empty: 'rosy', and 'rosy_angle'",
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            fields = {mesh: read_mesh_field(mesh) for mesh in self.needed(context)}
            for mesh, field in fields.items():
                usual = "rosy_angle" if self.form == "ANGLE" else attribute_name(mesh)
                write_mesh_field(mesh, field, self.attribute or usual, self.form)
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Stored the fields of {len(fields)} meshes: {FORMS[self.form][1]}")
        return {"FINISHED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "form")
        if self.form != "DIRECTIONS":
            layout.prop(self, "attribute")


def _names_of_values(context: bpy.types.Context) -> list[str]:
    thing = selected_meshes(context)[0]
    kinds = {"FLOAT", "INT", "INT8", "BOOLEAN", "FLOAT_COLOR", "BYTE_COLOR"}
    names = [each.name for each in thing.data.attributes if each.data_type in kinds]
    return [*(group.name for group in thing.vertex_groups), *names]


CLASSES = (ROSY_OT_field_convert, ROSY_OT_field_store)

"""Operators: convert existing fields, or store them in another form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi
from typing import Any

from bpy.types import Context, Mesh, Object, Operator, OperatorProperties

from ..rosy_addon.core.errors import RosyError, counted
from ..rosy_addon.field.convert import Conversion, convert
from ..rosy_addon.field.curvature import MAGNITUDES
from ..rosy_addon.field.rosy_field import MAX_DEGREE, RosyField
from ..rosy_addon.scene.computed_attributes import assign_tangents, mesh_tangents
from ..rosy_addon.scene.face_values import read_face_scalars
from ..rosy_addon.scene.field_attributes import has_field
from ..rosy_addon.scene.mesh_fields import STORAGE_FORMS, assign_fields, read_mesh_field
from ..rosy_addon.scene.meshes import mesh_surface
from ..rosy_addon.ui.operator_settings import draw_convert_settings, draw_settings
from ..rosy_addon.ui.property_makers import choice, fraction, integer, real, text
from ..rosy_addon.worker.job import Call, Step, Steps, part, shares
from .base import EDITABLE_FIELD, selected_mesh_objects
from .modal_job import ModalJobMixin

#: Items of the property for the new degree. The number of each item is the degree. They are not in the
#: annotation of the property, because up to Python 3.11 a comprehension there cannot see names of the module.
DEGREE_ITEMS = [
    ("KEEP", "Keep", "Keep the degree", 0),
    *(
        (f"DEGREE_{degree}", str(degree), f"{counted(degree, 'direction')} at each point", degree)
        for degree in range(1, MAX_DEGREE + 1)
    ),
]

#: Forms in which a field can be stored, and in addition the tangents that shaders need.
FORMS = {
    **STORAGE_FORMS,
    "TANGENT": ("Tangents", "One direction on each corner, for the Tangent input of shaders"),
}


def _get_degree(operator: OperatorProperties) -> int:
    return operator.degree


def _set_degree(operator: OperatorProperties, degree: int) -> None:
    operator.degree = degree


def _search_values(_operator: Any, context: Context, _typed: str) -> list[str]:
    """Return the names of the vertex groups and the scalar attributes of the active mesh."""
    obj = selected_mesh_objects(context)[0]
    scalar_types = {"FLOAT", "INT", "INT8", "BOOLEAN", "FLOAT_COLOR", "BYTE_COLOR"}
    names = [each.name for each in obj.data.attributes if each.data_type in scalar_types]
    return [*(group.name for group in obj.vertex_groups), *names]


class _FieldsJobMixin(ModalJobMixin):
    """Mixin of operators on the fields of the selected meshes."""

    conditions = EDITABLE_FIELD

    def find_objects(self, context: Context) -> list[Object]:
        return [obj for obj in selected_mesh_objects(context) if has_field(obj)]

    def each_mesh(self, begin: Callable[[Mesh], Steps[Any]]) -> Steps[dict[Mesh, Any]]:
        """Run a job for each mesh. Return the results by mesh.

        `begin` returns the steps of the job for a mesh.
        """
        results = {}
        for mesh, start, stop in shares(self.meshes):
            results[mesh] = yield from part(begin(mesh), start, stop)
        yield Step(1.0, "storing the fields")
        return results


class ROSY_OT_field_convert(_FieldsJobMixin, Operator):
    """Change the degree of the fields of the selected meshes, rotate or smooth them, cancel singularities, or replace their magnitudes"""

    bl_label = "Convert Field"

    degree: integer(
        "Degree",
        "New degree, a multiple or a divisor of the present one. 0: keep the degree",
        min=0,
        max=MAX_DEGREE,
    )
    new_degree: choice(
        "Degree",
        "New degree, a multiple or a divisor of the present one",
        DEGREE_ITEMS,
        get=_get_degree,
        set=_set_degree,
        options={"SKIP_SAVE"},
    )
    angle: real(
        "Rotate",
        "Rotate all directions counter-clockwise by this angle",
        subtype="ANGLE",
        min=-2 * pi,
        max=2 * pi,
    )
    smooth: fraction(
        "Smooth", "Smooth the field over this fraction of the size of the mesh", soft_max=0.2
    )
    pair_distance: fraction(
        "Cancel Pairs",
        "Remove singularities whose indices sum to 0 and that are nearer than this fraction of "
        "the size of the mesh",
        soft_max=0.2,
    )
    magnitude: choice(
        "Magnitude",
        "Lengths of the directions",
        [
            ("keep", "Keep", "Keep the present lengths"),
            *((kind, kind.capitalize(), text) for kind, text in MAGNITUDES.items()),
            (
                "values",
                "Values",
                "Values of an attribute or a vertex group, such as painted weights or a color",
            ),
        ],
    )
    values: text("Values", "Name of the attribute or vertex group", search=_search_values)

    def begin(self, context: Context) -> Steps[str]:
        """Convert the fields of all selected meshes, then store them. The result is a message to the user."""
        converted = yield from self.each_mesh(self._converted)
        self.store_fields(context, converted)
        return f"Converted {counted(len(converted), 'field')}"

    def _converted(self, mesh: Mesh) -> Steps[RosyField]:
        """Return the steps of the job that computes the converted field of a mesh."""
        surface = mesh_surface(mesh)
        field = read_mesh_field(mesh, surface=surface)
        values = read_face_scalars(mesh, self.values) if self.magnitude == "values" else None
        if values is not None and values.min() < 0:
            raise RosyError(
                f"{surface.name}: '{self.values}' has negative values, which cannot be lengths"
            )
        magnitude = values if self.magnitude in ("keep", "values") else self.magnitude
        conversion = Conversion(
            self.degree or None, self.angle, self.smooth, self.pair_distance, magnitude
        )
        field = yield Call(convert, (surface, field, conversion))
        return replace(field, source_directions=None)

    def draw(self, context: Context) -> None:
        draw_convert_settings(self.layout, self)


class ROSY_OT_field_store(_FieldsJobMixin, Operator):
    """Store the fields of the selected meshes in another form, for Geometry Nodes and other programs"""

    bl_label = "Store Field"

    form: choice(
        "Store As",
        "Form in which the field is stored",
        [(form, name, text) for form, (name, text) in FORMS.items()],
    )
    attribute: text(
        "Attribute",
        "Name of the attribute. Empty: the name of the field for vectors, 'rosy_angle' for angles, "
        "'rosy_tangent' for tangents",
    )

    def begin(self, context: Context) -> Steps[str]:
        """Read the fields of all selected meshes, then store them. The result is a message to the user."""
        if self.form == "TANGENT":
            guiding_angle = context.scene.rosy.look.guiding_angle
            tangents = yield from self.each_mesh(
                lambda mesh: mesh_tangents.begin(mesh, guiding_angle, self.attribute)
            )
            assign_tangents(tangents, self.attribute)
            count = len(tangents)
        else:
            yield Step(0.0, "reading the fields")
            fields = {mesh: read_mesh_field(mesh) for mesh in self.meshes}
            assign_fields(fields, self.attribute, self.form)
            count = len(fields)
        return f"Stored {counted(count, 'field')} as {FORMS[self.form][0]}"

    def draw(self, context: Context) -> None:
        draw_settings(self.layout, self, "form")
        if self.form != "DIRECTIONS":
            draw_settings(self.layout, self, "attribute")

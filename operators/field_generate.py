"""Operator: generate fields on the selected meshes."""

from functools import partial
from typing import Any

import numpy as np
from bpy.types import Context, Mesh, Object, Operator

from ..rosy_addon.core.errors import NoFeaturesError, RosyError, counted
from ..rosy_addon.field.generate import GeneratorSettings, generate
from ..rosy_addon.field.guides import feature_edges
from ..rosy_addon.field.mesh_checks import copies_warning, orientation_warning
from ..rosy_addon.field.rosy_field import MAX_DEGREE
from ..rosy_addon.field.singularities import description
from ..rosy_addon.field.surface import Surface
from ..rosy_addon.scene import guides, singularity_points
from ..rosy_addon.scene.field_meshes import FieldTargets, field_targets
from ..rosy_addon.scene.look_properties import read_settings
from ..rosy_addon.scene.meshes import EDGE_MARKS, marked_edges, mesh_surface, read_uvs
from ..rosy_addon.ui.operator_settings import draw_generator_settings, draw_settings
from ..rosy_addon.ui.property_makers import choice, integer, setting_properties, text
from ..rosy_addon.worker.job import Call, Steps, shares
from .base import EDITABLE, selected_mesh_objects
from .modal_job import ModalJobMixin

#: Generators that take less time than it takes to count the singularities. After these, singularities are
#: counted only if there are at most this many faces.
FAST_KINDS, MAX_FAST_FACES = ("axis", "uv"), 50_000


GUIDE_ITEMS = [
    ("OBJECTS", "Objects", "Grease Pencil, curves and empties"),
    ("ANNOTATIONS", "Annotations", "Annotations of the scene that are drawn on the surface"),
    ("EDGES", "Edges", "Borders and sharp edges, or marked ones"),
    ("UV", "UV Map", "The axes of a UV map"),
    ("ATTRIBUTE", "Vectors", "A vector attribute, where it is not zero"),
]
EDGE_ITEMS = [
    ("FEATURES", "By Angle", "Borders and sharp edges"),
    *((mark, name, text) for mark, (_, name, text) in EDGE_MARKS.items()),
]


def _search_guides(_operator: Any, context: Context, _typed: str) -> list[str]:
    return [obj.name for obj in guides.guide_objects(context.scene.objects)]


def _search_points(_operator: Any, context: Context, _typed: str) -> list[str]:
    return [
        obj.name
        for obj in context.scene.objects
        if singularity_points.has_points(obj)
        and singularity_points.INDEX_ATTRIBUTE in obj.data.attributes
    ]


def _search_uv_maps(_operator: Any, context: Context, _typed: str) -> list[str]:
    return selected_mesh_objects(context)[0].data.uv_layers.keys()


def _search_attributes(_operator: Any, context: Context, _typed: str) -> list[str]:
    return selected_mesh_objects(context)[0].data.attributes.keys()


class ROSY_OT_field_generate(ModalJobMixin, Operator):
    """Generate a field on the selected meshes"""

    bl_label = "Make Field"
    conditions = EDITABLE

    __annotations__ = setting_properties(GeneratorSettings) | {
        "degree": integer(
            "Degree",
            "Number of directions at each point: 2 for lines, 4 for crosses, 6 for triangles "
            "and hexagons",
            min=1,
            max=MAX_DEGREE,
            default=4,
        ),
        "guides": choice(
            "Follow",
            "Kinds of guides that the field follows",
            GUIDE_ITEMS,
            options={"ENUM_FLAG"},
            default={"OBJECTS"},
        ),
        "guide": text(
            "Object",
            "Grease Pencil, curve or empty that the field follows. Empty: all that are "
            "selected. An object of type Empty guides along its z axis, within its display size",
            search=_search_guides,
        ),
        "edges": choice("Edges", "Edges that the field follows", EDGE_ITEMS),
        "uv_map": text(
            "UV Map", "UV map that the field follows. Empty: the active one", search=_search_uv_maps
        ),
        "vectors": text(
            "Vectors",
            "Vector attribute on faces, points or corners that the field follows. Empty: for "
            "Guided, the guides that you have combed; for Prescribed, none",
            search=_search_attributes,
        ),
        "singularities": text(
            "Points",
            "Object whose points are the singularities, with an integer attribute 'index'. "
            "Empty: the points that Singularities has made for the mesh, wherever you have moved them",
            search=_search_points,
        ),
        "attribute": text(
            "Attribute",
            "Name of the mesh attribute that stores the field. An existing field is replaced",
            default="rosy",
        ),
    }

    def find_objects(self, context: Context) -> list[Object]:
        return selected_mesh_objects(context)

    def begin(self, context: Context) -> Steps[str]:
        """Read all selected meshes and their guides, generate fields, and store them.

        A mesh without features to follow, or on which the field is undefined everywhere, is left out and
        reported. If no other mesh is selected, an error is raised.
        """
        with field_targets(self.objects, context.evaluated_depsgraph_get()) as targets:
            return (yield from self._generate(context, targets))

    def _generate(self, context: Context, targets: FieldTargets) -> Steps[str]:
        """Generate and store a field on each mesh in `targets`. The result is a message to the user."""
        inputs, errors = [], []
        for mesh, (owner, *_) in targets.items():
            surface = mesh_surface(mesh, f"object '{owner.name}'")
            try:
                settings = self._settings_for(context, owner, mesh, surface)
            except NoFeaturesError as error:
                errors.append(error)
                continue
            inputs.append((mesh, surface, settings))
        made = {}
        for (mesh, surface, settings), start, stop in shares(inputs, 0.9):
            try:
                field = yield Call(generate, (surface, settings, self.degree), start, stop)
            except NoFeaturesError as error:
                errors.append(error)
                continue
            if surface.face_count and not field.vectors.any():
                kind = self.properties.bl_rna.properties["kind"].enum_items[self.kind].name
                reason = "gives no direction on any face: choose another kind, such as Form"
                errors.append(RosyError(f"{surface.name}: {kind} {reason}"))
                continue
            made[mesh] = surface, field
            for warning in (orientation_warning, copies_warning):
                if note := (yield Call(warning, (surface,), stop, stop, "checking the mesh")):
                    self.report_warnings(note)
        if not made:
            raise errors[0]
        self.report_warnings(*map(str, errors))
        # To count singularities must not take longer than to generate the field.
        face_count = sum(surface.face_count for surface, _ in made.values())
        is_cheap = self.kind not in FAST_KINDS or face_count <= MAX_FAST_FACES
        describe = partial(description, count_singularities=is_cheap)
        notes = yield Call(describe, (list(made.values()),), 0.9)
        fields = {mesh: field for mesh, (_, field) in made.items()}
        self.store_fields(context, fields, self.attribute, targets)
        names = [targets[mesh][0].name for mesh in made]
        target = f"'{names[0]}'" if len(made) == 1 else counted(len(made), "mesh", "meshes")
        return f"Made a field of degree {self.degree} on {target}{notes and ': '}{notes}"

    def _settings_for(
        self, context: Context, owner: Object, mesh: Mesh, surface: Surface
    ) -> GeneratorSettings:
        """Return the settings of the generator for a mesh. They contain the guides, read from the scene.

        `mesh` is the data of the object `owner`, or its field mesh. `surface` is the surface of `mesh`.
        """
        kind_guides = {"features": {"EDGES"}, "uv": {"UV"}, "guided": self.guides}
        guide_kinds = kind_guides.get(self.kind, ())
        values = read_settings(self, GeneratorSettings)
        if "EDGES" in guide_kinds and self.edges != "FEATURES":
            values["edges"] = marked_edges(mesh, self.edges)
        elif "EDGES" in guide_kinds and self.kind == "guided":
            values["edges"] = feature_edges(surface, self.sharp_angle)
        if "OBJECTS" in guide_kinds:
            strokes, empties = guides.guide_strokes_and_empties(self._guide_objects(context), owner)
            values |= {"strokes": strokes, "axis_guides": empties}
        if "ANNOTATIONS" in guide_kinds:
            annotations = guides.annotation_strokes(context.scene, owner)
            values["strokes"] = [*values.get("strokes", ()), *annotations]
        if "UV" in guide_kinds:
            values["uv"] = read_uvs(mesh, self.uv_map)
        if "ATTRIBUTE" in guide_kinds:
            name = self.vectors or guides.GUIDE_ATTRIBUTE
            values["vectors"] = guides.guide_vectors(mesh, name, surface)
            values["vectors_have_firmness"] = name == guides.GUIDE_ATTRIBUTE
        if self.kind == "prescribed":
            values["singularities"] = singularity_points.read_singularity_points(
                context.scene, owner, self.degree, self.singularities
            )
            vectors = guides.guide_vectors(mesh, self.vectors, surface) if self.vectors else None
            if self.vectors == guides.GUIDE_ATTRIBUTE:
                vectors[np.linalg.norm(vectors, axis=1) < guides.STROKE_FIRMNESS] = 0
            values["vectors"] = vectors
        return GeneratorSettings(**values)

    def _guide_objects(self, context: Context) -> list[Object]:
        """Return the guide objects: the one that the settings name, or else the selected ones."""
        if not self.guide:
            objects = guides.guide_objects(context.selected_objects)
            if not objects:
                raise RosyError(
                    "there are no guides: choose an object, or select Grease Pencil, curves or "
                    "empties in addition to the mesh"
                )
            return objects
        obj = context.scene.objects.get(self.guide)
        if obj is None or not guides.guide_objects([obj]):
            raise RosyError(
                f"object '{self.guide}' is not a Grease Pencil, curve or empty of this scene"
            )
        return [obj]

    def draw(self, context: Context) -> None:
        draw_generator_settings(self.layout, self)
        draw_settings(self.layout, self, "attribute")

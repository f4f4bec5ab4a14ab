"""Fields on evaluated meshes: temporary attributes that modifiers copy, and reading them again."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ..cache import Cache, content_hash
from ..field.frames import dot, normalize, transport
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..field.validate import (
    apply_nonfinite_policy,
    as_float64,
    project_to_tangent,
    tangent_normals,
)
from ..progress import report
from .field_attributes import VECTOR_TYPE, cached_field, field_values
from .meshes import read_attribute
from .rest_shape import follow_mesh, read_rest_shape

#: Temporary attribute while a scene is read: the normals of the original faces, to whose planes the
#: field's vectors are tangent. Modifiers copy it to the evaluated mesh.
FACE_NORMAL_ATTRIBUTE = "rosy_face_normal"


@dataclass(frozen=True)
class FieldLayout:
    """The attributes that hold a field on an evaluated mesh.

    Attributes
    ----------
    name : str
        Name of the attribute with the member vectors, on faces. The ratio of direction k is in the
        attribute ``name_k`` if there are deviations.
    degree : int
    has_deviations : bool
        Whether the field has `RosyField.direction_ratios`.
    family_count : int
        See `RosyField`.
    """

    name: str
    degree: int
    has_deviations: bool = False
    family_count: int = 1

    @property
    def attribute_names(self) -> list[str]:
        """The names of all attributes: the member vectors, then the direction ratios."""
        indices = range(self.degree if self.has_deviations else 0)
        return [self.name, *(f"{self.name}_{index}" for index in indices)]

    def is_on(self, mesh: bpy.types.Mesh) -> bool:
        """Return whether an evaluated mesh has all attributes; modifiers may have lost them."""
        return all(name in mesh.attributes for name in self.attribute_names)


def add_temp_field(mesh: bpy.types.Mesh, field: RosyField, name: str) -> FieldLayout:
    """Store a field in temporary attributes on the faces of a mesh, and return their layout."""
    layout = FieldLayout(name, field.degree, field.direction_ratios is not None, field.family_count)
    add_temp_vectors(mesh, name, field.vectors)
    for index, deviation_name in enumerate(layout.attribute_names[1:]):
        deviation = field.direction_ratios[:, index]
        attribute = mesh.attributes.new(deviation_name, "FLOAT2", "FACE")
        pairs = np.stack([deviation.real, deviation.imag], axis=1).astype(np.float32)
        attribute.data.foreach_set("vector", pairs.ravel())
    mesh.update_tag()
    return layout


def add_temp_vectors(mesh: bpy.types.Mesh, name: str, vectors: np.ndarray) -> None:
    """Store vectors, (F, 3), in a temporary attribute on the faces of a mesh."""
    attribute = mesh.attributes.new(name, VECTOR_TYPE, "FACE")
    attribute.data.foreach_set("vector", vectors.astype(np.float32).ravel())
    mesh.update_tag()


def read_evaluated_field(
    mesh: bpy.types.Mesh,
    layout: FieldLayout,
    surface: Surface,
    nonfinite: str,
    label: str,
    cache: Cache | None = None,
) -> RosyField:
    """Read the field of an evaluated mesh, whose faces a modifier may have created.

    Modifiers copy the vector of an original face without changing it. `Surface.rest_vertices` gives
    the new face before any deformation, but its plane can still differ from that of the original
    face, for example if the polygon was not planar. If the mesh has the original normals
    (`FACE_NORMAL_ATTRIBUTE`), each vector is transported by the minimal rotation between the two
    normals. Otherwise it is projected to the tangent plane.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Evaluated.
    layout : FieldLayout
    surface : Surface
        Of the mesh.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    label : str
        Name of the mesh in messages.
    cache : Cache, optional
        Keeps fields that have not changed since an earlier call.

    Raises
    ------
    RosyError
        If a value is not finite and the policy is "error".
    """
    source = f"{label}, attribute '{layout.name}'"
    stored_values = field_values(mesh.attributes[layout.name], source, mesh)
    values = follow_mesh(read_rest_shape(mesh, layout.name), stored_values, surface)
    original_normals = read_attribute(mesh, FACE_NORMAL_ATTRIBUTE, np.float32, 3)
    deviation_pairs = [
        read_attribute(mesh, name, np.float32, 2) for name in layout.attribute_names[1:]
    ]

    def build() -> RosyField:
        vectors = _transport(values, original_normals, surface, source, nonfinite)
        deviations = [pair.astype(np.float64) @ (1, 1j) for pair in deviation_pairs]
        ratios = np.stack(deviations, axis=1) if deviations else None
        return RosyField(layout.degree, vectors, ratios, layout.family_count)

    key_parts = values, original_normals, *deviation_pairs, layout, source, nonfinite
    if cache is None or surface.rest_vertices is None:
        return cached_field(cache, surface, build, "evaluated", *key_parts)
    # The field depends on the rest shape alone. The deformed shape changes from frame to frame.
    shape = surface.rest_vertices, surface.corner_vertex, surface.face_start
    return cache.get_or_create(("evaluated field", content_hash(*shape, *key_parts)), build)


def _transport(
    values: np.ndarray,
    original_normals: np.ndarray | None,
    surface: Surface,
    source: str,
    nonfinite: str,
) -> np.ndarray:
    """Return the vectors, (F, 3) float64, transported from the original to the evaluated faces."""
    label = "reading the field"
    vectors = as_float64(values)
    apply_nonfinite_policy(vectors, source, "face", nonfinite)
    report(0.0, label)
    normals = tangent_normals(surface, "face")
    report(0.3, label)
    if original_normals is not None:
        original_normals = normalize(original_normals.astype(np.float64))
        # A mirrored face has the opposite normal. Only its plane matters.
        original_normals *= np.where(dot(original_normals, normals) < 0, -1.0, 1.0)[:, None]
        report(0.4, label)
        vectors = project_to_tangent(vectors, original_normals, 180.0, source, "face")
        report(0.6, label)
        vectors = transport(vectors, original_normals, normals)
        report(0.7, label)
    return project_to_tangent(vectors, normals, 180.0, source, "face")

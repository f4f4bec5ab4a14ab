"""Fields on evaluated meshes, read from attributes that modifiers have copied."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import numpy as np
from bpy.types import Depsgraph, Mesh, Object

from ..core.cache import Cache, cached, content_hash
from ..core.errors import RosyError
from ..core.progress import report
from ..field.blocks import as_float64
from ..field.frames import dot, normalize, transport
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..field.validate import apply_nonfinite_policy, project_to_tangent, tangent_normals
from .datablocks import is_editable, user_modifiers
from .field_attributes import (
    VECTOR_TYPE,
    attribute_name,
    field_degree,
    field_values,
    follow_mesh,
    is_face_vector_field,
    store_attribute,
)
from .mesh_fields import read_mesh_field
from .meshes import mesh_surface, no_faces_error, polygon_arrays, read_attribute

#: Attribute that exists only while a scene is read: the normal of each original face, to which the vectors of
#: the field are perpendicular. Modifiers copy it to the evaluated mesh.
FACE_NORMAL_ATTRIBUTE = "rosy_face_normal"

#: Attribute that exists only while a scene is read: the field as vectors on faces, if it is stored in another
#: form.
TEMP_FIELD_ATTRIBUTE = "rosy_stand_in"

#: The errors of objects whose fields cannot be drawn.
Errors = dict[Object, RosyError]


@dataclass(frozen=True)
class FieldLayout:
    """The attributes that hold a field on an evaluated mesh.

    Attributes
    ----------
    name : str
        Name of the attribute with one member vector per face.
    degree : int
        Degree N of the field.
    has_deviations : bool
        Whether the directions deviate from equal angles. The attributes ``name_0`` ... ``name_{N-1}`` then
        have the real and imaginary parts of the N ratios of each face; see `RosyField.direction_ratios`.
    family_count : int
        Number of families of directions; see `RosyField.family_count`.
    """

    name: str
    degree: int
    has_deviations: bool = False
    family_count: int = 1

    @property
    def attribute_names(self) -> list[str]:
        """Names of all attributes: first the one of member vectors, then one for each direction ratio."""
        indices = range(self.degree if self.has_deviations else 0)
        return [self.name, *(f"{self.name}_{index}" for index in indices)]

    def is_on(self, mesh: Mesh) -> bool:
        """Return whether an evaluated mesh has all attributes of the layout.

        Modifiers may have dropped some.
        """
        return all(name in mesh.attributes for name in self.attribute_names)


def read_evaluated_field(
    mesh: Mesh, layout: FieldLayout, surface: Surface, nonfinite: str, cache: Cache | None = None
) -> RosyField:
    """Read the field of an evaluated mesh, whose faces may differ from those of the original mesh.

    When modifiers divide a face, they copy its vector unchanged to the new faces. A new face may lie in
    another plane than the original face, even in the rest shape (`Surface.rest_vertices`), for example if the
    original polygon was not planar. If the mesh has the normals of the original faces
    (`FACE_NORMAL_ATTRIBUTE`), each vector is rotated by the smallest rotation from the original normal to the
    new one. Otherwise it is projected to the plane of the new face.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Evaluated mesh.
    layout : FieldLayout
    surface : Surface
        Surface of the mesh. Messages have its name.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    cache : Cache, optional
        Keeps fields that have not changed since an earlier call.

    Raises
    ------
    RosyError
        If a value is not finite and `nonfinite` is "error".
    """
    source = f"{surface.name}, attribute '{layout.name}'"
    stored_values = field_values(mesh.attributes[layout.name], source, mesh)
    values = follow_mesh(mesh, layout.name, stored_values, surface)
    original_normals = read_attribute(mesh, FACE_NORMAL_ATTRIBUTE, np.float32, 3)
    names = layout.attribute_names[1:]
    ratio_parts = [read_attribute(mesh, name, np.float32, 2) for name in names]

    def build() -> RosyField:
        vectors = as_float64(values)
        apply_nonfinite_policy(vectors, source, "face", nonfinite)
        vectors = _transport(vectors, original_normals, surface, source)
        columns = [parts.astype(np.float64) @ (1, 1j) for parts in ratio_parts]
        ratios = np.stack(columns, axis=1) if columns else None
        return RosyField(layout.degree, vectors, ratios, layout.family_count)

    shape: tuple[object, ...] = (surface,)
    if surface.rest_vertices is not None:  # the field does not depend on the shape of each frame
        shape = surface.rest_vertices, surface.corner_vertex, surface.face_start
    inputs = values, original_normals, *ratio_parts, layout, source, nonfinite
    return cached(cache, build, "evaluated field", *shape, *inputs)


def _transport(
    vectors: np.ndarray, source_normals: np.ndarray | None, surface: Surface, source: str
) -> np.ndarray:
    """Return vectors, (F, 3) float64, transported from the original to the evaluated faces.

    Parameters
    ----------
    vectors : (F, 3) float64 ndarray
        The vectors that modifiers copied to the evaluated faces.
    source_normals : (F, 3) ndarray or None
        The normal of the original face of each evaluated face. None: vectors are only projected.
    surface : Surface
        Surface of the evaluated mesh.
    source : str
        Name of the attribute in messages.
    """
    label = "reading the field"
    report(0.0, label)
    normals = tangent_normals(surface, "face")
    report(0.3, label)
    if source_normals is not None:
        source_normals = normalize(source_normals.astype(np.float64))
        # Mirroring reverses the normal of a face. Only the plane matters, so the sign is made equal.
        source_normals *= np.where(dot(source_normals, normals) < 0, -1.0, 1.0)[:, None]
        report(0.4, label)
        vectors = project_to_tangent(vectors, source_normals, source, "face", "project")
        report(0.6, label)
        vectors = transport(vectors, source_normals, normals)
        report(0.7, label)
    return project_to_tangent(vectors, normals, source, "face", "project")


@contextmanager
def temp_attributes(
    depsgraph: Depsgraph, objects: Sequence[Object], nonfinite: str, cache: Cache, errors: Errors
) -> Iterator[dict[Object, FieldLayout]]:
    """Context manager: add temporary attributes, which modifiers copy to evaluated meshes.

    They are removed at the end of the block. The attributes are the rest positions and the normals of the
    original faces. A field that is not stored as vectors on faces is added in this form. All fields are
    checked on the original meshes.

    Inside another such context with the same objects, nothing is added again. A caller that calls
    `read_scene` many times is faster if it opens one context around all calls.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        It is updated when attributes have been added or removed.
    objects : sequence of bpy.types.Object
        Original mesh objects with a field.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    cache : Cache
        Keeps surfaces and fields that have not changed since an earlier call.
    errors : dict of bpy.types.Object to RosyError
        The errors of fields that cannot be read are added to it. The result leaves these objects out.

    Yields
    ------
    dict of bpy.types.Object to FieldLayout
        The attributes that hold each object's field on its evaluated mesh.
    """
    layouts: dict[Object, FieldLayout] = {}
    rest_enabled: list[Object] = []
    temp_meshes: list[Mesh] = []
    try:
        for obj in objects:
            mesh = obj.data
            try:
                layouts[obj] = _layout_of(obj, nonfinite, temp_meshes, cache)
            except RosyError as error:
                errors[obj] = error
                continue
            deforms = bool(user_modifiers(obj) or mesh.shape_keys)
            if deforms and is_editable(obj) and not obj.add_rest_position_attribute:
                obj.add_rest_position_attribute = True
                rest_enabled.append(obj)
            if deforms and FACE_NORMAL_ATTRIBUTE not in mesh.attributes and _can_modify(mesh):
                temp_meshes.append(mesh)
                surface = mesh_surface(mesh, f"object '{obj.name}'", cache=cache)
                store_attribute(mesh, FACE_NORMAL_ATTRIBUTE, VECTOR_TYPE, surface.face_normal)
                mesh.update_tag()
        if rest_enabled or temp_meshes:
            depsgraph.update()
        yield layouts
    finally:
        for obj in rest_enabled:
            with suppress(ReferenceError):  # the user may have deleted some
                obj.add_rest_position_attribute = False
        for mesh in set(temp_meshes):
            with suppress(ReferenceError):
                for name in list(mesh.attributes.keys()):
                    if name.startswith((FACE_NORMAL_ATTRIBUTE, TEMP_FIELD_ATTRIBUTE)):
                        mesh.attributes.remove(mesh.attributes[name])
                mesh.update_tag()
        if rest_enabled or temp_meshes:
            depsgraph.update()


def _layout_of(obj: Object, nonfinite: str, temp_meshes: list[Mesh], cache: Cache) -> FieldLayout:
    """Return the layout of the field of an object as vectors on faces; add temporary attributes if needed.

    If attributes are added to the mesh of the object, the mesh is appended to `temp_meshes`. `nonfinite` is
    "error" or "zero": vectors that are not finite raise an error, or are undefined.
    """
    mesh, label = obj.data, f"object '{obj.name}'"
    if mesh.is_editmode and is_face_vector_field(mesh):  # only the evaluated mesh can be read
        return FieldLayout(attribute_name(mesh), field_degree(mesh))
    field = read_mesh_field(mesh, nonfinite=nonfinite, label=label, cache=cache)
    if is_face_vector_field(mesh):
        return FieldLayout(attribute_name(mesh), field.degree)
    if not _can_modify(mesh):
        raise RosyError(
            f"{label}: its mesh is {'in edit mode' if mesh.is_editmode else 'linked'}, and only fields "
            "stored as vectors on faces can be read there: use Store Field first"
        )
    has_deviations = field.direction_ratios is not None
    layout = FieldLayout(TEMP_FIELD_ATTRIBUTE, field.degree, has_deviations, field.family_count)
    if TEMP_FIELD_ATTRIBUTE not in mesh.attributes:
        temp_meshes.append(mesh)
        store_attribute(mesh, TEMP_FIELD_ATTRIBUTE, VECTOR_TYPE, field.vectors)
        for index, name in enumerate(layout.attribute_names[1:]):
            ratios = field.direction_ratios[:, index]
            store_attribute(mesh, name, "FLOAT2", np.stack([ratios.real, ratios.imag], axis=1))
        mesh.update_tag()
    return layout


def _can_modify(mesh: Mesh) -> bool:
    """Return whether attributes can be added to a mesh."""
    return is_editable(mesh) and not mesh.is_editmode


def lost_field_error(obj: Object, attribute: str | None) -> RosyError:
    """Return the error for an object whose modifiers remove an attribute.

    `attribute` is the name of the attribute. If it is None, the modifiers remove all faces.
    """
    if attribute is None and not len(obj.data.polygons):
        return no_faces_error(obj.data, f"object '{obj.name}'")
    names = ", ".join(modifier.name for modifier in user_modifiers(obj)) or "none"
    problem = "has no faces"
    if attribute is not None:
        problem = f"has no attribute '{attribute}': make the field again"
    return RosyError(f"object '{obj.name}': after its modifiers ({names}) the mesh {problem}")


def topology_hash(mesh: Mesh, original: Mesh) -> bytes:
    """Return a hash of the faces and the field attribute of an evaluated mesh, without positions.

    The name of the field attribute is a setting of the original mesh, `original`.
    """
    name, values = attribute_name(original), None
    if is_face_vector_field(mesh, name):
        values = read_attribute(mesh, name, np.float32, 3)
    return content_hash(*polygon_arrays(mesh), values)

"""Jobs that compute mesh attributes: tangents, the angles between two fields, ambient occlusion.

The jobs read meshes, compute values, and store them; `assign_tangents` stores the tangents. If an attribute
cannot be stored, an error is raised before anything is computed or changed.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from bpy.types import Depsgraph, Mesh, Object

from ..core.errors import RosyError
from ..field.analysis import FieldComparison, compare_fields
from ..field.surface import have_same_polygons
from ..projection.ambient_occlusion import DIRECTION_COUNT, ambient_occlusion
from ..projection.gbuffer import MeshInstance
from ..surface_texture.line_order import corner_tangents
from ..worker.job import Call, Steps, call_steps, job, shares
from .field_attributes import VECTOR_TYPE, attribute_name, check_attribute_type, store_attribute
from .guides import GUIDE_ATTRIBUTE
from .look_inputs import ReadRequest
from .mesh_fields import check_writable, read_mesh_field, vector_names
from .meshes import mesh_label, mesh_surface
from .scene_reader import SceneData, read_scene

#: Default names of the attributes. The difference is the angle between two fields in degrees; it is NaN where
#: one of them is undefined.
TANGENT_ATTRIBUTE = "rosy_tangent"
DIFFERENCE_ATTRIBUTE = "Difference"
OCCLUSION_ATTRIBUTE = "Occlusion"


# --- tangents ------------------------------------------------------------------------------------


@job
def mesh_tangents(mesh: Mesh, guiding_angle: float, name: str = "") -> Steps[np.ndarray]:
    """Compute one direction of a mesh's field per corner, for the Tangent input of shaders.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    guiding_angle : float
        Which direction of the field is stored: one near this angle, in radians. On each face the angle is
        measured from the direction in the face that is horizontal in object space, counter-clockwise as seen
        from outside; see `line_order`.
    name : str
        Name of the attribute in which the tangents will be stored; see `assign_tangents`. It is only checked
        here, and nothing is stored.

    Returns
    -------
    (C, 3) float32 ndarray
        Unit vectors in object space; zero vectors where the field is undefined.

    Raises
    ------
    RosyError
        If there is no field, or no attribute of this name can store tangents.
    """
    _check_tangents_storable(mesh, name)
    surface = mesh_surface(mesh)
    field = read_mesh_field(mesh, surface=surface)
    return call_steps(corner_tangents, surface, field, guiding_angle)


def assign_tangents(tangents: Mapping[Mesh, np.ndarray], name: str = "") -> None:
    """Store tangents on the corners of meshes: on all of them, or on none if one cannot be changed.

    Parameters
    ----------
    tangents : mapping of bpy.types.Mesh to (C, 3) float32 ndarray
    name : str
        Name of the attribute; `TANGENT_ATTRIBUTE` if it is empty.

    Raises
    ------
    RosyError
        If a mesh is linked from a library or in edit mode, or has an attribute of the name with
        another type or domain. Nothing is changed in this case.
    """
    for mesh in tangents:
        _check_tangents_storable(mesh, name)
    for mesh, vectors in tangents.items():
        store_attribute(mesh, name or TANGENT_ATTRIBUTE, VECTOR_TYPE, vectors, "CORNER")
        mesh.update()


def _check_tangents_storable(mesh: Mesh, name: str) -> None:
    check_writable(mesh)
    check_attribute_type(mesh, name or TANGENT_ATTRIBUTE, VECTOR_TYPE, "CORNER")


# --- difference of two fields --------------------------------------------------------------------


def other_field_names(mesh: Mesh) -> list[str]:
    """Return the names of vector attributes of a mesh that may hold a field other than its own."""
    no_fields = (attribute_name(mesh), GUIDE_ATTRIBUTE, TANGENT_ATTRIBUTE)
    names = [name for name in vector_names(mesh) if not re.fullmatch(r"dir\d+", name)]
    return [name for name in names if name not in no_fields]


@job
def store_difference(mesh: Mesh, other: str) -> Steps[tuple[str, int, FieldComparison]]:
    """Compute the angle between the field of a mesh and another field, and store it on the faces.

    The attribute is `DIFFERENCE_ATTRIBUTE`, in degrees.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    other : str
        Name of the attribute with the other field. It is read with the degree of the mesh's field. If the
        name is empty, the only attribute of `other_field_names` is used.

    Returns
    -------
    other : str
        Name of the attribute with the other field.
    degree : int
        Degree of both fields.
    comparison : FieldComparison

    Raises
    ------
    RosyError
        If there is no such field, several could be meant, or the attribute cannot be written.
    """
    check_writable(mesh)
    label = mesh_label(mesh)
    names = other_field_names(mesh)
    if len(names) == 1:
        other = other or names[0]
    if not other or other == attribute_name(mesh):
        choice = " or ".join(f"'{known}'" for known in names)
        hint = f"choose {choice}" if choice else "make one with another name of the attribute"
        raise RosyError(f"{label}: needs another field to compare with: {hint}")
    check_attribute_type(mesh, DIFFERENCE_ATTRIBUTE, "FLOAT")
    surface = mesh_surface(mesh, label)
    field = read_mesh_field(mesh, surface=surface)
    other_field = read_mesh_field(mesh, other, field.degree, surface)
    comparison = yield Call(compare_fields, (surface, field, other_field))
    store_attribute(mesh, DIFFERENCE_ATTRIBUTE, "FLOAT", np.degrees(comparison.difference.angle))
    mesh.update()
    return other, field.degree, comparison


# --- ambient occlusion ---------------------------------------------------------------------------


@job
def store_occlusion(
    depsgraph: Depsgraph, objects: Sequence[Object], direction_count: int = DIRECTION_COUNT
) -> Steps[None]:
    """Compute the ambient occlusion of objects, and store it on their meshes, for use as their tone.

    All objects that are visible in renders of the view layer occlude. If the modifiers of an object keep its
    faces, occlusion is computed on the evaluated mesh, otherwise on the original mesh. It is stored on the
    original mesh, from which modifiers copy attributes to the evaluated mesh. The attribute is
    `OCCLUSION_ATTRIBUTE`, a float on corners: the visible fraction of the sky, from 0 to 1.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
    objects : sequence of bpy.types.Object
        Original objects with a field.
    direction_count : int
        Number of light directions.

    Raises
    ------
    RosyError
        If the scene cannot be read (see `read_scene`), or a mesh is linked, in edit mode, or has an
        attribute of that name with another type or domain.
    """
    for obj in objects:
        check_writable(obj.data)
        check_attribute_type(obj.data, OCCLUSION_ATTRIBUTE, "FLOAT", "CORNER")
    scene_data = read_scene(depsgraph, objects, ReadRequest("zero"))
    values_by_mesh: dict[Mesh, np.ndarray] = {}
    for obj, start, stop in shares(objects):
        inputs = *_with_original_faces(scene_data, obj), direction_count
        values_by_mesh[obj.data] = yield Call(ambient_occlusion, inputs, start, stop)
    for mesh, values in values_by_mesh.items():
        store_attribute(mesh, OCCLUSION_ATTRIBUTE, "FLOAT", values, "CORNER")
        mesh.update()


def _with_original_faces(scene_data: SceneData, obj: Object) -> tuple[list[MeshInstance], int]:
    """Return the mesh instances of a scene, and the index of the instance of an object.

    If the modifiers of the object change the faces, its instance has the surface of the original mesh.
    """
    index, instances = scene_data.objects.index(obj), list(scene_data.instances)
    original = mesh_surface(obj.data, f"object '{obj.name}'")
    if not have_same_polygons(original, instances[index].surface):
        instances[index] = replace(instances[index], surface=original)
    return instances, index

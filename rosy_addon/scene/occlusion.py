"""Ambient occlusion of the objects of a scene, stored as a mesh attribute for the tone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import bpy
import numpy as np

from ..core.errors import RosyError
from ..projection.ambient_occlusion import DIRECTION_COUNT, ambient_occlusion
from ..projection.gbuffer import MeshInstance
from ..worker.job import Call, Steps, job
from .compat import is_editable
from .meshes import mesh_surface
from .read_request import ReadRequest
from .scene_reader import SceneData, read_scene

#: Default name of the attribute.
OCCLUSION_ATTRIBUTE = "Occlusion"

_ATTRIBUTE_TYPE = "CORNER", "FLOAT"


@job
def store_occlusion(
    depsgraph: bpy.types.Depsgraph,
    objects: Sequence[bpy.types.Object],
    name: str = OCCLUSION_ATTRIBUTE,
    direction_count: int = DIRECTION_COUNT,
) -> Steps[None]:
    """Compute the ambient occlusion of objects, and store it on their meshes.

    Everything that is visible in renders of the view layer occludes. The evaluated mesh is used if
    the modifiers keep the faces, the original mesh otherwise. Modifiers then copy the attribute to
    the evaluated mesh.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
    objects : sequence of bpy.types.Object
        Original objects with a field.
    name : str
        Name of the attribute: a float on corners, from 0 (no sky visible) to 1 (all of it).
    direction_count : int
        Number of light directions.

    Raises
    ------
    RosyError
        If the scene cannot be read (see `read_scene`), or a mesh is linked, in edit mode, or has an
        attribute of that name with another type or domain. Nothing is changed in this case.
    """
    for obj in objects:
        _check_writable(obj, name)
    scene_data = read_scene(depsgraph, objects, ReadRequest("zero"))
    values_by_mesh: dict[bpy.types.Mesh, np.ndarray] = {}
    for index, obj in enumerate(objects):
        start, stop = index / len(objects), (index + 1) / len(objects)
        inputs = *_with_original_faces(scene_data, obj), direction_count
        values_by_mesh[obj.data] = yield Call(ambient_occlusion, inputs, start, stop)
    for mesh, values in values_by_mesh.items():
        attribute = mesh.attributes.get(name) or mesh.attributes.new(name, "FLOAT", "CORNER")
        attribute.data.foreach_set("value", values)
        mesh.update()


def _with_original_faces(
    scene_data: SceneData, obj: bpy.types.Object
) -> tuple[list[MeshInstance], int]:
    """Return the mesh instances of a scene, and the index of an object's instance.

    The instance gets the object's original surface if its modifiers change the faces.
    """
    instance_index = scene_data.objects.index(obj)
    instances = list(scene_data.instances)
    evaluated = instances[instance_index].surface
    original = mesh_surface(obj.data, f"object '{obj.name}'")
    same_faces = np.array_equal(original.face_start, evaluated.face_start)
    if not (same_faces and np.array_equal(original.corner_vertex, evaluated.corner_vertex)):
        instances[instance_index] = replace(instances[instance_index], surface=original)
    return instances, instance_index


def _check_writable(obj: bpy.types.Object, name: str) -> None:
    """Raise an error if the attribute cannot be written to the mesh of an object."""
    mesh, label = obj.data, f"object '{obj.name}'"
    if not is_editable(mesh) or mesh.is_editmode:
        raise RosyError(
            f"{label}: {'leave edit mode (Tab)' if mesh.is_editmode else 'make its linked mesh local'} first"
        )
    attribute = mesh.attributes.get(name)
    if attribute is not None and (attribute.domain, attribute.data_type) != _ATTRIBUTE_TYPE:
        raise RosyError(
            f"{label} already has an attribute '{name}' of another type ({attribute.data_type} on "
            f"{attribute.domain}): rename or remove it"
        )

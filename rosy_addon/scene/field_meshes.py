"""Field meshes: copies of evaluated meshes, which hold the fields of objects whose modifiers change the faces.

The property ``obj.rosy.field_mesh`` of such an object is its field mesh. The field is made for the faces of the
evaluated mesh, and rotates with them when a modifier or an edit moves them. The vertices of the field mesh are the rest
shape. All other objects have their fields on their own meshes; see `datablocks.field_mesh`.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress

import bpy
import numpy as np
from bpy.types import Depsgraph, Mesh, Object

from .datablocks import user_modifiers
from .meshes import evaluated_mesh, polygon_arrays, vertex_positions
from .picture_nodes import CLIP_ATTRIBUTE, MATERIAL_ATTRIBUTE

#: Custom property of field meshes.
_TAG = "rosy_field_mesh"

#: Meshes on which fields are made, each with the objects whose fields they will hold.
FieldTargets = dict[Mesh, list[Object]]


@contextmanager
def field_targets(objects: Sequence[Object], depsgraph: Depsgraph) -> Iterator[FieldTargets]:
    """Context manager: yield the meshes on which new fields of objects are made, each with its objects.

    The mesh of an object is its own mesh, unless modifiers change the faces. Then it is the field mesh of the object,
    with vertices moved to their evaluated positions; if there is none with these faces, it is a new copy of the
    evaluated mesh. Copies that `hold_fields` has not assigned to objects are deleted at the end.
    """
    targets: FieldTargets = {}
    try:
        for obj in objects:
            targets.setdefault(_target(obj, depsgraph), []).append(obj)
        yield targets
    finally:
        _discard(targets)


def _target(obj: Object, depsgraph: Depsgraph) -> Mesh:
    """Return the mesh on which a new field of an object is made."""
    if not user_modifiers(obj) or obj.library or obj.override_library:
        return obj.data  # a library override would lose its field mesh when the file is saved
    evaluated = obj.evaluated_get(depsgraph)
    with evaluated_mesh(evaluated) as mesh:
        if mesh is None or _have_same_faces(mesh, obj.data):
            return obj.data
        earlier = obj.rosy.field_mesh
        if earlier is not None and _have_same_faces(mesh, earlier):
            earlier.vertices.foreach_set("co", vertex_positions(mesh).ravel())
            earlier.update()
            return earlier
    copy = bpy.data.meshes.new_from_object(evaluated, depsgraph=depsgraph)
    copy.name = f"{obj.name} field"
    copy[_TAG] = True
    copy.materials.clear()
    for name in (CLIP_ATTRIBUTE, MATERIAL_ATTRIBUTE):
        if name in copy.attributes:
            copy.attributes.remove(copy.attributes[name])
    return copy


def _have_same_faces(mesh: Mesh, other: Mesh) -> bool:
    """Return whether two meshes have the same faces by vertex index. Positions may differ."""
    return len(mesh.vertices) == len(other.vertices) and all(
        map(np.array_equal, polygon_arrays(mesh), polygon_arrays(other))
    )


def hold_fields(targets: FieldTargets) -> None:
    """Assign the meshes of `field_targets`, after fields have been stored on them, to their objects.

    A mesh that is not the object's own becomes its field mesh. Earlier field meshes without users are deleted.
    """
    for mesh, objects in targets.items():
        for obj in objects:
            earlier = obj.rosy.field_mesh
            obj.rosy.field_mesh = None if mesh == obj.data else mesh
            obj.update_tag()
            if earlier is not None:
                _discard([earlier])


def _discard(meshes: Iterable[Mesh]) -> None:
    """Delete the given meshes that are field meshes and have no users."""
    for mesh in meshes:
        with suppress(ReferenceError):  # deleted
            if mesh.get(_TAG) and not mesh.users:
                bpy.data.meshes.remove(mesh)

"""Datablocks: find out which ones RoSy created, and which are linked, missing or editable.

Datablocks that RoSy creates have a custom property, by which they are recognized and deleted. If the library
of a linked object is missing, Blender keeps a placeholder in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal

import bpy

from ..core.errors import RosyError

#: The function of `rollback_on_error`, which takes and returns a datablock.
Track = Callable[[Any], Any]

#: Custom property on every datablock that RoSy created.
OWNED_TAG = "rosy_made"

#: Custom property on node groups that move strokes with a surface. Their modifiers are removed with the
#: strokes, not with the pictures.
STROKES_TAG = "rosy_surface_strokes"

#: Custom property on ink objects, which show the pictures of their parents; see `ink_objects`.
INK_TAG = "rosy_ink"

#: Custom property on the objects and materials of keys (legends). Their images are not pictures of a field.
KEY_TAG = "rosy_key"


def _is_rosy_modifier(modifier: bpy.types.Modifier) -> bool:
    group = modifier.node_group if modifier.type == "NODES" else None
    return group is not None and bool(group.get(OWNED_TAG)) and not group.get(STROKES_TAG)


def rosy_modifiers(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """Return the modifiers of an object that RoSy added to show pictures."""
    return [modifier for modifier in obj.modifiers if _is_rosy_modifier(modifier)]


def _is_from_library(modifier: bpy.types.Modifier) -> bool:
    """Return whether a library override has a modifier from its library."""
    return modifier.id_data.override_library is not None and modifier.is_override_data


def removable_modifiers(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """Return the modifiers that RoSy added or changed in this file, and not in a library.

    On a library override, a modifier from the library counts as changed if its node group is in this file, so that
    it shows a picture of this file.
    """
    if obj.library is not None:
        return []
    return [
        modifier
        for modifier in rosy_modifiers(obj)
        if modifier.node_group.library is None or not _is_from_library(modifier)
    ]


def remove_picture_modifiers(obj: bpy.types.Object) -> None:
    """Remove the pictures of this file from an object: remove or reset its `removable_modifiers`.

    A modifier that comes from a library gets the node group of the library again. An ink object is deleted.
    """
    if obj.get(INK_TAG):
        bpy.data.batch_remove([obj, obj.data])
        return
    for modifier in removable_modifiers(obj):
        if _is_from_library(modifier):
            original = obj.override_library.reference.modifiers.get(modifier.name)
            modifier.node_group = None if original is None else original.node_group
        else:
            obj.modifiers.remove(modifier)


def user_modifiers(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """Return the modifiers of an object that RoSy did not add."""
    return [modifier for modifier in obj.modifiers if not _is_rosy_modifier(modifier)]


@contextmanager
def rollback_on_error() -> Iterator[Track]:
    """Context manager: delete the datablocks that its block has created if the block raises an error.

    It yields a function that the block calls with each new datablock. The function returns the datablock. At the
    end of the block, the datablocks are tagged as created by RoSy.
    """
    created: list[bpy.types.ID] = []

    def track(datablock: Any) -> Any:
        created.append(datablock)
        return datablock

    try:
        yield track
        for datablock in created:
            datablock[OWNED_TAG] = True
    except BaseException:
        for datablock in reversed(created):
            delete_owned(datablock)
        raise


def delete_owned(datablock: bpy.types.ID | None) -> int:
    """Delete a datablock if RoSy created it. Return the number of deleted datablocks, 0 or 1."""
    if datablock is None or not datablock.get(OWNED_TAG, True):
        return 0
    bpy.data.batch_remove([datablock])
    return 1


def delete_unused() -> int:
    """Delete the meshes, node groups, materials and images that RoSy created and that nothing uses.

    Return the number of deleted images.
    """
    # The order matters: a mesh or a geometry node group uses a material, which uses an image and a shader node group.
    for name in ("meshes", "node_groups", "materials", "node_groups", "images"):
        owned = [block for block in getattr(bpy.data, name) if block.get(OWNED_TAG)]
        unused = [block for block in owned if not block.users and block.library is None]
        bpy.data.batch_remove(unused)
    return len(unused)


def check_object_type(obj: bpy.types.Object, kind: Literal["MESH", "CAMERA"]) -> None:
    """Check that an object has a type, and that it is not a placeholder for a missing object.

    Raises
    ------
    RosyError
        If it has another type, or is missing in its library.
    """
    check_not_missing(obj)
    if obj.type != kind:
        label = obj.bl_rna.properties["type"].enum_items[obj.type].name
        raise RosyError(f"object '{obj.name}' is not a {kind.lower()}, but of type {label}")


def check_not_missing(obj: bpy.types.Object) -> None:
    """Raise an error if an object or its data is a placeholder for data missing in a library."""
    for datablock in (obj, obj.data):
        if datablock is not None and datablock.is_missing:
            path, problem = datablock.library.filepath, f"does not contain '{datablock.name}'"
            if datablock.library.is_missing:
                problem = "is missing"
            raise RosyError(f"object '{obj.name}': its library {path} {problem}: relink it")


def remedy_for_absence(otherwise: str) -> str:
    """Return advice for a message that an object is absent: to relink missing libraries, if there are any.

    If no library is missing, return the advice `otherwise`.
    """
    paths = [library.filepath for library in bpy.data.libraries if library.is_missing]
    return f"relink the missing library {', '.join(paths)}" if paths else otherwise


def has_rosy_properties() -> bool:
    """Return whether RoSy's properties are registered, as they are while the extension is enabled."""
    return hasattr(bpy.types.Scene, "rosy") and hasattr(bpy.types.Mesh, "rosy")


def field_mesh(obj: bpy.types.Object) -> Any:
    """Return the mesh that holds the field of an object: its field mesh, or its own data.

    See the module `field_meshes`.
    """
    return (obj.rosy.field_mesh if has_rosy_properties() else None) or obj.data


def is_editable(datablock: bpy.types.ID) -> bool:
    """Return whether a datablock can be changed: it is local, or a library override of anything but a mesh.

    Blender (4.2 to 5.2) ignores values that are written to attributes of a mesh that is an override.
    """
    is_mesh_override = isinstance(datablock, bpy.types.Mesh) and datablock.override_library
    is_local = datablock.library is None and getattr(datablock, "is_editable", True)
    return is_local and not is_mesh_override

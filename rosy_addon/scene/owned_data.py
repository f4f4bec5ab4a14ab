"""Datablocks that RoSy created: how they are recognized, deleted, and rolled back after an error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

#: Custom property on every datablock that RoSy created.
OWNED_TAG = "rosy_made"

#: Custom property on node groups for strokes. Their modifiers go with the strokes.
STROKES_TAG = "rosy_surface_strokes"

#: Custom property on the objects and materials of keys. They show an image that is not a picture of a field.
KEY_TAG = "rosy_key"


def is_rosy_modifier(modifier: bpy.types.Modifier) -> bool:
    """Whether RoSy added a modifier that shows a picture."""
    group = getattr(modifier, "node_group", None) if modifier.type == "NODES" else None
    return group is not None and bool(group.get(OWNED_TAG)) and not group.get(STROKES_TAG)


def removable_modifiers(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """Return the modifiers that RoSy added to an object, and that are not linked from a library."""
    if obj.library is not None:
        return []
    is_override = obj.override_library is not None
    return [
        modifier
        for modifier in obj.modifiers
        if is_rosy_modifier(modifier) and not (is_override and modifier.is_override_data)
    ]


def user_modifiers(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """Return the modifiers of an object without those that RoSy added."""
    return [modifier for modifier in obj.modifiers if not is_rosy_modifier(modifier)]


@contextmanager
def rollback_on_error() -> Iterator[list[bpy.types.ID]]:
    """Yield a list to which new datablocks are appended.

    At the end they are tagged as created by RoSy. If an error is raised, they are deleted instead.
    """
    created: list[bpy.types.ID] = []
    try:
        yield created
        for datablock in created:
            datablock[OWNED_TAG] = True
    except BaseException:
        for datablock in reversed(created):
            delete_owned(datablock)
        raise


def delete_owned(datablock: bpy.types.ID | None) -> int:
    """Delete a datablock that RoSy created. Return the number of deleted datablocks, 0 or 1."""
    if datablock is None or not datablock.get(OWNED_TAG, True):
        return 0
    bpy.data.batch_remove([datablock])
    return 1


def delete_unused() -> int:
    """Delete the node groups, materials and images that RoSy created and that nothing uses.

    Return the number of deleted images.
    """
    # A geometry group uses its material, and that its image and its shader group.
    for name in ("node_groups", "materials", "node_groups", "images"):
        unused = [
            block
            for block in getattr(bpy.data, name)
            if block.get(OWNED_TAG) and not block.users and block.library is None
        ]
        bpy.data.batch_remove(unused)
    return len(unused)

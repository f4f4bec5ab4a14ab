"""Linked data whose library is missing: Blender keeps a placeholder, an empty, for each object."""

from __future__ import annotations

from typing import Literal

import bpy

from ..core.errors import RosyError


def check_object_type(obj: bpy.types.Object, kind: Literal["MESH", "CAMERA"]) -> None:
    """Check that an object is of a type.

    Raises
    ------
    RosyError
        If it is of another type, or is missing in its library.
    """
    check_not_missing(obj)
    if obj.type != kind:
        label = obj.bl_rna.properties["type"].enum_items[obj.type].name
        raise RosyError(f"object '{obj.name}' is not a {kind.lower()}, but of type {label}")


def check_not_missing(obj: bpy.types.Object) -> None:
    """Raise an error if an object or its data is a placeholder for data missing in a library."""
    for datablock in (obj, obj.data):
        if datablock is not None and datablock.is_missing:
            path = datablock.library.filepath
            if datablock.library.is_missing:
                raise RosyError(f"object '{obj.name}': its library {path} is missing: relink it")
            raise RosyError(
                f"object '{obj.name}': its library {path} does not contain '{datablock.name}': relink it"
            )


def remedy_for_absence(otherwise: str) -> str:
    """Return what to do if something is not there: relink libraries that are missing, if any."""
    paths = [library.filepath for library in bpy.data.libraries if library.is_missing]
    return f"relink the missing library {', '.join(paths)}" if paths else otherwise

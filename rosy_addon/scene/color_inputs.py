"""Reading the numbers of a color map: attributes of meshes, at the corners of their surfaces."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ..compositor.look import Look, colors_values
from ..core.cache import Cache, content_hash
from ..core.errors import RosyError
from .face_values import COLOR_TYPES, corner_scalars, filled_attribute

#: Types of attributes that messages list. Booleans are mostly Blender's own.
LISTED_TYPES = ("FLOAT", "INT", *COLOR_TYPES)


def color_attribute_of(scene: bpy.types.Scene, look: Look) -> str | None:
    """Return the name of the attribute whose numbers a look colors; None if it colors none."""
    return scene.rosy.color_attribute if colors_values(look) else None


def read_color_values(
    mesh: bpy.types.Mesh,
    name: str | None,
    label: str,
    cache: Cache | None = None,
) -> np.ndarray | None:
    """Read the numbers of an attribute.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Evaluated.
    name : str or None
        Of the attribute.
    label : str
        Of the object, in messages.
    cache : Cache, optional
        Keeps numbers that have not changed since an earlier call.

    Returns
    -------
    (C,) float32 ndarray or None
        At the corners; NaN where a number is not finite. None if the mesh has no such attribute.

    Raises
    ------
    RosyError
        If the type of the attribute is not supported.
    """
    attribute = filled_attribute(mesh, name) if name else None
    if attribute is None:
        return None
    source = f"{label}, attribute '{attribute.name}'"
    values = corner_scalars(attribute, mesh, source).astype(np.float32)
    values[~np.isfinite(values)] = np.nan
    if cache is None:
        return values
    return cache.get_or_create(("color values", content_hash(values)), lambda: values)


def color_values_digest(mesh: bpy.types.Mesh, name: str | None) -> bytes:
    """Return a digest of what `read_color_values` reads; empty if the mesh has no such attribute.

    If it cannot be read, it is the digest of the error.
    """
    try:
        values = read_color_values(mesh, name, mesh.name)
    except RosyError as error:
        return content_hash(str(error))
    return b"" if values is None else content_hash(values)


def check_colored(
    name: str | None, found: Sequence[tuple[np.ndarray | None, bpy.types.Object]]
) -> None:
    """Check that at least one object has the attribute whose numbers are colored.

    Parameters
    ----------
    name : str or None
        Of the attribute; None if there is none to color.
    found : sequence of ((C,) ndarray or None, bpy.types.Object)
        The numbers that were read, and their objects.

    Raises
    ------
    RosyError
        If no object has it. The message lists the attributes that exist.
    """
    if name is None or any(values is not None for values, _ in found):
        return
    names = ", ".join(f"'{obj.name}'" for obj in dict.fromkeys(owner for _, owner in found))
    available = dict.fromkeys(
        attribute.name
        for _, owner in found
        for attribute in owner.data.attributes
        if attribute.data_type in LISTED_TYPES
        and attribute.domain in ("POINT", "FACE", "CORNER")
        and not attribute.name.startswith(".")
    )
    listing = ", ".join(f"'{other}'" for other in available) or "no suitable one"
    if not name:
        raise RosyError(
            f"{names}: choose an attribute for the colors, under Look > Color: {listing}"
        )
    raise RosyError(f"{names}: there is no attribute '{name}' for the colors, only {listing}")

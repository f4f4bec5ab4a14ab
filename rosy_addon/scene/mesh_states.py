"""Compute digests of evaluated meshes and their fields. They tell whether a picture is out of date.

Computing a digest is much faster than reading a surface.
"""

from dataclasses import dataclass

import numpy as np
from bpy.types import Mesh, Object

from ..core.cache import content_hash
from .datablocks import field_mesh, user_modifiers
from .field_attributes import ANGLE_TYPE, VECTOR_TYPE, attribute_name, direction_names, field_degree
from .look_inputs import ReadRequest, color_values_digest, tone_digest
from .meshes import material_indices, read_attribute, shape_digest, vertex_positions
from .transparency import transparent_slots


@dataclass(frozen=True, eq=False)
class MeshState:
    """A digest of an evaluated mesh (and of its field, if that is drawn), and its bounding box.

    Attributes
    ----------
    digest : str
    bounds : (2, 3) float32 ndarray
        Lowest and highest corner of the bounding box, object space.
    lacks_tone : bool
        Whether the look takes its tone from the mesh, but the mesh has none. The mesh is then lit instead.
    """

    digest: str
    bounds: np.ndarray
    lacks_tone: bool = False


#: The states of meshes, by `mesh_state_key`. None: the mesh has no faces.
MeshStates = dict[tuple, MeshState | None]


def mesh_state_key(obj: Object, owner: Object, request: ReadRequest | None) -> tuple:
    """Return the key under which a `MeshStates` dictionary holds the mesh of an evaluated object.

    The first item of the key is the session UID of the original object.

    Parameters
    ----------
    obj : bpy.types.Object
        Evaluated object.
    owner : bpy.types.Object
        The original object.
    request : ReadRequest or None
        What is read from the mesh. None: the object has no field to draw, and only hides others.
    """
    return owner.session_uid, obj.data.as_pointer(), request or transparent_slots(obj.data, owner)


def read_mesh_state(
    mesh: Mesh | None, owner: Object, request: ReadRequest | None
) -> MeshState | None:
    """Return the state of an evaluated mesh; None if it has no faces, or has no field and is transparent.

    Parameters
    ----------
    mesh : bpy.types.Mesh or None
        Result of `evaluated_mesh`.
    owner : bpy.types.Object
        The original object.
    request : ReadRequest or None
        What is read from the mesh. None: the object has no field to draw, and only hides others.
    """
    if mesh is None:
        return None
    positions = vertex_positions(mesh)
    bounds = np.stack([positions.min(axis=0), positions.max(axis=0)])
    if request is None:
        transparent = transparent_slots(mesh, owner)
        if transparent and all(transparent):
            return None
        slots = material_indices(mesh) if any(transparent) else None
        parts = shape_digest(mesh, occluder_only=True), slots, *transparent
        return MeshState(digest(*parts), bounds)
    original, holder = owner.data, field_mesh(owner)
    digest_of_tone = tone_digest(mesh, owner, request)
    field_source = mesh if holder == original else holder
    parts = [shape_digest(mesh), *field_parts(field_source, holder), digest_of_tone]
    parts += [color_values_digest(each, request.color_attribute) for each in (mesh, holder)]
    if user_modifiers(owner) or original.shape_keys:
        # The evaluated field also depends on the original mesh: on its shape, normals and field.
        parts += [shape_digest(holder), *field_parts(holder, holder)]
    if any(isinstance(part, np.ndarray) and not np.isfinite(part).all() for part in parts):
        parts.append(request.nonfinite)
    lacks_tone = bool(request.tone) and not digest_of_tone
    return MeshState(digest(*parts), bounds, lacks_tone)


def field_parts(mesh: Mesh, original: Mesh) -> list:
    """Return the values on which the field of a mesh depends, for `digest`.

    They are the degree, and the domain and the values of each attribute of the field. The degree and the name
    of the attribute are settings of the original mesh, `original`. Values are read from `mesh`.
    """
    name = attribute_name(original)
    if name in original.attributes:
        names, parts = [name], [field_degree(original)]
    else:
        names, parts = direction_names(mesh), []
    for name in names:
        attribute = mesh.attributes.get(name)
        if attribute is None or attribute.data_type not in (VECTOR_TYPE, ANGLE_TYPE):
            parts.append(None)
            continue
        is_vector = attribute.data_type == VECTOR_TYPE
        parts += [attribute.domain, read_attribute(mesh, name, np.float32, 3 if is_vector else 1)]
    return parts


def digest(*parts: object) -> str:
    """Return a digest of some values: 16 hex digits, as it is stored in .blend files."""
    return content_hash(*parts).hex()[:16]

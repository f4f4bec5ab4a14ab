"""Ambient occlusion of the objects of a scene, as an attribute that tones can come from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import bpy
import numpy as np

from ..errors import RosyError
from ..progress import Work, part
from ..projection.gbuffer import Body
from ..projection.occlusion import DIRECTIONS, occluding
from .bodies import Reading, read_scene
from .capabilities import is_editable
from .meshes import mesh_surface

#: What the attribute is called, if nothing else is said.
OCCLUSION = "Occlusion"

_KIND = "CORNER", "FLOAT"


def storing_occlusion(
    depsgraph: bpy.types.Depsgraph,
    objects: Sequence[bpy.types.Object],
    name: str = OCCLUSION,
    directions: int = DIRECTIONS,
) -> Work[None]:
    """Find how much of the sky the surfaces of objects see, and store it on their meshes.

    All that renders of the view layer show is in the way. The surface is as it is after modifiers
    if these keep its faces, and as it is without if they do not; modifiers carry the attribute on.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
    objects : sequence of bpy.types.Object
        Original ones with a field.
    name : str
        Of the attribute, a number from 0 to 1 on the corners of faces.
    directions : int
        From how many sides it is looked at.

    Raises
    ------
    RosyError
        As `read_scene`; or if a mesh is linked, in edit mode, or has another attribute of that name.
        Nothing is changed then.
    """
    for thing in objects:
        _check_writable(thing, name)
    reading = read_scene(depsgraph, objects, "zero")
    found: dict[bpy.types.Mesh, np.ndarray] = {}
    for count, thing in enumerate(objects):
        start, stop = count / len(objects), (count + 1) / len(objects)
        bodies, number = _with_own_faces(reading, thing)
        found[thing.data] = yield from part(occluding(bodies, number, directions), start, stop)
    for mesh, values in found.items():
        attribute = mesh.attributes.get(name) or mesh.attributes.new(name, "FLOAT", "CORNER")
        attribute.data.foreach_set("value", values)
        mesh.update()


def _with_own_faces(reading: Reading, thing: bpy.types.Object) -> tuple[list[Body], int]:
    """The bodies of a scene, with that of an object having the faces of its mesh; and its number."""
    number = reading.owners.index(thing)
    bodies = list(reading.bodies)
    given, seen = mesh_surface(thing.data, f"object '{thing.name}'"), bodies[number].surface
    same = np.array_equal(given.face_start, seen.face_start)
    if not (same and np.array_equal(given.corner_vertex, seen.corner_vertex)):
        bodies[number] = replace(bodies[number], surface=given, carried={})
    return bodies, number


def _check_writable(thing: bpy.types.Object, name: str) -> None:
    mesh, owner = thing.data, f"object '{thing.name}'"
    if not is_editable(mesh) or mesh.is_editmode:
        raise RosyError(f"{owner}: its mesh is {'in edit mode' if mesh.is_editmode else 'linked'}")
    attribute = mesh.attributes.get(name)
    if attribute is not None and (attribute.domain, attribute.data_type) != _KIND:
        raise RosyError(
            f"{owner}: has an attribute '{name}' already, {attribute.data_type} on "
            f"{attribute.domain}; wanted is {_KIND[1]} on {_KIND[0]}"
        )

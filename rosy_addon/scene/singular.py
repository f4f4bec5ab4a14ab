"""Singularities of the fields of Blender's objects, and points in the scene that stand for them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..field.check import vertex_normals
from ..field.singularities import singularities
from .attributes import read_mesh_field
from .bodies import MADE, own_modifiers, read_scene
from .meshes import mesh_surface

#: What the points of an object carry: the index in units of 1 / N, and N.
INDEX, DEGREE = "index", "degree"


@dataclass(frozen=True, eq=False)
class Singular:
    """The singularities of a mesh's field.

    Attributes
    ----------
    points : (K, 3) float32 ndarray
        Object space.
    normals : (K, 3) float32 ndarray
        Of the vertices.
    index : (K,) int32 ndarray
        In units of 1 / N.
    degree : int
        N.
    """

    points: np.ndarray
    normals: np.ndarray
    index: np.ndarray
    degree: int

    def __len__(self) -> int:
        return len(self.index)


def singular_vertices(thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Singular:
    """The singularities of an object's field, on its mesh as it is shown: after its modifiers.

    Raises
    ------
    RosyError
        If its field cannot be read.
    """
    if own_modifiers(thing) or thing.data.shape_keys:
        reading = read_scene(depsgraph, [thing], undefined="zero")
        body = reading.bodies[0]
        surface, field = body.surface, body.field
    else:
        owner = f"object '{thing.name}'"
        surface = mesh_surface(thing.data, owner)
        field = read_mesh_field(thing.data, surface=surface, undefined="zero", owner=owner)
    # The field's vectors belong to the shape at rest.
    rest = surface if surface.rest is None else replace(surface, vertices=surface.rest, rest=None)
    vertex, index = singularities(rest, field)
    points = surface.vertices[vertex].astype(np.float32)
    normals = vertex_normals(surface)[vertex].astype(np.float32)
    return Singular(points, normals, index, field.degree)


def add_points(
    scene: bpy.types.Scene, thing: bpy.types.Object, found: Singular
) -> bpy.types.Object:
    """A point for each singularity, with its index as an attribute, as an object of its own.

    A point cloud, or where this Blender's cannot be made by scripts a mesh of vertices alone. It
    follows the object, and takes the place of one made for it before.
    """
    remove_points(scene, thing)
    name = f"{thing.name} singularities"
    data = _cloud(name, len(found))
    made = bpy.data.objects.new(name, data)
    made[MADE] = thing.name
    data.attributes["position"].data.foreach_set("vector", found.points.ravel())
    for key, values in ((INDEX, found.index), (DEGREE, np.full(len(found), found.degree))):
        attribute = data.attributes.new(key, "INT", "POINT")
        attribute.data.foreach_set("value", values.astype(np.int32))
    made.parent = thing
    for collection in thing.users_collection or (scene.collection,):
        collection.objects.link(made)
    return made


def remove_points(scene: bpy.types.Scene, thing: bpy.types.Object | None = None) -> int:
    """Remove the points made for an object, or for all of a scene; how many objects these were."""
    made = [
        other
        for other in scene.objects
        if isinstance(other.get(MADE), str) and (thing is None or other.parent == thing)
    ]
    for other in made:
        data = other.data
        bpy.data.objects.remove(other)
        if not data.users:
            store = bpy.data.meshes if isinstance(data, bpy.types.Mesh) else bpy.data.pointclouds
            store.remove(data)
    return len(made)


def _cloud(name: str, count: int) -> bpy.types.ID:
    cloud = bpy.data.pointclouds.new(name)
    if hasattr(cloud, "resize"):
        cloud.resize(count)
        return cloud
    bpy.data.pointclouds.remove(cloud)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(count)
    return mesh

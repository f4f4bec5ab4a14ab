"""Find the singularities of an object's field, and show them in the scene as point objects."""

from dataclasses import dataclass

import bpy
import numpy as np
from bpy.types import ID, Depsgraph, Mesh, Object, Scene

from ..core.errors import RosyError
from ..field.rosy_field import RosyField
from ..field.singularities import find_singularities
from ..field.surface import Surface
from ..field.validate import vertex_normals
from . import meshes
from .datablocks import OWNED_TAG, field_mesh, user_modifiers
from .look_inputs import ReadRequest
from .mesh_fields import read_mesh_field
from .scene_reader import read_scene

#: Names of attributes of the points: the singularity index in units of 1 / N, and the degree N of the field.
INDEX_ATTRIBUTE, DEGREE_ATTRIBUTE = "index", "degree"


@dataclass(frozen=True, eq=False)
class Singularities:
    """The singularities of a mesh's field.

    Attributes
    ----------
    points : (K, 3) float32 ndarray
        Positions, object space.
    normals : (K, 3) float32 ndarray
        Vertex normals at the points, object space.
    index : (K,) int32 ndarray
        Singularity index in units of 1 / N.
    degree : int
        Degree N of the field.
    vertex : (K,) int32 ndarray or None
        Their vertices of the original mesh. None if they were found on the evaluated mesh.
    """

    points: np.ndarray
    normals: np.ndarray
    index: np.ndarray
    degree: int
    vertex: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.index)


def read_singularities(obj: Object, depsgraph: Depsgraph) -> Singularities:
    """Find the singularities of an object's field on its evaluated mesh.

    Raises
    ------
    RosyError
        If the field cannot be read.

    See Also
    --------
    rosy_addon.field.singularities.find_singularities : Finds the singularities of a field on a surface.
    """
    if user_modifiers(obj) or obj.data.shape_keys:
        scene_data = read_scene(depsgraph, [obj], ReadRequest("zero"))
        instance = scene_data.instances[0]
        surface, field = instance.surface, instance.field
    else:
        surface, field = _own_field(obj)
    vertex, index = find_singularities(surface.in_rest_shape(), field)
    points = surface.vertices[vertex].astype(np.float32)
    normals = vertex_normals(surface)[vertex].astype(np.float32)
    return Singularities(points, normals, index, field.degree)


def _own_field(obj: Object) -> tuple[Surface, RosyField]:
    """Return the surface and the field of an object's original mesh."""
    mesh = field_mesh(obj)
    surface = meshes.mesh_surface(mesh, f"object '{obj.name}'")
    return surface, read_mesh_field(mesh, surface=surface, nonfinite="zero")


def read_editable_singularities(obj: Object, depsgraph: Depsgraph) -> Singularities:
    """Find the singularities of the field of an object's original mesh, which can be edited.

    A singularity is at a vertex. Its position is the position of this vertex on the evaluated mesh. The
    evaluated field may have other singularities.

    Raises
    ------
    RosyError
        If the field cannot be read.
    """
    surface, field = _own_field(obj)
    vertex, index = find_singularities(surface, field)
    with meshes.evaluated_mesh(obj.evaluated_get(depsgraph)) as mesh:
        source = mesh_of_own_vertices(obj, mesh)
        points = meshes.vertex_positions(source)[vertex]
        normals = meshes.read_collection(source.vertex_normals, "vector", np.float32, 3)[vertex]
    return Singularities(points, normals, index, field.degree, vertex)


def mesh_of_own_vertices(obj: Object, evaluated: Mesh | None) -> Mesh:
    """Return the evaluated mesh if its first vertices are the vertices of the original mesh.

    This is assumed if it has at least as many vertices as the original mesh: modifiers such as *Armature*,
    *Subdivision Surface* and *Mirror* keep the vertices, and add new ones after them. Otherwise, or if there is
    no evaluated mesh (None), the original mesh is returned.
    """
    own = field_mesh(obj)
    is_lost = evaluated is None or len(evaluated.vertices) < len(own.vertices)
    return own if is_lost else evaluated


def add_singularity_points(scene: Scene, obj: Object, singularity_data: Singularities) -> Object:
    """Create a child object of `obj` with a point for each singularity, and its index as an attribute.

    The object is a point cloud, or a mesh without edges if scripts cannot create point clouds in this version
    of Blender. The earlier point object of `obj` is deleted.
    """
    remove_singularity_points(scene, obj)
    name = f"{obj.name} singularities"
    data = _new_point_cloud(name, len(singularity_data))
    point_object = bpy.data.objects.new(name, data)
    point_object[OWNED_TAG], data[OWNED_TAG] = obj.name, True
    if len(singularity_data):  # an empty point cloud lacks the attribute
        data.attributes["position"].data.foreach_set("vector", singularity_data.points.ravel())
    for key, values in (
        (INDEX_ATTRIBUTE, singularity_data.index),
        (DEGREE_ATTRIBUTE, np.full(len(singularity_data), singularity_data.degree)),
    ):
        meshes.write_attribute(data.attributes.new(key, "INT", "POINT"), values)
    point_object.parent = obj
    for collection in obj.users_collection or (scene.collection,):
        collection.objects.link(point_object)
    return point_object


def read_singularity_points(
    scene: Scene, obj: Object, degree: int, name: str = ""
) -> tuple[np.ndarray, np.ndarray]:
    """Read singularities from point objects: the vertices of a mesh nearest to the points, and indices.

    Parameters
    ----------
    scene : bpy.types.Scene
    obj : bpy.types.Object
        The object of the mesh.
    degree : int
        Degree N of the returned indices. The points may have indices for another degree, which are converted.
    name : str
        Name of the object with the points. By default the one that `add_singularity_points` created for
        `obj`.

    Returns
    -------
    vertex : (K,) int64 ndarray
        In ascending order, without vertices at which the sum of indices is zero.
    index : (K,) int64 ndarray
        Sum of the indices of all points nearest to the vertex, in units of 1 / N.

    Raises
    ------
    RosyError
        If there is no such object, its points have no indices, or a field of this degree cannot have one of
        the indices.
    """
    own_points = next(iter(_point_objects(scene, obj)), None)
    source = scene.objects.get(name) if name else own_points
    if source is None:
        is_missing = f"'{name}' is not in this scene" if name else f"'{obj.name}': has no points"
        raise RosyError(
            f"object {is_missing}: press Singularities to get points, then move them and change their "
            "index"
        )
    index = None
    if has_points(source):
        index = meshes.read_attribute(source.data, INDEX_ATTRIBUTE, np.int64, 1)
    if index is None:
        raise RosyError(
            f"object '{source.name}': has no integer attribute '{INDEX_ATTRIBUTE}' on its points, or is in "
            "edit mode"
        )
    point_degree = meshes.read_attribute(source.data, DEGREE_ATTRIBUTE, np.int64, 1)
    if point_degree is not None:
        scaled = index * degree
        if (scaled % point_degree).any():
            bad = np.flatnonzero(scaled % point_degree)[0]
            raise RosyError(
                f"object '{source.name}': a field of degree {degree} has no singularity of the index "
                f"{index[bad]}/{point_degree[bad]}: choose another degree"
            )
        index = scaled // point_degree
    points = meshes.read_attribute(source.data, "position", np.float32, 3)
    to_mesh = np.array(obj.matrix_world.inverted_safe() @ source.matrix_world)
    points = points @ to_mesh[:3, :3].T + to_mesh[:3, 3]
    vertices = meshes.vertex_positions(field_mesh(obj))
    nearest = [np.square(vertices - point).sum(axis=1).argmin() for point in points]
    vertex, position = np.unique(np.array(nearest, dtype=np.int64), return_inverse=True)
    total = np.zeros(len(vertex), dtype=np.int64)
    np.add.at(total, position, index)
    return vertex[total != 0], total[total != 0]


def has_points(obj: Object) -> bool:
    """Return whether an object is a mesh or a point cloud, which have points with attributes."""
    return obj.type in ("MESH", "POINTCLOUD")


def _point_objects(scene: Scene, obj: Object) -> list[Object]:
    """Return the objects in a scene that `add_singularity_points` has created for an object."""
    return [
        candidate
        for candidate in scene.objects
        if isinstance(candidate.get(OWNED_TAG), str) and candidate.parent == obj
    ]


def remove_singularity_points(scene: Scene, obj: Object) -> None:
    """Delete the objects that `add_singularity_points` has created for an object."""
    for point_object in _point_objects(scene, obj):
        data = point_object.data
        bpy.data.objects.remove(point_object)
        if not data.users:
            bpy.data.batch_remove([data])


def _new_point_cloud(name: str, count: int) -> ID:
    """Create a point cloud with `count` points, or a mesh if scripts cannot create point clouds."""
    cloud = bpy.data.pointclouds.new(name)
    if hasattr(cloud, "resize"):
        cloud.resize(count)
        return cloud
    bpy.data.pointclouds.remove(cloud)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(count)
    return mesh

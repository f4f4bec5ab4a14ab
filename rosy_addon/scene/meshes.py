"""Blender meshes as `Surface`, and their attributes and edges as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ..core.cache import Cache, content_hash
from ..core.errors import NoFeaturesError, RosyError
from ..core.progress import progress
from ..field.connectivity import smooth_fans
from ..field.surface import Surface, build_surface

#: Marks of edges: RNA property, label, and description in the user interface.
EDGE_MARKS = {
    "SELECTED": ("select", "Selected", "Edges that are selected in edit mode"),
    "SHARP": ("use_edge_sharp", "Marked Sharp", "Edges that are marked sharp"),
    "SEAM": ("use_seam", "Seams", "Edges that are marked as seams"),
}

#: Attribute in which Blender stores the selection of edges.
EDGE_SELECTION_ATTRIBUTE = ".select_edge"

#: Attribute that Blender writes for objects with `add_rest_position_attribute`.
REST_ATTRIBUTE = "rest_position"


def mesh_label(mesh: bpy.types.Mesh) -> str:
    """Return a mesh in messages: an object that has it, a selected one if there is one."""
    users = [obj for obj in bpy.data.objects if obj.data == mesh]
    if not users:
        return f"mesh '{mesh.name}'"
    return f"object '{next((obj for obj in users if obj.select_get()), users[0]).name}'"


def mesh_surface(
    mesh: bpy.types.Mesh,
    name: str | None = None,
    *,
    occluder_only: bool = False,
    cache: Cache | None = None,
) -> Surface:
    """Read a mesh as a surface.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Original or evaluated. In edit mode, the current state of editing is read.
    name : str, optional
        Name for messages. By default `mesh_label`.
    occluder_only : bool
        Treat all faces as flat, which is cheaper. For meshes that only occlude others.
    cache : Cache, optional
        Keeps the surfaces of meshes that have not changed since an earlier call.

    Returns
    -------
    Surface

    Raises
    ------
    RosyError
        If the mesh has no faces (it is empty, or has only points and loose edges), or a coordinate
        is not finite.
    """
    name = mesh_label(mesh) if name is None else name
    shape = _read_shape(mesh, occluder_only=occluder_only)
    if not len(mesh.polygons):
        raise no_faces_error(mesh, name)
    topology = {
        key: value for key, value in shape.items() if key not in ("vertices", "corner_normal")
    }
    if occluder_only:
        topology["flat_faces"] = np.ones(len(mesh.polygons), dtype=bool)

    def build_fans() -> np.ndarray:
        return smooth_fans(shape["vertices"], **topology)

    def build() -> Surface:
        with progress(0.0, 0.7):
            # They depend on the topology alone, so a deformation does not change them.
            fans = (
                build_fans()
                if cache is None
                else cache.get_or_create(("fans", content_hash(*topology.values())), build_fans)
            )
        normals = shape["corner_normal"]
        if normals is None:
            normals = _corner_normals(mesh)
        with progress(0.7, 1.0):
            return build_surface(
                shape["vertices"],
                **topology,
                name=name,
                corner_normal=normals,
                corner_fan=fans,
                **_triangles(mesh),
            )

    if cache is None:
        return build()
    key = "surface", name, occluder_only, content_hash(*shape.values())
    return cache.get_or_create(key, build)


def no_faces_error(mesh: bpy.types.Mesh, name: str) -> RosyError:
    """Return the error for a mesh without faces, which is called `name`."""
    content = "only vertices and loose edges" if len(mesh.vertices) else "it is empty"
    return RosyError(f"{name}: the mesh has no faces, {content}")


def shape_digest(mesh: bpy.types.Mesh, *, occluder_only: bool = False) -> bytes:
    """Return a digest of everything that `mesh_surface` reads. Much faster than reading the surface."""
    return content_hash(*_read_shape(mesh, occluder_only=occluder_only).values())


def _read_shape(mesh: bpy.types.Mesh, *, occluder_only: bool) -> dict[str, np.ndarray | None]:
    """Return the arguments of `build_surface` from which all others follow.

    Triangles and normals are left out, as Blender computes them from the rest, unless normals are
    custom.
    """
    flush_edit_mode(mesh)
    corner_vertex, face_start = polygon_arrays(mesh)
    shape = {
        "vertices": vertex_positions(mesh),
        "corner_vertex": corner_vertex,
        "face_start": face_start,
        "sharp_edges": None,
        "flat_faces": None,
        "corner_normal": None,
    }
    if not occluder_only:
        flat_faces = read_attribute(mesh, "sharp_face", bool, 1)
        shape["sharp_edges"] = _sharp_edges(mesh)
        shape["flat_faces"] = flat_faces if flat_faces is not None and flat_faces.any() else None
        shape["corner_normal"] = _corner_normals(mesh) if mesh.has_custom_normals else None
    return shape


def _corner_normals(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the shading normals at the corners, (C, 3) float32."""
    return read_collection(mesh.corner_normals, "vector", np.float32, 3)


def read_uvs(mesh: bpy.types.Mesh, name: str, label: str, purpose: str) -> np.ndarray:
    """Return u and v of the corners, (C, 2) float32, from a UV map.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    name : str
        Of the UV map. Empty: the active one.
    label, purpose : str
        The mesh, and what needs the UV map, for the message.

    Raises
    ------
    RosyError
        If there is no such UV map.
    """
    layer = mesh.uv_layers.get(name) if name else mesh.uv_layers.active
    if layer is None:
        missing = f"no UV map '{name}'" if name else "no UV map"
        raise RosyError(f"{label}: its mesh has {missing}, which {purpose} needs")
    values = np.empty(2 * len(mesh.loops), dtype=np.float32)
    layer.uv.foreach_get("vector", values)
    return values.reshape(-1, 2)


def polygon_arrays(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return `Surface.corner_vertex`, (C,) int32, and `Surface.face_start`, (F + 1,) int32."""
    corner_vertex = _attribute_or_collection(
        mesh, ".corner_vert", mesh.loops, "vertex_index", np.int32
    )
    return corner_vertex, _face_starts(mesh)


def vertex_positions(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the positions of the vertices in object space, (V, 3) float32."""
    return _attribute_or_collection(mesh, "position", mesh.vertices, "co", np.float32, 3)


@contextmanager
def evaluated_mesh(obj: bpy.types.Object) -> Iterator[bpy.types.Mesh | None]:
    """Yield the temporary mesh of an evaluated object; None if it has no faces."""
    mesh = obj.to_mesh()
    try:
        yield mesh if mesh is not None and len(mesh.polygons) else None
    finally:
        obj.to_mesh_clear()


def marked_edges(mesh: bpy.types.Mesh, mark: str) -> np.ndarray:
    """Return the vertices of the edges that have a mark.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    mark : str
        A key of `EDGE_MARKS`.

    Returns
    -------
    (K, 2) int32 ndarray

    Raises
    ------
    NoFeaturesError
        If no edge has the mark.
    """
    property_name, label, _ = EDGE_MARKS[mark]
    is_marked = _edge_flags(mesh, property_name)
    if not is_marked.any():
        raise NoFeaturesError(
            f"{mesh_label(mesh)} has no edges of this kind ({label}): mark some, or choose another kind"
        )
    return _attribute_or_collection(mesh, ".edge_verts", mesh.edges, "vertices", np.int32, 2)[
        is_marked
    ]


def flush_edit_mode(mesh: bpy.types.Mesh) -> None:
    """Update a mesh that is in edit mode from the edit data."""
    if not mesh.is_editmode:
        return
    for obj in bpy.data.objects:
        if obj.data == mesh and obj.mode == "EDIT":
            obj.update_from_editmode()
            return


def read_attribute(mesh: bpy.types.Mesh, name: str, dtype: type, columns: int) -> np.ndarray | None:
    """Return an attribute: (n, columns), or (n,) for one column; None if missing or unreadable."""
    attribute = mesh.attributes.get(name)
    if attribute is None or not len(attribute.data):  # in edit mode, attributes are empty
        return None
    key = "vector" if attribute.data_type in ("FLOAT_VECTOR", "FLOAT2") else "value"
    return read_collection(attribute.data, key, dtype, columns)


def _face_starts(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the first corner of each face and the number of corners: (F + 1,) int32."""
    face_count, corner_count = len(mesh.polygons), len(mesh.loops)
    if corner_count == 3 * face_count:
        return np.arange(0, corner_count + 1, 3, dtype=np.int32)
    starts = np.empty(face_count + 1, dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", starts[:-1])
    starts[-1] = corner_count
    return starts


def _triangles(mesh: bpy.types.Mesh) -> dict[str, np.ndarray]:
    """Return Blender's own triangulation, for the same pictures; empty if there is none yet."""
    face_count = len(mesh.polygons)
    if len(mesh.loops) == 3 * face_count:
        face = np.arange(face_count, dtype=np.int32)
        return {"triangles": np.arange(3 * face_count, dtype=np.int32), "triangle_face": face}
    if not len(mesh.loop_triangles):
        return {}
    return {
        "triangles": read_collection(mesh.loop_triangles, "loops", np.int32, 3),
        "triangle_face": read_collection(mesh.loop_triangle_polygons, "value", np.int32),
    }


def _sharp_edges(mesh: bpy.types.Mesh) -> np.ndarray | None:
    """Return the vertices of the edges marked sharp, (K, 2) int32; None if there are none."""
    sharp = read_attribute(mesh, "sharp_edge", bool, 1)
    if sharp is None or not sharp.any():
        return None
    return _attribute_or_collection(mesh, ".edge_verts", mesh.edges, "vertices", np.int32, 2)[sharp]


def _edge_flags(mesh: bpy.types.Mesh, property_name: str) -> np.ndarray:
    """Return a flag of every edge, (E,) bool, by the name of its RNA property."""
    flags = np.empty(len(mesh.edges), dtype=bool)
    is_selection = property_name == "select"
    attribute = mesh.attributes.get(EDGE_SELECTION_ATTRIBUTE) if is_selection else None
    if attribute is not None and attribute.data_type == "INT32_2D" and len(attribute.data):
        # Blender 5.0 creates the attribute with this type, but with one byte for each edge, when
        # all or none of the edges are new (`Mesh.from_pydata`, `Mesh.update(calc_edges=True)`).
        # `foreach_get` would read past the end of it. All edges have the same value.
        flags[:] = attribute.data[0].value[0] & 0xFF
    else:
        mesh.edges.foreach_get(property_name, flags)
    return flags


def _attribute_or_collection(
    mesh: bpy.types.Mesh,
    attribute: str,
    collection: bpy.types.bpy_prop_collection,
    key: str,
    dtype: type,
    columns: int = 1,
) -> np.ndarray:
    """Return the values of a collection, from an attribute with the same values if it is readable.

    Blender copies attributes as a whole. It reads collections item by item, which is a thousand
    times slower.
    """
    values = read_attribute(mesh, attribute, dtype, columns)
    if values is None or len(values) != len(collection):
        return read_collection(collection, key, dtype, columns)
    return values


def read_collection(
    collection: bpy.types.bpy_prop_collection, key: str, dtype: type, columns: int = 1
):
    """Return a property of all items: (n, columns), or (n,) for one column."""
    values = np.empty(len(collection) * columns, dtype=dtype)
    collection.foreach_get(key, values)
    return values.reshape(-1, columns) if columns > 1 else values

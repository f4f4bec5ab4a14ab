"""Blender meshes as `Surface`, and their attributes and edges as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import bpy
import numpy as np

from ..cache import Cache, content_hash
from ..errors import NoFeaturesError, RosyError
from ..field.surface import Surface, build_surface, smooth_fans
from ..progress import progress

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
    read_rest: bool = False,
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
    read_rest : bool
        Read the undeformed positions from the attribute `REST_ATTRIBUTE`, if it exists.
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
    flush_edit_mode(mesh)
    if not len(mesh.polygons):
        content = "only vertices and loose edges" if len(mesh.vertices) else "it is empty"
        raise RosyError(f"{name}: the mesh has no faces, {content}")
    arguments = _topology(mesh, occluder_only) | {
        "vertices": vertex_positions(mesh),
        "name": name,
        "corner_normal": read_collection(mesh.corner_normals, "vector", np.float32, 3),
        "rest_vertices": read_attribute(mesh, REST_ATTRIBUTE, np.float32, 3) if read_rest else None,
    }
    if cache is None:
        return build_surface(**arguments, **_triangles(mesh))
    # Triangles are not part of the key: they are slow to read, and follow from the other arrays.
    key = "surface", content_hash(*arguments.values())
    if cache.get(key) is None:
        arguments |= _triangles(mesh)
    return cache.get_or_create(key, partial(_with_fans, arguments, cache))


def _topology(mesh: bpy.types.Mesh, occluder_only: bool = False) -> dict[str, np.ndarray | None]:
    """Return the arguments of `build_surface` that smooth fans depend on."""
    corner_vertex, face_start = polygon_arrays(mesh)
    return {
        "corner_vertex": corner_vertex,
        "face_start": face_start,
        "sharp_edges": None if occluder_only else _sharp_edges(mesh),
        "flat_faces": (
            np.ones(len(mesh.polygons), dtype=bool)
            if occluder_only
            else read_attribute(mesh, "sharp_face", bool, 1)
        ),
    }


def _with_fans(arguments: dict[str, Any], cache: Cache) -> Surface:
    """Build a surface from the arguments of `build_surface`, with smooth fans from the cache.

    The fans depend on the topology alone, so a deformation does not change them.
    """
    names = "corner_vertex", "face_start", "sharp_edges", "flat_faces"
    topology = {name: arguments[name] for name in names}
    key = "fans", content_hash(*topology.values())
    with progress(0.0, 0.7):
        fans = cache.get_or_create(key, partial(smooth_fans, arguments["vertices"], **topology))
    with progress(0.7, 1.0):
        return build_surface(**arguments, corner_fan=fans)


def shape_digest(mesh: bpy.types.Mesh, *, occluder_only: bool = False) -> bytes:
    """Return a digest of everything that `mesh_surface` reads, apart from the rest positions.

    Much faster than reading the surface: normals are left out where they follow from the rest.
    """
    flush_edit_mode(mesh)
    parts = [vertex_positions(mesh), *polygon_arrays(mesh)]
    if not occluder_only:
        sharp_faces = read_attribute(mesh, "sharp_face", bool, 1)
        is_smooth = sharp_faces is None or not sharp_faces.any()
        parts += [_sharp_edges(mesh), None if is_smooth else sharp_faces]
        if mesh.has_custom_normals:
            parts.append(read_collection(mesh.corner_normals, "vector", np.float32, 3))
    return content_hash(*parts)


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

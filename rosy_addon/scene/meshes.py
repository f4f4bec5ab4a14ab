"""Blender's meshes as surfaces."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ..errors import RosyError
from ..field.surface import Surface, build_surface, smooth_fans
from ..reuse import Kept, digest

#: What edges may be marked as: the property, its name, and what it does.
MARKS = {
    "SELECTED": ("select", "Selected", "Those that are selected in edit mode"),
    "SHARP": ("use_edge_sharp", "Marked Sharp", "Those that are marked sharp"),
    "SEAM": ("use_seam", "Seams", "Those that are marked as seams of a UV map"),
}

#: Attribute that Blender writes for objects with `add_rest_position_attribute`.
REST = "rest_position"


def mesh_surface(
    mesh: bpy.types.Mesh,
    name: str | None = None,
    *,
    rest: bool = False,
    plain: bool = False,
    kept: Kept | None = None,
) -> Surface:
    """The surface of a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Original or evaluated. One in edit mode is read as it is there.
    name : str, optional
        For messages; the mesh's own if not given.
    rest : bool
        Whether to read the undeformed positions from the attribute `REST`, where it is.
    plain : bool
        Whether no normals will be mixed on it: cheaper, for what only hides others.
    kept : Kept, optional
        Where the surface of a mesh that has not changed is found.

    Raises
    ------
    RosyError
        If it has no faces (be it empty, or points and loose edges alone) or a coordinate that is
        not finite.
    """
    name = mesh.name if name is None else name
    flush_edit_mode(mesh)
    faces = len(mesh.polygons)
    if not faces:
        has = "only points and loose edges" if len(mesh.vertices) else "nothing in it"
        raise RosyError(f"{name}: the mesh has no faces to draw on, {has}")
    parts = {
        "vertices": _quickly(mesh, "position", mesh.vertices, "co", np.float32, 3),
        "corner_vertex": _quickly(mesh, ".corner_vert", mesh.loops, "vertex_index", np.int32),
        "face_start": _face_starts(mesh),
        "name": name,
        "sharp_edges": None if plain else _sharp_edges(mesh),
        "flat_faces": (
            np.ones(faces, dtype=bool) if plain else read_values(mesh, "sharp_face", bool, 1)
        ),
        "corner_normal": _get(mesh.corner_normals, "vector", np.float32, 3),
        "rest": read_values(mesh, REST, np.float32, 3) if rest else None,
    }

    def build() -> Surface:
        return build_surface(**parts, **_triangles(mesh))

    if kept is None:
        return build()
    if not plain:
        # Deformations leave fans as they are.
        names = "corner_vertex", "face_start", "sharp_edges", "flat_faces"
        topology = {name: parts[name] for name in names}
        parts["corner_fan"] = kept.find_or_make(
            ("fans", digest(*topology.values())), lambda: smooth_fans(parts["vertices"], **topology)
        )
    # Triangles are slow to read, and follow from the rest.
    return kept.find_or_make(("surface", digest(*parts.values())), build)


@contextmanager
def evaluated_mesh(thing: bpy.types.Object) -> Iterator[bpy.types.Mesh | None]:
    """The mesh of an evaluated object for as long as it is read; None if it has no faces."""
    mesh = thing.to_mesh()
    try:
        yield mesh if mesh is not None and len(mesh.polygons) else None
    finally:
        thing.to_mesh_clear()


def marked_edges(mesh: bpy.types.Mesh, mark: str) -> np.ndarray:
    """(E, 2) int32: the vertices of the edges that have one of `MARKS`.

    Raises
    ------
    RosyError
        If there are none.
    """
    attribute, name, _ = MARKS[mark]
    chosen = np.empty(len(mesh.edges), dtype=bool)
    mesh.edges.foreach_get(attribute, chosen)
    if not chosen.any():
        raise RosyError(f"{mesh.name}: no edge is marked: {name}")
    return _quickly(mesh, ".edge_verts", mesh.edges, "vertices", np.int32, 2)[chosen]


def flush_edit_mode(mesh: bpy.types.Mesh) -> None:
    """Bring a mesh up to date with what is being edited, if it is."""
    if not mesh.is_editmode:
        return
    for thing in bpy.data.objects:
        if thing.data == mesh and thing.mode == "EDIT":
            thing.update_from_editmode()
            return


def read_values(mesh: bpy.types.Mesh, name: str, dtype: type, columns: int) -> np.ndarray | None:
    """(n, columns), or (n,) for one column: the values of an attribute; None if there are none."""
    attribute = mesh.attributes.get(name)
    if attribute is None or not len(attribute.data):  # none is readable in edit mode
        return None
    key = "vector" if attribute.data_type in ("FLOAT_VECTOR", "FLOAT2") else "value"
    return _get(attribute.data, key, dtype, columns)


def _face_starts(mesh: bpy.types.Mesh) -> np.ndarray:
    """(F + 1,) int32: the first corner of each face, and the end."""
    faces, corners = len(mesh.polygons), len(mesh.loops)
    if corners == 3 * faces:
        return np.arange(0, corners + 1, 3, dtype=np.int32)
    starts = np.empty(faces + 1, dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", starts[:-1])
    starts[-1] = corners
    return starts


def _triangles(mesh: bpy.types.Mesh) -> dict[str, np.ndarray]:
    """Blender's own, so that RoSy draws what it draws; none if there are none yet."""
    faces = len(mesh.polygons)
    if len(mesh.loops) == 3 * faces:
        face = np.arange(faces, dtype=np.int32)
        return {"triangles": np.arange(3 * faces, dtype=np.int32), "triangle_face": face}
    if not len(mesh.loop_triangles):
        return {}
    return {
        "triangles": _get(mesh.loop_triangles, "loops", np.int32, 3),
        "triangle_face": _get(mesh.loop_triangle_polygons, "value", np.int32),
    }


def _sharp_edges(mesh: bpy.types.Mesh) -> np.ndarray | None:
    sharp = read_values(mesh, "sharp_edge", bool, 1)
    if sharp is None or not sharp.any():
        return None
    return _quickly(mesh, ".edge_verts", mesh.edges, "vertices", np.int32, 2)[sharp]


def _quickly(
    mesh: bpy.types.Mesh,
    attribute: str,
    collection: bpy.types.bpy_prop_collection,
    key: str,
    dtype: type,
    columns: int = 1,
) -> np.ndarray:
    """Values of a collection, from the attribute that holds them if it is readable.

    Blender copies attributes whole; from collections it asks item by item, a thousand times slower.
    """
    values = read_values(mesh, attribute, dtype, columns)
    if values is None or len(values) != len(collection):
        return _get(collection, key, dtype, columns)
    return values


def _get(collection: bpy.types.bpy_prop_collection, key: str, dtype: type, columns: int = 1):
    values = np.empty(len(collection) * columns, dtype=dtype)
    collection.foreach_get(key, values)
    return values.reshape(-1, columns) if columns > 1 else values

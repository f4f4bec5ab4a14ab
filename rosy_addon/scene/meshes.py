"""Convert Blender meshes to `Surface`, and read their attributes and edges as arrays."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import bpy
import numpy as np
from bpy.types import Attribute, Mesh, Object, bpy_prop_collection

from ..core.cache import Cache, cached, content_hash
from ..core.errors import NoFeaturesError, RosyError
from ..core.progress import progress
from ..field.connectivity import are_pairs, smooth_fans
from ..field.surface import Surface, build_surface
from .datablocks import field_mesh

#: Ways to mark edges in Blender: RNA property, label, and description in the user interface.
EDGE_MARKS = {
    "SELECTED": ("select", "Selected", "Edges that are selected in edit mode"),
    "SHARP": ("use_edge_sharp", "Marked Sharp", "Edges that are marked sharp"),
    "SEAM": ("use_seam", "Seams", "Edges that are marked as seams"),
}

#: Name of the RNA property with the values of an attribute, by its data type. For other types it is "value".
VALUE_KEYS = {"FLOAT_VECTOR": "vector", "FLOAT2": "vector", "FLOAT_COLOR": "color"}

#: Number of columns and kind (`numpy.dtype.kind`) of the values of an attribute, by its data type.
VALUE_SHAPES = {
    "FLOAT": (1, "f"),
    "FLOAT2": (2, "f"),
    "FLOAT_VECTOR": (3, "f"),
    **dict.fromkeys(("FLOAT_COLOR", "BYTE_COLOR", "QUATERNION"), (4, "f")),
    "BOOLEAN": (1, "b"),
    "INT": (1, "i"),
    "INT8": (1, "i"),
    "INT32_2D": (2, "i"),
}

#: Meshes with at most this number of faces may be meant to be shaded flat.
FEW_FACES = 50

#: Attribute in which Blender stores which edges are selected.
EDGE_SELECTION_ATTRIBUTE = ".select_edge"


def mesh_label(mesh: Mesh) -> str:
    """Return the name of a mesh for messages: the name of an object that uses it, if there is one.

    Selected objects are preferred.
    """
    users = [obj for obj in bpy.data.objects if mesh in (obj.data, field_mesh(obj))]
    if not users:
        return f"mesh '{mesh.name}'"
    return f"object '{next((obj for obj in users if obj.select_get()), users[0]).name}'"


def mesh_surface(
    mesh: Mesh, name: str | None = None, *, occluder_only: bool = False, cache: Cache | None = None
) -> Surface:
    """Read a mesh as a surface.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        An original or evaluated mesh. In edit mode, the current state of editing is read.
    name : str, optional
        Name for messages. By default `mesh_label`.
    occluder_only : bool
        Treat all faces as flat, which is faster and enough for meshes that only occlude others.
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
    vertices, topology, custom_normals = _read_shape(mesh, occluder_only)
    if not len(mesh.polygons):
        raise no_faces_error(mesh, name)
    if occluder_only:
        topology["flat_faces"] = np.ones(len(mesh.polygons), dtype=bool)

    def build() -> Surface:
        with progress(0.0, 0.7):
            # Cached by the topology alone, which a deformation does not change.
            build_fans = partial(smooth_fans, vertices, **topology)
            fans = cached(cache, build_fans, "fans", *topology.values())
        parts = {**topology, **_triangles(mesh), "corner_fan": fans}
        parts["corner_normal"] = _corner_normals(mesh) if custom_normals is None else custom_normals
        with progress(0.7, 1.0):
            return build_surface(vertices, name=name, **parts)

    shape = vertices, *topology.values(), custom_normals
    return cached(cache, build, "surface", name, occluder_only, *shape)


def no_faces_error(mesh: Mesh, name: str) -> RosyError:
    """Return the error for a mesh without faces, which is called `name`."""
    content = "only vertices and loose edges" if len(mesh.vertices) else "it is empty"
    return RosyError(f"{name}: the mesh has no faces, {content}")


def shape_digest(mesh: Mesh, *, occluder_only: bool = False) -> bytes:
    """Return a digest of everything that `mesh_surface` reads. Much faster than reading the surface."""
    vertices, topology, custom_normals = _read_shape(mesh, occluder_only)
    return content_hash(vertices, *topology.values(), custom_normals)


def _read_shape(
    mesh: Mesh, occluder_only: bool
) -> tuple[np.ndarray, dict[str, np.ndarray | None], np.ndarray | None]:
    """Return the arguments of `build_surface` that determine all others.

    Triangles and normals are left out, because Blender computes them from the returned arrays. Only custom
    normals are included.

    Returns
    -------
    vertices : (V, 3) float32 ndarray
    topology : dict
        The faces, and which edges and faces are sharp.
    custom_normals : (C, 3) float32 ndarray or None
        The shading normals at the corners, if the mesh has custom normals.
    """
    flush_edit_mode(mesh)
    corner_vertex, face_start = polygon_arrays(mesh)
    topology = {"corner_vertex": corner_vertex, "face_start": face_start}
    topology |= {"sharp_edges": None, "flat_faces": None}
    custom_normals = None
    if not occluder_only:
        flat_faces = read_attribute(mesh, "sharp_face", bool, 1)
        sharp_edges = read_attribute(mesh, "sharp_edge", bool, 1)
        if sharp_edges is not None and len(sharp_edges) == len(mesh.edges) and sharp_edges.any():
            topology["sharp_edges"] = _edge_vertices(mesh)[sharp_edges]
        if flat_faces is not None and len(flat_faces) == len(mesh.polygons) and flat_faces.any():
            topology["flat_faces"] = flat_faces
        if mesh.has_custom_normals:
            custom_normals = _corner_normals(mesh)
    return vertex_positions(mesh), topology, custom_normals


def _corner_normals(mesh: Mesh) -> np.ndarray:
    """Return the shading normals at the corners, (C, 3) float32."""
    return read_collection(mesh.corner_normals, "vector", np.float32, 3)


def uv_map_name(mesh: Mesh, name: str, label: str) -> str:
    """Return the name of a UV map of a mesh: `name`, or the active one if it is empty.

    Raises
    ------
    RosyError
        If there is no such UV map. `label` is the name of the mesh in the message.
    """
    layer = mesh.uv_layers.get(name) if name else mesh.uv_layers.active
    if layer is not None:
        return layer.name
    if not mesh.uv_layers:
        raise RosyError(f"{label} has no UV map: unwrap its mesh first")
    available = ", ".join(f"'{other.name}'" for other in mesh.uv_layers)
    raise RosyError(f"{label} has no UV map '{name}', only {available}")


def read_uvs(mesh: Mesh, name: str = "", label: str | None = None) -> np.ndarray:
    """Return the UV coordinates of the corners of a mesh, (C, 2) float32.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    name : str
        Name of the UV map. If it is empty, the active UV map is read.
    label : str, optional
        Name of the mesh in messages. By default `mesh_label`.

    Raises
    ------
    RosyError
        If there is no such UV map, or the mesh is in edit mode.
    """
    label = mesh_label(mesh) if label is None else label
    name = uv_map_name(mesh, name, label)
    # Not read as an attribute: on evaluated meshes, another one may have the same name.
    values = mesh.uv_layers[name].uv
    if not len(values):
        raise RosyError(
            f"{label}: UV map '{name}' cannot be read in edit mode: leave edit mode (Tab) first"
        )
    return read_collection(values, "vector", np.float32, 2)


def polygon_arrays(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return `Surface.corner_vertex`, (C,) int32, and `Surface.face_start`, (F + 1,) int32."""
    loops, face_count = mesh.loops, len(mesh.polygons)
    key = "vertex_index"
    corner_vertex = _attribute_or_collection(mesh, ".corner_vert", loops, key, np.int32, 1)
    if len(loops) == 3 * face_count:
        return corner_vertex, np.arange(0, len(loops) + 1, 3, dtype=np.int32)
    face_start = np.empty(face_count + 1, dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", face_start[:-1])
    face_start[-1] = len(loops)
    return corner_vertex, face_start


def vertex_positions(mesh: Mesh) -> np.ndarray:
    """Return the positions of the vertices in object space, (V, 3) float32."""
    return _attribute_or_collection(mesh, "position", mesh.vertices, "co", np.float32, 3)


def material_indices(mesh: Mesh) -> np.ndarray:
    """Return the indices of the material slots of the faces, (F,) int32."""
    name, faces = "material_index", mesh.polygons
    if name not in mesh.attributes:
        return np.zeros(len(faces), dtype=np.int32)
    return _attribute_or_collection(mesh, name, faces, name, np.int32, 1)


@contextmanager
def evaluated_mesh(obj: Object) -> Iterator[Mesh | None]:
    """Context manager: yield the temporary mesh of an evaluated object; None if it has no faces."""
    mesh = obj.to_mesh()
    try:
        yield mesh if mesh is not None and len(mesh.polygons) else None
    finally:
        obj.to_mesh_clear()


def is_shaded_flat(mesh: Mesh) -> bool:
    """Return whether a mesh has more than `FEW_FACES` faces, and its first face is shaded flat.

    Only one value is read, so that panels can call this at each redraw.
    """
    sharp = mesh.attributes.get("sharp_face")
    is_sharp = sharp is not None and sharp.domain == "FACE" and sharp.data_type == "BOOLEAN"
    return is_sharp and len(sharp.data) > FEW_FACES and sharp.data[0].value


def marked_edges(mesh: Mesh, mark: str) -> np.ndarray:
    """Return the vertex indices of the edges that are selected, marked sharp, or marked as seams.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    mark : {"SELECTED", "SHARP", "SEAM"}
        See `EDGE_MARKS`.

    Returns
    -------
    (K, 2) int32 ndarray
        Both vertices of each marked edge.

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
    return _edge_vertices(mesh)[is_marked]


def mark_sharp(mesh: Mesh, edges: np.ndarray) -> int:
    """Mark edges as sharp, given by (K, 2) vertex indices. Return how many different ones there are."""
    is_wanted = are_pairs(_edge_vertices(mesh), edges)
    mesh.edges.foreach_set("use_edge_sharp", _edge_flags(mesh, "use_edge_sharp") | is_wanted)
    mesh.update()
    return int(np.count_nonzero(is_wanted))


def flush_edit_mode(mesh: Mesh) -> None:
    """Write the current state of editing to a mesh that is in edit mode. Do nothing otherwise."""
    if not mesh.is_editmode:
        return
    for obj in bpy.data.objects:
        if obj.data == mesh and obj.mode == "EDIT":
            obj.update_from_editmode()
            return


def read_attribute(mesh: Mesh, name: str, dtype: type, columns: int) -> np.ndarray | None:
    """Return an attribute as (n, columns), or (n,) for one column; None if it is missing or empty.

    Also None if it has another type: users may give any name to an attribute.
    """
    attribute = mesh.attributes.get(name)
    if attribute is None or not len(attribute.data):  # in edit mode, attributes are empty
        return None
    if VALUE_SHAPES.get(attribute.data_type) != (columns, np.dtype(dtype).kind):
        return None
    key = VALUE_KEYS.get(attribute.data_type, "value")
    return read_collection(attribute.data, key, dtype, columns)


def write_attribute(attribute: Attribute, values: np.ndarray) -> None:
    """Set the values of an attribute of a mesh, Curves or a Grease Pencil drawing: a row per element."""
    dtype = {"INT": np.int32, "INT8": np.int8}.get(attribute.data_type, np.float32)
    key = VALUE_KEYS.get(attribute.data_type, "value")
    attribute.data.foreach_set(key, np.ascontiguousarray(values, dtype=dtype).ravel())


def _triangles(mesh: Mesh) -> dict[str, np.ndarray]:
    """Return Blender's triangulation as arguments of `build_surface`; empty if it is not computed yet."""
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


def _edge_vertices(mesh: Mesh) -> np.ndarray:
    """Return the vertex indices of all edges, (E, 2) int32."""
    return _attribute_or_collection(mesh, ".edge_verts", mesh.edges, "vertices", np.int32, 2)


def _edge_flags(mesh: Mesh, property_name: str) -> np.ndarray:
    """Return a boolean RNA property of all edges, (E,) bool."""
    flags = np.empty(len(mesh.edges), dtype=bool)
    is_selection = property_name == "select"
    attribute = mesh.attributes.get(EDGE_SELECTION_ATTRIBUTE) if is_selection else None
    if attribute is not None and attribute.data_type == "INT32_2D" and len(attribute.data):
        # If all edges were created at once (`Mesh.from_pydata`, `Mesh.update(calc_edges=True)`), Blender 5.0
        # creates the attribute with this type, but with only one byte per edge, so `foreach_get` would read
        # past its end. All edges then have the same value.
        flags[:] = attribute.data[0].value[0] & 0xFF
    else:
        mesh.edges.foreach_get(property_name, flags)
    return flags


def _attribute_or_collection(
    mesh: Mesh, attribute: str, collection: bpy_prop_collection, key: str, dtype: type, columns: int
) -> np.ndarray:
    """Return the values of a property of a collection, from an attribute with the same values if possible.

    `attribute` is the name of the attribute, and `key` is the name of the property. The result is
    (n, columns), or (n,) for one column.

    Blender copies an attribute as a whole. It reads a collection item by item, which is a thousand times
    slower.
    """
    values = read_attribute(mesh, attribute, dtype, columns)
    if values is None or len(values) != len(collection):
        return read_collection(collection, key, dtype, columns)
    return values


def read_collection(collection: bpy_prop_collection, key: str, dtype: type, columns: int = 1):
    """Return a property of all items of a collection as (n, columns), or (n,) if `columns` is 1."""
    values = np.empty(len(collection) * columns, dtype=dtype)
    collection.foreach_get(key, values)
    return values.reshape(-1, columns) if columns > 1 else values

"""Read mesh attributes as one vector per face, or as one scalar per face or corner."""

import bpy
import numpy as np

from ..core.color import REC709_LUMINANCE
from ..core.errors import RosyError
from ..field.polygon_arrays import mean_per_face
from ..field.validate import apply_nonfinite_policy
from .datablocks import field_mesh
from .field_attributes import describe_type, field_values
from .meshes import evaluated_mesh, mesh_label, polygon_arrays, read_collection

#: Blender's types of scalar attributes, with the dtypes of their values; and its types of color attributes.
NUMBER_TYPES = {"FLOAT": np.float32, "INT": np.int32, "INT8": np.int32, "BOOLEAN": bool}
COLOR_TYPES = ("FLOAT_COLOR", "BYTE_COLOR")


def read_face_vectors(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """Read a vector attribute on faces, points or corners as one vector per face.

    Vectors on points or corners are averaged over each face. They are not projected to its plane.

    Returns
    -------
    (F, 3) float64 ndarray

    Raises
    ------
    RosyError
        If the attribute does not hold vectors, or a value is not finite.
    """
    source = f"{mesh_label(mesh)}, attribute '{name}'"
    attribute = mesh.attributes[name]
    values = field_values(attribute, source, mesh).astype(np.float64)
    if values.ndim == 1:
        raise RosyError(f"{source}: expected a vector, found {describe_type(attribute)}")
    apply_nonfinite_policy(values, source, attribute.domain.lower(), "error")
    return _face_means(values, attribute.domain, mesh)


def read_face_scalars(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """Read an attribute or a vertex group as one scalar per face.

    The attribute may have floats, integers, booleans or colors (of which the linear luminance is taken).
    Values on points or corners are averaged over each face.

    Returns
    -------
    (F,) float64 ndarray

    Raises
    ------
    RosyError
        If there is neither an attribute nor a vertex group of this name, the type or domain of the
        attribute is not supported, or a value is not finite.
    """
    source = f"{mesh_label(mesh)}, '{name}'"
    users = [obj for obj in bpy.data.objects if field_mesh(obj) == mesh]
    if not users or users[0].data == mesh:
        return _face_scalars(mesh, name, users, source)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    with evaluated_mesh(users[0].evaluated_get(depsgraph)) as seen:
        is_same = seen is not None and len(seen.polygons) == len(mesh.polygons)
        return _face_scalars(seen if is_same else mesh, name, users, source)


def _face_scalars(
    mesh: bpy.types.Mesh, name: str, users: list[bpy.types.Object], source: str
) -> np.ndarray:
    """Return the result of `read_face_scalars`, given the mesh to read: the original, evaluated or field mesh.

    `users` are the objects that may have a vertex group of this name. `source` names the values in messages.
    """
    attribute = mesh.attributes.get(name)
    if attribute is not None:
        domain, values = attribute.domain, scalar_values(attribute, source)
    else:
        owners = [obj for obj in users if name in obj.vertex_groups]
        if not owners:
            raise RosyError(f"{source}: no attribute or vertex group has this name")
        group = owners[0].vertex_groups[name].index
        domain, values = "POINT", np.zeros(len(mesh.vertices))
        for vertex in mesh.vertices:
            for membership in vertex.groups:
                if membership.group == group:
                    values[vertex.index] = membership.weight
    if not np.isfinite(values).all():
        raise RosyError(f"{source}: has values that are not finite")
    return _face_means(values, domain, mesh)


def _face_means(values: np.ndarray, domain: str, mesh: bpy.types.Mesh) -> np.ndarray:
    """Return values of faces, (F, ...), as they are; average values of points or corners over each face."""
    if domain == "FACE":
        return values
    corner_vertex, face_start = polygon_arrays(mesh)
    return mean_per_face(values[corner_vertex] if domain == "POINT" else values, face_start)


def filled_attribute(mesh: bpy.types.Mesh, name: str) -> bpy.types.Attribute | None:
    """Return an attribute of a mesh; None if it is missing, or empty as in edit mode."""
    attribute = mesh.attributes.get(name)
    # In edit mode, attributes are empty.
    return attribute if attribute is not None and len(attribute.data) else None


def corner_scalars(attribute: bpy.types.Attribute, mesh: bpy.types.Mesh, source: str) -> np.ndarray:
    """Return the values of a scalar attribute at the corners of its mesh, (C,) float64.

    Parameters
    ----------
    attribute : bpy.types.Attribute
    mesh : bpy.types.Mesh
    source : str
        Name of the attribute in messages.

    Raises
    ------
    RosyError
        If the type or domain of the attribute is not supported; see `scalar_values`.
    """
    values = scalar_values(attribute, source)
    corner_vertex, face_start = polygon_arrays(mesh)
    if attribute.domain == "POINT":
        return values[corner_vertex]
    return np.repeat(values, np.diff(face_start)) if attribute.domain == "FACE" else values


def scalar_values(attribute: bpy.types.Attribute, source: str) -> np.ndarray:
    """Return the values of a scalar attribute. Colors are converted to linear luminance.

    Parameters
    ----------
    attribute : bpy.types.Attribute
    source : str
        Name of the attribute in messages.

    Returns
    -------
    (n,) float64 ndarray
        One value per element of the attribute's domain.

    Raises
    ------
    RosyError
        If the attribute is not on faces, points or corners, or has neither numbers nor colors.
    """
    data_type, found = attribute.data_type, describe_type(attribute)
    if attribute.domain not in ("FACE", "POINT", "CORNER"):
        raise RosyError(f"{source}: expected values on FACE, POINT or CORNER, found {found}")
    if data_type in COLOR_TYPES:
        colors = read_collection(attribute.data, "color", np.float32, 4)
        return colors[:, :3] @ REC709_LUMINANCE
    if data_type not in NUMBER_TYPES:
        raise RosyError(f"{source}: expected a number or a color, found {found}")
    return read_collection(attribute.data, "value", NUMBER_TYPES[data_type]).astype(np.float64)

"""Read the guides that a generated field follows: strokes, annotations, empties, vectors and combed guides.

Combed guides are drawn with a brush and stored on the mesh. The attribute `GUIDE_ATTRIBUTE` (FLOAT_VECTOR on
faces) holds one vector per face in object space: a member that the field should have there. The length of the
vector, from 0 to 1, is the firmness of the guide. Two more things are stored with it: its rest shape, as for
fields (`field_attributes`), and a checksum of the field that was computed from the guides.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from bpy.types import Mesh, Object, Scene, Spline
from mathutils.geometry import interpolate_bezier

from ..core.errors import RosyError
from ..field.surface import Surface
from .datablocks import check_not_missing
from .face_values import read_face_vectors
from .field_attributes import (
    ANGLE_TYPE,
    VECTOR_TYPE,
    attribute_name,
    check_attribute_type,
    follow_mesh,
    have_checks,
    is_face_vector_field,
    store_attribute,
    store_rest_shape,
    vector_checks,
)
from .meshes import mesh_label, read_attribute, read_collection

#: Types of objects with strokes, and all types of objects that can guide a field.
STROKE_TYPES = ("GREASEPENCIL", "GPENCIL", "CURVE", "CURVES")
GUIDE_TYPES = (*STROKE_TYPES, "EMPTY")

#: Number of points that are sampled on each segment of a Bézier curve, including both ends.
BEZIER_SEGMENT_SAMPLES = 12

#: Position, axis and radius of influence of an empty that guides a field.
EmptyGuide = tuple[np.ndarray, np.ndarray, float]


def guide_objects(objects: Iterable[Object]) -> list[Object]:
    """Return the objects that can guide a field: Grease Pencil, curves, hair curves and empties."""
    return [obj for obj in objects if obj.type in GUIDE_TYPES]


def guide_strokes_and_empties(
    objects: Iterable[Object], owner: Object
) -> tuple[list[np.ndarray], list[EmptyGuide]]:
    """Read guide objects as strokes and empties, in the space of the object whose field they guide.

    Strokes are read from Grease Pencil (the current frame of visible layers), curves and hair curves.
    An empty guides the field along its z axis, within its display size.

    Parameters
    ----------
    objects : iterable of bpy.types.Object
    owner : bpy.types.Object
        The object of the mesh whose field is guided.

    Returns
    -------
    strokes : list of (n, 3) float64 ndarray
        Polylines with at least two points.
    empties : list of (position, axis, radius)
        The axis is not normalized.

    Raises
    ------
    RosyError
        If an object other than an empty has no stroke, if a point is not finite, if an object is missing in
        its library, or if the owner is scaled to zero.
    """
    world_to_owner = _world_to_object(owner)
    strokes: list[np.ndarray] = []
    empties: list[EmptyGuide] = []
    for obj in objects:
        check_not_missing(obj)
        matrix = world_to_owner @ np.array(obj.matrix_world, dtype=np.float64)
        if obj.type == "EMPTY":
            radius = obj.empty_display_size * np.linalg.norm(matrix[:3, :3], axis=0).max()
            empties.append((matrix[:3, 3], matrix[:3, 2], float(radius)))
            continue
        polylines = [stroke for stroke in _object_strokes(obj) if len(stroke) > 1]
        if not polylines:
            raise RosyError(
                f"object '{obj.name}' has no stroke to follow: draw one, or choose another object"
            )
        if not all(np.isfinite(stroke).all() for stroke in polylines):
            raise RosyError(f"object '{obj.name}' has a point that is not finite: remove it")
        strokes += [stroke @ matrix[:3, :3].T + matrix[:3, 3] for stroke in polylines]
    return strokes, empties


def annotation_strokes(scene: Scene, owner: Object) -> list[np.ndarray]:
    """Read the annotations of a scene as strokes, in the space of an object.

    The strokes of the current frame of visible layers are read. Strokes that are placed on the view instead
    of in the scene, and rulers, are left out.

    Parameters
    ----------
    scene : bpy.types.Scene
    owner : bpy.types.Object
        The object of the mesh whose field is guided.

    Returns
    -------
    list of (n, 3) float64 ndarray
        Polylines with at least two points.

    Raises
    ------
    RosyError
        If there is no such stroke, or if the owner is scaled to zero.
    """
    matrix = _world_to_object(owner)
    # The property was renamed in Blender 5.0.
    annotation = scene.annotation if hasattr(scene, "annotation") else scene.grease_pencil
    strokes = [
        _read_coordinates(stroke.points, "co", 3)
        for layer in (annotation.layers if annotation else ())
        if not layer.annotation_hide and not layer.is_ruler
        for stroke in _annotation_strokes(layer, scene.frame_current)
        # Some versions (4.3) do not tell whether a stroke is placed in the scene or on the view.
        if len(stroke.points) > 1 and getattr(stroke, "display_mode", "3DSPACE") == "3DSPACE"
    ]
    strokes = [stroke for stroke in strokes if np.isfinite(stroke).all()]
    if not strokes:
        raise RosyError(
            f"scene '{scene.name}' has no annotation to follow: draw one on the mesh, with Placement "
            "set to Surface"
        )
    return [stroke @ matrix[:3, :3].T + matrix[:3, 3] for stroke in strokes]


def _annotation_strokes(layer: Any, number: int) -> Any:
    """Return the strokes of an annotation layer that are visible at a frame number.

    The layer's own ``active_frame`` is only valid after the layer was drawn.
    """
    frames = [frame for frame in layer.frames if frame.frame_number <= number]
    return max(frames, key=lambda frame: frame.frame_number).strokes if frames else ()


def _world_to_object(obj: Object) -> np.ndarray:
    """Return the (4, 4) matrix from world space to the space of an object."""
    try:
        return np.linalg.inv(np.array(obj.matrix_world, dtype=np.float64))
    except np.linalg.LinAlgError:
        raise RosyError(f"object '{obj.name}' has a scale of zero: scale it up") from None


def guide_vectors(mesh: Mesh, name: str, surface: Surface) -> np.ndarray:
    """Read a vector attribute as one guide per face; see `read_face_vectors`.

    If RoSy has stored the attribute and the mesh was deformed since, the vectors are rotated with their
    faces; see `follow_mesh`.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    name : str
        Name of the attribute.
    surface : Surface
        Surface of the mesh.

    Returns
    -------
    (F, 3) float64 ndarray

    Raises
    ------
    RosyError
        If there is no attribute of this name, it does not hold vectors, or a value is not finite.
    """
    if not name or name not in mesh.attributes:
        raise RosyError(
            f"{mesh_label(mesh)} has no attribute '{name}' to follow: choose a vector attribute"
        )
    return follow_mesh(mesh, name, read_face_vectors(mesh, name), surface)


def _object_strokes(obj: Object) -> list[np.ndarray]:
    """Return the strokes of an object, each (n, 3), in its own space."""
    if obj.type == "CURVE":
        return [_spline_points(spline) for spline in obj.data.splines]
    if obj.type == "CURVES":
        return _split_strokes(obj.data.attributes, obj.data.curve_offset_data)
    strokes = []
    for layer in obj.data.layers:
        is_legacy = hasattr(layer, "active_frame")  # before Blender 4.3
        frame = layer.active_frame if is_legacy else layer.current_frame()
        if layer.hide or frame is None:
            continue
        if is_legacy:
            strokes += [_read_coordinates(stroke.points, "co", 3) for stroke in frame.strokes]
        else:
            drawing, matrix = frame.drawing, np.array(layer.matrix_local, dtype=np.float64)
            points = _split_strokes(drawing.attributes, drawing.curve_offsets)
            strokes += [stroke @ matrix[:3, :3].T + matrix[:3, 3] for stroke in points]
    return strokes


def _split_strokes(attributes, offsets) -> list[np.ndarray]:
    """Return the points of each curve, (n, 3) float64, from the attributes of Curves or a drawing.

    The values of `offsets` are the index of the first point of each curve, then the number of points.
    """
    position = attributes.get("position")
    if position is None or not len(position.data):  # the offsets of an empty drawing are unreadable
        return []
    points = _read_coordinates(position.data, "vector", 3)
    return np.split(points, read_collection(offsets, "value", np.int32)[1:-1])


def _spline_points(spline: Spline) -> np.ndarray:
    """Return the points of a spline, (n, 3): samples of a Bézier spline, control points of a NURBS."""
    if spline.type != "BEZIER":
        points = _read_coordinates(spline.points, "co", 4)[:, :3]
        return np.concatenate([points, points[:1]]) if spline.use_cyclic_u else points
    knots = list(spline.bezier_points)
    next_knots = knots[1:] + (knots[:1] if spline.use_cyclic_u else [])
    points = []
    for knot, following in zip(knots, next_knots, strict=False):
        controls = knot.co, knot.handle_right, following.handle_left, following.co
        points += interpolate_bezier(*controls, BEZIER_SEGMENT_SAMPLES)
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def _read_coordinates(collection, key: str, columns: int) -> np.ndarray:
    """Return coordinates, (n, columns) float64: the property `key` of the n items of a collection."""
    return read_collection(collection, key, np.float32, columns).astype(np.float64)


#: Name of the attribute with the combed guides, and of the attribute with the checksums of the field.
GUIDE_ATTRIBUTE, FIELD_CHECK_ATTRIBUTE = "rosy_guides", ".rosy_guides_field"

#: Least firmness of guides that come from strokes. Weaker guides only keep the rest of the field as it was.
STROKE_FIRMNESS = 0.25


def read_combed_guides(mesh: Mesh, surface: Surface) -> np.ndarray:
    """Read the combed guides of a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    surface : Surface
        Surface of the mesh.

    Returns
    -------
    (F, 3) float64 ndarray
        One vector per face. It is zero on faces without a guide, and where the field was changed by something
        other than combing since the guides were stored.
    """
    guides = np.zeros((surface.face_count, 3))
    checks = read_attribute(mesh, FIELD_CHECK_ATTRIBUTE, np.float32, 1)
    are_stored = is_face_vector_field(mesh, GUIDE_ATTRIBUTE) and is_face_vector_field(mesh)
    if not are_stored or checks is None or len(checks) != len(guides):  # converted by the user
        return guides
    names = GUIDE_ATTRIBUTE, attribute_name(mesh)
    values, field = (read_attribute(mesh, name, np.float32, 3) for name in names)
    values = follow_mesh(mesh, GUIDE_ATTRIBUTE, values.astype(np.float64), surface)
    is_current = have_checks(field, checks) & np.isfinite(values).all(axis=1)
    guides[is_current] = values[is_current]
    return guides


def check_guides_storable(mesh: Mesh) -> None:
    """Raise an error if `store_combed_guides` cannot store guides on a mesh."""
    check_attribute_type(mesh, GUIDE_ATTRIBUTE, VECTOR_TYPE)
    check_attribute_type(mesh, FIELD_CHECK_ATTRIBUTE, ANGLE_TYPE)


def store_combed_guides(mesh: Mesh, guides: np.ndarray) -> None:
    """Store (F, 3) combed guides. Call it after the field that was computed from them is stored.

    Raises
    ------
    RosyError
        If the mesh has an attribute with the name of the guides and another type.
    """
    check_guides_storable(mesh)
    store_attribute(mesh, GUIDE_ATTRIBUTE, VECTOR_TYPE, guides)
    store_rest_shape(mesh, GUIDE_ATTRIBUTE)
    field = read_attribute(mesh, attribute_name(mesh), np.float32, 3)
    store_attribute(mesh, FIELD_CHECK_ATTRIBUTE, ANGLE_TYPE, vector_checks(field))
    mesh.update()

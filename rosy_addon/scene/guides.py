"""What an artist sets up beside a mesh for a field to follow: strokes, curves, empties, UV maps."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from mathutils.geometry import interpolate_bezier

from ..errors import RosyError
from .attributes import read_vectors
from .meshes import read_values

#: Types of objects that guide: lines drawn, and axes.
STROKES = ("GREASEPENCIL", "GPENCIL", "CURVE", "CURVES")
GUIDES = (*STROKES, "EMPTY")

#: Points of a Bézier curve from one control point to the next.
FINE = 12

Handle = tuple[np.ndarray, np.ndarray, float]


def guide_objects(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Those of some objects that can guide a field."""
    return [thing for thing in objects if thing.type in GUIDES]


def strokes_and_handles(
    objects: Iterable[bpy.types.Object], owner: bpy.types.Object
) -> tuple[list[np.ndarray], list[Handle]]:
    """What objects guide along, in the space of another one.

    Grease Pencil strokes of the current frame and visible layers, curves and hair curves are
    strokes. An empty guides along its z axis, as far as it is drawn.

    Parameters
    ----------
    objects : iterable of bpy.types.Object
    owner : bpy.types.Object
        The object of the mesh that is guided.

    Returns
    -------
    strokes : list of (n, 3) float64 ndarray
    handles : list of (place, axis, radius)

    Raises
    ------
    RosyError
        If there is nothing to follow on one of them.
    """
    into = np.linalg.inv(np.array(owner.matrix_world, dtype=np.float64))
    strokes: list[np.ndarray] = []
    handles: list[Handle] = []
    for thing in objects:
        matrix = into @ np.array(thing.matrix_world, dtype=np.float64)
        if thing.type == "EMPTY":
            radius = thing.empty_display_size * np.linalg.norm(matrix[:3, :3], axis=0).max()
            handles.append((matrix[:3, 3], matrix[:3, 2], float(radius)))
            continue
        found = [stroke for stroke in _strokes_of(thing) if len(stroke) > 1]
        if not found:
            raise RosyError(f"object '{thing.name}': there is no stroke on it to follow")
        strokes += [stroke @ matrix[:3, :3].T + matrix[:3, 3] for stroke in found]
    return strokes, handles


def uv_of_corners(mesh: bpy.types.Mesh, name: str = "") -> np.ndarray:
    """(C, 2) float32: a UV map of a mesh, the active one if none is named.

    Raises
    ------
    RosyError
        If there is none.
    """
    layer = mesh.uv_layers.get(name) if name else mesh.uv_layers.active
    if layer is None:
        has = ", ".join(f"'{other.name}'" for other in mesh.uv_layers) or "none"
        raise RosyError(f"{mesh.name}: has no UV map '{name}' to follow; there is {has}")
    values = read_values(mesh, layer.name, np.float32, 2)
    if values is None:
        raise RosyError(f"{mesh.name}: UV map '{layer.name}' cannot be read in edit mode")
    return values


def guiding_vectors(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """(F, 3) float64: a vector attribute of a mesh on its faces; see `attributes.read_vectors`.

    Raises
    ------
    RosyError
        If there is none of this name, or it holds anything else.
    """
    if not name or name not in mesh.attributes:
        raise RosyError(f"{mesh.name}: has no attribute '{name}' to follow")
    return read_vectors(mesh, name)


def _strokes_of(thing: bpy.types.Object) -> list[np.ndarray]:
    """In the object's own space."""
    if thing.type == "CURVE":
        return [_spline(spline) for spline in thing.data.splines]
    if thing.type == "CURVES":
        return _split(thing.data.attributes, thing.data.curve_offset_data)
    strokes = []
    for layer in thing.data.layers:
        if layer.hide:
            continue
        if hasattr(layer, "active_frame"):  # before Blender 4.3
            frame = layer.active_frame
            strokes += (
                [_coordinates(stroke.points, "co", 3) for stroke in frame.strokes] if frame else []
            )
            continue
        frame = layer.current_frame()
        if frame is None:
            continue
        place = np.array(layer.matrix_local, dtype=np.float64)
        for stroke in _split(frame.drawing.attributes, frame.drawing.curve_offsets):
            strokes.append(stroke @ place[:3, :3].T + place[:3, 3])
    return strokes


def _split(attributes, offsets) -> list[np.ndarray]:
    """Points that lie in a row, cut where each stroke begins."""
    if "position" not in attributes or not len(offsets):
        return []
    points = _coordinates(attributes["position"].data, "vector", 3)
    start = np.empty(len(offsets), dtype=np.int32)
    offsets.foreach_get("value", start)
    return np.split(points, start[1:-1])


def _spline(spline: bpy.types.Spline) -> np.ndarray:
    """(n, 3) points of a spline; of a NURBS its control points."""
    if spline.type != "BEZIER":
        points = _coordinates(spline.points, "co", 4)[:, :3]
        return np.concatenate([points, points[:1]]) if spline.use_cyclic_u else points
    knots = list(spline.bezier_points)
    ahead = knots[1:] + (knots[:1] if spline.use_cyclic_u else [])
    pieces = [
        interpolate_bezier(one.co, one.handle_right, other.handle_left, other.co, FINE)
        for one, other in zip(knots, ahead, strict=False)
    ]
    return np.array([point for piece in pieces for point in piece], dtype=np.float64).reshape(-1, 3)


def _coordinates(collection, key: str, columns: int) -> np.ndarray:
    values = np.empty(columns * len(collection), dtype=np.float32)
    collection.foreach_get(key, values)
    return values.reshape(-1, columns).astype(np.float64)

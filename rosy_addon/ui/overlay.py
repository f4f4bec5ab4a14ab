"""The overlay of singularities in the 3D view: dots colored by sign, labeled with their indices.

Draw handlers exist only while something is shown. Singularities are computed once, and again when a field
is stored and after an undo: the dots move with the object, but do not follow other changes of the mesh.
"""

from __future__ import annotations

import math
from collections.abc import Container
from typing import Any

import blf
import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ..compositor.label_placement import place_labels
from ..errors import RosyError
from ..scene.singularity_points import (
    Singularities,
    read_editable_singularities,
    read_singularities,
)
from ..viewport.view3d import redraw

#: Linear colors by the sign of the index: orange for positive, blue for negative.
COLOR_BY_SIGN = {1: (1.0, 0.32, 0.05, 1.0), -1: (0.05, 0.35, 1.0, 1.0)}
OUTLINE_COLOR = (0.02, 0.02, 0.02, 1.0)

#: Diameter of a dot in pixels, without its outline of 2 pixels.
DOT_DIAMETER = 9.0

#: Number of sides of the polygon that approximates a disc.
DISC_SEGMENTS = 20

#: Offset of dots from the surface, as a fraction of the size of the object. It avoids z-fighting.
SURFACE_OFFSET = 0.004

#: Maximum number of labels of an object. More would hide the dots.
MAX_LABELS = 250


class _Overlay:
    """The singularities that are shown, by the names of their objects, and the draw handlers."""

    def __init__(self) -> None:
        self.singularities: dict[str, Singularities] = {}
        self.handlers: list[Any] = []

    def add_handlers(self) -> None:
        """Start drawing."""
        for handlers, handler in _app_handlers():
            if handler not in handlers:
                handlers.append(handler)
        if not self.handlers and not bpy.app.background:
            add = bpy.types.SpaceView3D.draw_handler_add
            self.handlers.append(add(_draw_dots, (), "WINDOW", "POST_VIEW"))
            self.handlers.append(add(_draw_labels, (), "WINDOW", "POST_PIXEL"))

    def remove_handlers(self) -> None:
        """Stop drawing."""
        for handlers, handler in _app_handlers():
            if handler in handlers:
                handlers.remove(handler)
        while self.handlers:
            bpy.types.SpaceView3D.draw_handler_remove(self.handlers.pop(), "WINDOW")


#: Emptied by `hide`, which `unregister` calls.
_OVERLAY = _Overlay()


def show(object_name: str, singularities: Singularities) -> None:
    """Show the singularities of an object, in place of those shown before."""
    _OVERLAY.singularities[object_name] = singularities
    _OVERLAY.add_handlers()
    redraw()


def hide(object_name: str | None = None) -> None:
    """Hide the singularities of an object, or of all objects if no name is given."""
    if object_name is None:
        _OVERLAY.singularities.clear()
    else:
        _OVERLAY.singularities.pop(object_name, None)
    if not _OVERLAY.singularities:
        _OVERLAY.remove_handlers()
    redraw()


def refresh(context: bpy.types.Context, meshes: Container[bpy.types.Mesh]) -> None:
    """Read the singularities again of objects that show them and whose fields have changed.

    They are hidden if they cannot be read, for example because a modifier loses the field.
    """
    for name, shown_before in list(_OVERLAY.singularities.items()):
        obj = context.view_layer.objects.get(name)
        if obj is None or obj.data not in meshes:
            continue
        read = read_singularities if shown_before.vertex is None else read_editable_singularities
        try:
            show(name, read(obj, context.evaluated_depsgraph_get()))
        except RosyError:
            hide(name)


def _app_handlers() -> list[tuple[Any, Any]]:
    """Return the lists of application handlers, and the handler that belongs in each."""
    handlers = bpy.app.handlers
    return [
        (handlers.load_pre, _clear_on_load),
        (handlers.undo_post, _read_again),
        (handlers.redo_post, _read_again),
    ]


def _clear_on_load(*_: Any) -> None:
    """Hide everything before a file is loaded, as its objects may have the same names."""
    hide()


def _read_again(*_: Any) -> None:
    """Read all singularities again, as an undo step may have changed the fields."""
    context = bpy.context
    refresh(context, {obj.data for obj in context.view_layer.objects if obj.type == "MESH"})


def is_shown(object_name: str) -> bool:
    """Return whether the singularities of an object are shown."""
    return object_name in _OVERLAY.singularities


def shown(object_name: str) -> Singularities | None:
    """Return the singularities of an object that are shown, or None."""
    return _OVERLAY.singularities.get(object_name)


def has_handlers() -> bool:
    """Return whether there are draw handlers."""
    return bool(_OVERLAY.handlers)


def format_index(index: int, degree: int) -> str:
    """Return an index, given in units of 1 / N, as a fraction: +1/4, -1, +3/2."""
    divisor = int(np.gcd(index, degree))
    numerator, denominator = index // divisor, degree // divisor
    return f"{numerator:+d}" if denominator == 1 else f"{numerator:+d}/{denominator}"


def _visible_singularities() -> list[tuple[bpy.types.Object, Singularities]]:
    """Return the visible objects and their singularities, without objects that were removed or renamed."""
    view_layer = bpy.context.view_layer
    candidates = (
        (view_layer.objects.get(name), singularities)
        for name, singularities in _OVERLAY.singularities.items()
    )
    return [
        (obj, singularities)
        for obj, singularities in candidates
        if obj is not None and obj.visible_get()
    ]


def _draw_dots() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.depth_test_set("LESS_EQUAL")
    scale = context.preferences.system.ui_scale
    for obj, singularities in _visible_singularities():
        positions = offset_points(obj, singularities)
        for sign, fill_color in COLOR_BY_SIGN.items():
            points = positions[np.sign(singularities.index) == sign]
            if not len(points):  # Blender makes no batch without vertices
                continue
            # The outline first, slightly behind the dot.
            for radius, depth_offset, color in (
                (DOT_DIAMETER / 2 + 2, DOT_DIAMETER / 2, OUTLINE_COLOR),
                (DOT_DIAMETER / 2, DOT_DIAMETER, fill_color),
            ):
                vertices = _disc_triangles(context, points, radius * scale, depth_offset)
                shader.uniform_float("color", color)
                batch_for_shader(shader, "TRIS", {"pos": vertices}).draw(shader)
    gpu.state.depth_test_set("NONE")


def _disc_triangles(
    context: bpy.types.Context, points: np.ndarray, radius: float, depth_offset: float
) -> np.ndarray:
    """Return the (n, 3) corners of the triangles of a disc at each point, facing the camera.

    The radius is in pixels, and so is the offset toward the camera.
    """
    view, window = context.region_data, context.region
    view_to_world = np.array(view.view_matrix.inverted())
    right, up, back = view_to_world[:3, 0], view_to_world[:3, 1], view_to_world[:3, 2]
    depth = np.ones(len(points))
    if view.is_perspective:
        depth = (view_to_world[:3, 3] - points) @ back
    pixel = (depth * (2 / (view.window_matrix[0][0] * window.width)))[:, None, None]
    angles = np.linspace(0, 2 * np.pi, DISC_SEGMENTS + 1)
    circle = np.cos(angles)[:, None] * right + np.sin(angles)[:, None] * up
    triangles = np.stack([np.zeros((DISC_SEGMENTS, 3)), circle[:-1], circle[1:]], axis=1).reshape(
        -1, 3
    )
    vertices = points[:, None] + pixel * (radius * triangles + depth_offset * back)
    return vertices.reshape(-1, 3).astype(np.float32)


def _draw_labels() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays or not context.space_data.overlay.show_text:
        return
    scale = context.preferences.system.ui_scale
    font_id = 0
    blf.size(font_id, 12 * scale)
    blf.color(font_id, 1.0, 1.0, 1.0, 1.0)
    blf.enable(font_id, blf.SHADOW)
    blf.shadow(font_id, 5, 0.0, 0.0, 0.0, 1.0)
    dots, texts = [], []
    for obj, singularities in _visible_singularities():
        if len(singularities) > MAX_LABELS:
            continue
        for point, index in zip(
            offset_points(obj, singularities), singularities.index.tolist(), strict=True
        ):
            position = location_3d_to_region_2d(context.region, context.region_data, Vector(point))
            if position is not None and not is_occluded(context, point):
                dots.append(position)
                texts.append(format_index(index, singularities.degree))
    if texts:
        radius = (DOT_DIAMETER / 2 + 2) * scale
        sizes = [blf.dimensions(font_id, text) for text in texts]
        for text, corner in zip(texts, place_labels(dots, sizes, radius).tolist(), strict=True):
            if math.isfinite(corner[0]):
                blf.position(font_id, *corner, 0)
                blf.draw(font_id, text)
    blf.disable(font_id, blf.SHADOW)


def is_occluded(context: bpy.types.Context, point: np.ndarray) -> bool:
    """Return whether something is between a point in world space and the camera."""
    point = Vector(point)
    view_to_world = context.region_data.view_matrix.inverted()
    view_direction = (
        view_to_world.translation - point
        if context.region_data.is_perspective
        else view_to_world.col[2].xyz
    )
    return context.scene.ray_cast(context.view_layer.depsgraph, point, view_direction.normalized())[
        0
    ]


def offset_points(obj: bpy.types.Object, singularities: Singularities) -> np.ndarray:
    """Return the (K, 3) positions in world space, slightly off the surface."""
    matrix = np.array(obj.matrix_world)
    offset = SURFACE_OFFSET * max(obj.dimensions)
    scale = np.cbrt(abs(np.linalg.det(matrix[:3, :3]))) or 1.0
    points = singularities.points + singularities.normals * (offset / scale)
    return points @ matrix[:3, :3].T + matrix[:3, 3]

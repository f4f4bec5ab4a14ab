"""Points on an object under the mouse, for the tool *Comb Field* and its operator."""

from typing import Any

import numpy as np
from bpy.types import Context, Object
from bpy_extras import view3d_utils
from mathutils import Vector

from ..core.cache import BAKE_CACHE
from ..scene.app_handlers import add_handlers, remove_handlers
from ..scene.brush_surface import BrushSurface
from ..scene.datablocks import field_mesh
from ..scene.field_attributes import attribute_name, field_degree, is_face_vector_field
from ..scene.guides import GUIDE_ATTRIBUTE, STROKE_FIRMNESS
from ..scene.meshes import mesh_surface, read_attribute
from .view3d import to_world


class BrushMouse:
    """The points of an object under the mouse, in a region of a 3D view."""

    def __init__(self, context: Context, obj: Object) -> None:
        self._region, self._view = context.region, context.region_data
        self._obj = obj
        surface = mesh_surface(field_mesh(obj), cache=BAKE_CACHE)
        self._surface = BrushSurface(obj, context.evaluated_depsgraph_get(), surface)

    def place(self, mouse: tuple[float, float]) -> np.ndarray | None:
        """Return the point under the mouse on the object's original mesh, (3,) float32 in object space.

        `mouse` is in pixels from the lower left corner of the region. Return None if the object is not under
        the mouse.
        """
        origin = view3d_utils.region_2d_to_origin_3d(self._region, self._view, mouse)
        direction = view3d_utils.region_2d_to_vector_3d(self._region, self._view, mouse)
        return self._surface.cast_ray(origin, direction)

    def radius(self, place: np.ndarray, pixels: float) -> float:
        """Return the length in object space of a number of pixels at `place`, a point in object space."""
        world = self._obj.matrix_world @ Vector(place.tolist())
        x, y = self._region.width / 2, self._region.height / 2
        start, end = (
            view3d_utils.region_2d_to_location_3d(self._region, self._view, position, world)
            for position in ((x, y), (x + 1, y))
        )
        return pixels * (end - start).length / (self._obj.matrix_world.median_scale or 1.0)

    def dashes(self, place: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
        """Return short line segments along the field around a point.

        Parameters
        ----------
        place : (3,) ndarray
            Center of the brush: a point of the original mesh, object space.
        radius : float
            Radius of the brush, object space.

        Returns
        -------
        ends : (K, 2, 3) float64 ndarray
            The two ends of each segment in world space.
        is_guided : (K,) bool ndarray
            Whether a firm guide determines the field at each segment.
        """
        mesh = field_mesh(self._obj)
        if not is_face_vector_field(mesh):
            return np.empty((0, 2, 3)), np.empty(0, dtype=bool)
        vectors = read_attribute(mesh, attribute_name(mesh), np.float32, 3)
        ends, face = self._surface.dashes(vectors, field_degree(mesh), place, radius)
        is_guided = np.zeros(len(face), dtype=bool)
        if is_face_vector_field(mesh, GUIDE_ATTRIBUTE):
            guides = read_attribute(mesh, GUIDE_ATTRIBUTE, np.float32, 3)
            is_guided = np.linalg.norm(guides[face], axis=1) > STROKE_FIRMNESS
        return to_world(self._obj, ends), is_guided


#: The `BrushMouse` that was created last, after the name of its object and the pointer of its region.
_current: tuple[tuple[str, int], BrushMouse] | None = None

#: Whether `_current` is kept although the mesh changes, because a stroke is being drawn.
_is_held = False


def current_mouse(context: Context, obj: Object, *, holds: bool = False) -> BrushMouse:
    """Return the `BrushMouse` of an object in the region of the context.

    It is kept until the scene changes or another object or region is requested. If `holds` is true, a new one is
    created, and is kept until `release_mouse`, whatever changes.
    """
    global _current, _is_held
    key = obj.name, context.region.as_pointer()
    if holds or _current is None or (_current[0] != key and not _is_held):
        _current = key, BrushMouse(context, obj)
        add_handlers(_HANDLERS)
    _is_held |= holds
    return _current[1]


def release_mouse(*_: Any) -> None:
    """Discard the current `BrushMouse`. Blender also calls this before it loads a file or undoes a step."""
    global _current, _is_held
    _current, _is_held = None, False


def unregister() -> None:
    """Discard the current `BrushMouse`, and remove the handlers."""
    release_mouse()
    remove_handlers(_HANDLERS)


def _after_change(*_: Any) -> None:
    """Discard the current `BrushMouse` after a change of the scene, unless it is held."""
    if not _is_held:
        release_mouse()


#: Handlers of Blender's events, by the names of their lists in `bpy.app.handlers`.
_HANDLERS = {
    "depsgraph_update_post": _after_change,
    **dict.fromkeys(("load_pre", "undo_pre", "redo_pre"), release_mouse),
}

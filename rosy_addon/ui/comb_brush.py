"""The tool *Comb Field* of the 3D view: its cursor, its settings, and places under the mouse."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy_extras.view3d_utils import (
    region_2d_to_location_3d,
    region_2d_to_origin_3d,
    region_2d_to_vector_3d,
)
from gpu_extras.presets import draw_circle_2d
from mathutils import Vector

from ..core.cache import BAKE_CACHE
from ..core.errors import RosyError
from ..scene.brush_surface import BrushSurface
from ..scene.field_attributes import attribute_name, field_degree, has_field, is_face_vector_field
from ..scene.guides import GUIDE_ATTRIBUTE, STROKE_FIRMNESS
from ..scene.meshes import mesh_surface, read_attribute
from ..viewport import session
from .view_lines import draw_lines, to_pixels

#: Color of the cursor, and those of dashes on faces without and with a firm guide.
CURSOR_COLOR = (1.0, 1.0, 1.0, 0.8)
FREE_COLOR, GUIDED_COLOR = (0.85, 0.85, 0.85, 0.9), (1.0, 0.55, 0.15, 1.0)

#: Width of the dashes in pixels.
DASH_WIDTH = 1.5


class BrushMouse:
    """Finds places on an object under the mouse, in a region of a 3D view."""

    def __init__(self, context: bpy.types.Context, obj: bpy.types.Object) -> None:
        self._region, self._view = context.region, context.region_data
        self._obj = obj
        surface = mesh_surface(obj.data, cache=BAKE_CACHE)
        self._surface = BrushSurface(obj, context.evaluated_depsgraph_get(), surface)

    def place(self, mouse: tuple[float, float]) -> np.ndarray | None:
        """Return the place at rest, (3,) float32 in object space; None beside the object."""
        origin = region_2d_to_origin_3d(self._region, self._view, mouse)
        direction = region_2d_to_vector_3d(self._region, self._view, mouse)
        return self._surface.cast_ray(origin, direction)

    def radius(self, place: np.ndarray, pixels: float) -> float:
        """Return a length of pixels at a place, in object space."""
        world = self._obj.matrix_world @ Vector(place.tolist())
        center = self._region.width / 2, self._region.height / 2
        beside = center[0] + 1, center[1]
        ends = [
            region_2d_to_location_3d(self._region, self._view, end, world)
            for end in (center, beside)
        ]
        scale = self._obj.matrix_world.median_scale or 1.0
        return pixels * (ends[1] - ends[0]).length / scale

    def dashes(self, place: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
        """Return short lines along the field around a place.

        Returns
        -------
        ends : (K, 2, 2) float64 ndarray
            Positions in the region.
        is_guided : (K,) bool ndarray
            Whether there is a firm guide.
        """
        mesh = self._obj.data
        if not is_face_vector_field(mesh):
            return np.empty((0, 2, 2)), np.empty(0, dtype=bool)
        vectors = read_attribute(mesh, attribute_name(mesh), np.float32, 3)
        ends, face = self._surface.dashes(vectors, field_degree(mesh), place, radius)
        is_guided = np.zeros(len(face), dtype=bool)
        if is_face_vector_field(mesh, GUIDE_ATTRIBUTE):
            guides = read_attribute(mesh, GUIDE_ATTRIBUTE, np.float32, 3)
            is_guided = np.linalg.norm(guides[face], axis=1) > STROKE_FIRMNESS
        matrix = np.array(self._obj.matrix_world)
        world = ends @ matrix[:3, :3].T + matrix[:3, 3]
        pixels = to_pixels(self._region, self._view, world)
        is_visible = np.isfinite(pixels).all(axis=(1, 2))
        return pixels[is_visible], is_guided[is_visible]


class _Cursor:
    """What the cursor of the tool keeps between redraws."""

    def __init__(self) -> None:
        self.mouse: BrushMouse | None = None
        self.key: tuple[Any, ...] = ()
        self.is_held = False

    def mouse_of(self, context: bpy.types.Context, obj: bpy.types.Object) -> BrushMouse:
        """Return the places on an object in the region of the context, read again after each change."""
        key = obj.name, context.region.as_pointer()
        if self.mouse is None or (self.key != key and not self.is_held):
            self.hold(context, obj, False)
        return self.mouse

    def hold(
        self, context: bpy.types.Context, obj: bpy.types.Object, is_held: bool = True
    ) -> BrushMouse:
        """Read the places on an object. If they are held, they stay until `release`."""
        self.mouse, self.is_held = BrushMouse(context, obj), is_held
        self.key = obj.name, context.region.as_pointer()
        for handlers, handler in _app_handlers():
            if handler not in handlers:
                handlers.append(handler)
        return self.mouse

    def release(self) -> None:
        """Forget the places on the object."""
        self.mouse, self.is_held = None, False


#: Emptied by `unregister`.
CURSOR = _Cursor()


def unregister() -> None:
    """Forget the object, and stop watching for changes."""
    CURSOR.release()
    for handlers, handler in _app_handlers():
        if handler in handlers:
            handlers.remove(handler)


def _app_handlers() -> list[tuple[Any, Any]]:
    """Return the lists of application handlers, and the handler that belongs in each."""
    handlers = bpy.app.handlers
    return [
        (handlers.depsgraph_update_post, _after_change),
        (handlers.load_pre, _before_other_data),
        (handlers.undo_pre, _before_other_data),
        (handlers.redo_pre, _before_other_data),
    ]


def _after_change(*_: Any) -> None:
    """Read the object again at the next redraw of the cursor."""
    if not CURSOR.is_held:
        CURSOR.release()


def _before_other_data(*_: Any) -> None:
    """Forget the object, which will not exist any more."""
    CURSOR.release()


def draw_settings(layout: bpy.types.UILayout, settings: Any) -> None:
    """Draw the settings that the operator and the tool share."""
    layout.prop(settings, "exact")
    layout.prop(settings, "reach")
    layout.prop(settings, "front_faces")
    layout.row(heading="Mirror").prop(settings, "mirror", toggle=True, text="")


class CombTool:
    """The tool in all modes."""

    bl_space_type = "VIEW_3D"
    bl_label = "Comb Field"
    bl_description = (
        "Drag along the surface to turn the field.\nCtrl: erase guides. Shift: smooth them. F, Shift F: radius and "
        "strength"
    )
    bl_icon = str(Path(__file__).parent / "icons" / "comb")  # Blender adds .dat
    bl_keymap = (
        ("rosy.field_comb", {"type": "LEFTMOUSE", "value": "PRESS"}, None),
        (
            "rosy.field_comb",
            {"type": "LEFTMOUSE", "value": "PRESS", "ctrl": True},
            {"properties": [("effect", "ERASE")]},
        ),
        (
            "rosy.field_comb",
            {"type": "LEFTMOUSE", "value": "PRESS", "shift": True},
            {"properties": [("effect", "SMOOTH")]},
        ),
        (
            "wm.radial_control",
            {"type": "F", "value": "PRESS"},
            {"properties": [("data_path_primary", "scene.rosy.comb.size")]},
        ),
        (
            "wm.radial_control",
            {"type": "F", "value": "PRESS", "shift": True},
            {"properties": [("data_path_primary", "scene.rosy.comb.strength")]},
        ),
    )

    # Blender calls both without an instance.
    @staticmethod
    def draw_settings(
        context: bpy.types.Context, layout: bpy.types.UILayout, tool: bpy.types.WorkSpaceTool
    ) -> None:
        comb = context.scene.rosy.comb
        layout.prop(comb, "size")
        layout.prop(comb, "strength", slider=True)
        draw_settings(layout, tool.operator_properties("rosy.field_comb"))

    @staticmethod
    def draw_cursor(
        context: bpy.types.Context, tool: bpy.types.WorkSpaceTool, mouse: tuple[int, int]
    ) -> None:
        """Draw the circle of the brush and, without a live view, the field around it."""
        comb = context.scene.rosy.comb
        draw_circle_2d(mouse, CURSOR_COLOR, comb.size, segments=64)
        obj, region = context.view_layer.objects.active, context.region
        if obj is None or not has_field(obj) or session.is_live(context.space_data):
            return
        with suppress(RosyError):  # combing reports it
            places = CURSOR.mouse_of(context, obj)
            place = places.place((mouse[0] - region.x, mouse[1] - region.y))
            if place is not None:
                ends, is_guided = places.dashes(place, 1.5 * places.radius(place, comb.size))
                ends = ends + (region.x, region.y)
                width = DASH_WIDTH * context.preferences.system.ui_scale
                for chosen, color in ((~is_guided, FREE_COLOR), (is_guided, GUIDED_COLOR)):
                    draw_lines("LINES", ends[chosen].reshape(-1, 2), color, width)


class VIEW3D_TOOL_rosy_comb(CombTool, bpy.types.WorkSpaceTool):
    """Comb a field in Object Mode"""

    bl_context_mode = "OBJECT"
    bl_idname = "rosy.comb_tool"


class VIEW3D_TOOL_rosy_comb_sculpt(CombTool, bpy.types.WorkSpaceTool):
    """Comb a field in Sculpt Mode"""

    bl_context_mode = "SCULPT"
    bl_idname = "rosy.comb_sculpt_tool"

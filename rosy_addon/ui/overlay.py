"""Singularities in the 3D view: dots coloured by sign, with their indices beside them.

Drawing hangs on handlers that are there only while something is shown, so that it costs nothing
when off. What is shown was found once and follows its object, not changes of the mesh.
"""

from __future__ import annotations

from typing import Any

import blf
import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ..live import redraw
from ..scene.singular import Singular

#: By the sign of the index: orange turns with the way around, blue against it. Linear light.
COLOURS = {1: (1.0, 0.32, 0.05, 1.0), -1: (0.05, 0.35, 1.0, 1.0)}
RIM = (0.02, 0.02, 0.02, 1.0)

#: Diameter of a dot in pixels, without its rim of two.
DOT = 9.0

#: Sides of the polygon that passes for a disc.
SIDES = 20

#: How far dots are lifted off the surface, as a share of the object's size, not to sink into it.
LIFT = 0.004

#: More labels than these would hide what they are about.
MOST_LABELS = 250

_shown: dict[str, Singular] = {}
_handlers: list[Any] = []


def show(name: str, found: Singular) -> None:
    """Show the singularities of the object of a name, in place of what was shown of it."""
    _shown[name] = found
    if _forget not in bpy.app.handlers.load_pre:
        bpy.app.handlers.load_pre.append(_forget)
    if not _handlers and not bpy.app.background:
        add = bpy.types.SpaceView3D.draw_handler_add
        _handlers.append(add(_draw_dots, (), "WINDOW", "POST_VIEW"))
        _handlers.append(add(_draw_labels, (), "WINDOW", "POST_PIXEL"))
    redraw()


def hide(name: str | None = None) -> None:
    """Hide those of an object, or all."""
    if name is None:
        _shown.clear()
    _shown.pop(name, None)
    if not _shown:
        if _forget in bpy.app.handlers.load_pre:
            bpy.app.handlers.load_pre.remove(_forget)
        while _handlers:
            bpy.types.SpaceView3D.draw_handler_remove(_handlers.pop(), "WINDOW")
    redraw()


def _forget(*_: Any) -> None:
    """Another file has other objects, which may have the same names."""
    hide()


def is_shown(name: str) -> bool:
    """Whether those of an object are shown."""
    return name in _shown


def index_text(index: int, degree: int) -> str:
    """An index in units of 1 / N as users read it: +1/4, -1, +3/2."""
    over = int(np.gcd(index, degree))
    top, bottom = index // over, degree // over
    return f"{top:+d}" if bottom == 1 else f"{top:+d}/{bottom}"


def _visible() -> list[tuple[bpy.types.Object, Singular]]:
    """What this view shows. Objects that are gone, or were renamed, are passed over."""
    layer = bpy.context.view_layer
    things = ((layer.objects.get(name), found) for name, found in _shown.items())
    return [(thing, found) for thing, found in things if thing is not None and thing.visible_get()]


def _draw_dots() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.depth_test_set("LESS_EQUAL")
    scale = context.preferences.system.ui_scale
    for thing, found in _visible():
        lifted = _lifted(thing, found)
        for sign, colour in COLOURS.items():
            points = lifted[np.sign(found.index) == sign]
            # The rim first, and a little behind.
            for radius, nearer, ink in ((DOT / 2 + 2, DOT / 2, RIM), (DOT / 2, DOT, colour)):
                corners = _discs(context, points, radius * scale, nearer)
                shader.uniform_float("color", ink)
                batch_for_shader(shader, "TRIS", {"pos": corners}).draw(shader)
    gpu.state.depth_test_set("NONE")


def _discs(
    context: bpy.types.Context, points: np.ndarray, radius: float, nearer: float
) -> np.ndarray:
    """(n, 3) corners of triangles that make up a disc at each point, facing the eye.

    `radius` and `nearer`, by how much they come nearer to the eye, are in pixels.
    """
    view, window = context.region_data, context.region
    eye = np.array(view.view_matrix.inverted())
    right, up, back = eye[:3, 0], eye[:3, 1], eye[:3, 2]
    depth = np.ones(len(points))
    if view.is_perspective:
        depth = (eye[:3, 3] - points) @ back
    pixel = (depth * (2 / (view.window_matrix[0][0] * window.width)))[:, None, None]
    turn = np.linspace(0, 2 * np.pi, SIDES + 1)
    rim = np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * up
    fan = np.stack([np.zeros((SIDES, 3)), rim[:-1], rim[1:]], axis=1).reshape(-1, 3)
    corners = points[:, None] + pixel * (radius * fan + nearer * back)
    return corners.reshape(-1, 3).astype(np.float32)


def _draw_labels() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays or not context.space_data.overlay.show_text:
        return
    scale = context.preferences.system.ui_scale
    font = 0
    blf.size(font, 12 * scale)
    blf.color(font, 1.0, 1.0, 1.0, 1.0)
    blf.enable(font, blf.SHADOW)
    blf.shadow(font, 5, 0.0, 0.0, 0.0, 1.0)
    for thing, found in _visible():
        if len(found) > MOST_LABELS:
            continue
        for point, index in zip(_lifted(thing, found), found.index.tolist(), strict=True):
            place = location_3d_to_region_2d(context.region, context.region_data, Vector(point))
            if place is not None and not _is_hidden(context, Vector(point)):
                blf.position(font, place.x + 8 * scale, place.y + 5 * scale, 0)
                blf.draw(font, index_text(index, found.degree))
    blf.disable(font, blf.SHADOW)


def _is_hidden(context: bpy.types.Context, point: Vector) -> bool:
    """Whether something is between a point and the eye."""
    eye = context.region_data.view_matrix.inverted()
    toward = eye.translation - point if context.region_data.is_perspective else eye.col[2].xyz
    return context.scene.ray_cast(context.view_layer.depsgraph, point, toward.normalized())[0]


def _lifted(thing: bpy.types.Object, found: Singular) -> np.ndarray:
    """(K, 3) places in the world, a little off the surface."""
    matrix = np.array(thing.matrix_world)
    lift = LIFT * max(thing.dimensions)
    size = np.cbrt(abs(np.linalg.det(matrix[:3, :3]))) or 1.0
    raised = found.points + found.normals * (lift / size)
    return raised @ matrix[:3, :3].T + matrix[:3, 3]

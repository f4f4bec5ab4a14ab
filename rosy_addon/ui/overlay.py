"""The overlay of singularities in the 3D view: dots colored by sign, labeled with their indices.

Draw handlers exist only while something is shown. Singularities are computed when they are switched on, when
a field is stored, and after an undo. So the dots move with the object, but do not follow other changes of the
mesh.
"""

from collections.abc import Callable, Container
from typing import Any

import bpy
import numpy as np

from ..core.errors import RosyError
from ..projection.rest_coordinates import matrix_scale
from ..scene.app_handlers import add_handlers, remove_handlers
from ..scene.datablocks import field_mesh
from ..scene.singularity_points import (
    Singularities,
    read_editable_singularities,
    read_singularities,
)
from ..viewport.overlays import SingularityDots, draw_dots, draw_labels
from ..viewport.view3d import redraw, to_world

#: Diameter in pixels of the dot of a singularity of index 1 / N, without its outline, at a resolution scale
#: of 1.
DOT_DIAMETER = 9.0

#: Distance of dots from the surface, as a fraction of the size of the object. It avoids z-fighting.
SURFACE_OFFSET = 0.004


#: The singularities that are shown, by the session UIDs of their objects.
_SINGULARITIES: dict[int, Singularities] = {}

#: The tools whose handles are shown, by the session UIDs of the objects. Handles are hidden without the tool.
_TOOLS: dict[int, str] = {}

#: The draw handlers, while something is shown.
DRAW_HANDLERS: list[Any] = []


def show(obj: bpy.types.Object, singularities: Singularities, tool: str = "") -> None:
    """Show the singularities of an object, in place of those shown before.

    If `tool` is the identifier of a tool, they are shown only while this tool is active.
    """
    _SINGULARITIES[obj.session_uid], _TOOLS[obj.session_uid] = singularities, tool
    add_handlers(_APP_HANDLERS)
    if not DRAW_HANDLERS and not bpy.app.background:
        add = bpy.types.SpaceView3D.draw_handler_add
        DRAW_HANDLERS.append(add(_draw, (draw_dots, False), "WINDOW", "POST_VIEW"))
        DRAW_HANDLERS.append(add(_draw, (draw_labels, True), "WINDOW", "POST_PIXEL"))
    redraw()


def hide(obj: bpy.types.Object | None = None) -> None:
    """Hide the singularities of an object, or of all objects if it is None. Forget those of deleted objects."""
    kept = () if obj is None else {other.session_uid for other in bpy.data.objects if other != obj}
    for uid in _SINGULARITIES.keys() - kept:
        del _SINGULARITIES[uid], _TOOLS[uid]
    if not _SINGULARITIES:
        remove_handlers(_APP_HANDLERS)
        while DRAW_HANDLERS:
            bpy.types.SpaceView3D.draw_handler_remove(DRAW_HANDLERS.pop(), "WINDOW")
    redraw()


def refresh(context: bpy.types.Context, meshes: Container[bpy.types.Mesh]) -> None:
    """Compute shown singularities again, on all objects whose mesh is one of `meshes`.

    If they cannot be computed, for example because a modifier loses the field, they are hidden.
    """
    for obj in context.view_layer.objects:
        shown_before = _SINGULARITIES.get(obj.session_uid)
        if shown_before is None or field_mesh(obj) not in meshes:
            continue
        read = read_singularities if shown_before.vertex is None else read_editable_singularities
        try:
            singularities = read(obj, context.evaluated_depsgraph_get())
            show(obj, singularities, _TOOLS[obj.session_uid])
        except RosyError:
            hide(obj)


def _read_again(*_: Any) -> None:
    """Compute all shown singularities again after an undo or redo, which may have changed the fields."""
    context = bpy.context
    refresh(context, {field_mesh(obj) for obj in context.view_layer.objects if obj.type == "MESH"})


#: Handlers of Blender's events while something is shown, by the names of their lists in `bpy.app.handlers`.
_APP_HANDLERS = dict.fromkeys(("undo_post", "redo_post"), _read_again)
_APP_HANDLERS["load_pre"] = lambda *_: hide()


def shown(obj: bpy.types.Object) -> Singularities | None:
    """Return the shown singularities of an object; None if they are not shown."""
    tool = _TOOLS.get(obj.session_uid)
    return None if tool and not _is_active(tool) else _SINGULARITIES.get(obj.session_uid)


def _is_active(tool: str) -> bool:
    """Return whether a tool of 3D views is active in the present mode."""
    context = bpy.context
    active = context.workspace and context.workspace.tools.from_space_view3d_mode(context.mode)
    return bool(active) and active.idname == tool


def _all_dots() -> list[SingularityDots]:
    """Return the dots of each visible object."""
    return [
        SingularityDots(
            offset_points(obj, singularities), singularities.index, singularities.degree
        )
        for obj in bpy.context.view_layer.objects
        if (singularities := shown(obj)) is not None and obj.visible_get()
    ]


def _draw(draw: Callable[..., None], is_text: bool) -> None:
    """Draw the dots, or their labels, if the current 3D view shows overlays of this kind."""
    context, settings = bpy.context, bpy.context.space_data.overlay
    if settings.show_overlays and (settings.show_text or not is_text):
        draw(context, _all_dots(), DOT_DIAMETER * context.preferences.system.ui_scale)


def offset_points(obj: bpy.types.Object, singularities: Singularities) -> np.ndarray:
    """Return (K, 3) positions of the dots of singularities in world space, slightly above the surface."""
    offset = SURFACE_OFFSET * max(obj.dimensions)
    scale = matrix_scale(obj.matrix_world)
    points = singularities.points + singularities.normals * (offset / scale)
    return to_world(obj, points)

"""The tool *Field Singularities* of the 3D view: its handles, and dragging one of them along the surface.

The handles are the dots of the overlay. Operators change the field.
"""

from contextlib import suppress
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy.types import Context, Object, Region, SpaceView3D, UILayout, WorkSpaceTool
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d

from ..core.errors import RosyError
from ..scene.datablocks import field_mesh
from ..scene.field_attributes import has_field
from ..scene.meshes import vertex_positions
from ..scene.singularity_points import mesh_of_own_vertices, read_editable_singularities
from ..viewport.overlays import is_occluded
from ..viewport.view3d import redraw, to_world
from . import overlay
from .comb_brush import key_press
from .view_lines import draw_lines, to_pixels

#: Largest distance in pixels between the mouse and a handle that is grabbed.
GRAB_DISTANCE = 16.0

#: Radius and line width in pixels, and color, of the ring around the target vertex of a drag.
RING_RADIUS, LINE_WIDTH = 9.0, 2.0
RING_COLOR = (1.0, 1.0, 1.0, 1.0)

#: Number of sides of the polygon that approximates the ring.
RING_SEGMENTS = 24


class Drag:
    """A drag of a singularity with the mouse, which is drawn over the view.

    Attributes
    ----------
    source : int
        Vertex where the drag has started.
    target : int or None
        Vertex nearest to the surface point under the mouse. None if the mouse is not over the object.
    """

    def __init__(self, obj: Object, source: int, region: Region) -> None:
        self.source = source
        self.target: int | None = None
        self._obj = obj
        self._region = region
        #: Points of the line in world space: the drawing does not need the object, which may be deleted.
        self._ends = to_world(obj, _own_points(bpy.context, obj)[[source]])
        add = SpaceView3D.draw_handler_add
        self._handler: Any = add(self._draw, (), "WINDOW", "POST_PIXEL")

    def move(self, context: Context, mouse: tuple[float, float]) -> None:
        """Find the target vertex for a new position of the mouse, in region pixels. Redraw the view."""
        points = _own_points(context, self._obj)
        self.target = _vertex_under(context, self._obj, points, mouse)
        vertices = [self.source] if self.target is None else [self.source, self.target]
        self._ends = to_world(self._obj, points[vertices])
        redraw()

    def stop(self) -> None:
        """Remove the drawing of the drag from the view. Later calls have no effect."""
        if self._handler is not None:
            SpaceView3D.draw_handler_remove(self._handler, "WINDOW")
            self._handler = None
            redraw()

    def _draw(self) -> None:
        context = bpy.context
        if context.region != self._region:
            return
        points = to_pixels(context.region, context.region_data, self._ends)
        angle = np.linspace(0, 2 * np.pi, RING_SEGMENTS + 1)
        ring = RING_RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        scale = context.preferences.system.ui_scale
        for line in (points[-1] + scale * ring, points):
            if np.isfinite(line).all():
                draw_lines("LINE_STRIP", line, RING_COLOR, LINE_WIDTH * scale)


def start_drag(
    context: Context, obj: Object, mouse: tuple[float, float], from_any_vertex: bool
) -> Drag | None:
    """Start to drag the handle under the mouse (or with `from_any_vertex` the vertex under the mouse).

    `mouse` is in pixels of the region. Return None if there is no handle or vertex under it.

    Raises
    ------
    RosyError
        If the field cannot be read.
    """
    show_handles(context, obj)
    if from_any_vertex:
        source = _vertex_under(context, obj, _own_points(context, obj), mouse)
    else:
        source = _handle_under(context, obj, mouse)
    return None if source is None else Drag(obj, source, context.region)


def show_handles(context: Context, obj: Object) -> None:
    """Show the singularities of the original mesh (without modifiers), unless the overlay shows them already.

    Only these can be edited. The evaluated mesh may have others.

    Raises
    ------
    RosyError
        If the field cannot be read.
    """
    shown = overlay.shown(obj)
    if shown is None or shown.vertex is None:
        depsgraph = context.evaluated_depsgraph_get()
        tool = VIEW3D_TOOL_rosy_singularities.bl_idname if shown is None else ""
        overlay.show(obj, read_editable_singularities(obj, depsgraph), tool)


def _own_points(context: Context, obj: Object) -> np.ndarray:
    """Return the (V, 3) vertices of an object's original mesh, moved by its modifiers, in object space.

    Vertices that modifiers add are left out.
    """
    evaluated = obj.evaluated_get(context.evaluated_depsgraph_get())
    return vertex_positions(mesh_of_own_vertices(obj, evaluated.data))[
        : len(field_mesh(obj).vertices)
    ]


def _vertex_under(
    context: Context, obj: Object, points: np.ndarray, mouse: tuple[float, float]
) -> int | None:
    """Return the vertex (an index into `points`) nearest to the surface point under the mouse.

    `points` is the result of `_own_points`, and `mouse` is in pixels of the region. None if the mouse is not
    over the object.
    """
    region, view = context.region, context.region_data
    to_object = obj.matrix_world.inverted_safe()
    origin = to_object @ region_2d_to_origin_3d(region, view, mouse)
    toward = to_object.to_3x3() @ region_2d_to_vector_3d(region, view, mouse)
    evaluated = obj.evaluated_get(context.evaluated_depsgraph_get())
    is_hit, location, _, _ = evaluated.ray_cast(origin, toward)
    if not is_hit:
        return None
    return int(np.square(points - np.array(location, np.float32)).sum(axis=1).argmin())


def _handle_under(context: Context, obj: Object, mouse: tuple[float, float]) -> int | None:
    """Return the vertex of the visible handle nearest to the mouse. None if no handle is near enough.

    The vertex is an index into the original mesh. `mouse` is in pixels of the region.
    """
    shown = overlay.shown(obj)
    assert shown is not None and shown.vertex is not None
    points = overlay.offset_points(obj, shown)
    pixels = to_pixels(context.region, context.region_data, points)
    distance = np.linalg.norm(pixels - np.array(mouse), axis=1)
    reach = GRAB_DISTANCE * context.preferences.system.ui_scale
    for position in np.argsort(distance):
        if not distance[position] <= reach:
            break
        if not is_occluded(context, points[position]):
            return int(shown.vertex[position])
    return None


class VIEW3D_TOOL_rosy_singularities(WorkSpaceTool):
    """Move the singularities of a field"""

    bl_space_type = "VIEW_3D"
    bl_context_mode = "OBJECT"
    bl_idname = "rosy.singularities_tool"
    bl_label = "Field Singularities"
    bl_description = (
        "Drag a singularity of the field along the surface, or onto another one to merge them.\n"
        "Ctrl: drag a new pair apart"
    )
    bl_icon = str(Path(__file__).parent / "icons" / "singularities")  # Blender adds .dat
    bl_keymap = (
        key_press("rosy.drag_singularity"),
        key_press("rosy.drag_singularity", "ctrl", make_pair=True),
        # A drag that starts beside the singularities selects. Blender's own keymap would move the object.
        ("view3d.select_box", {"type": "LEFTMOUSE", "value": "CLICK_DRAG"}, None),
    )

    # Blender calls both functions without an instance, so they are static.
    @staticmethod
    def draw_settings(context: Context, layout: UILayout, tool: WorkSpaceTool) -> None:
        properties = tool.operator_properties("rosy.drag_singularity")
        layout.prop(properties, "reach")

    @staticmethod
    def draw_cursor(context: Context, tool: WorkSpaceTool, mouse: tuple[int, int]) -> None:
        """Show the handles while the tool is active."""
        obj = context.view_layer.objects.active
        if obj is not None and has_field(obj):
            with suppress(RosyError):  # the operator reports the error when the user drags
                show_handles(context, obj)

"""Queries about Blender's 3D views, and redraws."""

import bpy
import numpy as np
from bpy.types import Area, Context, Depsgraph, Object, RegionView3D, SpaceView3D

from ..compositor.look import Look
from ..core.errors import RosyError
from ..projection.camera import Camera
from ..rendering.view_input import Background
from ..scene.camera_planes import frame_corners
from ..scene.cameras import camera_of_object
from ..scene.look_properties import backdrop_color

#: A clip plane (x, y, z, w) that cuts nothing away.
_NO_CLIP_PLANE = 0.0, 0.0, 0.0, 1.0


def to_world(obj: Object, points: np.ndarray) -> np.ndarray:
    """Transform (..., 3) points from the object space of an object to world space."""
    matrix = np.array(obj.matrix_world)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def open_view3d_spaces() -> list[SpaceView3D]:
    """Return the 3D views of all screens, shown or not."""
    return [
        space
        for screen in bpy.data.screens
        for area in screen.areas
        for space in area.spaces
        if space.type == "VIEW_3D"
    ]


def shown_areas() -> list[Area]:
    """Return the areas of all windows that show a 3D view."""
    screens = [window.screen for window in bpy.context.window_manager.windows]
    return [area for screen in screens for area in screen.areas if area.type == "VIEW_3D"]


def redraw(spaces: set[int] | None = None) -> None:
    """Tag 3D views for a redraw.

    Parameters
    ----------
    spaces : set of int, optional
        Pointers of the `SpaceView3D` to redraw. By default, all visible views are redrawn.
    """
    for area in shown_areas():
        if spaces is None or area.spaces.active.as_pointer() in spaces:
            area.tag_redraw()


def redraw_sidebars() -> None:
    """Tag the sidebars of all 3D views for a redraw."""
    for area in shown_areas():
        for region in area.regions:
            if region.type == "UI":
                region.tag_redraw()


def is_timeline_playing() -> bool:
    """Return whether Blender plays an animation in one of its windows."""
    windows = bpy.context.window_manager.windows
    return any(window.screen.is_animation_playing for window in windows)


def is_visible(obj: Object, depsgraph: Depsgraph, space: SpaceView3D) -> bool:
    """Return whether a view shows an object as a surface."""
    try:
        # In some versions of Blender only the evaluated object knows which local views it is in.
        evaluated = obj.evaluated_get(depsgraph)
        is_solid = obj.display_type not in {"BOUNDS", "WIRE"}
        return is_solid and evaluated.visible_in_viewport_get(space)
    except ReferenceError:
        return False


def clip_planes(region_3d: RegionView3D) -> np.ndarray | None:
    """Return the planes of a view's clipping region, or None if it has none.

    Returns
    -------
    (6, 4) float64 ndarray or None
        World space. The negative side of each plane is cut away.
    """
    if not region_3d.use_clip_planes:
        return None
    planes = np.array([tuple(plane) for plane in region_3d.clip_planes], dtype=np.float64)
    planes[~planes.any(axis=1)] = _NO_CLIP_PLANE
    return planes


def view_background(context: Context, camera: Camera, look: Look) -> Background | None:
    """Return the background of a view in the color of the paper.

    Return None if there is no backdrop; see `backdrop_color`. In a camera view, the background fills only the
    frame of the camera.

    Parameters
    ----------
    context : bpy.types.Context
        Context of the region that is drawn.
    camera : Camera
        Camera of the view.
    look : Look
    """
    paper = backdrop_color(context.scene, look)
    if paper is None:
        return None
    color, frame = tuple(paper.tolist()), camera_frame(context, camera)
    return Background(color) if frame is None else Background(color, *frame)


def camera_frame(
    context: Context, camera: Camera
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return the lower left and the upper right corner of the frame of the camera in a camera view.

    They are in normalized device coordinates, -1 to 1. The result is None if the view is no camera view.
    `camera` is the camera of the view.
    """
    if context.region_data.view_perspective != "CAMERA":
        return None
    space = context.space_data
    camera_object = space.camera if space.use_local_camera else context.scene.camera
    try:
        frame = camera_of_object(context.scene, context.evaluated_depsgraph_get(), camera_object)
    except RosyError:
        return None  # a light, for example, has no frame
    corners = np.concatenate([frame_corners(frame, 1.0), np.ones((4, 1))], axis=1)
    clip = corners @ (camera.projection @ camera.view @ np.linalg.inv(frame.view)).T
    position = clip[:, :2] / clip[:, 3:]
    low, high = position.min(axis=0).tolist(), position.max(axis=0).tolist()
    return tuple(low), tuple(high)

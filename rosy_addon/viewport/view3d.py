"""Queries about Blender's 3D views, and redraws."""

from __future__ import annotations

import bpy
import numpy as np

#: A clip plane (x, y, z, w) that cuts nothing away.
_NO_CLIP_PLANE = 0.0, 0.0, 0.0, 1.0


def open_view3d_spaces() -> list[bpy.types.SpaceView3D]:
    """Return the 3D views of all screens, shown or not."""
    return [
        space
        for screen in bpy.data.screens
        for area in screen.areas
        for space in area.spaces
        if space.type == "VIEW_3D"
    ]


def redraw(spaces: set[int] | None = None) -> None:
    """Tag 3D views for a redraw.

    Parameters
    ----------
    spaces : set of int, optional
        Pointers of `SpaceView3D`; all visible views by default.
    """
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D" and (
                spaces is None or area.spaces.active.as_pointer() in spaces
            ):
                area.tag_redraw()


def redraw_sidebars() -> None:
    """Tag the sidebars of all 3D views for a redraw."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


def is_timeline_playing() -> bool:
    """Return whether Blender plays an animation in one of its windows."""
    windows = bpy.context.window_manager.windows
    return any(window.screen.is_animation_playing for window in windows)


def shows_surfaces(space: bpy.types.SpaceView3D) -> bool:
    """Return whether the shading of a view shows surfaces, unlike wireframe shading."""
    return space.shading.type in {"SOLID", "MATERIAL", "RENDERED"}


def is_visible(
    obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D
) -> bool:
    """Return whether a view shows an object as a surface."""
    try:
        # In some versions only the evaluated object knows which local views it is in.
        evaluated = obj.evaluated_get(depsgraph)
        is_solid = obj.display_type not in {"BOUNDS", "WIRE"}
        return is_solid and evaluated.visible_in_viewport_get(space)
    except ReferenceError:
        return False


def clip_planes(region_3d: bpy.types.RegionView3D) -> np.ndarray | None:
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

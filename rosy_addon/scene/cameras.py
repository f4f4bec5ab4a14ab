"""Blender's cameras and views as two matrices."""

from __future__ import annotations

import bpy
import numpy as np

from ..errors import RosyError
from ..projection.camera import Camera, check_size

#: What a picture from a 3D view is named after.
VIEW_NAME = "3D View"


def scene_cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """All cameras of a scene by name, the one that renders it last.

    Raises
    ------
    RosyError
        If there are none.
    """
    cameras = sorted(
        (thing for thing in scene.objects if thing.type == "CAMERA"),
        key=lambda thing: (thing == scene.camera, thing.name),
    )
    if not cameras:
        raise RosyError(f"scene '{scene.name}' has no camera")
    return cameras


def render_camera(scene: bpy.types.Scene) -> bpy.types.Object:
    """The camera that renders a scene.

    Raises
    ------
    RosyError
        If there is none.
    """
    if scene.camera is None:
        raise RosyError(f"scene '{scene.name}' has no active camera: add one, or choose one")
    return scene.camera


def frame_camera(scene: bpy.types.Scene, frame: int) -> bpy.types.Object:
    """The camera that renders a frame: that of the last marker bound to one, or the scene's.

    Raises
    ------
    RosyError
        If there is none.
    """
    bound = [marker for marker in scene.timeline_markers if marker.camera is not None]
    if not bound:
        return render_camera(scene)
    # As Blender chooses: the last one up to here, or else the first.
    passed = [marker for marker in bound if marker.frame <= frame]
    if passed:
        return max(passed, key=lambda marker: marker.frame).camera
    return min(bound, key=lambda marker: marker.frame).camera


def picture_size(scene: bpy.types.Scene, percentage: float | None = None) -> tuple[int, int]:
    """(width, height) in pixels: that of renders, in percent if given."""
    render = scene.render
    scale = render.resolution_percentage / 100 * (1 if percentage is None else percentage / 100)
    # As Blender rounds it: down.
    width, height = int(render.resolution_x * scale), int(render.resolution_y * scale)
    return check_size(max(width, 1), max(height, 1))


def camera_of_object(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    camera_object: bpy.types.Object,
    width: int | None = None,
    height: int | None = None,
) -> Camera:
    """What a camera of the scene sees.

    Parameters
    ----------
    scene : bpy.types.Scene
        Its pixel aspect counts, too.
    depsgraph : bpy.types.Depsgraph
    camera_object : bpy.types.Object
    width, height : int, optional
        Pixels; the size of renders if not given.

    Raises
    ------
    RosyError
        If it is not a camera, or a panoramic one, or the size is impossible.
    """
    name = camera_object.name
    if camera_object.type != "CAMERA":
        raise RosyError(f"object '{name}' is a {camera_object.type.lower()}, not a camera")
    kind = camera_object.data.type
    if kind not in ("PERSP", "ORTHO"):
        words = {"PANO": "panoramic", "CUSTOM": "custom"}.get(kind, kind.lower())
        raise RosyError(
            f"camera '{name}' is {words}: only perspective and orthographic ones can be drawn from"
        )
    if width is None or height is None:
        width, height = picture_size(scene)
    width, height = check_size(width, height)
    evaluated = camera_object.evaluated_get(depsgraph)
    projection = evaluated.calc_matrix_camera(
        depsgraph,
        x=width,
        y=height,
        scale_x=scene.render.pixel_aspect_x,
        scale_y=scene.render.pixel_aspect_y,
    )
    view = evaluated.matrix_world.normalized().inverted_safe()
    return Camera(np.array(view), np.array(projection), width, height, name)


def camera_of_view(
    region: bpy.types.Region,
    region_3d: bpy.types.RegionView3D,
    width: int | None = None,
    height: int | None = None,
) -> Camera:
    """What a 3D view sees.

    Parameters
    ----------
    region : bpy.types.Region
    region_3d : bpy.types.RegionView3D
    width, height : int, optional
        Pixels; the region's own if not given.
    """
    return Camera(
        np.array(region_3d.view_matrix),
        np.array(region_3d.window_matrix),
        region.width if width is None else width,
        region.height if height is None else height,
        VIEW_NAME,
    )

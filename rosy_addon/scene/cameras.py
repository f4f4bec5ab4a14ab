"""Convert the cameras and 3D views of Blender to `Camera`, and find the cameras of a scene."""

import numpy as np
from bpy.types import Depsgraph, Object, Region, RegionView3D, Scene

from ..core.errors import RosyError
from ..projection.camera import Camera, check_size
from .datablocks import check_object_type

#: Camera name of pictures that are drawn from a 3D view.
VIEW_NAME = "3D View"

#: Value of `RosyBake.view` for a sequence in which each frame was drawn from the camera that renders it.
FRAME_CAMERAS = "frame cameras"

#: The camera of a picture: a camera object of the scene, or a `Camera`, for example of a 3D view.
CameraSource = Object | Camera


def scene_cameras(scene: Scene) -> list[Object]:
    """Return all cameras of a scene, sorted by name. The active camera comes last.

    Raises
    ------
    RosyError
        If the scene has no camera.
    """
    cameras = [obj for obj in scene.objects if obj.type == "CAMERA"]
    if not cameras:
        raise RosyError(f"scene '{scene.name}' has no camera: add one")
    return sorted(cameras, key=lambda obj: (obj == scene.camera, obj.name))


def render_camera(scene: Scene) -> Object:
    """Return the active camera of a scene.

    Raises
    ------
    RosyError
        If the scene has no active camera.
    """
    if scene.camera is None:
        raise RosyError(f"scene '{scene.name}' has no active camera: add one, or choose one")
    return scene.camera


def frame_camera(scene: Scene, frame: int) -> Object:
    """Return the camera that renders a frame.

    Timeline markers may be bound to cameras. The last such marker at or before the frame decides. If all of
    them are later, the first one decides. Without such markers it is the active camera.

    Raises
    ------
    RosyError
        If there is neither a marker with a camera nor an active camera.
    """
    bound = [marker for marker in scene.timeline_markers if marker.camera is not None]
    if not bound:
        return render_camera(scene)
    # Blender chooses the camera in the same way.
    earlier = [marker for marker in bound if marker.frame <= frame]
    if earlier:
        return max(earlier, key=lambda marker: marker.frame).camera
    return min(bound, key=lambda marker: marker.frame).camera


def render_size(scene: Scene, percentage: float = 100.0) -> tuple[int, int]:
    """Return the (width, height) in pixels at which Blender renders a scene.

    Parameters
    ----------
    scene : bpy.types.Scene
    percentage : float
        Percentage by which the size is scaled, after the resolution percentage of the scene.
    """
    render = scene.render
    scale = render.resolution_percentage / 100 * (percentage / 100)
    # Round down, as Blender does.
    width, height = int(render.resolution_x * scale), int(render.resolution_y * scale)
    return check_size(max(width, 1), max(height, 1))


def camera_of_object(
    scene: Scene, depsgraph: Depsgraph, camera_object: Object, size: tuple[int, int] | None = None
) -> Camera:
    """Return the view and projection of a camera object as a `Camera`.

    Parameters
    ----------
    scene : bpy.types.Scene
        Its pixel aspect is used, and by default its render size (`render_size`).
    depsgraph : bpy.types.Depsgraph
    camera_object : bpy.types.Object
        A perspective or orthographic camera.
    size : (int, int), optional
        Width and height in pixels. By default `render_size`.

    Raises
    ------
    RosyError
        If the object is not a camera, the camera is neither perspective nor orthographic, or the
        size is out of range.
    """
    name = camera_object.name
    check_object_type(camera_object, "CAMERA")
    kind = camera_object.data.type
    if kind not in ("PERSP", "ORTHO"):
        kind = {"PANO": "panoramic"}.get(kind, kind.lower())
        raise RosyError(f"camera '{name}' is {kind}: choose a perspective or orthographic camera")
    width, height = render_size(scene) if size is None else check_size(*size)
    evaluated = camera_object.evaluated_get(depsgraph)
    aspect = {"scale_x": scene.render.pixel_aspect_x, "scale_y": scene.render.pixel_aspect_y}
    projection = evaluated.calc_matrix_camera(depsgraph, x=width, y=height, **aspect)
    view = evaluated.matrix_world.normalized().inverted_safe()
    return Camera(np.array(view), np.array(projection), width, height, name)


def resolve_camera(
    scene: Scene, depsgraph: Depsgraph, source: CameraSource, size: tuple[int, int] | None = None
) -> Camera:
    """Return the view and projection from which a picture is drawn, as a `Camera`.

    Parameters
    ----------
    scene : bpy.types.Scene
    depsgraph : bpy.types.Depsgraph
    source : bpy.types.Object or Camera
        A `Camera` is returned unchanged, with its own size. An object is converted by `camera_of_object`.
    size : (int, int), optional
        Width and height in pixels. By default `render_size`, scaled by the percentage that the user sets for
        pictures (``scene.rosy.percentage``).

    Raises
    ------
    RosyError
        See `camera_of_object`.
    """
    if isinstance(source, Camera):
        return source
    if size is None:
        size = render_size(scene, scene.rosy.percentage)
    return camera_of_object(scene, depsgraph, source, size)


def camera_of_view(region: Region, region_3d: RegionView3D) -> Camera:
    """Return the view and projection of a 3D view as a `Camera` named `VIEW_NAME`, of the region's size."""
    view, projection = np.array(region_3d.view_matrix), np.array(region_3d.window_matrix)
    return Camera(view, projection, region.width, region.height, VIEW_NAME)

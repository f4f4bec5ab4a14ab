"""Planes that only camera rays hit: backdrops behind all objects, in the color of the paper, and keys (legends)."""

from contextlib import suppress

import bpy
import numpy as np
from bpy.types import Material, Object, PropertyGroup, Scene
from mathutils import Matrix

from ..core.errors import RosyError
from ..projection.camera import Camera
from .cameras import FRAME_CAMERAS, camera_of_object
from .datablocks import Track, delete_owned, rollback_on_error
from .look_properties import backdrop_color, read_look
from .node_builder import new_emissive_material
from .picture_nodes import shown_materials
from .read_view import scene_depsgraph

#: Kinds of rays that pass through planes: all except camera rays.
HIDDEN_FROM = ("diffuse", "glossy", "transmission", "volume_scatter", "shadow")


def pictured_views(scene: Scene) -> list[tuple[Object, Camera, PropertyGroup]]:
    """Return the cameras from which pictures were baked, each as it is now and with the record of one of its pictures.

    If a camera has several pictures, one that objects show is preferred. An animation in which each frame is
    drawn from the camera that renders it counts as a picture of the active camera. A camera that was made panoramic
    after the bake, or sheared by a parent, is left out.
    """
    shown = {material for obj in scene.objects for material in shown_materials(obj)}
    cameras: dict[Object, PropertyGroup] = {}
    for record in scene.rosy.bakes:
        camera = scene.camera if record.view == FRAME_CAMERAS else record.camera
        is_camera = camera is not None and camera.type == "CAMERA"
        if is_camera and (camera not in cameras or record.material in shown):
            cameras[camera] = record
    views = []
    for camera, record in cameras.items():
        with suppress(RosyError):
            views.append((camera, camera_of_object(scene, scene_depsgraph(scene), camera), record))
    return views


def remove_camera_planes(scene: Scene, tag: str) -> None:
    """Delete the planes of a scene that have the custom property `tag`.

    Their meshes, materials and images are deleted as well if nothing else uses them.
    """
    images = []
    for obj in [obj for obj in scene.objects if obj.get(tag)]:
        mesh, materials = obj.data, [material for material in obj.data.materials if material]
        delete_owned(obj)
        if not mesh.users:
            delete_owned(mesh)
        for material in materials:
            if not material.users:
                nodes = material.node_tree.nodes
                images += [node.image for node in nodes if hasattr(node, "image")]
                delete_owned(material)
    for image in dict.fromkeys(images):
        if image is not None and not image.users:
            delete_owned(image)


def add_camera_plane(
    scene: Scene, camera: Object, tag: str, corners: np.ndarray, material: Material, track: Track
) -> Object:
    """Add a plane, parented to a camera, and return its object.

    Parameters
    ----------
    scene : bpy.types.Scene
    camera : bpy.types.Object
    tag : str
        Name of the custom property by which the new object is found again.
    corners : (4, 3) float ndarray
        Corners of the plane in camera space, counter-clockwise as seen from the camera.
    material : bpy.types.Material
        The new object has its name.
    track : function
        Called with each new datablock, which it returns; see `datablocks.rollback_on_error`.
    """
    mesh = track(bpy.data.meshes.new(material.name))
    mesh.from_pydata(corners.tolist(), [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    obj = track(bpy.data.objects.new(material.name, mesh))
    obj[tag] = True
    scene.collection.objects.link(obj)
    obj.parent = camera
    # A plane would inherit the scale of the camera, which does not change what the camera sees.
    scale = camera.matrix_world.to_scale()
    obj.matrix_parent_inverse = Matrix.Diagonal((*scale, 1.0)).inverted_safe()
    obj.hide_select = True
    for ray in HIDDEN_FROM:
        setattr(obj, f"visible_{ray}", False)
    return obj


def frame_corners(camera: Camera, distance: float, size: float = 1.0) -> np.ndarray:
    """Return the corners of the frame of a camera at a distance, counter-clockwise from the lower left.

    Parameters
    ----------
    camera : Camera
    distance : float
        Distance from the camera along its view direction, in Blender units.
    size : float
        Factor by which the frame is scaled about its center.

    Returns
    -------
    (4, 3) float64 ndarray
        Camera space. The camera looks along its negative z axis.
    """
    depth = camera.projection @ (0.0, 0.0, -distance, 1.0)
    signs = (-1, -1), (1, -1), (1, 1), (-1, 1)
    clip = [(size * x, size * y, depth[2] / depth[3], 1.0) for x, y in signs]
    corners = np.array(clip) @ np.linalg.inv(camera.projection).T
    return corners[:, :3] / corners[:, 3:]


#: Custom property that marks the objects of backdrops.
BACKDROP_TAG = "rosy_backdrop"

#: Distance of a backdrop from the camera, as a fraction of the distance of its far clip plane.
DISTANCE = 0.99

#: Size of a backdrop relative to the frame of the camera. It is larger than the frame, to fill it also after
#: small changes of the lens or of the render size.
OVERSIZE = 1.5


def update_backdrops(scene: Scene) -> None:
    """Replace the backdrops of a scene by the ones that its settings ask for.

    There is one backdrop for each of `pictured_views`. Its color is `backdrop_color`; without one there are none.
    """
    remove_camera_planes(scene, BACKDROP_TAG)
    paper = backdrop_color(scene, read_look(scene.rosy))
    if paper is not None:
        for camera, view, _ in pictured_views(scene):
            _add_backdrop(scene, camera, view, paper)


def _add_backdrop(scene: Scene, camera: Object, view: Camera, paper: np.ndarray) -> None:
    """Add a plane in a linear RGB color that fills the view of a camera, parented to it."""
    name = f"RoSy Backdrop {camera.name}"
    corners = frame_corners(view, DISTANCE * camera.data.clip_end, OVERSIZE)
    with rollback_on_error() as track:
        color = (*paper.tolist(), 1.0)
        material = track(new_emissive_material(name, color, scene.rosy.emission))
        material.diffuse_color = color  # in views with Solid shading
        material.use_backface_culling = True
        add_camera_plane(scene, camera, BACKDROP_TAG, corners, material, track)

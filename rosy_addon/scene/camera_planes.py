"""Planes in front of cameras that only these see: backdrops and keys."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from ..projection.camera import Camera
from .cameras import FRAME_CAMERAS
from .owned_data import delete_owned
from .picture_nodes import shown_materials

#: Visibility to rays; only camera rays meet a plane.
HIDDEN_FROM = (
    "visible_diffuse",
    "visible_glossy",
    "visible_transmission",
    "visible_volume_scatter",
    "visible_shadow",
)


def pictured_cameras(scene: bpy.types.Scene) -> dict[bpy.types.Object, bpy.types.PropertyGroup]:
    """Return the cameras that have pictures, with a record of each: of a picture that is shown, if any.

    For animations, it is the active camera of the scene.
    """
    shown = set[bpy.types.Material]().union(*(shown_materials(obj) for obj in scene.objects))
    cameras: dict[bpy.types.Object, bpy.types.PropertyGroup] = {}
    for record in scene.rosy.bakes:
        camera = scene.camera if record.view == FRAME_CAMERAS else record.camera
        if camera is None or camera.type != "CAMERA":
            continue
        if camera not in cameras or record.material in shown:
            cameras[camera] = record
    return cameras


def remove_camera_planes(scene: bpy.types.Scene, tag: str) -> list[bpy.types.Image]:
    """Remove the planes with a tag from a scene, and their meshes and materials.

    Returns
    -------
    list of bpy.types.Image
        The images of these materials that nothing else uses.
    """
    images = []
    for obj in [obj for obj in scene.objects if obj.get(tag)]:
        mesh, materials = obj.data, list(obj.data.materials)
        delete_owned(obj)
        if not mesh.users:
            delete_owned(mesh)
        for material in materials:
            if material is None or material.users:
                continue
            images += [node.image for node in material.node_tree.nodes if hasattr(node, "image")]
            delete_owned(material)
    return [image for image in dict.fromkeys(images) if image is not None and not image.users]


def add_camera_plane(
    scene: bpy.types.Scene,
    camera: bpy.types.Object,
    name: str,
    tag: str,
    corners: np.ndarray,
    material: bpy.types.Material,
    created: list[bpy.types.ID],
) -> bpy.types.Object:
    """Add a plane, parented to a camera.

    Parameters
    ----------
    scene : bpy.types.Scene
    camera : bpy.types.Object
    name, tag : str
        Name of the object, and custom property that marks it.
    corners : (4, 3) float ndarray
        In the space of the camera, counter-clockwise.
    material : bpy.types.Material
    created : list of bpy.types.ID
        Gets the new datablocks; see `owned_data.rollback_on_error`.
    """
    mesh = bpy.data.meshes.new(name)
    created.append(mesh)
    mesh.from_pydata(corners.tolist(), [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    obj = bpy.data.objects.new(name, mesh)
    created.append(obj)
    obj[tag] = True
    scene.collection.objects.link(obj)
    obj.parent = camera
    # The scale of a camera does not change what it sees.
    scale = camera.matrix_world.to_scale()
    obj.matrix_parent_inverse = Matrix.Diagonal((*scale, 1.0)).inverted_safe()
    obj.hide_select = True
    for visibility in HIDDEN_FROM:
        setattr(obj, visibility, False)
    return obj


def frame_corners(camera: Camera, distance: float, size: float = 1.0) -> np.ndarray:
    """Return the corners of the frame of a camera at a distance, counter-clockwise.

    Parameters
    ----------
    camera : Camera
    distance : float
        From the camera along its view direction, in Blender units.
    size : float
        Scale of the frame about its center.

    Returns
    -------
    (4, 3) float64 ndarray
        In the space of the camera, which looks along its negative z axis.
    """
    depth = camera.projection @ (0.0, 0.0, -distance, 1.0)
    clip = [
        (size * x, size * y, depth[2] / depth[3], 1.0)
        for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    corners = np.array(clip) @ np.linalg.inv(camera.projection).T
    return corners[:, :3] / corners[:, 3:]

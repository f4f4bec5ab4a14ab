"""Planes in front of cameras, which only camera rays see, and backdrops, which are such planes."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from ..compositor.look import is_hatched
from ..core.color import from_hex, to_linear
from ..projection.camera import Camera
from .cameras import FRAME_CAMERAS, camera_of_object
from .datablocks import delete_owned, rollback_on_error
from .look_properties import read_look
from .node_builder import new_emissive_material
from .picture_nodes import shown_materials
from .read_view import scene_depsgraph

#: Kinds of rays that do not see a plane. Only camera rays do.
HIDDEN_FROM = (
    "visible_diffuse",
    "visible_glossy",
    "visible_transmission",
    "visible_volume_scatter",
    "visible_shadow",
)


def pictured_cameras(scene: bpy.types.Scene) -> dict[bpy.types.Object, bpy.types.PropertyGroup]:
    """Return the cameras that have pictures, with the record of one picture each.

    A picture that is shown goes first. An animation counts for the active camera of the scene.
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
        The images of these materials, if nothing else uses them.
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


#: Custom property on the objects of backdrops.
BACKDROP_TAG = "rosy_backdrop"

#: Distance of a backdrop from the camera, as a fraction of the end of the clip range.
DISTANCE = 0.99

#: Size of a backdrop relative to the frame, so that it also fills the frame if the lens or the size of
#: renders changes a little.
OVERSIZE = 1.5


def update_backdrops(scene: bpy.types.Scene) -> None:
    """Replace the backdrops of a scene by the ones that its settings ask for.

    If backdrops are switched on and the look draws lines on paper, every camera with a picture gets a
    backdrop in the color of the paper. For an animation, the active camera of the scene gets one.
    """
    remove_camera_planes(scene, BACKDROP_TAG)
    look = read_look(scene.rosy)
    if scene.rosy.backdrop and is_hatched(look):
        for camera in pictured_cameras(scene):
            _add_backdrop(scene, camera, look.paper_color)


def _add_backdrop(scene: bpy.types.Scene, camera: bpy.types.Object, paper: str) -> None:
    """Add a plane with the color of the paper, parented to a camera."""
    name = f"RoSy Backdrop {camera.name}"
    view = camera_of_object(scene, scene_depsgraph(scene), camera)
    corners = frame_corners(view, DISTANCE * camera.data.clip_end, OVERSIZE)
    with rollback_on_error() as created:
        color = (*to_linear(from_hex(paper)).tolist(), 1.0)
        material = new_emissive_material(name, color, scene.rosy.emission)
        created.append(material)
        material.diffuse_color = color  # in views with Solid shading
        material.use_backface_culling = True
        add_camera_plane(scene, camera, name, BACKDROP_TAG, corners, material, created)

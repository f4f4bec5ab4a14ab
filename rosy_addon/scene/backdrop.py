"""Backdrops: paper behind everything that a camera sees, as a plane parented to the camera."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from ..color import from_hex, to_linear
from ..compositor.look import is_hatched
from ..projection.camera import Camera
from .cameras import FRAME_CAMERAS, camera_of_object
from .compat import has_nodes_by_default
from .look_properties import read_look
from .owned_data import delete_owned, rollback_on_error
from .read_view import scene_depsgraph

#: Custom property on the objects of backdrops.
BACKDROP_TAG = "rosy_backdrop"

#: Distance of a backdrop from the camera, as a fraction of the end of the clip range.
DISTANCE = 0.99

#: Size of a backdrop relative to the frame, so that it also fills the frame if the lens or the size of
#: renders changes a little.
OVERSIZE = 1.5

#: Visibility to rays; only camera rays meet a backdrop.
HIDDEN_FROM = (
    "visible_diffuse",
    "visible_glossy",
    "visible_transmission",
    "visible_volume_scatter",
    "visible_shadow",
)


def update_backdrops(scene: bpy.types.Scene) -> None:
    """Create the backdrops of a scene anew, and remove those that it should not have.

    If the switch is on and lines are drawn on paper, every camera with a picture has a backdrop with
    the color of the paper. For animations, it is the active camera of the scene.
    """
    for obj in [obj for obj in scene.objects if obj.get(BACKDROP_TAG)]:
        data = [obj.data, *obj.data.materials]
        delete_owned(obj)
        for datablock in data:
            if not datablock.users:
                delete_owned(datablock)
    look = read_look(scene.rosy)
    if not scene.rosy.backdrop or not is_hatched(look):
        return
    cameras = dict.fromkeys(
        scene.camera if record.view == FRAME_CAMERAS else record.camera
        for record in scene.rosy.bakes
    )
    for camera in cameras:
        if camera is not None and camera.type == "CAMERA":
            _add_backdrop(scene, camera, look.paper_colour)


def _add_backdrop(scene: bpy.types.Scene, camera: bpy.types.Object, paper: str) -> None:
    """Add a plane with the color of the paper, parented to a camera."""
    name = f"RoSy Backdrop {camera.name}"
    view = camera_of_object(scene, scene_depsgraph(scene), camera)
    with rollback_on_error() as created:
        mesh = bpy.data.meshes.new(name)
        created.append(mesh)
        corners = frame_corners(view, DISTANCE * camera.data.clip_end, OVERSIZE)
        mesh.from_pydata(corners.tolist(), [], [(0, 1, 2, 3)])
        material = _new_material(name, paper, scene.rosy.emission)
        created.append(material)
        mesh.materials.append(material)
        obj = bpy.data.objects.new(name, mesh)
        created.append(obj)
        obj[BACKDROP_TAG] = True
        scene.collection.objects.link(obj)
    obj.parent = camera
    # The scale of a camera does not change what it sees.
    scale = camera.matrix_world.to_scale()
    obj.matrix_parent_inverse = Matrix.Diagonal((*scale, 1.0)).inverted_safe()
    obj.hide_select = True
    for visibility in HIDDEN_FROM:
        setattr(obj, visibility, False)


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


def _new_material(name: str, paper: str, strength: float) -> bpy.types.Material:
    """Create a material that emits the color of the paper, given as ``#rrggbb``."""
    material = bpy.data.materials.new(name)
    color = (*to_linear(from_hex(paper)).tolist(), 1.0)
    material.diffuse_color = color  # in views with Solid shading
    material.use_backface_culling = True
    if not has_nodes_by_default(material):
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    emission.inputs["Color"].default_value = color
    emission.inputs["Strength"].default_value = strength
    links.new(emission.outputs["Emission"], output.inputs["Surface"])
    emission.location, output.location = (-200, 0), (0, 0)
    return material

"""Backdrops: paper behind everything that a camera sees, as a plane parented to the camera."""

from __future__ import annotations

import bpy

from ..compositor.look import is_hatched
from ..core.color import from_hex, to_linear
from .camera_planes import (
    add_camera_plane,
    frame_corners,
    pictured_cameras,
    remove_camera_planes,
)
from .cameras import camera_of_object
from .look_properties import read_look
from .node_builder import new_emissive_material
from .owned_data import rollback_on_error
from .read_view import scene_depsgraph

#: Custom property on the objects of backdrops.
BACKDROP_TAG = "rosy_backdrop"

#: Distance of a backdrop from the camera, as a fraction of the end of the clip range.
DISTANCE = 0.99

#: Size of a backdrop relative to the frame, so that it also fills the frame if the lens or the size of
#: renders changes a little.
OVERSIZE = 1.5


def update_backdrops(scene: bpy.types.Scene) -> None:
    """Create the backdrops of a scene anew, and remove those that it should not have.

    If the switch is on and lines are drawn on paper, every camera with a picture has a backdrop with
    the color of the paper. For animations, it is the active camera of the scene.
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

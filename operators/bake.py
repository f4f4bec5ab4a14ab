"""Draw the fields of the scene as a camera or the view sees them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy

from ..rosy_addon.bake import baking
from ..rosy_addon.errors import RosyError
from ..rosy_addon.progress import Work, part
from ..rosy_addon.scene.bodies import rosy_objects
from .meshes import is_idle
from .ticking import Ticking

CAMERAS = [
    ("SCENE", "Scene Camera", "From the camera that renders the scene"),
    ("ALL", "All Cameras", "From every camera in the scene, one picture each"),
    ("VIEW", "Current View", "From where this 3D view looks now"),
]


class ROSY_OT_bake(Ticking, bpy.types.Operator):
    """Draw the fields of the scene as the chosen camera sees them, and put the picture on the meshes"""

    bl_idname = "rosy.bake"
    bl_label = "Bake"
    bl_options = {"UNDO"}

    camera: bpy.props.EnumProperty(
        name="Camera", description="From where the fields are drawn", items=CAMERAS
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not is_idle(cls):
            return False
        if not rosy_objects(context.view_layer):
            cls.poll_message_set("No visible mesh has a field: make or import one first")
            return False
        return True

    def work(self, context: bpy.types.Context) -> Work[Any]:
        return baking(context.scene, None)

    def needed(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return rosy_objects(context.view_layer)


CLASSES = (ROSY_OT_bake,)

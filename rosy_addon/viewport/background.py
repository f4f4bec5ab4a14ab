"""The paper behind everything in a live view, in place of the backdrop of a bake."""

from __future__ import annotations

import bpy
import numpy as np

from ..compositor.look import Look, is_hatched
from ..core.color import from_hex, to_linear
from ..core.errors import RosyError
from ..projection.camera import Camera
from ..rendering.view_input import Background
from ..scene.camera_planes import frame_corners
from ..scene.cameras import camera_of_object


def view_background(
    context: bpy.types.Context, depsgraph: bpy.types.Depsgraph, camera: Camera, look: Look
) -> Background | None:
    """Return the paper of a view, or None if its scene has no backdrop or no paper.

    A camera view has it in the frame of the camera.

    Parameters
    ----------
    context : bpy.types.Context
        Of the region that is drawn.
    depsgraph : bpy.types.Depsgraph
    camera : Camera
        Of the view.
    look : Look
    """
    if not context.scene.rosy.backdrop or not is_hatched(look):
        return None
    color = tuple(to_linear(from_hex(look.paper_color)).tolist())
    if context.region_data.view_perspective != "CAMERA":
        return Background(color)
    space = context.space_data
    camera_object = space.camera if space.use_local_camera else context.scene.camera
    try:
        frame = camera_of_object(context.scene, depsgraph, camera_object)
    except RosyError:
        return Background(color)  # a light, for example, has no frame
    corners = np.concatenate([frame_corners(frame, 1.0), np.ones((4, 1))], axis=1)
    clip = corners @ (camera.projection @ camera.view @ np.linalg.inv(frame.view)).T
    position = clip[:, :2] / clip[:, 3:]
    low, high = position.min(axis=0).tolist(), position.max(axis=0).tolist()
    return Background(color, tuple(low), tuple(high))

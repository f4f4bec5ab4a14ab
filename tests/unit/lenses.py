"""Cameras with a shifted lens."""

import numpy as np

from rosy_addon.projection.camera import Camera


def shifted(camera: Camera, shift: tuple[float, float]) -> Camera:
    """Return a camera with Blender's lens shift, in units of the longer side of the picture."""
    size = np.array([camera.width, camera.height])
    offset = 2 * np.array(shift) * size.max() / size
    projection = camera.projection.copy()
    if camera.is_perspective:
        projection[:2, 2] += offset
    else:
        projection[:2, 3] -= offset
    return Camera(camera.view, projection, camera.width, camera.height, camera.name)

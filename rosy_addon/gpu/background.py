"""Drawing into a 3D view: pictures over its surfaces, and a background color behind everything."""

from typing import Any

import numpy as np

from ..rendering.view_input import Background
from .device import Batches, Device
from .passes import RasterPass


def draw_texture(
    device: Device, texture: Any, batches: Batches, opacity: float, depth_bias: float = 0.0
) -> None:
    """Draw a picture over the 3D view that is being drawn.

    Parameters
    ----------
    device : Device
    texture : texture
        The picture. It may have any size, and fills the view.
    batches : sequence of (batch, dict)
        Triangles that the picture is drawn on, each batch with the uniforms of `uniforms.clip_uniforms`.
    opacity : float
        From 0 to 1.
    depth_bias : float
        How much closer to the eye the triangles are drawn, in normalized depth.
    """
    left, bottom, width, height = device.viewport()
    uniforms = {
        "depth_bias": depth_bias,
        "view_origin": (float(left), float(bottom)),
        "pixel_scale": (texture.width / width, texture.height / height),
        "opacity": opacity,
    }
    device.draw_to_view(RasterPass("composite"), batches, {"picture": texture}, uniforms)


def draw_background(device: Device, background: Background) -> None:
    """Fill a rectangle of the 3D view that is being drawn with a color, behind everything else in it."""
    vertices = np.zeros((6, 4), dtype=np.float32)
    vertices[:, :2] = [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]
    uniforms = {
        "background_color": (*background.color, 1.0),
        "low_corner": background.low_corner,
        "high_corner": background.high_corner,
    }
    device.draw_to_view(RasterPass("background"), [(device.batch(vertices), {})], {}, uniforms)

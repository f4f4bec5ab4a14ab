"""A color behind everything in a 3D view."""

from __future__ import annotations

import numpy as np

from ..rendering.view_input import Background
from .device import Device
from .passes import BACKGROUND


def draw_background(device: Device, background: Background) -> None:
    """Fill a rectangle of the 3D view that is being drawn, wherever nothing else is in it."""
    vertices = np.zeros((6, 4), dtype=np.float32)
    vertices[:, :2] = [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]
    uniforms = {
        "background_color": (*background.color, 1.0),
        "low_corner": background.low_corner,
        "high_corner": background.high_corner,
    }
    device.draw_to_view(BACKGROUND, [(device.batch(vertices), {})], {}, uniforms)

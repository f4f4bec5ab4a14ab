"""Sizes of pixels at points of a 3D view, for what is drawn there in pixels."""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np


class PixelFrames(NamedTuple):
    """The steps of a pixel at K points of a view.

    Attributes
    ----------
    right, up : (K, 3) float64 ndarray
        World space, parallel to the view.
    nearer : (K, 3) float64 ndarray
        As far along the axis of the view, toward the eye. The point stays where it is in the view.
    """

    right: np.ndarray
    up: np.ndarray
    nearer: np.ndarray


def pixel_frames(context: bpy.types.Context, points: np.ndarray) -> PixelFrames:
    """Return the steps of a pixel at (K, 3) points in world space, in the region that is drawn."""
    view, window = context.region_data, context.region
    view_to_world = np.array(view.view_matrix.inverted())
    right, up, back, eye = view_to_world[:3].T
    depth, toward_eye = np.ones(len(points)), np.broadcast_to(back, points.shape)
    if view.is_perspective:
        depth = (eye - points) @ back
        toward_eye = (eye - points) / depth[:, None]
    pixel = (depth * (2 / (view.window_matrix[0][0] * window.width)))[:, None]
    return PixelFrames(pixel * right, pixel * up, pixel * toward_eye)

"""Bounding boxes of meshes on the screen, in pixels."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..projection.camera import Camera
from .resources import DrawItem

#: Left, bottom, right and top, in pixels; right and top are exclusive.
Box = tuple[int, int, int, int]


def screen_box(item: DrawItem, camera: Camera) -> Box:
    """Return the box of the pixels that a mesh can cover.

    The whole frame if the near plane cuts off a part of the bounds; an empty box if it cuts off all.
    """
    points = np.concatenate([item.mesh.buffers.bounds, np.ones((8, 1))], axis=1)
    clip = points @ (camera.projection @ camera.view @ item.model_matrix).T
    is_cut_off = clip[:, 2] < -clip[:, 3]
    if is_cut_off.all():
        return 0, 0, 0, 0
    if is_cut_off.any() or (clip[:, 3] <= 0).any():
        return 0, 0, camera.width, camera.height
    ends = clip[:, :2] / clip[:, 3:] * 0.5 + 0.5
    size = np.array([camera.width, camera.height])
    low = np.clip(np.floor(ends.min(axis=0) * size), 0, size).astype(int)
    high = np.clip(np.ceil(ends.max(axis=0) * size), 0, size).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def is_empty(box: Box) -> bool:
    """Return whether a box contains no pixel."""
    left, bottom, right, top = box
    return left >= right or bottom >= top


def union_box(boxes: Iterable[Box]) -> Box:
    """Return the smallest box around others. Empty boxes are ignored."""
    boxes = [box for box in boxes if not is_empty(box)]
    if not boxes:
        return 0, 0, 0, 0
    left, bottom, right, top = zip(*boxes, strict=True)
    return min(left), min(bottom), max(right), max(top)


def box_size(box: Box) -> tuple[int, int]:
    """Return width and height."""
    left, bottom, right, top = box
    return right - left, top - bottom

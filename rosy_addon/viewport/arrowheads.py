"""Arrowheads over the lines of fields in a 3D view."""

from __future__ import annotations

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..annotation.arrow_marks import FILL_COLOR, OUTLINE_COLOR, ArrowMarks
from ..annotation.draw_arrows import head_outline
from ..color import from_hex
from .pixel_frames import pixel_frames

#: How far arrowheads are in front of their places, and their outlines behind them, in lengths. Those beside their
#: places are nearer still, by so many times the distance, so that slanted surfaces do not hide them.
NEARNESS, OUTLINE_DISTANCE, SLOPE = 1.5, 0.5, 2.5

#: Points of the arc around a corner of an outline.
ARC_POINTS = 4


def draw_arrowheads(context: bpy.types.Context, marks: ArrowMarks) -> None:
    """Draw arrowheads in a view, behind what is in front of them.

    Parameters
    ----------
    context : bpy.types.Context
    marks : ArrowMarks
        Of this view.
    """
    if not len(marks):  # Blender makes no batch without vertices
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.depth_test_set("LESS_EQUAL")
    for grown, code, nearness in (
        (marks.outline, OUTLINE_COLOR, NEARNESS - OUTLINE_DISTANCE),
        (0.0, FILL_COLOR, NEARNESS),
    ):
        vertices = _head_triangles(context, marks, grown, nearness * marks.size)
        shader.uniform_float("color", (*from_hex(code).tolist(), 1.0))
        batch_for_shader(shader, "TRIS", {"pos": vertices}).draw(shader)
    gpu.state.depth_test_set("NONE")


def _head_triangles(
    context: bpy.types.Context, marks: ArrowMarks, grown: float, nearness: float
) -> np.ndarray:
    """Return the (n, 3) float32 corners of the triangles of arrowheads, facing the camera.

    Their outlines are moved outward, and they are moved toward the camera, both in pixels.
    """
    corners = _outline_triangles(head_outline(marks.size), grown)
    forward, left = marks.direction, marks.direction[:, ::-1] * (-1, 1)
    offset = (marks.position - marks.place)[:, None] + (
        corners[:, :1] * forward[:, None] + corners[:, 1:] * left[:, None]
    )
    frames = pixel_frames(context, marks.anchor)
    nearness = nearness + SLOPE * np.hypot(*(marks.position - marks.place).T)[:, None]
    vertices = (marks.anchor + nearness * frames.nearer)[:, None] + (
        offset[..., :1] * frames.right[:, None] + offset[..., 1:] * frames.up[:, None]
    )
    return vertices.reshape(-1, 3).astype(np.float32)


def _outline_triangles(outline: np.ndarray, grown: float) -> np.ndarray:
    """Return the (n, 2) corners of triangles that fill an arrowhead whose outline is moved outward.

    Its corners are round; see `head_outline`.
    """
    tip, barb, notch = outline
    # The sides run counter-clockwise from the tip, so their right sides are outside.
    side, back = (
        np.arctan2(-step[0], step[1]) % (2 * np.pi) for step in (barb - tip, notch - barb)
    )
    half = [tip + grown * _unit_vectors(0.0, side), barb + grown * _unit_vectors(side, back)]
    half = np.concatenate([*half, [notch + (grown / np.cos(back), 0.0)]])
    points = np.concatenate([half, (half * (1, -1))[-2:0:-1]])
    center = np.zeros_like(points)
    return np.stack([center, points, np.roll(points, -1, axis=0)], axis=1).reshape(-1, 2)


def _unit_vectors(first: float, last: float) -> np.ndarray:
    """Return (`ARC_POINTS`, 2) unit vectors at angles from the first to the last, in radians."""
    angles = np.linspace(first, last, ARC_POINTS)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)

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

#: How far arrowheads are in front of their places, and their outlines behind them, in lengths.
NEARNESS, OUTLINE_DISTANCE = 1.5, 0.5


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
    """Return the (6 K, 3) float32 corners of the triangles of K arrowheads, facing the camera.

    Their outlines are moved outward, and they are moved toward the camera, both in pixels.
    """
    tip, barb, notch = _grown(head_outline(marks.size), grown)
    mirrored = barb * (1, -1)
    corners = np.array([tip, barb, notch, tip, notch, mirrored])
    forward, left = marks.direction, marks.direction[:, ::-1] * (-1, 1)
    offset = (marks.position - marks.place)[:, None] + (
        corners[:, :1] * forward[:, None] + corners[:, 1:] * left[:, None]
    )
    frames = pixel_frames(context, marks.anchor)
    vertices = (marks.anchor + nearness * frames.nearer)[:, None] + (
        offset[..., :1] * frames.right[:, None] + offset[..., 1:] * frames.up[:, None]
    )
    return vertices.reshape(-1, 3).astype(np.float32)


def _grown(outline: np.ndarray, width: float) -> np.ndarray:
    """Return the tip, the barb and the notch of an arrowhead whose edges are moved outward."""
    tip, barb, notch = outline
    edges = np.array([barb - tip, notch - barb])
    # The edges run counter-clockwise: outward is to their right.
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    side, back = normals
    levels = np.array([side @ tip, back @ notch]) + width
    # The tip and the notch are on the axis; the barb is where the edges meet.
    a, b = normals
    determinant = a[0] * b[1] - a[1] * b[0]
    corner = (
        np.array([levels[0] * b[1] - levels[1] * a[1], levels[1] * a[0] - levels[0] * b[0]])
        / determinant
    )
    return np.array([[levels[0] / side[0], 0.0], corner, [levels[1] / back[0], 0.0]])

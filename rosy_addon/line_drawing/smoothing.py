"""Smooth the corners that lines have at the edges of triangles."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..core.progress import report
from ..field.frames import dot
from ..projection.camera import Camera
from .stroke_set import Strokes
from .visibility import SAMPLE_STEP_PX, pixel_size, project_to_pixels

#: Standard deviation of the binomial filter in pixels. It moves a corner of 20 degrees by half a pixel,
#: and an arc with a radius of 20 pixels by a fifth.
FILTER_PX = 3.0

#: The same in spacings, if this is less: strokes that are near each other bend more.
FILTER_SPACINGS = 0.3

#: Sharper turns in the picture are meant and stay, in radians: those of outlines, and those of strokes.
MAX_OUTLINE_TURN, MAX_STROKE_TURN = np.radians(45), np.radians(100)

#: Rounds of the filter: each has half the variance of the distance between points.
ROUNDS = round(2 * (FILTER_PX / SAMPLE_STEP_PX) ** 2)

#: Points that are filtered at once.
BLOCK_POINTS = 1 << 15


def smooth(strokes: Strokes, camera: Camera) -> Strokes:
    """Filter the points of lines, so that they do not have corners where the mesh has edges.

    Parameters
    ----------
    strokes : Strokes
        As `clip_to_visible` returns them, with points at most `SAMPLE_STEP_PX` pixels apart.
    camera : Camera

    Returns
    -------
    Strokes
        Ends and sharp corners are where they were. The lines leave the surface by a fraction of a pixel.
    """
    points = strokes.points.copy()
    block_index = strokes.start[1:] // BLOCK_POINTS
    cuts = [0, *np.flatnonzero(np.diff(block_index)) + 1, len(strokes)]
    for first, stop in pairwise(cuts):
        report(first / max(len(strokes), 1), "smoothing strokes")
        block = slice(strokes.start[first], strokes.start[stop])
        points[block] = _smoothed_points(strokes.select(np.arange(first, stop)), camera)
    return replace(strokes, points=points)


def _smoothed_points(strokes: Strokes, camera: Camera) -> np.ndarray:
    """Return the (n, 3) filtered points of strokes."""
    points = strokes.points
    before, after = np.arange(len(points)) - 1, np.arange(len(points)) + 1
    first, last = strokes.start[:-1], strokes.start[1:] - 1
    before[first] = np.where(strokes.closed, last - 1, first)
    after[last] = np.where(strokes.closed, first + 1, last)
    pixels, _ = project_to_pixels(points, camera)
    incoming, outgoing = pixels - pixels[before], pixels[after] - pixels
    norm = np.hypot(*incoming.T) * np.hypot(*outgoing.T)
    # False at ends, where a vector is zero, and behind the camera, where it is NaN.
    spacing = strokes.spacing / pixel_size(points, camera)
    max_turn = np.where(spacing > 0, MAX_STROKE_TURN, MAX_OUTLINE_TURN)
    moves = dot(incoming, outgoing) > np.cos(max_turn) * norm
    width = np.where(spacing > 0, FILTER_SPACINGS * spacing, FILTER_PX)
    strength = moves * 0.25 * np.minimum(width / FILTER_PX, 1) ** 2
    for _ in range(ROUNDS):
        points = points + strength[:, None] * (points[before] + points[after] - 2 * points)
    return points

"""What a camera sees of strokes: where points are in the frame, and the runs that nothing hides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..field.frames import dot, unit
from ..projection.camera import Camera
from ..projection.gbuffer import Body
from ..projection.raster import rasterise
from .strokes import Strokes, arcs

#: Pixels between the points at which strokes are looked at.
LOOK = 1.0

#: Runs that are seen, and gaps between them, of fewer pixels than this are the rasteriser's doing.
SPECK = 2.5

#: Pixels, as lengths at a point's depth, by which something has to be in front to hide it.
BIAS = 1.5

#: Up to where steepness adds to it.
STEEPEST = 4.0


def on_screen(points: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Where points are in the frame.

    Parameters
    ----------
    points : (n, 3) ndarray
        World space.
    camera : Camera

    Returns
    -------
    pixels : (n, 2) float64 ndarray
        From the lower left corner; NaN for points that are not in front of the camera.
    depth : (n,) float64 ndarray
        Along the camera's axis.
    """
    clip = _on_clip(points, camera)
    with np.errstate(divide="ignore", invalid="ignore"):
        flat = clip[:, :2] / clip[:, 3:]
    pixels = (flat + 1) * (np.array([camera.width, camera.height]) / 2)
    pixels[(clip[:, 3] <= 0) | (clip[:, 2] < -clip[:, 3])] = np.nan
    row = camera.view[2]
    return pixels, -(points @ row[:3] + row[3])


def pixel_size(points: np.ndarray, camera: Camera) -> np.ndarray:
    """(n,) float64: the length in world space that a pixel is, across the camera's axis."""
    if not camera.is_perspective:
        return np.full(len(points), 1 / camera.pixels_per_unit)
    row = camera.view[2]
    depth = -(points @ row[:3] + row[3])
    return np.maximum(depth, 1e-6 * np.abs(depth).max(initial=0)) / camera.pixels_per_unit


def seen(strokes: Strokes, bodies: Sequence[Body], camera: Camera, *, hide: bool = True) -> Strokes:
    """The parts of strokes that are in the frame and that nothing hides.

    Parameters
    ----------
    strokes : Strokes
    bodies : sequence of Body
        All that may hide them, with or without a field.
    camera : Camera
    hide : bool
        Otherwise they are only cut at the frame.

    Returns
    -------
    Strokes
        With points at most `LOOK` pixels apart.

    Notes
    -----
    A point is hidden if the planes of the triangles that are seen at all four pixel centres around
    it are in front of it where it is, by more than `BIAS` pixels and what their steepness adds:
    planes, as depths of pixels would be off by the slope over half a pixel.
    """
    strokes = densified(strokes, camera)
    pixels, _ = on_screen(strokes.points, camera)
    inside = in_frame(pixels, camera)
    shown = inside.copy()
    if hide:
        shown[shown] = ~_hidden(strokes, pixels, shown, sight(bodies, camera), camera)
        shown = _without_specks(shown, pixels, strokes.start)
    return strokes.runs(shown, loose=inside)


def in_frame(pixels: np.ndarray, camera: Camera) -> np.ndarray:
    """(n,) bool: which of the (n, 2) pixels of `on_screen` are in the frame."""
    with np.errstate(invalid="ignore"):
        return ((pixels >= 0) & (pixels <= (camera.width, camera.height))).all(axis=1)


def densified(strokes: Strokes, camera: Camera) -> Strokes:
    """With points put between those that are more than `LOOK` pixels apart."""
    pixels, _ = on_screen(strokes.points, camera)
    apart = np.zeros(len(pixels))
    apart[1:] = np.hypot(*np.diff(pixels, axis=0).T)
    apart[strokes.start[:-1]] = 0
    pieces = np.where(np.isfinite(apart), np.ceil(apart / LOOK), 1)
    return strokes.densified(np.clip(pieces, 1, 4096))


@dataclass(frozen=True, eq=False)
class Sight:
    """What a camera sees at the centres of its pixels, of T triangles, in camera space.

    Attributes
    ----------
    triangle : (height, width) int32 ndarray
        -1 where there is none.
    depth : (height, width) float64 ndarray
        Along the camera's axis; infinite where there is none.
    normal : (T, 3) float64 ndarray
        Unit, from the order of the corners.
    offset : (T,) float64 ndarray
        Of their planes along it.
    """

    triangle: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    offset: np.ndarray


def sight(bodies: Sequence[Body], camera: Camera) -> Sight:
    """Find what a camera sees of bodies."""
    corners = np.concatenate([_triangles(body, camera) for body in bodies])
    flat = corners.reshape(-1, 3)
    clip = flat @ camera.projection[:, :3].T + camera.projection[:, 3]
    numbers = np.arange(len(flat), dtype=np.int32).reshape(-1, 3)
    found = rasterise(clip, numbers, camera.width, camera.height)
    triangle = np.full((camera.height, camera.width), -1, dtype=np.int32)
    triangle.flat[found.pixel] = found.triangle
    depth = np.full(triangle.shape, np.inf)
    depth.flat[found.pixel] = -dot(found.barycentric, corners[found.triangle, :, 2])
    normal = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return Sight(triangle, depth, normal, dot(normal, corners[:, 0]))


def _on_clip(points: np.ndarray, camera: Camera) -> np.ndarray:
    matrix = camera.projection @ camera.view
    return points @ matrix[:, :3].T + matrix[:, 3]


def _hidden(
    strokes: Strokes,
    pixels: np.ndarray,
    shown: np.ndarray,
    there: Sight,
    camera: Camera,
) -> np.ndarray:
    """For the points that are in the frame."""
    view = camera.view
    points = strokes.points[shown] @ view[:3, :3].T + view[:3, 3]
    normals = strokes.normal[shown] @ view[:3, :3].T
    eye = -points if camera.is_perspective else np.broadcast_to((0.0, 0.0, 1.0), points.shape)
    footprint = pixel_size(strokes.points[shown], camera)
    # Outlines follow no member; they are on both sides at once.
    facing = np.sign(dot(normals, eye)) * strokes.member[shown].any(axis=1)
    low = np.floor(pixels[shown] - 0.5).astype(np.int64)
    hidden, behind_front = np.ones(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    for right in (0, 1):
        for up in (0, 1):
            column = np.clip(low[:, 0] + right, 0, camera.width - 1)
            row = np.clip(low[:, 1] + up, 0, camera.height - 1)
            triangle = there.triangle[row, column]
            some = np.maximum(triangle, 0)
            across = dot(there.normal[some], eye)
            # How far the point is behind the plane, along the ray.
            behind = there.offset[some] - dot(there.normal[some], points)
            length = np.sqrt(dot(eye, eye))
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = np.where(across != 0, behind / across, 0) * length
                steep = np.sqrt(np.maximum(length**2 / across**2 - 1, 0))
            bias = footprint * (BIAS + np.minimum(np.nan_to_num(steep, posinf=STEEPEST), STEEPEST))
            turned = np.sign(across) * facing < 0
            hidden &= (triangle >= 0) & (distance > bias)
            # What faces away, behind what does not: at the rim of a body one pixel is enough.
            behind_front |= (triangle >= 0) & turned & (distance > 0)
    return hidden | behind_front


def _triangles(body: Body, camera: Camera) -> np.ndarray:
    """(T, 3, 3) corners in camera space."""
    matrix = camera.view @ np.asarray(body.matrix, dtype=np.float64)
    vertices = body.surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    return vertices[body.surface.triangle_vertex]


def _without_specks(shown: np.ndarray, pixels: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Short gaps closed, then short runs taken out."""
    arc = arcs(np.nan_to_num(np.column_stack([pixels, np.zeros(len(pixels))])), start)
    for value in (False, True):
        shown = _flipped_runs(shown, arc, start, value)
    return shown


def _flipped_runs(shown: np.ndarray, arc: np.ndarray, start: np.ndarray, value: bool) -> np.ndarray:
    """Runs of `value` shorter than a speck turned over; gaps only between runs of one stroke."""
    begins = np.ones(len(shown), dtype=bool)
    begins[1:] = shown[1:] != shown[:-1]
    begins[start[:-1]] = True
    first = np.flatnonzero(begins)
    last = np.append(first[1:], len(shown)) - 1
    flip = (shown[first] == value) & (arc[last] - arc[first] < SPECK)
    if not value:
        ends = np.zeros(len(shown) + 1, dtype=bool)
        ends[start] = True
        flip &= ~ends[first] & ~ends[last + 1]
    run = np.cumsum(begins) - 1
    return shown ^ flip[run]

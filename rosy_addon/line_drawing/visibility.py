"""Project strokes to pixels, clip them to the frame and to their visible parts, and smooth them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..core.progress import progress, report
from ..field.blocks import mask, row_blocks
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import dot, normalize, transformed
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.rasterizer import rasterize
from .stroke_set import Strokes, arc_lengths

#: Largest distance between the points of strokes at which visibility is tested, in pixels.
SAMPLE_STEP_PX = 1.0

#: Number of points of strokes that are clipped at once. It bounds memory.
BLOCK_POINTS = 1 << 16

#: Number of pixels whose depth is computed at once. It bounds memory.
BLOCK_PIXELS = 1 << 20

#: Visible runs of points, and hidden runs between them, count as artifacts of rasterization if they are
#: shorter than this, in pixels.
MIN_RUN_PX = 2.5

#: A surface hides a point only if it is in front of the point by more than this many pixels, measured as a
#: length in world space at the depth of the point.
DEPTH_BIAS_PX = 1.5

#: Largest value that the steepness of the surface adds to this bias, in pixels. Steepness is the
#: tangent of the angle between the normal and the direction to the camera.
MAX_BIAS_STEEPNESS = 4.0

#: Standard deviation, in pixels, of the binomial filter that smooths strokes. The filter moves a corner of 20
#: degrees by half a pixel, and an arc with a radius of 20 pixels by a fifth of a pixel.
FILTER_PX = 3.0

#: Largest standard deviation of the filter, in spacings. Strokes at small spacings are filtered less, as they
#: bend more.
FILTER_SPACINGS = 0.3

#: Corners that turn by more than this in the picture are not smoothed, in outlines and in strokes, in
#: radians.
MAX_OUTLINE_TURN, MAX_STROKE_TURN = np.radians(45), np.radians(100)

#: Number of times that the filter (1, 2, 1) / 4 is applied. Its variance is half of the squared distance
#: between points.
ROUNDS = round(2 * (FILTER_PX / SAMPLE_STEP_PX) ** 2)

#: Number of points of strokes that are smoothed at once. It bounds memory.
SMOOTHED_POINTS = 1 << 15


def project_to_pixels(points: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Project points to pixel coordinates.

    Parameters
    ----------
    points : (n, 3) ndarray
        Points in world space.
    camera : Camera

    Returns
    -------
    pixels : (n, 2) float64 ndarray
        Pixel coordinates from the lower left corner; NaN for points that are nearer than the near
        plane or behind the camera.
    depth : (n,) float64 ndarray
        Depth along the axis of the camera.
    """
    clip = transformed(points, camera.projection @ camera.view)
    with np.errstate(divide="ignore", invalid="ignore"):
        ndc = clip[:, :2] / clip[:, 3:]
    pixels = (ndc + 1) * (np.array(camera.size) / 2)
    pixels[(clip[:, 3] <= 0) | (clip[:, 2] < -clip[:, 3])] = np.nan
    return pixels, camera.depths(points)


def pixel_size(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Return (n,) float64: the side of a pixel in world space, at the depth of each point.

    It is measured perpendicular to the axis of the camera.
    """
    depth = camera.depths(points)
    return camera.pixel_sizes(np.maximum(depth, 1e-6 * np.abs(depth).max(initial=0)))


def clip_to_visible(strokes: Strokes, camera: Camera, depth_buffer: DepthBuffer | None) -> Strokes:
    """Return the parts of strokes that are in the frame and not hidden.

    Parameters
    ----------
    strokes : Strokes
    camera : Camera
    depth_buffer : DepthBuffer or None
        Depth buffer of all surfaces that can hide strokes. If None, strokes are only clipped to the frame.

    Returns
    -------
    Strokes
        The visible parts, with points at most `SAMPLE_STEP_PX` pixels apart. Ends at occluding edges are free
        ends (see `Strokes`), ends at the frame are not.

    Notes
    -----
    A point is compared with the triangles that are visible at the four pixel centers around it. It
    is hidden if the planes of all four triangles are in front of it by more than a bias: `DEPTH_BIAS_PX` plus
    the tangent of the angle between the view ray and the normal of the plane, times the size of a pixel in
    world space at the point. Planes are used because the depth at a pixel center differs from the depth
    at the point, by the slope times up to half a pixel. A point is also hidden by a
    single triangle in front of it if the triangle faces the camera and the surface at the point faces away,
    or the reverse.
    """
    if depth_buffer is None:
        return visible_runs(strokes, camera, None, 0.0, 0.0)

    def is_visible(block: Strokes, point: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        return ~_is_hidden(block, point, pixels, depth_buffer)

    return visible_runs(strokes, camera, is_visible, MIN_RUN_PX, MIN_RUN_PX)


def visible_runs(
    strokes: Strokes,
    camera: Camera,
    is_visible: Callable[[Strokes, np.ndarray, np.ndarray], np.ndarray] | None,
    max_gap: float,
    min_run: float,
) -> Strokes:
    """Cut strokes into runs of visible points inside the frame.

    Runs of closed strokes continue over their first point.

    Parameters
    ----------
    strokes : Strokes
    camera : Camera
    is_visible : function or None
        Function, called as ``is_visible(block, point, pixels)``, that returns (m,) bool: whether points in
        the frame are visible. `block` is a part of the strokes, with points at most `SAMPLE_STEP_PX` pixels
        apart. `point` holds the (m,) indices of its points in the frame, and `pixels` their (m, 2) pixel
        coordinates. If None, all points in the frame are visible.
    max_gap, min_run : float
        Hidden runs shorter than `max_gap` become visible, then visible runs shorter than `min_run` are
        removed. Both are lengths in pixels.

    Returns
    -------
    Strokes
        A stroke for each run.
    """
    if not len(strokes):
        return strokes
    clipped = []
    counts = pixel_counts(strokes, camera)
    for first, stop in _stroke_blocks(offsets_from_sizes(counts)[strokes.start[1:]], BLOCK_POINTS):
        report(first / len(strokes), "finding visible strokes")
        block = strokes.subdivided(counts, first, stop)
        pixels, _ = project_to_pixels(block.points, camera)
        inside = in_frame(pixels, camera)
        visible = inside.copy()
        if is_visible is not None:
            visible[inside] = is_visible(block, np.flatnonzero(inside), pixels[inside])
        order = _from_hidden_points(block, visible)
        block = block.take_points(order)
        visible = clean_runs(visible[order], pixels[order], block.start, max_gap, min_run)
        clipped.append(block.runs_where(visible, free_at_removed=inside[order]))
    return Strokes.join(clipped)


def _stroke_blocks(point_count: np.ndarray, size: int) -> Iterator[tuple[int, int]]:
    """Return the ranges ``(first, stop)`` of consecutive strokes that have about `size` points together.

    `point_count`, (S,), is the cumulative number of points: of each stroke and all strokes before it. A new
    block begins with each stroke at which this number reaches the next multiple of `size`.
    """
    return pairwise([0, *np.flatnonzero(np.diff(point_count // size)) + 1, len(point_count)])


def _from_hidden_points(strokes: Strokes, visible: np.ndarray) -> np.ndarray:
    """Return indices that reorder points such that closed strokes start at a hidden point, if they have one.

    `visible` is (n,) bool. The points of other strokes keep their order.
    """
    order = np.arange(len(visible))
    for stroke in np.flatnonzero(strokes.closed & visible[strokes.start[:-1]]):
        first, last = strokes.start[stroke], strokes.start[stroke + 1] - 1
        hidden = np.flatnonzero(~visible[first:last])
        if len(hidden):
            # The last point is the same as the first.
            begin = first + hidden[0]
            parts = np.arange(begin, last + 1), np.arange(first + 1, begin + 1)
            order[first : last + 1] = np.concatenate(parts)
    return order


def in_frame(pixels: np.ndarray, camera: Camera) -> np.ndarray:
    """Return (n,) bool: whether (n, 2) pixel coordinates from `project_to_pixels` are in the frame."""
    with np.errstate(invalid="ignore"):
        return ((pixels >= 0) & (pixels <= (camera.width, camera.height))).all(axis=1)


def pixel_counts(strokes: Strokes, camera: Camera) -> np.ndarray:
    """Return (n,) int64: into how many parts to divide the segment that ends at each point.

    Parts are then at most `SAMPLE_STEP_PX` pixels long. A segment that is partly behind the camera is not
    divided. `Strokes.subdivided` takes these counts.
    """
    pixels, _ = project_to_pixels(strokes.points, camera)
    pixel_distance = np.zeros(len(pixels))
    pixel_distance[1:] = np.hypot(*np.diff(pixels, axis=0).T)
    pixel_distance[strokes.start[:-1]] = 0
    counts = np.where(np.isfinite(pixel_distance), np.ceil(pixel_distance / SAMPLE_STEP_PX), 1)
    return np.clip(counts, 1, 4096).astype(np.int64)


@dataclass(frozen=True, eq=False)
class DepthBuffer:
    """The nearest of T triangles at the pixel centers of a camera, in camera space.

    Attributes
    ----------
    camera : Camera
    start : tuple of int
        Index of the first triangle of each mesh instance, then T.
    triangle : (height, width) int32 ndarray
        Index of the visible triangle at each pixel; -1 if there is none. Row 0 is at the bottom.
    depth : (height, width) float64 ndarray
        Depth along the axis of the camera; infinite if there is no triangle.
    normal : (T, 3) float64 ndarray
        Unit normals of the triangles; corners are counter-clockwise around the normal.
    offset : (T,) float64 ndarray
        Distance of the plane of each triangle from the origin, along its normal.
    """

    camera: Camera
    start: tuple[int, ...]
    triangle: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    offset: np.ndarray


def rasterize_depth(instances: Sequence[MeshInstance], camera: Camera) -> DepthBuffer:
    """Rasterize mesh instances to a depth buffer."""
    label = "finding the nearest surface"
    corners = np.concatenate([_camera_triangles(instance, camera) for instance in instances])
    flat_corners = corners.reshape(-1, 3)
    clip = transformed(flat_corners, camera.projection)
    indices = np.arange(len(flat_corners), dtype=np.int32).reshape(-1, 3)
    with progress(0.2, 0.8, label):
        fragments = rasterize(clip, indices, camera.width, camera.height)
    triangle = np.full((camera.height, camera.width), -1, dtype=np.int32)
    triangle.flat[fragments.pixel] = fragments.triangle
    depth = np.full(triangle.shape, np.inf)
    for block in row_blocks(len(fragments.pixel), BLOCK_PIXELS):
        report(0.8, label)
        corner_depth = corners[fragments.triangle[block], :, 2]
        depth.flat[fragments.pixel[block]] = -dot(fragments.barycentric[block], corner_depth)
    normal = normalize(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    start = tuple(offsets_from_sizes([len(i.surface.triangles) for i in instances]).tolist())
    return DepthBuffer(camera, start, triangle, depth, normal, dot(normal, corners[:, 0]))


def _is_hidden(
    strokes: Strokes, point: np.ndarray, pixels: np.ndarray, depth_buffer: DepthBuffer
) -> np.ndarray:
    """Return (m,) bool: whether points of strokes are hidden.

    The notes of `clip_to_visible` describe the test.

    Parameters
    ----------
    strokes : Strokes
    point : (m,) ndarray of int
        Indices of points in the frame.
    pixels : (m, 2) float64 ndarray
        Pixel coordinates of these points.
    depth_buffer : DepthBuffer
    """
    camera, points = depth_buffer.camera, strokes.points[point]
    eye = _to_eye(transformed(points, camera.view[:3]), camera)
    normals = strokes.normal[point] @ camera.view[:3, :3].T
    # Outlines have no member of the field. They count as facing neither toward the camera nor away from it.
    facing = np.sign(dot(normals, eye)) * strokes.member[point].any(axis=1)
    hidden, behind_front = np.ones(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    for plane in planes_around(points, pixels, depth_buffer):
        faces_away = np.sign(plane.facing) * facing < 0
        hidden &= plane.hides
        # At a silhouette, a point that faces away is behind a triangle that faces the camera, or the reverse.
        # Then a single triangle of the four is enough, without a bias.
        behind_front |= (plane.triangle >= 0) & faces_away & (plane.distance > 0)
    return hidden | behind_front


class PlanesAround(NamedTuple):
    """For each of n points, the plane of the triangle that is visible at one of the four pixels around it.

    Attributes
    ----------
    triangle : (n,) int32 ndarray
        Index of the triangle; -1 if there is none.
    facing : (n,) float64 ndarray
        Positive if the triangle faces the camera, negative if it faces away.
    distance : (n,) float64 ndarray
        Distance, in world space, from the plane to the point along the ray from the camera. It is positive
        if the point is behind the plane, and negative if it is in front.
    hides : (n,) bool ndarray
        Whether the plane hides the point: the distance is larger than a bias.
    """

    triangle: np.ndarray
    facing: np.ndarray
    distance: np.ndarray
    hides: np.ndarray


def planes_around(
    points: np.ndarray, pixels: np.ndarray, depth_buffer: DepthBuffer
) -> Iterator[PlanesAround]:
    """Yield, for each of the four pixels around points, the planes of the triangles visible there.

    Parameters
    ----------
    points : (n, 3) float64 ndarray
        Points in world space.
    pixels : (n, 2) float64 ndarray
        Pixel coordinates of these points.
    depth_buffer : DepthBuffer
    """
    camera = depth_buffer.camera
    footprint, points = pixel_size(points, camera), transformed(points, camera.view[:3])
    eye = _to_eye(points, camera)
    length = np.sqrt(dot(eye, eye))
    low_pixel = np.floor(pixels - 0.5).astype(np.int64)
    for right in (0, 1):
        for up in (0, 1):
            column = np.clip(low_pixel[:, 0] + right, 0, camera.width - 1)
            row = np.clip(low_pixel[:, 1] + up, 0, camera.height - 1)
            triangle = depth_buffer.triangle[row, column]
            normal = depth_buffer.normal[triangle]
            facing = dot(normal, eye)
            # Distance of the point behind the plane: along the normal, then along the view ray.
            behind_plane = depth_buffer.offset[triangle] - dot(normal, points)
            with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
                distance = np.where(facing != 0, behind_plane / facing, 0) * length
                steepness = np.sqrt(np.maximum(length**2 / facing**2 - 1, 0))
            # NaN if the square of `facing` is 0 and the length as well.
            steepness = np.minimum(np.nan_to_num(steepness), MAX_BIAS_STEEPNESS)
            hides = (triangle >= 0) & (distance > footprint * (DEPTH_BIAS_PX + steepness))
            yield PlanesAround(triangle, facing, distance, hides)


def _to_eye(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Return (n, 3) vectors from points to the camera, in camera space.

    For parallel projection, they are unit vectors in the direction to the camera.
    """
    return -points if camera.is_perspective else np.broadcast_to((0.0, 0.0, 1.0), points.shape)


def _camera_triangles(instance: MeshInstance, camera: Camera) -> np.ndarray:
    """Return the (T, 3, 3) corners of triangles in camera space."""
    matrix = camera.view @ np.asarray(instance.matrix, dtype=np.float64)
    return transformed(instance.surface.vertices, matrix[:3])[instance.surface.triangle_vertex]


def clean_runs(
    visible: np.ndarray, pixels: np.ndarray, start: np.ndarray, max_gap: float, min_run: float
) -> np.ndarray:
    """Return (n,) bool: the visibility of points of strokes, without short runs.

    Hidden runs shorter than `max_gap` become visible. After that, visible runs shorter than `min_run` become
    hidden.

    Parameters
    ----------
    visible : (n,) bool ndarray
        Whether each point is visible.
    pixels : (n, 2) ndarray
        Pixel coordinates of the points.
    start : (S + 1,) ndarray of int
        Index of the first point of each stroke, then n.
    max_gap, min_run : float
        Lengths in pixels.
    """
    arc = arc_lengths(np.nan_to_num(pixels), start)
    for value, min_length in ((False, max_gap), (True, min_run)):
        starts_run = np.ones(len(visible), dtype=bool)
        starts_run[1:] = visible[1:] != visible[:-1]
        starts_run[start[:-1]] = True
        first = np.flatnonzero(starts_run)
        last = np.append(first[1:], len(visible)) - 1
        flip = (visible[first] == value) & (arc[last] - arc[first] < min_length)
        if not value:
            # Hidden runs at the ends of strokes are not gaps between visible runs.
            ends = mask(len(visible) + 1, start)
            flip &= ~ends[first] & ~ends[last + 1]
        visible = visible ^ flip[np.cumsum(starts_run) - 1]
    return visible


# --- smoothing --------------------------------------------------------------------------------------


def smooth(strokes: Strokes, camera: Camera) -> Strokes:
    """Smooth strokes and outlines, so that they do not have corners where they cross edges of the mesh.

    Parameters
    ----------
    strokes : Strokes
        Strokes as `clip_to_visible` returns them, with points at most `SAMPLE_STEP_PX` pixels apart.
    camera : Camera

    Returns
    -------
    Strokes
        The smoothed strokes. Ends and sharp corners are not moved. Other points may leave the surface by a
        fraction of a pixel.
    """
    points = strokes.points.copy()
    for first, stop in _stroke_blocks(strokes.start[1:], SMOOTHED_POINTS):
        report(first / max(len(strokes), 1), "smoothing strokes")
        block = slice(strokes.start[first], strokes.start[stop])
        points[block] = _smoothed_points(strokes.select(np.arange(first, stop)), camera)
    return replace(strokes, points=points)


def _smoothed_points(strokes: Strokes, camera: Camera) -> np.ndarray:
    """Return (n, 3) float64: the points of strokes after smoothing by a binomial filter."""
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

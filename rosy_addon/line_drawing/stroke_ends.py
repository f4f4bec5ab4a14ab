"""Find the free ends of strokes and extend them, and find the ends of strokes that meet head on.

A free end is at an occluding edge, at a border or at the end of a shaded area. Strokes that are extended
beyond it (overshoot) imitate quick drawings by hand, in which lines continue a little too far.
"""

from dataclasses import replace

import numpy as np

from ..core.progress import report
from ..field.blocks import numbered_ranges
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import dot, normalize
from ..projection.camera import Camera
from ..projection.pixel_blocks import reported_blocks
from .point_grid import PointGrid
from .stroke_set import Strokes, arc_lengths
from .tangent_mesh import TangentMesh
from .visibility import (
    MAX_BIAS_STEEPNESS,
    SAMPLE_STEP_PX,
    DepthBuffer,
    pixel_counts,
    pixel_size,
    project_to_pixels,
)

#: Shortest extension of an end, as a fraction of the longest extension.
MIN_EXTENSION_RATIO = 0.3

#: An extension leaves its stroke `BACKTRACK_PX` pixels before the end, or `MAX_BACKTRACK_RATIO` of the length
#: of the stroke if that is less. The direction of the extension is measured over the same length.
BACKTRACK_PX, MAX_BACKTRACK_RATIO = 6.0, 0.25

#: Longest extension of an end, as a fraction of the length of the stroke.
MAX_EXTENSION_RATIO = 0.5

#: A point is on an edge of a triangle if one of its barycentric coordinates is below this.
EDGE_EPS = 1e-9

#: An end meets the end of another stroke if the latter is at most this far ahead, to the side and behind, in
#: spacings.
MAX_FORWARD, MAX_LATERAL, MAX_BACKWARD = 1.2, 0.8, 0.6

#: Largest cosine between the outward directions of two ends that meet, and smallest cosine between
#: their normals.
MAX_DIRECTION_COSINE, MIN_NORMAL_COSINE = -0.8, 0.5

#: Number of ends that are compared with others at once. It bounds memory.
BLOCK_ENDS = 1 << 12


def mark_free_boundary_ends(strokes: Strokes, mesh: TangentMesh) -> Strokes:
    """Return strokes whose `free_ends` are the ends on a boundary of the mesh.

    Parameters
    ----------
    strokes : Strokes
        Strokes as they were traced, with barycentric weights at their ends.
    mesh : TangentMesh
        The mesh on which they were traced. Its boundaries are the borders of the surface and the
        creases that strokes do not cross.
    """
    ends = np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1)
    on_edge = strokes.weights[ends] < EDGE_EPS
    at_boundary = (on_edge & (mesh.neighbor[strokes.triangle[ends]] < 0)).any(axis=2)
    return replace(strokes, free_ends=at_boundary & ~strokes.closed[:, None])


def extend_free_ends(
    strokes: Strokes, camera: Camera, max_pixels: float, depth_buffer: DepthBuffer | None
) -> Strokes:
    """Extend the free ends of strokes in straight lines of pseudorandom lengths.

    Outlines, which do not follow the field, are not extended.

    Parameters
    ----------
    strokes : Strokes
        Strokes as `clip_to_visible` returns them.
    camera : Camera
    max_pixels : float
        Longest extension in pixels. The shortest is `MIN_EXTENSION_RATIO` of it.
    depth_buffer : DepthBuffer or None
        If given, extensions are straight in the picture. They are at the depth of the end, or on
        the visible surface where the surface is nearer or at about the same depth.
        If None, extensions are straight in world space.

    Returns
    -------
    Strokes
        The strokes with their extensions. Points of extensions are at most `SAMPLE_STEP_PX` pixels apart.
        Extensions are not clipped to the frame.

    See Also
    --------
    mark_free_boundary_ends : Marks the ends at borders as free.
    Strokes.runs_where : Marks the ends at removed points as free.
    """
    report(0.0, "extending strokes")
    if depth_buffer is None:
        strokes = strokes.subdivided(pixel_counts(strokes, camera))
    arc = arc_lengths(np.nan_to_num(project_to_pixels(strokes.points, camera)[0]), strokes.start)
    ends = np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1)
    is_free = strokes.free_end_mask & strokes.member[ends].any(axis=2)
    stroke, side = np.nonzero(is_free & (arc[ends[:, 1]] > 0)[:, None])
    end, total = ends[stroke, side], arc[ends[stroke, 1]]
    backtrack = np.minimum(BACKTRACK_PX, MAX_BACKTRACK_RATIO * total)
    if depth_buffer is None:
        start_point, origin = end, strokes.points[end]
        before = strokes.points[_point_before_end(arc, strokes, end, backtrack)]
        step = pixel_size(origin, camera)[:, None] * normalize(origin - before)
    else:
        start_point, origin, step = _extension_in_picture(strokes, arc, end, backtrack, camera)
    length = max_pixels * _extension_ratios(len(strokes))[stroke, side]
    length = np.minimum(length, MAX_EXTENSION_RATIO * total) + np.abs(arc[end] - arc[start_point])
    is_valid = step.any(axis=1) & np.isfinite(step).all(axis=1)
    lines = (column[is_valid] for column in (start_point, side, origin, step, length))
    extended, distance = _append_extensions(strokes, *lines)
    if depth_buffer is None:
        return extended
    return _drop_onto_surfaces(extended, distance, depth_buffer, camera)


def _extension_in_picture(
    strokes: Strokes, arc: np.ndarray, end: np.ndarray, backtrack: np.ndarray, camera: Camera
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the lines along which k ends are extended, for extensions that are straight in the picture.

    Each line lies in the plane through the end of the stroke that is parallel to the image plane. It leaves
    the stroke `backtrack` pixels before its end, because strokes close to a silhouette bend along it.

    Parameters
    ----------
    strokes : Strokes
    arc : (n,) float64 ndarray
        Arc lengths of points, in pixels.
    end : (k,) int64 ndarray
        Indices of the end points.
    backtrack : (k,) float64 ndarray
        Length in pixels before the end over which the direction is measured.
    camera : Camera

    Returns
    -------
    start_point : (k,) int64 ndarray
        Indices of the points at which the extensions leave the strokes.
    origin : (k, 3) float64 ndarray
        Start of each line, in world space.
    step : (k, 3) float64 ndarray
        Step of one pixel along each line, in world space.
    """
    start_point = _point_before_end(arc, strokes, end, backtrack)
    before = _point_before_end(arc, strokes, end, backtrack + np.abs(arc[end] - arc[start_point]))
    start_pixel, depth = project_to_pixels(strokes.points[start_point], camera)
    before_pixel, _ = project_to_pixels(strokes.points[before], camera)
    _, end_depth = project_to_pixels(strokes.points[end], camera)
    origin = _move_to_depth(strokes.points[start_point], depth, end_depth, camera)
    step = _pixel_steps_to_world(normalize(start_pixel - before_pixel), end_depth, camera)
    return start_point, origin, step


def _point_before_end(
    arc: np.ndarray, strokes: Strokes, end: np.ndarray, distance: np.ndarray
) -> np.ndarray:
    """Return (k,) indices of points: for each end, the nearest point that is at least `distance` away.

    The distance is measured along the stroke, in the unit of the arc lengths `arc`. `end` holds the indices
    of the end points.
    """
    stroke = strokes.stroke[end]
    first, last = strokes.start[stroke], strokes.start[stroke + 1] - 1
    stride = 2 * arc.max(initial=0) + 1
    key = arc + strokes.stroke * stride
    after = np.searchsorted(key, distance + stroke * stride, side="left")
    before = np.searchsorted(key, arc[last] - distance + stroke * stride, side="right") - 1
    return np.clip(np.where(end == first, after, before), first, last)


def _move_to_depth(
    points: np.ndarray, depth: np.ndarray, target_depth: np.ndarray, camera: Camera
) -> np.ndarray:
    """Return (k, 3) points in world space, moved along their view rays from `depth` to `target_depth`.

    Both depths, (k,), are measured along the axis of the camera.
    """
    to_camera = camera.view_directions(points)
    return points + ((depth - target_depth) / (to_camera @ camera.view[2, :3]))[:, None] * to_camera


def _pixel_steps_to_world(pixel_steps: np.ndarray, depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Convert (k, 2) steps in pixels to (k, 3) steps in world space, parallel to the image plane.

    `depth` is the (k,) depth along the axis of the camera.
    """
    view_steps = (pixel_steps * 2 / (camera.width, camera.height)) @ camera.clip_to_camera_xy.T
    if camera.is_perspective:
        view_steps *= depth[:, None]
    return view_steps @ camera.view[:2, :3]


def _extension_ratios(count: int) -> np.ndarray:
    """Return (count, 2) float64: a pseudorandom ratio, `MIN_EXTENSION_RATIO` to 1, for each end of strokes.

    Each ratio is a hash of the index of the end.
    """
    bits = np.arange(1, 2 * count + 1, dtype=np.uint64)
    for shift, factor in ((32, 0x9E3779B97F4A7C15), (29, 0xBF58476D1CE4E5B9), (32, 1)):
        bits = (bits ^ (bits >> np.uint64(shift))) * np.uint64(factor)
    ratio = (bits >> np.uint64(11)).astype(np.float64) / 2.0**53
    return (MIN_EXTENSION_RATIO + (1 - MIN_EXTENSION_RATIO) * ratio).reshape(count, 2)


def _append_extensions(
    strokes: Strokes,
    start_point: np.ndarray,
    side: np.ndarray,
    origin: np.ndarray,
    step: np.ndarray,
    length: np.ndarray,
) -> tuple[Strokes, np.ndarray]:
    """Replace k ends of strokes by straight lines.

    Parameters
    ----------
    strokes : Strokes
    start_point : (k,) int64 ndarray
        Indices of the points at which the lines leave their strokes.
    side : (k,) int64 ndarray
        0 if the line is at the first point of its stroke, 1 if at the last point.
    origin : (k, 3) float64 ndarray
        Start of the line in world space: the start point, or a point at the same position in the picture.
    step : (k, 3) float64 ndarray
        Step of one pixel along the line, in world space.
    length : (k,) float64 ndarray
        Length of the line in pixels.

    Returns
    -------
    extended : Strokes
        The strokes with the lines, n points in all.
    distance : (n,) float64 ndarray
        Distance in pixels of each point from the start of its line; 0 for original points of strokes.
    """
    low, high = strokes.start[:-1].copy(), strokes.start[1:] - 1
    owner, at_start = strokes.stroke[start_point], side == 0
    low[owner[at_start]], high[owner[~at_start]] = start_point[at_start], start_point[~at_start]
    kept = np.arange(len(strokes.points))
    kept = kept[(kept >= low[strokes.stroke]) & (kept <= high[strokes.stroke])]
    count = np.ceil(length / SAMPLE_STEP_PX).astype(np.int64)
    line, number = numbered_ranges(np.ones_like(count), count)
    sort_key = start_point[line] + np.where(at_start[line], -number, number)
    sort_key = np.concatenate([kept, sort_key])
    point = np.concatenate([kept, start_point[line]])
    line_distance = (length / count)[line] * number
    distance = np.concatenate([np.zeros(len(kept)), line_distance])
    line_points = origin[line] + line_distance[:, None] * step[line]
    points = np.concatenate([strokes.points[kept], line_points])
    order = np.lexsort((sort_key, strokes.stroke[point]))
    point, distance = point[order], distance[order]
    extended = strokes.take_points(point)
    extended.weights[distance > 0] = np.nan
    start = offsets_from_sizes(np.bincount(strokes.stroke[point], minlength=len(strokes)))
    return replace(extended, points=points[order], start=start), distance


def _drop_onto_surfaces(
    strokes: Strokes, distance: np.ndarray, depth_buffer: DepthBuffer, camera: Camera
) -> Strokes:
    """Move points of extensions along their view rays onto the visible surface.

    Points are moved only if the surface is in front of them, or behind them by less than a tolerance.
    `distance`, (n,), is the distance in pixels of a point of an extension from the start of the extension,
    and 0 for other points.
    """
    extended = np.flatnonzero(distance > 0)
    points = strokes.points[extended]
    pixels, depth = project_to_pixels(points, camera)
    last_pixel = np.array(camera.size) - 1
    column, row = np.clip(np.nan_to_num(pixels), 0, last_pixel).astype(np.int64).T
    target_depth = depth_buffer.depth[row, column]
    reach = MAX_BIAS_STEEPNESS * (distance[extended] + BACKTRACK_PX)
    moves = target_depth < depth + reach * pixel_size(points, camera)
    extended = extended[moves]
    moved, normal = strokes.points.copy(), strokes.normal.copy()
    moved[extended] = _move_to_depth(points[moves], depth[moves], target_depth[moves], camera)
    triangle = depth_buffer.triangle[row, column][moves]
    normal[extended] = depth_buffer.normal[triangle] @ camera.view[:3, :3]
    return replace(strokes, points=moved, normal=normal)


# --- ends that meet ------------------------------------------------------------------------------------


def head_on_ends(strokes: Strokes) -> np.ndarray:
    """Return which ends of strokes meet the end of another stroke head on.

    Strokes that grow toward each other are rarely aligned, so both end where they meet. If these ends
    were tapered like others, a light band would appear where the strokes from both sides meet.

    Parameters
    ----------
    strokes : Strokes

    Returns
    -------
    (S, 2) bool ndarray
        Values for the first and the last point of each stroke.
    """
    ends = np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1).ravel()
    next_to_end = np.stack([strokes.start[:-1] + 1, strokes.start[1:] - 2], axis=1).ravel()
    position, normal, spacing = strokes.points[ends], strokes.normal[ends], strokes.spacing[ends]
    outward = normalize(position - strokes.points[next_to_end])
    result = np.zeros(len(ends), dtype=bool)
    if not len(ends):
        return result.reshape(-1, 2)
    grid = PointGrid(MAX_FORWARD * float(np.median(spacing)), len(ends))
    grid.add(position, MAX_FORWARD * spacing)
    radius = float(np.hypot(MAX_FORWARD, MAX_LATERAL)) * spacing
    for block in reported_blocks(len(ends), "shaping ends", size=BLOCK_ENDS):
        query, other = grid.pairs_within(position[block], radius[block])
        query = query + block.start
        delta = position[other] - position[query]
        forward = dot(delta, outward[query])
        lateral = np.sqrt(np.maximum(dot(delta, delta) - forward**2, 0))
        meets = (query != other) & (dot(outward[query], outward[other]) < MAX_DIRECTION_COSINE)
        meets &= dot(normal[query], normal[other]) > MIN_NORMAL_COSINE
        meets &= forward < MAX_FORWARD * spacing[query]
        meets &= forward > -MAX_BACKWARD * spacing[query]
        meets &= lateral < MAX_LATERAL * spacing[query]
        result[query[meets]] = True
    return result.reshape(-1, 2)

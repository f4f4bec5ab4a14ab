"""Shadows: the bodies as a light sees them, and whether it sees what the eye sees.

What a light sees is found by the rasteriser that finds what the eye sees. A pixel is lit where the
light sees nothing nearer; to either side of a border the answers of neighbouring rays are mixed. A
surface is not to shade itself by the width of those rays: the point that is asked for is
moved off the surface, by as much as that takes (Holbert, "Saying goodbye to shadow acne", 2011).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..field.frames import unit
from .camera import Camera, look_at, orthographic_camera, perspective_camera
from .gbuffer import Body, GBuffer
from .project import rasterised

#: Pixels of a light's view, each way.
SIDE = 2048

#: Over so many of them, each way, the answers are mixed.
WIDTH = 3

#: By so many of them points are moved off their surface: half of `WIDTH`, half of a pixel for the one
#: that is looked at, both along the diagonal, and something for a surface that is curved.
OFFSET = 3.2

#: How much farther away than the border of what is lit a lamp has to be, to light it by one view.
OUTSIDE = 1.3

#: Pixels that are worked on at once: bounds memory, and fits the caches.
BLOCK = 1 << 15


def light_cameras(
    bodies: Sequence[Body], camera: Camera, kind: str, vector: np.ndarray, side: int = SIDE
) -> list[Camera]:
    """How a light sees those bodies that have a field.

    Parameters
    ----------
    bodies : sequence of Body
        All that casts shadows.
    camera : Camera
        In whose space the vector is.
    kind : {"sun", "point"}
    vector : (3,) ndarray
        The unit direction to a sun, the position of a point.
    side : int
        Pixels of each view.

    Returns
    -------
    list of Camera
        One, or six all around a point that is among the bodies.
    """
    turn = camera.view[:3, :3].T
    casting = np.concatenate([bounds_of(body) for body in bodies])
    shown = np.concatenate([bounds_of(body) for body in bodies if body.field is not None])
    vector = np.asarray(vector, dtype=np.float64)
    if kind == "sun":
        return [sun_camera(turn @ vector, casting, shown, side)]
    return _point_cameras(turn @ (vector - camera.view[:3, 3]), casting, shown, side)


def bounds_of(body: Body) -> np.ndarray:
    """(8, 3) corners of the box around a body, in world space."""
    matrix = np.asarray(body.matrix, dtype=np.float64)
    return body.surface.bounds @ matrix[:3, :3].T + matrix[:3, 3]


def sun_camera(direction: np.ndarray, casting: np.ndarray, shown: np.ndarray, side: int) -> Camera:
    """What a sun sees of points.

    Parameters
    ----------
    direction : (3,) ndarray
        To it, world space.
    casting, shown : (n, 3) ndarray
        Of what may cast shadows, and of what they may fall on.
    side : int
        Pixels.
    """
    direction = unit(direction)
    up = np.eye(3)[np.argmin(np.abs(direction))]
    view = look_at(direction, (0, 0, 0), up)
    flat = shown @ view[:2, :3].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    height = casting @ direction
    scale = max(float((high - low).max()), 1e-9) * (1 + 4 * OFFSET / side)
    # From a little before the first thing that it meets.
    room = 0.01 * max(float(np.ptp(height)), scale)
    view[:2, 3] = -(low + high) / 2
    view[2, 3] = -(height.max() + room)
    reach = float(np.ptp(height)) + 2 * room
    return orthographic_camera(view, side, side, scale=scale, clip=(0.0, reach), name="sun")


def _point_cameras(
    place: np.ndarray, casting: np.ndarray, shown: np.ndarray, side: int
) -> list[Camera]:
    centre = (shown.min(axis=0) + shown.max(axis=0)) / 2
    radius = float(np.linalg.norm(shown - centre, axis=1).max())
    away = float(np.linalg.norm(centre - place))
    far = float(np.linalg.norm(casting - place, axis=1).max()) * 1.01 + 1e-9
    clip = (1e-3 * far, far)
    if away > OUTSIDE * radius:
        up = np.eye(3)[np.argmin(np.abs(centre - place))]
        fov = 2 * np.arcsin(radius / away) * (1 + 4 * OFFSET / side)
        view = look_at(place, centre, up)
        return [perspective_camera(view, side, side, fov=fov, clip=clip, name="lamp")]
    views = [
        look_at(place, place + sign * np.eye(3)[axis], np.eye(3)[axis - 2])
        for axis in range(3)
        for sign in (1, -1)
    ]
    fov = np.pi / 2
    return [perspective_camera(view, side, side, fov=fov, clip=clip, name="lamp") for view in views]


def nearest_depth(bodies: Sequence[Body], camera: Camera) -> np.ndarray:
    """(H, W) float32: how far away along a camera's axis the nearest surface is; inf if none is."""
    fragments, _ = rasterised(bodies, camera)
    depth = np.full(camera.width * camera.height, np.inf, dtype=np.float32)
    along, base = camera.projection[2, 2:]
    if camera.is_perspective:
        depth[fragments.pixel] = base / (fragments.depth + along)
    else:
        depth[fragments.pixel] = (fragments.depth - base) / -along
    return depth.reshape(camera.height, camera.width)


def reached(gbuffer: GBuffer, cameras: Sequence[Camera]) -> np.ndarray:
    """The share of a light's rays that meet nothing on their way to the pixels of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
        With its bodies.
    cameras : sequence of Camera
        Of `light_cameras`.

    Returns
    -------
    (P,) float32 ndarray
        0 to 1.
    """
    turn, shift = gbuffer.camera.view[:3, :3], gbuffer.camera.view[:3, 3]
    result = np.ones(len(gbuffer.pixel), dtype=np.float32)
    for camera in cameras:
        depth = nearest_depth(gbuffer.bodies, camera)
        for start in range(0, len(result), BLOCK):
            part = slice(start, start + BLOCK)
            points = (gbuffer.position[part] - shift) @ turn
            result[part] *= open_to(camera, depth, points, gbuffer.normal[part] @ turn)
    return result


def open_to(
    camera: Camera, depth: np.ndarray, points: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Whether a camera sees points, or something nearer.

    Parameters
    ----------
    camera : Camera
    depth : (H, W) ndarray
        Of `nearest_depth`.
    points, normals : (n, 3) ndarray
        World space; the normals are unit.

    Returns
    -------
    (n,) float32 ndarray
        From 0, hidden, to 1, also outside of what the camera sees.
    """
    turn, shift = camera.view[:3, :3], camera.view[:3, 3]
    place = points @ turn.T + shift
    away = np.abs(place[:, 2:]) if camera.is_perspective else 1.0
    place = place + OFFSET / camera.pixels_per_unit * away * (normals @ turn.T)
    clip = place @ camera.projection[:3, :3].T + camera.projection[:3, 3]
    # In front of the eye; behind it nothing is asked.
    ahead = -place[:, 2]
    divisor = np.where(ahead > 0, ahead, 1.0) if camera.is_perspective else np.ones(len(place))
    x, y = clip[:, 0] / divisor, clip[:, 1] / divisor
    asked = np.flatnonzero((np.abs(x) <= 1) & (np.abs(y) <= 1) & (ahead > 0))
    seen = np.ones(len(points), dtype=np.float32)
    size = np.array([camera.width, camera.height])
    pixel = (np.stack([x[asked], y[asked]], axis=1) * 0.5 + 0.5) * size
    seen[asked] = _share_beyond(depth, pixel, ahead[asked])
    return seen


def _share_beyond(depth: np.ndarray, pixel: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """(n,) of a square of pixels, the share in which nothing is nearer than a number."""
    height, width = depth.shape
    corner = pixel - 0.5 * WIDTH
    first = np.floor(corner)
    share = (corner - first).astype(np.float32)
    first = first.astype(np.intp)
    ahead = ahead.astype(np.float32)
    columns = [np.clip(first[:, 0] + step, 0, width - 1) for step in range(WIDTH + 1)]
    rows = [np.clip(first[:, 1] + step, 0, height - 1) * width for step in range(WIDTH + 1)]
    # The first and the last are covered in part, and together as much as one.
    parts = [1 - share.T, *[np.ones_like(share.T)] * (WIDTH - 1), share.T]
    hidden = np.zeros(len(pixel), dtype=np.float32)
    for row, (_, up) in zip(rows, parts, strict=True):
        across = np.zeros(len(pixel), dtype=np.float32)
        for column, (own, _) in zip(columns, parts, strict=True):
            across += own * (depth.take(row + column) < ahead)
        hidden += up * across
    return np.maximum(1 - hidden / np.float32(WIDTH**2), 0)

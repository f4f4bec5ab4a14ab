"""How much of the sky the corners of a surface see: ambient occlusion, by shadows from all sides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import RosyError
from ..field.frames import dot, unit
from ..field.surface import Surface, mix_over_fans
from ..progress import Progress, Work, drain
from .gbuffer import Body
from .shadows import OFFSET, bounds_of, nearest_depth, open_to, sun_camera

#: From how many sides it is looked at, and by so many pixels each way.
DIRECTIONS, SIDE = 256, 512

#: Points are asked for so far inside of their faces, in pixels of that, lest walls that stand on
#: an edge hide them by halves; but by no more than this share of the way to the middle of the faces.
INSET, LARGEST_INSET = 2 * OFFSET, 0.3


def occluding(
    bodies: Sequence[Body], number: int, directions: int = DIRECTIONS, side: int = SIDE
) -> Work[np.ndarray]:
    """The light of an even sky that reaches the corners of a body.

    Parameters
    ----------
    bodies : sequence of Body
        All that is in the way.
    number : int
        Which of them it is about.
    directions : int
        Of the light. They are spread evenly over the sphere.
    side : int
        Pixels of each shadow map.

    Yields
    ------
    Progress

    Returns
    -------
    (C,) float32 ndarray
        1 where all of the half of the sky above is seen, 0 where nothing is; what is overhead counts
        more than what is low, as it does for light. The same over each smooth fan.

    Raises
    ------
    RosyError
        If there are no directions.
    """
    if directions < 1:
        raise RosyError(f"{directions} directions: light comes from 1 at least")
    body = bodies[number]
    shown = bounds_of(body)
    casting = np.concatenate([bounds_of(other) for other in bodies])
    pixel = float(np.ptp(shown, axis=0).max()) / side
    points, normals = _fan_points(body, INSET * pixel)
    seen, most = np.zeros(len(points)), np.zeros(len(points))
    for count, direction in enumerate(even_directions(directions)):
        yield Progress(count / directions, "looking from all sides")
        facing = normals @ direction
        toward = np.flatnonzero(facing > 0)
        camera = sun_camera(direction, casting, shown, side)
        depth = nearest_depth(bodies, camera)
        most[toward] += facing[toward]
        seen[toward] += facing[toward] * open_to(camera, depth, points[toward], normals[toward])
    share = np.divide(seen, most, out=np.ones_like(seen), where=most > 0)
    return share[body.surface.corner_fan].astype(np.float32)


def ambient_occlusion(
    bodies: Sequence[Body], number: int, directions: int = DIRECTIONS, side: int = SIDE
) -> np.ndarray:
    """`occluding`, run to its end."""
    return drain(occluding(bodies, number, directions, side))


def even_directions(count: int) -> np.ndarray:
    """(count, 3) unit vectors, evenly over the sphere, on a spiral of golden angles."""
    number = np.arange(count)
    z = 1 - (2 * number + 1) / count
    turn = number * (np.pi * (3 - np.sqrt(5)))
    out = np.sqrt(1 - z * z)
    return np.stack([out * np.cos(turn), out * np.sin(turn), z], axis=1)


def _fan_points(body: Body, inset: float) -> tuple[np.ndarray, np.ndarray]:
    """(K, 3) a place a little inside of the faces of each fan and (K, 3) its normal, world space."""
    surface, matrix = body.surface, np.asarray(body.matrix, dtype=np.float64)
    linear, shift = matrix[:3, :3], matrix[:3, 3]
    vertex, centre = _fan_places(surface)
    place, centre = vertex @ linear.T + shift, centre @ linear.T + shift
    way = centre - place
    length = np.sqrt(dot(way, way))
    share = np.minimum(LARGEST_INSET, inset / np.maximum(length, 1e-30))
    a, b, c = linear
    cofactors = np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
    return place + share[:, None] * way, unit(surface.fan_normal @ cofactors.T)


def _fan_places(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """(K, 3) the vertex of each fan, and (K, 3) the mean of the middles of its faces."""
    vertex = np.empty((len(surface.fan_normal), 3))
    vertex[surface.corner_fan] = surface.vertices[surface.corner_vertex]
    middles = mix_over_fans(surface.face_centre[surface.corner_face], surface.corner_fan)
    return vertex, middles / np.bincount(surface.corner_fan)[:, None]

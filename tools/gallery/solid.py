"""Fields on surfaces, and pictures of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.picture import Picture
from rosy_addon.field.corner_fans import corner_angles, corner_rotations, smooth_face_values
from rosy_addon.field.frames import normalize
from rosy_addon.field.representation import (
    face_frames,
    face_representation,
    from_representation,
    power,
)
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface
from rosy_addon.projection.camera import Camera, orbit_camera
from rosy_addon.projection.gbuffer import GBuffer, MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput
from tests.harness.planar import DegreeLayer, degree_layers


def harmonic_field(surface: Surface, degree: int, axes: np.ndarray) -> RosyField:
    """Return the RoSy of degree N with z = sum of (a.x + i a.y)^N over projected axes a.

    On the sphere, the three axes of a cube and N = 4 give the pattern of a cube, singular at its
    eight corners; the six axes of an icosahedron and N = 6 one that is singular at twelve points.
    """
    x, y = face_frames(surface)
    z = power((x + 1j * y) @ axes.T, degree).sum(axis=1)
    return RosyField(degree, from_representation(z, x, y, degree))


def icosahedron_axes() -> np.ndarray:
    """Return (6, 3) unit directions to vertices of an icosahedron, one of each opposite pair."""
    golden = (1 + np.sqrt(5)) / 2
    axes = [np.roll([0, sign, golden], shift) for shift in range(3) for sign in (1, -1)]
    return normalize(np.array(axes, dtype=np.float64))


def around_field(surface: Surface, degree: int) -> RosyField:
    """Return the field with one member around the z axis."""
    direction = np.cross([0.0, 0.0, 1.0], surface.face_center)
    direction -= np.sum(direction * surface.face_normal, axis=1)[:, None] * surface.face_normal
    return RosyField(degree, normalize(direction))


def smoothed(surface: Surface, field: RosyField, rounds: int) -> RosyField:
    """Smooth a field by repeated averaging, with magnitude 1.

    Singularities of opposite signs cancel.
    """
    x, y = face_frames(surface)
    rotations = corner_rotations(surface.face_normal, x, surface.corner_face, surface.corner_normal)
    weights, z = corner_angles(surface), face_representation(surface, field)
    for _ in range(rounds):
        z = smooth_face_values(surface, z, rotations, field.degree, weights)
        z /= np.maximum(np.abs(z), 1e-12)
    return RosyField(field.degree, from_representation(z, x, y, field.degree))


def view(
    surface: Surface,
    angles: tuple[float, float],
    size: tuple[int, int],
    supersampling: int,
    perspective: bool = True,
) -> Camera:
    """Return a camera that frames a surface, with `supersampling` times `size` pixels."""
    width, height = (supersampling * side for side in size)
    return orbit_camera(
        surface.vertices, *angles, width, height, perspective=perspective, margin=0.006
    )


def compose_view(surface: Surface, field: RosyField, look: Look, camera: Camera) -> Picture:
    """Draw a field; the resolution of the camera includes the supersampling of the look."""
    return compose(project([MeshInstance(surface, np.eye(4), field)], camera, look.display), look)


def layer_in_view(surface: Surface, field: RosyField, look: Look, camera: Camera) -> DegreeLayer:
    """Return the images that `compose_view` draws a field with."""
    instance = MeshInstance(surface, np.eye(4), field)
    (layer,) = degree_layers(project([instance], camera, look.display), look)
    return layer


def render_view(
    surface: Surface, field: RosyField, look: Look, angles: tuple[float, float], side: int
) -> np.ndarray:
    """Return the (side, side, 4) linear RGBA of a field as users draw it, with its singularities."""
    instance = MeshInstance(surface, np.eye(4), field)
    view_input = ViewInput((instance,), view(surface, angles, (side, side), 1), look)
    return draw_picture(view_input).rgba


def curve_through(start: tuple, middle: tuple, stop: tuple) -> np.ndarray:
    """Return (n, 2) points of a parabola through three points, in picture coordinates.

    These are fractions of the picture from the top left.
    """
    t = np.linspace(0, 1, 60)[:, None]
    a, b, c = (np.array(point) for point in (start, middle, stop))
    return (1 - t) * (1 - 2 * t) * a + 4 * t * (1 - t) * b + t * (2 * t - 1) * c


def points_on_surface(surface: Surface, camera: Camera, curve: np.ndarray) -> np.ndarray:
    """Return the points of a surface that a camera sees at (n, 2) places of the picture, without misses."""
    buffer = _visible_pixels(surface, camera)
    position = np.full((camera.height * camera.width, 3), np.nan)
    position[buffer.pixel] = (
        buffer.position @ camera.view[:3, :3] - camera.view[:3, 3] @ camera.view[:3, :3]
    )
    column, row = (curve * (camera.width, camera.height)).astype(int).T
    points = position.reshape(camera.height, camera.width, 3)[camera.height - 1 - row, column]
    return points[np.isfinite(points).all(axis=1)]


def visible_points(
    points: np.ndarray, normals: np.ndarray, camera: Camera, supersampling: int
) -> list[tuple[float, float]]:
    """Return (x, y) of the visible points of a convex surface, in pixels from the upper left.

    `supersampling` is the number of camera pixels per picture pixel.
    """
    camera_points = points @ camera.view[:3, :3].T + camera.view[:3, 3]
    facing = np.sum(camera_points * (normals @ camera.view[:3, :3].T), axis=1) < 0
    clip = (
        np.append(camera_points[facing], np.ones((facing.sum(), 1)), axis=1) @ camera.projection.T
    )
    across, upward = (clip[:, :2] / clip[:, 3:] / 2 + 0.5).T
    width, height = camera.width / supersampling, camera.height / supersampling
    return [(x * width, (1 - y) * height) for x, y in zip(across, upward, strict=True)]


def _visible_pixels(surface: Surface, camera: Camera) -> GBuffer:
    """Return the G-buffer of a surface without a field of its own."""
    field = RosyField(1, np.broadcast_to([1.0, 0.0, 0.0], (surface.face_count, 3)))
    return project([MeshInstance(surface, np.eye(4), field)], camera)


def frame_of(values: np.ndarray, pixel: np.ndarray, shape: Sequence[int]) -> np.ndarray:
    """Return (H, W) values at their pixels, 0 elsewhere."""
    frame = np.zeros(int(np.prod(shape)), dtype=np.float64)
    frame[pixel] = values
    return frame.reshape(shape)

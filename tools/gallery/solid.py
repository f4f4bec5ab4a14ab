"""Make fields on surfaces, and draw them."""

from collections.abc import Callable, Sequence

import numpy as np

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.picture import Picture
from rosy_addon.core.color import from_hex, to_linear
from rosy_addon.field.analysis import angle_errors
from rosy_addon.field.corner_fans import corner_angles, corner_rotations, smooth_face_values
from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.directional_field import field_from_directions, tensor_field
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import GeneratorSettings, axis_field, generate
from rosy_addon.field.representation import (
    face_representation,
    from_representation,
    power,
)
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface
from rosy_addon.projection.camera import Camera, orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from tests.harness.planar import DegreeLayer, degree_layers


def harmonic_field(surface: Surface, degree: int, axes: np.ndarray) -> RosyField:
    """Return a RoSy field of degree N that is a sum over some axes.

    In the frame (x, y) of a face, the N-th power of a member is z = sum of (a.x + i a.y)^N over the axes a.
    On the sphere, the three axes of a cube and N = 4 give a field with singularities at the eight corners of
    the cube. The six axes of an icosahedron and N = 6 give a field with twelve singularities.
    """
    x, y = surface.face_frames
    z = power((x + 1j * y) @ axes.T, degree).sum(axis=1)
    return RosyField(degree, from_representation(z, x, y, degree))


def icosahedron_axes() -> np.ndarray:
    """Return the (6, 3) unit directions to one vertex of each opposite pair of an icosahedron."""
    golden = (1 + np.sqrt(5)) / 2
    axes = [np.roll([0, sign, golden], shift) for shift in range(3) for sign in (1, -1)]
    return normalize(np.array(axes, dtype=np.float64))


def around_field(surface: Surface, degree: int) -> RosyField:
    """Return a field of magnitude 1 with one member in the direction of rotation about the z axis."""
    direction = np.cross([0.0, 0.0, 1.0], surface.face_center)
    direction -= np.sum(direction * surface.face_normal, axis=1)[:, None] * surface.face_normal
    return RosyField(degree, normalize(direction))


def smoothed(surface: Surface, field: RosyField, rounds: int) -> RosyField:
    """Smooth a field by repeated averaging over neighboring faces. The result has magnitude 1.

    Pairs of singularities of opposite signs vanish.
    """
    x, y = surface.face_frames
    rotations = corner_rotations(surface, surface.corner_normal)
    weights, z = corner_angles(surface), face_representation(surface, field)
    for _ in range(rounds):
        z = smooth_face_values(surface, z, rotations, field.degree, weights)
        z /= np.maximum(np.abs(z), 1e-12)
    return RosyField(field.degree, from_representation(z, x, y, field.degree))


def even_curvature(surface: Surface, degree: int) -> RosyField:
    """Return the slightly smoothed curvature field of a surface, without the noise of small faces."""
    return smoothed(surface, curvature_field(surface, degree), 6)


def ring_curvature(rings: Surface, degree: int = 4) -> RosyField:
    """Return a smooth field along the principal curvature directions of the triple torus."""
    return smoothed(rings, curvature_field(rings, degree), 200)


def pairs_of_directions(ball: Surface, degree: int) -> RosyField:
    """Return a field of two pairs of opposite directions on a sphere, with angles from 90 to 25 degrees."""
    up = 1 - np.abs(ball.face_center[:, 2])
    half = np.radians(12.5 + (45 - 12.5) * np.clip(up, 0, 1))[:, None]
    along = normalize(axis_field(ball, 1).vectors)
    across = np.cross(ball.face_normal, along)
    first, second = (np.cos(half) * along + sign * np.sin(half) * across for sign in (1, -1))
    return field_from_directions(ball, np.stack([first, second, -first, -second], axis=1))


def stress_of_force(ring: Surface, degree: int) -> RosyField:
    """Return the field of tension and compression in a ring, with a force at its side."""
    offset = ring.face_center - (1.2, -1.4, 0.6)
    distance = np.sqrt(dot(offset, offset))[:, None, None]
    outward = normalize(offset)
    tensors = outward[:, :, None] * outward[:, None, :] / distance - 0.35 * np.eye(3) * distance
    return tensor_field(ring, tensors)


def ring_of_singularities(
    ball: Surface, distance: float, far: float = 7.0, degree: int = 4
) -> RosyField:
    """Return a field on a sphere with eight singularities on one or two circles around the view direction.

    Parameters
    ----------
    ball : Surface
        The unit sphere.
    distance : float
        The singularities are points of a circle of radius 1 that are projected to the sphere from its center.
        This is the distance of the circle from the center of the sphere, toward the eye. Singularities at
        angles of at least `far` are on a second circle, which is as far away from the eye.
    far : float
        Angle around the view direction, in radians.
    """
    axes = view(ball, (-26, 8), (256, 256), 1).view[:3, :3]
    angle = np.arange(8) * np.pi / 4 + 0.2
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes[:2]
    centers = np.where(angle < far, distance, -distance)[:, None] * axes[2]
    vertex = [int((ball.vertices @ point).argmax()) for point in normalize(circle + centers)]
    settings = GeneratorSettings("prescribed", singularities=(vertex, np.ones(8, dtype=int)))
    return generate(ball, settings, degree)


def planar_field(
    square: Surface, degree: int, z_of: Callable[[np.ndarray], np.ndarray]
) -> RosyField:
    """Return a field in the plane z = 0, given a member as a function of points, as complex numbers."""
    z = z_of(square.face_center[:, 0] + 1j * square.face_center[:, 1])
    return RosyField(degree, np.stack([z.real, z.imag, np.zeros(len(z))], axis=1))


def vortices(p: np.ndarray) -> np.ndarray:
    """Return a member of a cross field with one positive and one negative singularity."""
    z = (p + 0.35) * (p - 0.35).conj()
    return (z / np.abs(z) * np.exp(0.6j)) ** (1 / 4)


def wind(p: np.ndarray) -> np.ndarray:
    """Return a vector field with a vortex and a saddle."""
    z = 1j * (p + 0.4) * (p - 0.6).conj()
    return z / np.abs(z)


def height(surface: Surface) -> np.ndarray:
    """Return the (C,) z coordinates of the corners of a surface."""
    return surface.vertices[surface.corner_vertex, 2]


def height_on_the_left(surface: Surface) -> np.ndarray:
    """Return the (C,) z coordinates of corners on the left side of a surface, NaN on the right side."""
    is_left = surface.vertices[surface.corner_vertex, 0] < 0.2
    return np.where(is_left, height(surface), np.nan)


def angle_to_curvature(surface: Surface) -> np.ndarray:
    """Return the (C,) angles, in degrees, between the fields of the generators form and curvature."""
    errors = angle_errors(surface, generate(surface, "form", 4), curvature_field(surface, 4))
    return np.degrees(errors)[surface.corner_face]


#: Numbers for the color map, by name: functions of a surface that return a number for each corner.
VALUES = {"height": height, "left": height_on_the_left, "angle": angle_to_curvature}

#: Tones of surfaces, by name: functions of a surface that return a tone for each corner.
TONES = {"waves": lambda surface: 0.55 + 0.4 * np.sin(9 * height(surface))}

#: Fields that no generator of RoSy makes, by name: functions of a surface and a degree.
MADE_FIELDS: dict[str, Callable[[Surface, int], RosyField]] = {
    "around": around_field,
    "icosahedral": lambda ball, degree: harmonic_field(ball, degree, icosahedron_axes()),
    "ring-curvature": ring_curvature,
    "even-curvature": even_curvature,
    "vortices": lambda plane, degree: planar_field(plane, degree, vortices),
    "wind": lambda plane, degree: planar_field(plane, degree, wind),
    "gusts": lambda plane, degree: planar_field(
        plane, degree, lambda p: wind(p) * (p.real + 1.1) / 2.1
    ),
    "gap": lambda plane, degree: planar_field(
        plane, degree, lambda p: wind(p) * (p.real + 1.1) * (np.abs(p - 0.1) > 0.35)
    ),
    "pairs": pairs_of_directions,
    "force": stress_of_force,
    "two-in-front": lambda ball, degree: ring_of_singularities(ball, 2, 1.7, degree),
    "out-of-sight": lambda ball, degree: ring_of_singularities(ball, -2, degree=degree),
}


def view(
    surface: Surface,
    angles: tuple[float, float],
    size: tuple[int, int],
    supersampling: int,
    perspective: bool = True,
) -> Camera:
    """Return a camera in whose frame a surface fits, with `supersampling` times `size` pixels."""
    width, height = (supersampling * side for side in size)
    return orbit_camera(
        surface.vertices, *angles, width, height, perspective=perspective, margin=0.006
    )


def compose_view(surface: Surface, field: RosyField, look: Look, camera: Camera) -> Picture:
    """Draw a field. The resolution of the camera must include the supersampling of the look."""
    return compose(project([MeshInstance(surface, np.eye(4), field)], camera, look.display), look)


def picture_on_paper(
    instance: MeshInstance,
    look: Look,
    angles: tuple[float, float],
    size: tuple[int, int],
    margin: float,
) -> np.ndarray:
    """Draw a field, with the paper color of its look as background if it is hatched. Return (H, W, 4)."""
    points = instance.surface.vertices @ instance.matrix[:3, :3].T + instance.matrix[:3, 3]
    width, height = (look.supersampling * side for side in size)
    camera = orbit_camera(points, *angles, width, height, margin=margin)
    rgba = compose(project([instance], camera, look.display), look).rgba
    if look.ink != "hatch":
        return rgba
    alpha = rgba[..., 3:]
    color = rgba[..., :3] * alpha + to_linear(from_hex(look.paper_color)) * (1 - alpha)
    return np.concatenate([color, np.ones_like(alpha)], axis=-1)


def layer_in_view(surface: Surface, field: RosyField, look: Look, camera: Camera) -> DegreeLayer:
    """Return the LIC images, and their pixels, from which `compose_view` draws a field."""
    instance = MeshInstance(surface, np.eye(4), field)
    (layer,) = degree_layers(project([instance], camera, look.display), look)
    return layer


def curve_through(start: tuple, middle: tuple, stop: tuple) -> np.ndarray:
    """Return (n, 2) points of a parabola through three points.

    All points are fractions of the picture from the top left.
    """
    t = np.linspace(0, 1, 60)[:, None]
    a, b, c = (np.array(point) for point in (start, middle, stop))
    return (1 - t) * (1 - 2 * t) * a + 4 * t * (1 - t) * b + t * (2 * t - 1) * c


def points_on_surface(surface: Surface, camera: Camera, curve: np.ndarray) -> np.ndarray:
    """Return the (m, 3) visible points of a surface at (n, 2) fractions of the picture from the top left.

    Fractions at which the camera does not see the surface are left out.
    """
    # A G-buffer needs some field.
    field = RosyField(1, np.broadcast_to([1.0, 0.0, 0.0], (surface.face_count, 3)))
    buffer = project([MeshInstance(surface, np.eye(4), field)], camera)
    position = np.full((camera.height * camera.width, 3), np.nan)
    position[buffer.pixel] = (
        buffer.position @ camera.view[:3, :3] - camera.view[:3, 3] @ camera.view[:3, :3]
    )
    column, row = (curve * (camera.width, camera.height)).astype(int).T
    points = position.reshape(camera.height, camera.width, 3)[camera.height - 1 - row, column]
    return points[np.isfinite(points).all(axis=1)]


def frame_of(values: np.ndarray, pixel: np.ndarray, shape: Sequence[int]) -> np.ndarray:
    """Return an (H, W) image with (P,) values at their pixels, 0 elsewhere."""
    frame = np.zeros(int(np.prod(shape)), dtype=np.float64)
    frame[pixel] = values
    return frame.reshape(shape)

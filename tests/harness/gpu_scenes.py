"""Fields, meshes and views on which the pictures of the graphics card are compared with those of numpy."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from lenses import shifted
from scipy.spatial.transform import Rotation
from shapes import cube, icosphere, joined, placed, rebuilt

from rosy_addon.compositor.look import Look
from rosy_addon.field.directional_field import field_from_directions, tensor_field
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.worker.job import run

from .gpu_parity import draw_on_card, draw_pair

AXIS = (0.3, 0.2, 1.0)
SHEAR = np.array([[1.0, 0.4, 0.0], [0.0, 0.8, 0.3], [0.0, 0.0, 1.2]])
MIRROR = np.diag([-1.0, 1.0, 1.0])
SIZE = 160, 144
LOOK = Look(shading=0.0, length=30)
EVEN_LINES = replace(LOOK, ink="even", shading=0.9, line_width=3.0, line_distance=6.0)
BALL = icosphere(3)


# --- matrices and meshes -------------------------------------------------------------------------


def rotation(x, y, z):
    """Return the rotation about the three axes, one after the other."""
    return Rotation.from_euler("xyz", (x, y, z)).as_matrix()


def boxes():
    """A plate, and a block that intersects it, as one mesh with sharp edges."""
    plate = rebuilt(cube(), (cube().vertices - 0.5) * (2.0, 2.0, 0.2))
    block = rebuilt(cube(), (cube().vertices - (0.5, 0.5, 0.0)) * (0.5, 0.3, 0.8))
    return joined(plate, block, sharp_angle=0.5)


# --- fields --------------------------------------------------------------------------------------


def smooth_field(surface, degree, families=1):
    """Return a field with singularities of index 1 / N and a magnitude that varies.

    An axis field is not suitable, because all N members run into the ends of the axis. There, brute
    force follows the N directions and the covering the lines through a pixel, and streamlines that
    differ in the last digit diverge. For the same reason, streamlines of degree 1 are circles around the axis: they do
    not leave one singularity and run into another.
    """
    vectors = np.cross(AXIS, surface.face_normal)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    if degree > 1:
        vectors = generate(surface, "smoothest", degree).vectors
    magnitude = 0.8 + 0.4 * np.sin(3 * surface.face_center @ np.array(AXIS) + 1)
    return RosyField(degree, vectors * magnitude[:, None], family_count=families)


def field_at_angles(surface, degree, offsets, lengths=1.0):
    """Return directions on each face, at angles to the first member of an axis field."""
    x, y = surface.face_frames
    base = axis_field(surface, degree, AXIS).vectors
    first_angle = np.arctan2((base * y).sum(axis=1), (base * x).sum(axis=1))[:, None]
    angles = (first_angle + offsets)[..., None]
    directions = np.cos(angles) * x[:, None] + np.sin(angles) * y[:, None]
    return field_from_directions(surface, np.ones(len(offsets))[:, None] * lengths * directions)


def perturbed_field(surface, degree, lengths=None, seed=0):
    """Return N directions on each face, each up to 0.3 radians from those of a RoSy."""
    number = np.arange(degree)
    offsets = number * 2 * np.pi / degree + 0.3 * np.sin(number * 2.1 + seed)
    lengths = np.ones(degree) if lengths is None else np.asarray(lengths)
    return field_at_angles(surface, degree, offsets, lengths[:, None])


def conjugate_field(surface):
    """Return four directions on two lines, at 1.2 radians to each other."""
    return field_at_angles(surface, 4, np.array([0, 1.2, np.pi, np.pi + 1.2]))


def sign_changing_tensors(surface):
    """Return the field of symmetric tensors whose eigenvalues change sign."""
    x, y, z = surface.face_center.T
    tensor = np.zeros((surface.face_count, 3, 3))
    tensor[:, 0, 0], tensor[:, 1, 1], tensor[:, 2, 2] = 1 + x, 0.3 - y, 2 * z
    tensor[:, 0, 2] = tensor[:, 2, 0] = 0.5
    return tensor_field(surface, tensor)


FREE = {
    "two": lambda surface: perturbed_field(surface, 2),
    "three": lambda surface: perturbed_field(surface, 3, (1.0, 1.5, 0.7)),
    "four": lambda surface: perturbed_field(surface, 4),
    "five": lambda surface: perturbed_field(surface, 5, seed=3),
    "six": lambda surface: perturbed_field(surface, 6),
    "two lines": conjugate_field,
    "tensors": sign_changing_tensors,
}


@lru_cache(maxsize=64)
def field_of(surface, degree):
    return smooth_field(surface, degree)


def shown(surface, field=None, linear=1.0, shift=(0, 0, 0)):
    """Return an instance of a surface with a field, or of an occluder."""
    return MeshInstance(surface, placed(linear, shift), field)


def ball(degree=4, linear=1.0, shift=(0, 0, 0), surface=BALL):
    """Return a ball with a smooth field."""
    return shown(surface, field_of(surface, degree), linear, shift)


# --- pictures ------------------------------------------------------------------------------------


def view(size=SIZE, azimuth=0.4, perspective=True, distance=4.0, supersampling=1):
    """Return a camera that looks at the origin, with a shifted lens."""
    eye = distance * np.array([np.sin(azimuth), -np.cos(azimuth), 0.5])
    size = [side * supersampling for side in size]
    view_matrix = look_at(eye, (0, 0, 0), (0, 0, 1))
    if perspective:
        return shifted(perspective_camera(view_matrix, *size, fov=0.65), (0.06, -0.04))
    return shifted(orthographic_camera(view_matrix, *size, scale=2.6), (0.06, -0.04))


def draw(renderer, instances, look=LOOK, camera=None):
    """Draw a picture on a card, or with numpy if it is None."""
    view_input = ViewInput(tuple(instances), camera or view(), look)
    return draw_picture(view_input) if renderer is None else run(renderer.picture_steps(view_input))


def card_rgba(card, instances, look=LOOK, camera=None, **others):
    """Draw a picture on the card; it may be empty, and larger than what is in view."""
    return draw_on_card(card, ViewInput(tuple(instances), camera or view(), look, **others))


def assert_parity(card, instances, camera=None, look=LOOK, agreement=0.998, likeness=0.98, **scene):
    """Compare the picture of the card with the picture of numpy, and return both."""
    camera = view(supersampling=look.supersampling) if camera is None else camera
    pair = draw_pair(card, instances, camera, look, **scene)
    assert np.isfinite(pair.card).all()
    both = (pair.card[..., 3] == 1) & (pair.numpy[..., 3] == 1)
    assert both.sum() > 500 and pair.agreement >= agreement and pair.likeness >= likeness
    brightness = pair.card[both].mean(axis=0) - pair.numpy[both].mean(axis=0)
    assert np.abs(brightness).max() < 0.01
    contrast = pair.card[both][:, :3].std(axis=0) / pair.numpy[both][:, :3].std(axis=0)
    assert np.abs(contrast - 1).max() < 0.02
    assert (np.abs(pair.card[..., 3] - pair.numpy[..., 3]) > 1e-6).mean() < 1e-3
    return pair

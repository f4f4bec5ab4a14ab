"""A tube, a ball and a wall with fields, their pictures, and the error of the tone of hatching."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.ndimage import gaussian_filter
from shapes import cylinder, from_quads, icosphere, rebuilt

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.inks import inks_of
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import diffuse
from rosy_addon.field.generate import axis_field
from rosy_addon.field.surface import Surface
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project

SIZE = 256

INK = Look(
    fade="ends",
    ink="hatch",
    anchor="surface",
    light="lamp",
    shading=1.0,
    line_width=2.5,
    supersampling=2,
)

BALL = icosphere(5)


@lru_cache(maxsize=4)
def tube(bend=0.0):
    """A tube along z with radius 0.5; its rest shape is straight if it is bent."""
    straight = cylinder(160, 120, 0.5, 3.0)
    points = bent(straight.vertices, bend)
    return rebuilt(straight, points, name="tube", rest_vertices=straight.vertices)


def bent(points, angle):
    """Rotate points about the x axis by angles that grow with z, like an armature."""
    local_angle = angle * np.clip(0.5 + points[:, 2], 0, 1)
    cos, sin = np.cos(local_angle), np.sin(local_angle)
    y, z = points[:, 1], points[:, 2]
    return np.stack([points[:, 0], cos * y - sin * z, sin * y + cos * z], axis=1)


def make_instance(surface: Surface, degree=4, matrix=None, tone=None):
    field = axis_field(surface.in_rest_shape(), degree, (0.3, 0.2, 1.0))
    return MeshInstance(surface, np.eye(4) if matrix is None else matrix, field, tone)


def make_wall(angle=0.0, half=9.0, matrix=None):
    """A square in the plane y = 0 with lines at an angle to x."""
    points = half * np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    wall = from_quads(points, np.array([[0, 1, 2, 3]]), name="wall")
    field = axis_field(wall, 2, (np.cos(angle), 0, np.sin(angle)))
    return MeshInstance(wall, np.eye(4) if matrix is None else matrix, field)


def make_camera(azimuth=0.0, zoom=1.0, distance=4.0):
    position = distance * np.array([np.sin(azimuth), -np.cos(azimuth), 0.3])
    fov = 2 * np.arctan(np.tan(0.28) / zoom)
    return perspective_camera(look_at(position, (0, 0, 0)), SIZE, SIZE, fov=fov)


def camera_before_wall(scale, x=0.0, z=0.0):
    return orthographic_camera(look_at((x, -5, z), (x, 0, z)), SIZE, SIZE, scale=scale)


def camera_above(scale=8.0, size=SIZE, eye=(0, 0, 5)):
    """An orthographic camera on the z axis, with y up in the picture."""
    return orthographic_camera(look_at(eye, (0, 0, 0), (0, 1, 0)), size, size, scale=scale)


def render(instance, camera, look, lights=()):
    """(H, W, 4) linear colors, shaded at all samples."""
    return compose(project([instance], camera.scaled(look.supersampling)), look, lights).rgba


def ramp_error(look, field=None, zoom=1.0, sigma=16.0):
    """Mean absolute error of the tone of a ball under its lights, blurred by `sigma` pixels.

    The tone is the transmittance of luminance. Blurs that reach beyond the ball are left out.
    """
    instance, camera = make_instance(BALL, degree=6), make_camera(zoom=zoom)
    if field is not None:
        instance = replace(instance, field=field)
    gbuffer = project([instance], camera)
    tone = np.clip(diffuse(gbuffer, look).mean(axis=1), 0, 1)
    inks = inks_of(look, 3 if look.hue == "families" else 1)
    visible, expected = np.zeros((2, SIZE * SIZE))
    visible[gbuffer.pixel] = 1
    expected[gbuffer.pixel] = inks.target_transmittance(1 - tone if inks.is_light else tone)
    visible, expected = visible.reshape(SIZE, SIZE), expected.reshape(SIZE, SIZE)
    rgba = render(instance, camera, look)
    rendered = np.where(visible > 0, inks.luminance_transmittance(rgba[..., :3]), 0)
    share = gaussian_filter(visible, sigma)
    error = (gaussian_filter(rendered - expected, sigma) / np.maximum(share, 0.5))[share > 0.98]
    return np.abs(error).mean()

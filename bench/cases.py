"""Inputs of benchmarks: a planar field with singularities, and surfaces with any number of triangles."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from harness.planar import lic, planar_pixel_field

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.lic import look_noise
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.pixel_field import PixelField
from rosy_addon.core.cache import Cache
from rosy_addon.field.generate import axis_field
from rosy_addon.field.surface import Surface, build_surface
from rosy_addon.projection.camera import Camera, look_at, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project

#: Side of the picture in Table 1 of the paper (Palacios and Zhang 2011), in pixels.
SIZE = 512

#: Settings of the paper's program: streamlines of 40 steps in each direction, noise cells of 1.5 pixels.
LOOK = Look(length=40, line_width=1.5)


@lru_cache(maxsize=8)
def plane(degree: int, size: int = SIZE) -> tuple[PixelField, np.ndarray]:
    """Return a planar field with singularities of index 1 / N and -1 / N, and noise for it."""
    y, x = np.mgrid[0:size, 0:size] + 0.5
    plus = np.arctan2(y - 0.5 * size, x - 0.33 * size)
    minus = np.arctan2(y - 0.5 * size, x - 0.67 * size)
    field = planar_pixel_field((plus - minus) / degree + 0.3, degree)
    return field, look_noise(field, pixel_look(LOOK))


def compose_lic(method: str, degree: int, look: Look = LOOK, size: int = SIZE) -> None:
    """Run the LIC stage alone: compute the LIC images of the members of the field of `plane`."""
    field, noise = plane(degree, size)
    lic(field, replace(look, method=method), noise)


@lru_cache(maxsize=8)
def ball(triangles: int, bumps: float = 0.06) -> Surface:
    """Return a bumpy sphere with about this many triangles of similar size."""
    rows = round(np.sqrt(triangles / 4))
    columns = 2 * rows
    polar = np.linspace(0, np.pi, rows + 1)[:, None]
    azimuth = np.arange(columns) * (2 * np.pi / columns)
    radius = 1 + bumps * np.sin(polar) ** 3 * np.sin(5 * azimuth) * np.sin(4 * polar)
    around, up = np.sin(polar), np.cos(polar) + 0 * azimuth
    point = np.stack([around * np.cos(azimuth), around * np.sin(azimuth), up], axis=-1)
    return _surface("ball", radius[..., None] * point)


@lru_cache(maxsize=8)
def torus(triangles: int, tube: float = 0.45) -> Surface:
    """Return a torus around the z axis with about this many triangles."""
    rows = round(np.sqrt(triangles / 4))
    tube_angle = np.linspace(0, -2 * np.pi, rows + 1)[:, None]
    azimuth = np.arange(2 * rows) * (np.pi / rows)
    radius, height = 1 + tube * np.cos(tube_angle), tube * np.sin(tube_angle) + 0 * azimuth
    return _surface(
        "torus", np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=-1)
    )


def _surface(name: str, point: np.ndarray) -> Surface:
    """Return a triangulated surface through (R, C, 3) points: R rings of C points, from top to bottom."""
    rows, columns = point.shape[0] - 1, point.shape[1]
    upper_left = np.arange(rows)[:, None] * columns + np.arange(columns)
    upper_right = np.roll(upper_left, -1, axis=1)
    lower_triangles = np.stack([upper_left, upper_left + columns, upper_right + columns], axis=-1)
    upper_triangles = np.stack([upper_left, upper_right + columns, upper_right], axis=-1)
    corners = np.concatenate(
        [lower_triangles.reshape(-1, 3), upper_triangles.reshape(-1, 3)]
    ).astype(np.int32)
    starts = np.arange(0, corners.size + 1, 3)
    points = point.reshape(-1, 3)
    return build_surface(points, corners.ravel(), starts, name=f"{name} {len(corners)}")


#: Cache of fields that are averaged at corners. Frames in which only the camera has moved reuse them.
CORNER_FIELDS = Cache()


@lru_cache(maxsize=16)
def instance(triangles: int, degree: int) -> MeshInstance:
    """Return the ball with a field of a degree."""
    surface = ball(triangles)
    return MeshInstance(surface, np.eye(4), axis_field(surface, degree, (0.3, 0.2, 1.0)))


def camera(width: int = SIZE, height: int | None = None, azimuth: float = 0.0) -> Camera:
    """Return a camera at which the ball covers 85 % of a square picture."""
    eye = 2.33 * np.array([np.sin(azimuth), -np.cos(azimuth), 0.35])
    view = look_at(eye, (0, 0, 0), (0, 0, 1))
    return perspective_camera(view, width, width if height is None else height, fov=0.8)


def first_frame(triangles: int, degree: int, look: Look = LOOK, size: int = SIZE) -> np.ndarray:
    """Draw the ball as if for the first time, including the work that does not depend on the camera."""
    cached = instance(triangles, degree)
    # A copy of the surface has no cached results.
    gbuffer = project([replace(cached, surface=cached.surface.with_parts())], camera(size))
    return compose(gbuffer, look).rgba


def frame(
    triangles: int, degree: int, look: Look = LOOK, size: int = SIZE, azimuth: float = 0.0
) -> np.ndarray:
    """Draw the ball again, with only the work that is necessary after the camera has moved."""
    eye = camera(size, azimuth=azimuth)
    instances = [instance(triangles, degree)]
    gbuffer = project(instances, eye, look.display, CORNER_FIELDS, look.supersampling)
    return compose(gbuffer, look).rgba


def ball_scene(triangles: int) -> object:
    """Open a new file of Blender with only the ball and its field of degree 4. Return the scene."""
    import bpy

    from rosy_addon.scene.mesh_fields import write_mesh_field
    from rosy_addon.ui.properties import ensure_registered

    bpy.ops.wm.read_factory_settings(use_empty=True)
    ensure_registered()
    surface = ball(triangles)
    mesh = bpy.data.meshes.new("Ball")
    corners = surface.corner_vertex[surface.triangles]
    mesh.from_pydata(surface.vertices.tolist(), [], corners.tolist())
    mesh.shade_smooth()
    write_mesh_field(mesh, instance(triangles, 4).field)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Ball", mesh))
    bpy.context.view_layer.update()
    return bpy.context.scene

"""Target tones from attributes, images, reference renders and shadows, and their hatching."""

from dataclasses import replace

import numpy as np
import pytest
from hatched import BALL, camera_above, make_instance
from shapes import icosphere, placed, plane

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light, diffuse
from rosy_addon.compositor.target_tone import ReferenceRender, apply_tone_curve, target_tone
from rosy_addon.field.frames import dot, normalize
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.projection.shadow_maps import light_cameras, shadow_visibility
from rosy_addon.projection.surface_sampling import surface_tones
from rosy_addon.projection.surface_tone import SurfaceTone

#: These tests draw many pictures and measure them.
pytestmark = pytest.mark.slow

SIZE = 384


def make_camera(size=SIZE, position=(0.0, -4.0, 1.2), target=(0.0, 0.0, 0.0), fov=0.56):
    return perspective_camera(look_at(position, target), size, size, fov=fov)


def tone_from_vertices(surface, values):
    """A `SurfaceTone` from values at the vertices."""
    return SurfaceTone(np.asarray(values, dtype=np.float32)[surface.corner_vertex, None])


def world_positions(gbuffer):
    """(P, 3) positions of pixels in world space."""
    view = gbuffer.camera.view
    return (gbuffer.position - view[:3, 3]) @ view[:3, :3]


# --- attributes -----------------------------------------------------------------------------------


def test_attributes_are_interpolated_over_triangles():
    """An attribute that is linear in space is linear at the pixels, under perspective too."""
    surface = plane(3, 3, 4.0)
    linear = 0.3 * surface.vertices[:, 0] - 0.2 * surface.vertices[:, 1] + 0.5
    matrix = placed(1.5, (0.3, 0.2, -0.4))
    instance = make_instance(surface, 4, matrix, tone_from_vertices(surface, linear))
    gbuffer = project([instance], make_camera(fov=0.9))
    x, y, _ = ((world_positions(gbuffer) - matrix[:3, 3]) / 1.5).T
    np.testing.assert_allclose(surface_tones(gbuffer), 0.3 * x - 0.2 * y + 0.5, atol=2e-5)


def test_corner_values_may_differ_between_faces():
    surface = plane(2, 1, 2.0)
    values = np.repeat([0.2, 0.9], 4)[:, None].astype(np.float32)
    instance = make_instance(surface, tone=SurfaceTone(values))
    gbuffer = project([instance], make_camera(position=(0, -0.5, 5)))
    expected = np.where(surface.triangle_face[gbuffer.triangle] == 0, 0.2, 0.9)
    np.testing.assert_allclose(surface_tones(gbuffer), expected, atol=1e-6)


def test_instances_without_a_tone_use_the_light():
    other = make_instance(BALL, 4, placed(0.5, (1.2, 0, 0)))
    tone = tone_from_vertices(BALL, np.full(len(BALL.vertices), 0.7))
    painted = make_instance(BALL, 4, placed(0.5, (-1.2, 0, 0)), tone)
    gbuffer = project([painted, other], make_camera(fov=1.2))
    look = Look(tone="attribute", light="lamp")
    tone = target_tone(gbuffer, look)
    light = diffuse(gbuffer, look)
    is_painted = gbuffer.instance_id == 0
    np.testing.assert_allclose(tone[is_painted], 0.7, atol=1e-6)
    np.testing.assert_array_equal(tone[~is_painted], light[~is_painted])
    lit = target_tone(gbuffer, replace(look, tone_lit=True))
    np.testing.assert_allclose(lit[is_painted], 0.7 * light[is_painted], rtol=1e-5)
    np.testing.assert_array_equal(lit[~is_painted], light[~is_painted])


@pytest.mark.parametrize("tone", ["attribute", "image", "picture"])
def test_missing_tones_are_refused(tone, error_of):
    gbuffer = project([make_instance(BALL)], make_camera(64))
    assert tone in error_of(target_tone, gbuffer, Look(tone=tone))


# --- the curve -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("levels", "tones", "expected"),
    [
        (Look().tone_levels, [0.0, 0.3, 1.0, 1.7], [0.0, 0.3, 1.0, 1.7]),
        ((-1.0, 3.0, 2.0), [-2.0, -1.0, 0.0, 1.0, 3.0], [0, 0, 0.5, 0.5**0.5, 1]),
        ((1.0, 0.0, 1.0), [0.0, 0.25, 1.0], [1, 0.75, 0]),
    ],
    ids=["default", "gamma", "inverted"],
)
def test_tone_curves(levels, tones, expected):
    actual = apply_tone_curve(np.array(tones, dtype=np.float32), Look(tone_levels=levels))
    np.testing.assert_allclose(actual, expected, atol=1e-6)


def test_equal_black_and_white_are_a_threshold():
    look = Look(tone_levels=(0.5, 0.5, 1.0))
    actual = apply_tone_curve(np.array([0.2, 0.49, 0.51, 0.9], dtype=np.float32), look)
    assert (actual[:2] == 0).all() and (actual[2:] >= 1).all()


# --- images -----------------------------------------------------------------------------------------


def mapped_plane(image, repeat=1.0, cells=4):
    """A square whose UV map repeats an image `repeat` times in each direction."""
    surface = plane(cells, cells, 2.0)
    uv = (surface.vertices[surface.corner_vertex, :2] * 0.5 + 0.5) * repeat
    return make_instance(surface, tone=SurfaceTone(uv.astype(np.float32), image.astype(np.float32)))


@pytest.mark.parametrize("repeat", [1, 2])
def test_images_follow_the_uv_map_and_repeat(repeat):
    """An image with pixels of the size of the picture's is reproduced, rows from the bottom."""
    image = np.random.default_rng(1).random((16, 16))
    size = 16 * repeat
    gbuffer = project([mapped_plane(image, repeat)], camera_above(2.0, size))
    tones = surface_tones(gbuffer).reshape(size, size)
    np.testing.assert_allclose(tones, np.tile(image, (repeat, repeat)), atol=2e-4)


def test_images_are_interpolated():
    ramp = np.tile((np.arange(8) + 0.5) / 8, (8, 1))
    tones = surface_tones(project([mapped_plane(ramp)], camera_above(2.0, 128))).reshape(128, 128)
    expected = (np.arange(128) + 0.5) / 128
    np.testing.assert_allclose(tones[:, 8:-8], np.tile(expected[8:-8], (128, 1)), atol=1e-3)


def test_images_finer_than_the_picture_are_averaged():
    """A checkerboard with sixteen squares per pixel of the picture is gray."""
    board = np.indices((256, 256)).sum(axis=0) % 2
    tones = surface_tones(project([mapped_plane(board)], camera_above(2.0, 64)))
    np.testing.assert_allclose(tones, 0.5, atol=1e-3)
    # The same for an image with odd sides that is repeated.
    odd = np.random.default_rng(2).random((255, 131))
    tones = surface_tones(project([mapped_plane(odd, repeat=3.0)], camera_above(2.0, 8)))
    np.testing.assert_allclose(tones, odd.mean(), atol=0.05)


# --- pictures ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("perspective", [True, False])
def test_reference_renders_are_sampled_at_the_pixel(perspective):
    camera = make_camera(96)
    if not perspective:
        camera = orthographic_camera(look_at((0, -4, 1), (0, 0, 0)), 96, 96, scale=2.6)
    luminance = np.random.default_rng(4).random((96, 96)).astype(np.float32)
    gbuffer = project([make_instance(BALL)], camera)
    actual = ReferenceRender(luminance, camera).sample(gbuffer)
    np.testing.assert_allclose(actual, luminance.ravel()[gbuffer.pixel], atol=2e-4)
    # At twice the resolution, the mean of four pixels.
    fine = np.repeat(np.repeat(luminance, 2, axis=0), 2, axis=1)
    actual = ReferenceRender(fine, camera).sample(gbuffer)
    np.testing.assert_allclose(actual, luminance.ravel()[gbuffer.pixel], atol=2e-4)


def test_reference_renders_are_reprojected():
    """From another camera, a point has the tone that it has in the reference render."""
    camera = make_camera(256)
    gbuffer = project([make_instance(BALL)], camera)
    luminance = np.zeros(256 * 256, dtype=np.float32)
    luminance[gbuffer.pixel] = world_positions(gbuffer)[:, 2] * 0.5 + 0.5
    rendered = ReferenceRender(luminance.reshape(256, 256), camera)
    other = project([make_instance(BALL)], make_camera(256, position=(1.5, -3.8, 0.6)))
    point = world_positions(other)
    facing = dot(camera.view_directions(point), point) > 0.25
    actual = rendered.sample(other)[facing]
    np.testing.assert_allclose(actual, point[facing, 2] * 0.5 + 0.5, atol=0.01)


def test_reference_renders_of_another_aspect_ratio_are_refused(error_of):
    luminance = np.zeros((90, 160), dtype=np.float32)
    message = error_of(ReferenceRender, luminance, make_camera(64), "shot.png")
    assert "shot.png" in message and "160 x 90" in message and "64 x 64" in message


# --- shadows ------------------------------------------------------------------------------------------


def light_at(camera, kind, where):
    """A point light at a position in world space, or a sun in a direction, in the space of a camera."""
    if kind == "sun":
        vector = camera.view[:3, :3] @ normalize(np.array(where))
    else:
        vector = camera.view[:3, :3] @ where + camera.view[:3, 3]
    return Light(kind, vector, np.ones(3), 1.0)


def visibility_of(gbuffer, light):
    cameras = light_cameras(gbuffer.instances, gbuffer.camera, light.kind, light.vector)
    return shadow_visibility(gbuffer, cameras)


def clearance_from_ball(points, toward, center, radius, max_distance=np.inf):
    """(n,) distances of rays from a ball, negative if they hit it; `toward` are unit directions."""
    to_center = center - points
    along = np.einsum("pi,pi->p", to_center, toward)
    squared = (to_center**2).sum(axis=1) - along**2
    clearance = np.sqrt(np.maximum(squared, 0)) - radius
    return np.where((along > 0) & (along < max_distance), clearance, np.inf)


LIGHTS = {
    "low sun": ("sun", (-0.9, 0.1, 0.3)),
    "lamp outside": ("point", (-5.0, -4.0, 6.0)),
    "lamp among them": ("point", (-1.6, -1.0, 1.4)),
}


@pytest.mark.parametrize("name", ["low sun", "lamp among them"])
def test_the_shadow_of_a_ball_on_a_plane(name):
    """The shadow is known in closed form. It may differ only close to its border."""
    kind, where = LIGHTS[name]
    ground = make_instance(plane(8, 8, 8.0))
    ball = make_instance(BALL, 4, placed(0.8, (0, 0, 1.0)))
    camera = make_camera(256, position=(3, -6, 4), target=(0, 0, 0.6), fov=0.7)
    light = light_at(camera, kind, where)
    gbuffer = project([ground, ball], camera)
    visibility = visibility_of(gbuffer, light)
    on_ground = gbuffer.instance_id == 0
    point = world_positions(gbuffer)[on_ground].astype(float)
    to_light = np.multiply(where, 1e9 if kind == "sun" else 1.0) - point
    light_distance = np.linalg.norm(to_light, axis=1)
    toward = to_light / light_distance[:, None]
    clearance = clearance_from_ball(point, toward, np.array([0, 0, 1.0]), 0.8, light_distance)
    certain = np.abs(clearance) > 0.04
    assert certain.mean() > 0.9 and (clearance < 0).mean() > 0.02
    np.testing.assert_allclose(visibility[on_ground][certain], (clearance > 0)[certain], atol=1e-6)
    # The border of the shadow is soft.
    assert ((visibility > 0.1) & (visibility < 0.9)).any()


@pytest.mark.parametrize("name", ["low sun", "lamp outside"])
def test_surfaces_that_face_the_light_do_not_shadow_themselves(name):
    kind, where = LIGHTS[name]
    for surface in (icosphere(3), BALL, plane(3, 3, 2.0)):
        camera = make_camera(256, position=(1.0, -4, 1.8))
        gbuffer = project([make_instance(surface)], camera)
        light = light_at(camera, kind, where)
        visibility = visibility_of(gbuffer, light)
        to_light = normalize(light.vector - (kind == "point") * gbuffer.position)
        # Normals of triangles, because smooth normals may face the light where triangles do not.
        facing = (gbuffer.geometric_normal * to_light).sum(axis=1)
        assert (visibility[facing > 0.05] == 1).mean() > 0.999
        if surface is BALL:
            assert visibility[facing < -0.3].max() < 1e-6


def test_instances_without_a_field_cast_shadows():
    ground, ball = make_instance(plane(2, 2, 4.0)), MeshInstance(BALL, placed(0.5, (0, 0, 2.0)))
    camera = perspective_camera(look_at((0, -5, 5), (0, 0, 0)), 128, 128, fov=0.9)
    look = Look(light="scene", shading=1.0)
    sun = light_at(camera, "sun", (0, 0.01, 1))
    bare, both = project([ground], camera), project([ground, ball], camera)
    assert target_tone(bare, look, [sun]).min() > 0.9
    assert 0.01 < (target_tone(both, look, [sun])[:, 0] < 0.1).mean() < 0.2
    assert target_tone(both, look, [replace(sun, has_shadow=False)]).min() > 0.9


def test_the_headlight_casts_no_shadows():
    gbuffer = project([make_instance(BALL)], make_camera(64))
    tones = (target_tone(gbuffer, Look(shadows=shadows)) for shadows in (True, False))
    np.testing.assert_array_equal(*tones)

"""Target tones from attributes, images, reference renders and shadows, and their hatching."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import mainly
from harness.planar import degree_layers
from scipy.ndimage import gaussian_filter
from shapes import from_quads, grid_of_quads, icosphere, plane

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light, diffuse
from rosy_addon.compositor.target_tone import ReferenceRender, apply_tone_curve, target_tone
from rosy_addon.core.cache import Cache
from rosy_addon.core.color import from_hex, to_display, to_linear
from rosy_addon.field.generate import axis_field
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.projection.shadow_maps import light_cameras, shadow_visibility
from rosy_addon.projection.surface_sampling import surface_tones
from rosy_addon.projection.surface_tone import SurfaceTone

#: These tests draw many pictures and measure them.
pytestmark = pytest.mark.slow

SIZE = 384
PRESETS = {name: load_preset(name).look for name in preset_keys()}
HATCHED = [name for name, look in PRESETS.items() if look.ink != "soft"]
BALL = icosphere(5)


def moved_and_scaled(x, y, z, scale=1.0):
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def make_instance(surface, matrix=None, tone=None):
    field = axis_field(surface, 4, (0.3, 0.2, 1.0))
    return MeshInstance(surface, np.eye(4) if matrix is None else matrix, field, tone)


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


def relative_lightness(rgba, look):
    """(H, W) lightness, from 0 at the darker of ink and paper to 1 at the lighter."""
    paper, ink = (to_linear(from_hex(code)) for code in (look.paper_color, look.ink_color))
    channel = int(np.argmax(np.abs(paper - ink)))
    darker, lighter = sorted((paper[channel], ink[channel]))
    return (rgba[..., channel] - darker) / (lighter - darker)


def blurred(gbuffer, values, sigma=16):
    """(n,) blurred values of covered pixels, where the blur contains almost only such pixels."""
    size = gbuffer.camera.height, gbuffer.camera.width
    visible = np.zeros(size[0] * size[1])
    visible[gbuffer.pixel] = 1
    visible = visible.reshape(size)
    fraction = gaussian_filter(visible, sigma)
    inner = fraction > 0.98
    return gaussian_filter(np.where(visible > 0, values, 0), sigma)[inner] / fraction[inner]


@pytest.mark.parametrize("name", mainly(HATCHED[2:3], HATCHED))
def test_presets_reproduce_a_ramp_on_the_surface(name):
    """Ink on paper, blurred over 16 pixels, has the tone of an attribute from 0 to 1 on a ball.

    A blur contains few broad streaks. So the mean absolute error over several seeds is bounded, and
    the mean error, without its random part, is bounded more tightly.
    """
    ramp = np.clip(BALL.vertices[:, 0] * 0.62 + 0.5, 0, 1)
    instance = make_instance(BALL, tone=tone_from_vertices(BALL, ramp))
    camera = make_camera()
    gbuffer = project([instance], camera)
    expected = np.zeros(SIZE * SIZE)
    expected[gbuffer.pixel] = np.clip(world_positions(gbuffer)[:, 0] * 0.62 + 0.5, 0, 1)
    expected = blurred(gbuffer, expected.reshape(SIZE, SIZE))
    assert expected.min() < 0.15 and expected.max() > 0.85
    fine = project([instance], camera.scaled(PRESETS[name].supersampling))
    errors = []
    for seed in range(3):
        look = replace(PRESETS[name], tone="attribute", seed=seed)
        errors.append(
            blurred(gbuffer, relative_lightness(compose(fine, look).rgba, look)) - expected
        )
    assert np.abs(errors).mean() <= 0.04
    assert abs(np.mean(errors)) <= 0.02


def contrast(look, tone):
    """The standard deviation of display values on a wall of one tone."""
    surface = plane(1, 1, 4.0)
    surface_tone = SurfaceTone(np.full((4, 1), tone, dtype=np.float32))
    instance = MeshInstance(
        surface, np.eye(4), axis_field(surface, 4, (1.0, 0.2, 0.0)), surface_tone
    )
    camera = camera_above(128, scale=3.0).scaled(look.supersampling)
    rgba = compose(project([instance], camera), replace(look, tone="attribute")).rgba
    luminance = rgba[..., 1] * rgba[..., 3] + 1 - rgba[..., 3]
    return to_display(luminance).std()


@pytest.mark.parametrize("name", mainly(HATCHED[::4], HATCHED))
def test_lines_have_contrast_in_dark_tones(name):
    assert contrast(PRESETS[name], 0.1) >= 0.9 * contrast(PRESETS[name], 0.9) > 0.08


def test_soft_streaks_lose_contrast_in_dark_tones():
    """Soft streaks are multiplied by the light, in contrast to lines of hatching."""
    soft = Look(gain=1.5)
    assert contrast(soft, 0.1) < 0.6 * contrast(soft, 0.9)


def test_attributes_are_interpolated_over_triangles():
    """An attribute that is linear in space is linear at the pixels, under perspective too."""
    surface = plane(3, 3, 4.0)
    linear = 0.3 * surface.vertices[:, 0] - 0.2 * surface.vertices[:, 1] + 0.5
    matrix = moved_and_scaled(0.3, 0.2, -0.4, 1.5)
    gbuffer = project(
        [make_instance(surface, matrix, tone_from_vertices(surface, linear))], make_camera(fov=0.9)
    )
    x, y, _ = ((world_positions(gbuffer) - matrix[:3, 3]) / 1.5).T
    np.testing.assert_allclose(surface_tones(gbuffer), 0.3 * x - 0.2 * y + 0.5, atol=2e-5)


def test_corner_values_may_differ_between_faces():
    surface = plane(2, 1, 2.0)
    values = np.repeat([0.2, 0.9], 4)[:, None].astype(np.float32)
    gbuffer = project(
        [make_instance(surface, tone=SurfaceTone(values))], make_camera(position=(0, -0.5, 5))
    )
    tones = surface_tones(gbuffer)
    np.testing.assert_allclose(tones, np.where(gbuffer.face == 0, 0.2, 0.9), atol=1e-6)


def test_instances_without_a_tone_use_the_light():
    other = make_instance(BALL, moved_and_scaled(1.2, 0, 0, 0.5))
    painted = make_instance(
        BALL,
        moved_and_scaled(-1.2, 0, 0, 0.5),
        tone_from_vertices(BALL, np.full(len(BALL.vertices), 0.7)),
    )
    gbuffer = project([painted, other], make_camera(fov=1.2))
    look = Look(tone="attribute", light="lamp")
    tone = target_tone(gbuffer, look)
    light = diffuse(gbuffer, look)
    np.testing.assert_allclose(tone[gbuffer.instance_id == 0], 0.7, atol=1e-6)
    np.testing.assert_array_equal(tone[gbuffer.instance_id == 1], light[gbuffer.instance_id == 1])
    lit = target_tone(gbuffer, replace(look, tone_lit=True))
    np.testing.assert_allclose(
        lit[gbuffer.instance_id == 0], 0.7 * light[gbuffer.instance_id == 0], rtol=1e-5
    )
    np.testing.assert_array_equal(lit[gbuffer.instance_id == 1], light[gbuffer.instance_id == 1])


@pytest.mark.parametrize("tone", ["attribute", "image", "picture"])
def test_missing_tones_are_refused(tone, error_of):
    gbuffer = project([make_instance(BALL)], make_camera(64))
    assert tone in error_of(target_tone, gbuffer, Look(tone=tone))


def test_lic_images_do_not_depend_on_the_tone():
    """Changes of the tone reuse the cached LIC images."""
    gbuffer = project(
        [make_instance(BALL, tone=tone_from_vertices(BALL, BALL.vertices[:, 0]))], make_camera(96)
    )
    cache = Cache()
    first = degree_layers(gbuffer, Look(), cache)[0].images
    for other in (
        {"tone": "attribute"},
        {"tone_levels": (0.0, 1.0, 2.0)},
        {"shadows": True, "light": "lamp"},
    ):
        assert degree_layers(gbuffer, Look(**other), cache)[0].images is first


# --- the curve -------------------------------------------------------------------------------------


def test_the_default_tone_curve_is_the_identity():
    tone = np.array([0.0, 0.3, 1.0, 1.7], dtype=np.float32)
    np.testing.assert_array_equal(apply_tone_curve(tone, Look()), tone)


def test_black_white_and_gamma():
    look = Look(tone_levels=(-1.0, 3.0, 2.0))
    tones = np.array([-2.0, -1.0, 0.0, 1.0, 3.0], dtype=np.float32)
    np.testing.assert_allclose(
        apply_tone_curve(tones, look), [0, 0, 0.5, np.sqrt(0.5), 1], atol=1e-6
    )


def test_black_above_white_inverts_tones():
    look = Look(tone_levels=(1.0, 0.0, 1.0))
    tones = np.array([0.0, 0.25, 1.0], dtype=np.float32)
    np.testing.assert_allclose(apply_tone_curve(tones, look), [1, 0.75, 0], atol=1e-6)


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


def camera_above(size, scale=2.0):
    return orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), size, size, scale=scale)


def test_images_follow_the_uv_map():
    """An image with pixels of the size of the picture's is reproduced, rows from the bottom."""
    image = np.random.default_rng(1).random((32, 32))
    gbuffer = project([mapped_plane(image)], camera_above(32))
    assert len(gbuffer.pixel) == 32 * 32
    np.testing.assert_allclose(surface_tones(gbuffer).reshape(32, 32), image, atol=2e-4)


def test_images_are_interpolated():
    ramp = np.tile((np.arange(8) + 0.5) / 8, (8, 1))
    tones = surface_tones(project([mapped_plane(ramp)], camera_above(128))).reshape(128, 128)
    expected = (np.arange(128) + 0.5) / 128
    np.testing.assert_allclose(tones[:, 8:-8], np.tile(expected[8:-8], (128, 1)), atol=1e-3)


def test_images_finer_than_the_picture_are_averaged():
    """A checkerboard with sixteen squares per pixel of the picture is gray."""
    board = np.indices((256, 256)).sum(axis=0) % 2
    tones = surface_tones(project([mapped_plane(board)], camera_above(64)))
    np.testing.assert_allclose(tones, 0.5, atol=1e-3)
    # The same for an image with odd sides that is repeated.
    odd = np.random.default_rng(2).random((255, 131))
    tones = surface_tones(project([mapped_plane(odd, repeat=3.0)], camera_above(8)))
    np.testing.assert_allclose(tones, odd.mean(), atol=0.05)


def test_images_repeat():
    image = np.random.default_rng(3).random((16, 16))
    tones = surface_tones(project([mapped_plane(image, repeat=2.0)], camera_above(32))).reshape(
        32, 32
    )
    np.testing.assert_allclose(tones, np.tile(image, (2, 2)), atol=2e-4)


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
    in_reference_camera = (camera.view[:3, :3] @ point.T + camera.view[:3, 3:]).T
    facing = -np.einsum("pi,pi->p", in_reference_camera, point @ camera.view[:3, :3].T) > 0.8
    actual = rendered.sample(other)[facing]
    np.testing.assert_allclose(actual, point[facing, 2] * 0.5 + 0.5, atol=0.01)


def test_reference_renders_of_another_aspect_ratio_are_refused(error_of):
    message = error_of(
        ReferenceRender, np.zeros((90, 160), dtype=np.float32), make_camera(64), "shot.png"
    )
    assert "shot.png" in message and "160 x 90" in message and "64 x 64" in message


# --- shadows ------------------------------------------------------------------------------------------


def point_light(camera, position, strength=1.0):
    """A point light at a position in world space, in the space of a camera."""
    vector = camera.view[:3, :3] @ np.asarray(position, dtype=float) + camera.view[:3, 3]
    return Light("point", vector, np.ones(3), strength)


def sun_light(camera, direction, strength=1.0):
    direction = np.asarray(direction, dtype=float)
    direction = camera.view[:3, :3] @ (direction / np.linalg.norm(direction))
    return Light("sun", direction, np.ones(3), strength)


def clearance_from_ball(points, toward, center, radius, max_distance=np.inf):
    """(n,) distances of rays from a ball, negative if they hit it; `toward` are unit directions."""
    to_center = center - points
    along = np.einsum("pi,pi->p", to_center, toward)
    clearance = (
        np.sqrt(np.maximum(np.einsum("pi,pi->p", to_center, to_center) - along**2, 0)) - radius
    )
    return np.where((along > 0) & (along < max_distance), clearance, np.inf)


LIGHTS = {
    "sun": ("sun", (-0.6, -0.4, 0.8)),
    "low sun": ("sun", (-0.9, 0.1, 0.3)),
    "lamp outside": ("point", (-5.0, -4.0, 6.0)),
    "lamp among them": ("point", (-1.6, -1.0, 1.4)),
}


@pytest.mark.parametrize("name", mainly(["low sun", "lamp among them"], LIGHTS))
def test_the_shadow_of_a_ball_on_a_plane(name):
    """The shadow is known in closed form. It may differ only close to its border."""
    kind, where = LIGHTS[name]
    ground, ball = (
        make_instance(plane(8, 8, 8.0)),
        make_instance(icosphere(6), moved_and_scaled(0, 0, 1.0, 0.8)),
    )
    camera = make_camera(256, position=(3, -6, 4), target=(0, 0, 0.6), fov=0.7)
    light = (sun_light if kind == "sun" else point_light)(camera, where)
    gbuffer = project([ground, ball], camera)
    visibility = shadow_visibility(
        gbuffer, light_cameras(gbuffer.instances, camera, kind, light.vector)
    )
    on_ground = gbuffer.instance_id == 0
    point = world_positions(gbuffer)[on_ground].astype(float)
    if kind == "sun":
        toward = np.broadcast_to(np.divide(where, np.linalg.norm(where)), point.shape)
        light_distance = np.inf
    else:
        to_light = where - point
        light_distance = np.linalg.norm(to_light, axis=1)
        toward = to_light / light_distance[:, None]
    clearance = clearance_from_ball(point, toward, np.array([0, 0, 1.0]), 0.8, light_distance)
    certain = np.abs(clearance) > 0.04
    assert certain.mean() > 0.9 and (clearance < 0).mean() > 0.02
    np.testing.assert_allclose(visibility[on_ground][certain], (clearance > 0)[certain], atol=1e-6)
    # The border of the shadow is soft.
    assert ((visibility > 0.1) & (visibility < 0.9)).any()


@pytest.mark.parametrize("name", mainly(["low sun", "lamp outside"], LIGHTS))
def test_surfaces_that_face_the_light_do_not_shadow_themselves(name):
    kind, where = LIGHTS[name]
    for surface in (icosphere(3), BALL, plane(3, 3, 2.0)):
        camera = make_camera(256, position=(1.0, -4, 1.8))
        gbuffer = project([make_instance(surface)], camera)
        light = (sun_light if kind == "sun" else point_light)(camera, where)
        visibility = shadow_visibility(
            gbuffer, light_cameras(gbuffer.instances, camera, kind, light.vector)
        )
        to_light = light.vector - gbuffer.position if kind == "point" else light.vector
        to_light = to_light / np.linalg.norm(to_light, axis=-1, keepdims=True)
        # Normals of triangles, because smooth normals may face the light where triangles do not.
        facing = np.einsum(
            "pi,pi->p", gbuffer.geometric_normal, np.broadcast_to(to_light, gbuffer.normal.shape)
        )
        assert (visibility[facing > 0.05] == 1).mean() > 0.999
        if surface is BALL:
            assert visibility[facing < -0.3].max() < 1e-6


def test_instances_without_a_field_cast_shadows():
    ground, ball = (
        make_instance(plane(2, 2, 4.0)),
        MeshInstance(BALL, moved_and_scaled(0, 0, 2.0, 0.5)),
    )
    camera = perspective_camera(look_at((0, -5, 5), (0, 0, 0)), 128, 128, fov=0.9)
    look = Look(light="scene", shading=1.0)
    sun = sun_light(camera, (0, 0.01, 1))
    bare, both = project([ground], camera), project([ground, ball], camera)
    shadows = replace(look, shadows=True)
    assert diffuse(bare, shadows, [sun]).min() > 0.9
    shaded = diffuse(both, shadows, [sun])
    assert 0.01 < (shaded[:, 0] < 0.1).mean() < 0.2
    assert diffuse(both, look, [sun]).min() > 0.9


def test_the_headlight_casts_no_shadows():
    gbuffer = project([make_instance(BALL)], make_camera(64))
    np.testing.assert_array_equal(
        diffuse(gbuffer, Look(shadows=True)), diffuse(gbuffer, Look(shadows=False))
    )


def rays_hit_triangles(origin, direction, corners):
    """(n,) whether rays from (n, 3) points hit any of (T, 3, 3) triangles."""
    a, b, c = corners.transpose(1, 0, 2)
    p = np.cross(direction, c - a)
    divisor = np.einsum("ti,ti->t", b - a, p)
    hit = np.zeros(len(origin), dtype=bool)
    for start in range(0, len(origin), 512):
        offset = origin[start : start + 512, None] - a
        u = np.einsum("nti,ti->nt", offset, p) / divisor
        q = np.cross(offset, b - a)
        v = q @ direction / divisor
        t = np.einsum("nti,ti->nt", q, c - a) / divisor
        hit[start : start + 512] = ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)).any(axis=1)
    return hit


def test_shadows_match_ray_casting():
    """A torus that stands on the ground and shadows itself, against ray casting."""
    quads, count = grid_of_quads(48, 24, True, True)
    u, v = np.divmod(np.arange(count), 24)
    u, v = u * 2 * np.pi / 48, v * 2 * np.pi / 24
    out = 1.0 + 0.35 * np.cos(v)
    points = np.stack([out * np.cos(u), -0.35 * np.sin(v), out * np.sin(u)], axis=1)
    ring = from_quads(points, quads, name="ring")
    instances = [make_instance(plane(2, 2, 6.0), moved_and_scaled(0, 0, -1.5)), make_instance(ring)]
    camera = make_camera(128, position=(2.5, -6, 2.5), target=(0, 0, -0.4), fov=0.75)
    gbuffer = project(instances, camera)
    assert gbuffer.front_facing.all()
    direction = np.array([0.6, 0.3, 0.7]) / np.linalg.norm([0.6, 0.3, 0.7])
    light = sun_light(camera, direction)
    visibility = shadow_visibility(gbuffer, light_cameras(instances, camera, "sun", light.vector))
    origin = (
        world_positions(gbuffer).astype(float)
        + 1e-3 * gbuffer.geometric_normal @ camera.view[:3, :3]
    )
    hit = rays_hit_triangles(origin, direction, points[ring.triangle_vertex])
    assert 0.1 < hit.mean() < 0.7
    # Grazing light is left out, and so are the soft borders of shadows.
    certain = np.abs(gbuffer.geometric_normal @ light.vector) > 0.1
    certain &= (visibility < 0.01) | (visibility > 0.99)
    assert certain.mean() > 0.9
    assert ((visibility > 0.5) == ~hit)[certain].mean() > 0.995

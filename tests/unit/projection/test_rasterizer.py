"""The rasterizer against a ray caster; no cracks, no overlaps, any order of triangles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rays import ray_intersections
from shapes import plane

from rosy_addon.field.frames import transformed
from rosy_addon.projection import near_clipping, rasterizer
from rosy_addon.projection.camera import orthographic_camera, perspective_camera
from rosy_addon.projection.rasterizer import rasterize

pytestmark = pytest.mark.filterwarnings("error")

WIDTH, HEIGHT = 37, 29
CLIP = (0.3, 9.0)
seeds = st.integers(0, 2**32 - 1)


def flat_clip(x, y, z=0.0, width=WIDTH, height=HEIGHT):
    """Clip coordinates of points given in pixels."""
    z = np.broadcast_to(z, x.shape)
    return np.stack([2 * x / width - 1, 2 * y / height - 1, z, np.ones(x.shape)], 1)


def make_camera(perspective, width=WIDTH, height=HEIGHT):
    if perspective:
        return perspective_camera(np.eye(4), width, height, fov=1.2, clip=CLIP)
    return orthographic_camera(np.eye(4), width, height, scale=5.0, clip=CLIP)


def cast_rays(points, triangles, camera):
    """Cast a ray through each pixel: nearest triangle, barycentric coordinates and depth along -z.

    Also return whether a margin is below 1e-9, so that the result depends on rounding.
    """
    row, column = np.divmod(np.arange(camera.width * camera.height), camera.width)
    x = (2 * (column + 0.5) / camera.width - 1) / camera.projection[0, 0]
    y = (2 * (row + 0.5) / camera.height - 1) / camera.projection[1, 1]
    on_plane, away = np.stack([x, y, 0 * x], axis=1), np.array([0.0, 0.0, -1.0])
    if camera.is_perspective:
        origin, direction = 0 * on_plane, on_plane + away
    else:
        origin, direction = on_plane, 0 * on_plane + away
    barycentric, distance = ray_intersections(origin, direction, points[triangles])
    near, far = CLIP
    margin = np.min([barycentric.min(axis=2), distance - near, far - distance], axis=0)
    depths = np.where(margin > -1e-9, distance, np.inf)
    owner, first_two = depths.argmin(axis=1), np.sort(depths, axis=1)[:, :2]
    doubtful = (np.abs(margin) < 1e-9).any(axis=1) | (first_two[:, 1] < first_two[:, 0] + 1e-9)
    weights = barycentric[np.arange(len(owner)), owner]
    return np.where(np.isfinite(first_two[:, 0]), owner, -1), weights, first_two[:, 0], doubtful


@pytest.mark.slow
@settings(max_examples=15)
@given(seeds, st.booleans())
def test_visible_triangles_match_a_ray_caster(seed, perspective):
    """Triangles in front of, behind and around the eye, and across both clip planes."""
    random = np.random.default_rng(seed)
    camera = make_camera(perspective, 19, 13)
    points = random.normal(size=(24, 3)) * (2, 2, 4) + (0, 0, -2)
    triangles = np.arange(24).reshape(8, 3)
    owner, weights, depth, doubtful = cast_rays(points, triangles, camera)
    clip = transformed(points, camera.projection @ camera.view)
    fragments = rasterize(clip, triangles, camera.width, camera.height)
    actual = np.full(len(owner), -1)
    actual[fragments.pixel] = fragments.triangle
    assert (actual == owner)[~doubtful].all()
    certain = (actual == owner)[fragments.pixel]
    actual, expected = fragments.barycentric[certain], weights[fragments.pixel[certain]]
    np.testing.assert_allclose(actual, expected, atol=1e-7)
    z = -depth[fragments.pixel[certain]]
    projection = camera.projection
    ndc = (projection[2, 2] * z + projection[2, 3]) / (projection[3, 2] * z + projection[3, 3])
    np.testing.assert_allclose(fragments.depth[certain], ndc, atol=1e-7)


def jittered_grid(random, cells, snap):
    """A square from 3.5 to 25.5 pixels, split at random into triangles of both windings.

    With `snap` all vertices lie on multiples of 1 / snap, so that many edges and vertices fall on
    the centers of pixels.
    """
    side = np.linspace(3.5, 25.5, cells + 1)
    x, y = np.meshgrid(side, side)
    max_offset = np.zeros_like(x)
    max_offset[1:-1, 1:-1] = 0.24 * (side[1] - side[0])
    x = x + max_offset * random.uniform(-1, 1, x.shape)
    y = y + max_offset * random.uniform(-1, 1, x.shape)
    if snap:
        x, y = np.round(x * snap) / snap, np.round(y * snap) / snap
    index = np.arange(x.size).reshape(x.shape)
    corners = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    a, b, c, d = (corner.ravel() for corner in corners)
    flip = (random.random(len(a)) < 0.5)[:, None]
    first = np.where(flip, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    second = np.where(flip, np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    triangles = np.concatenate([first, second])
    reversed_winding = random.random(len(triangles)) < 0.5
    triangles[reversed_winding] = triangles[reversed_winding][:, ::-1]
    return x.ravel(), y.ravel(), triangles


def coverage(clip, triangles, width=WIDTH, height=HEIGHT):
    """(height, width) number of triangles, drawn one by one, that cover each pixel."""
    count = np.zeros(width * height, dtype=int)
    for triangle in triangles:
        count[rasterize(clip, triangle[None], width, height).pixel] += 1
    return count.reshape(height, width)


@settings(max_examples=25)
@given(seeds, st.integers(1, 6), st.sampled_from([0, 2, 4]))
def test_each_pixel_belongs_to_exactly_one_triangle(seed, cells, snap):
    """Pixel centers on the left and lower borders are inside, on the other borders outside."""
    x, y, triangles = jittered_grid(np.random.default_rng(seed), cells, snap)
    # In a frame of 32 x 32 pixels the clip coordinates of the border are exact.
    count = coverage(flat_clip(x, y, 0.0, 32, 32), triangles, 32, 32)
    expected = np.zeros((32, 32), dtype=int)
    expected[3:25, 3:25] = 1
    assert (count == expected).all()


@pytest.mark.slow
@settings(max_examples=25)
@given(seeds)
def test_no_cracks_where_the_near_plane_cuts(seed):
    """A floor under the eye, split at random: all pixels below the horizon are covered once."""
    random = np.random.default_rng(seed)
    camera = make_camera(True)
    x, y, triangles = jittered_grid(random, 5, 0)
    points = np.stack([(x - 14.5) * 30, np.full(x.shape, -0.1), (y - 14.5) * 0.7], axis=1)
    clip = transformed(points, camera.projection @ camera.view)
    # w is from behind the eye to in front of it; the near plane is at w = 0.1.
    clip[:, 2] = -0.1
    count = coverage(clip, triangles)
    lowest_row = HEIGHT / 2 * (1 - camera.projection[1, 1] * 0.1 / 0.1)
    farthest_row = HEIGHT / 2 * (1 - camera.projection[1, 1] * 0.1 / (11 * 0.7))
    rows = np.arange(HEIGHT) + 0.5
    inside = (rows > lowest_row) & (rows < farthest_row)
    assert inside.sum() > 8 and (count == inside[:, None]).all()


@settings(max_examples=20)
@given(seeds)
def test_order_of_triangles_and_corners_does_not_matter(seed):
    random = np.random.default_rng(seed)
    camera = make_camera(True)
    points = random.normal(size=(40, 3)) * (2, 2, 2) + (0, 0, -3)
    triangles = random.permuted(np.tile(np.arange(40), (60, 1)), axis=1)[:, :3]
    _, distinct = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    triangles = triangles[distinct]
    clip = transformed(points, camera.projection @ camera.view)
    fragments = rasterize(clip, triangles, WIDTH, HEIGHT)
    order = random.permutation(len(triangles))
    again = rasterize(clip, triangles[order], WIDTH, HEIGHT)
    assert (order[again.triangle] == fragments.triangle).all()
    for name in ("pixel", "barycentric", "depth"):
        np.testing.assert_array_equal(getattr(again, name), getattr(fragments, name))
    turned = rasterize(clip, triangles[:, [1, 2, 0]], WIDTH, HEIGHT)
    assert (turned.pixel == fragments.pixel).all() and (turned.triangle == fragments.triangle).all()
    np.testing.assert_allclose(turned.barycentric[:, [2, 0, 1]], fragments.barycentric, atol=1e-6)
    assert (turned.front_facing == fragments.front_facing).all()
    mirrored = rasterize(clip, triangles[:, ::-1], WIDTH, HEIGHT)
    assert (mirrored.triangle == fragments.triangle).all()
    assert (mirrored.front_facing == ~fragments.front_facing).all()


@pytest.mark.parametrize(("block", "band"), [(1, 1), (7, 100), (1 << 20, 1 << 30)])
def test_the_size_of_blocks_does_not_matter(monkeypatch, block, band):
    points = np.random.default_rng(5).normal(size=(60, 3)) * (2, 2, 2) + (0, 0, -3)
    triangles = np.arange(60).reshape(20, 3)
    triangles = np.concatenate([triangles, triangles])
    camera = make_camera(True)
    clip = transformed(points, camera.projection @ camera.view)
    expected = rasterize(clip, triangles, WIDTH, HEIGHT)
    monkeypatch.setattr(rasterizer, "BLOCK_SIZE", block)
    monkeypatch.setattr(rasterizer, "MAX_BAND_PIXELS", band)
    for pair in zip(rasterize(clip, triangles, WIDTH, HEIGHT), expected, strict=True):
        np.testing.assert_array_equal(*pair)


@pytest.mark.parametrize("z", [-1.0, 1.0])
def test_clip_planes_are_inclusive(z):
    x, y = np.array([0.0, 37, 0]), np.array([0.0, 0, 29])
    triangle = np.array([[0, 1, 2]])
    assert len(rasterize(flat_clip(x, y, z), triangle, WIDTH, HEIGHT).pixel) > 400
    assert not len(rasterize(flat_clip(x, y, 1.001 * z), triangle, WIDTH, HEIGHT).pixel)


def test_triangles_without_area_or_outside_the_frame_cover_nothing():
    x = np.array([3.0, 20, 11.5, 3, 3, -50, -90, -60])
    y = np.array([3.0, 20, 11.5, 3, 3, 10, 12, 20])
    triangles = np.array([[0, 1, 2], [0, 3, 4], [0, 0, 1], [5, 6, 7]])
    assert not len(rasterize(flat_clip(x, y), triangles, WIDTH, HEIGHT).pixel)
    assert not len(rasterize(flat_clip(x, y), triangles[:0], WIDTH, HEIGHT).pixel)


def test_vertices_far_outside_the_frame():
    """A triangle of 10^12 pixels with an edge across the picture."""
    x, y = np.array([18.5, 18.5, 1e12]), np.array([-1e12, 1e12, 0.0])
    fragments = rasterize(flat_clip(x, y), np.array([[0, 1, 2]]), WIDTH, HEIGHT)
    assert len(fragments.pixel) == HEIGHT * (WIDTH - 18) and (fragments.pixel % WIDTH >= 18).all()


@pytest.mark.slow
def test_tiny_triangles_leave_no_hole():
    surface = plane(400, 400)
    x, y, _ = surface.vertices.T
    clip = np.stack([x, y, 0.3 * np.sin(9 * x * y), np.ones(x.shape)], axis=1)
    assert len(rasterize(clip, surface.triangle_vertex, 128, 128).pixel) == 128 * 128


def test_near_plane_intersections_do_not_depend_on_the_edge_direction():
    """Intersections are bit-identical; otherwise rounding would separate adjacent triangles."""
    vertices = np.random.default_rng(3).normal(size=(2000, 4))
    first, second = np.arange(1000), np.arange(1000, 2000)
    forward = near_clipping._intersect_near(vertices, first, second)
    assert (forward == near_clipping._intersect_near(vertices, second, first)).all()


def test_the_first_of_equal_depths_is_visible_among_clipped_triangles():
    camera = make_camera(True)
    points = np.array([[-50, -1, 60], [60, -1, 50], [40, -1, -70], [-45, -1, -40.0], [0, 1, -80]])
    # A floor four times, clipped in different ways, and a wall that is not clipped.
    triangles = np.array([[0, 1, 2], [1, 2, 0], [2, 3, 0], [0, 2, 3], [2, 3, 4], [2, 4, 3]])
    clip = transformed(points, camera.projection @ camera.view)
    fragments = rasterize(clip, triangles[[4, 0, 2, 5, 0, 2]], WIDTH, HEIGHT)
    assert set(fragments.triangle) <= {0, 1, 2}

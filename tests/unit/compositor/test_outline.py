"""Outlines: no specks, all silhouettes and creases, and stability under motion."""

from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
import pytest
from harness.outline_marks import covered_share, mark_lengths, to_image, visible_silhouettes
from hatched import make_instance, make_wall
from scipy.ndimage import maximum_filter
from shapes import (
    cube,
    cylinder,
    from_triangles,
    icosphere,
    joined,
    moved,
    plane,
    rebuilt,
    roughened,
    sharp_cube,
    torus,
)

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.outline import (
    FULL_MARK_LENGTH,
    MIN_MARK_LENGTH,
    _mark_strength,
    outline_coverage,
)
from rosy_addon.field.surface import Surface
from rosy_addon.projection.camera import look_at, orbit_camera, orthographic_camera
from rosy_addon.projection.outline_mesh import outline_mesh
from rosy_addon.projection.project import project

#: Width of outlines, and side of pictures in pixels.
WIDTH, SIZE = 1.3, 320

#: Marks from this length on are no specks.
MIN_LENGTH = 6


def outline_of(instance, camera, **settings):
    gbuffer = project([instance], camera)
    supersampling = settings.pop("supersampling", 1)
    look = pixel_look(Look(outline=settings.pop("outline", WIDTH), **settings))
    coverage = outline_coverage(gbuffer, replace(look, supersampling=supersampling))
    return to_image(gbuffer, coverage)


@lru_cache(maxsize=4)
def noisy(name: str, flat: bool) -> Surface:
    """A dense mesh whose vertices are moved along their normals."""
    surface = torus(160, 80) if name == "torus" else icosphere(5)
    edge = 0.025 if name == "torus" else 0.04
    return roughened(surface, 0.25 * edge, 5, flat_faces=np.full(surface.face_count, flat))


def combined(*parts: tuple[np.ndarray, np.ndarray]) -> Surface:
    """Boxes as one mesh, with sharp edges: each is given by its center and its half sides."""
    corners = 2 * cube().vertices - 1
    boxes = (rebuilt(cube(), corners * half_sides + center) for center, half_sides in parts)
    return joined(*boxes, sharp_angle=0.5)


# --- closed forms --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("width", [1.0, 2.0, 3.5, 6.0])
def test_the_width_of_outlines(width):
    """The outline of a ball has the area of a ring of that width along the border.

    A border of pixels is off by up to half a pixel, which is most for the thinnest ring.
    """
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), SIZE, SIZE, scale=2.4)
    gbuffer = project([make_instance(icosphere(5))], camera)
    covered = outline_coverage(gbuffer, pixel_look(Look(outline=width)))
    radius = SIZE / 2.4
    ring = np.pi * (radius**2 - (radius - width) ** 2)
    assert covered.sum() == pytest.approx(ring, rel=0.15 / width)
    from_middle = np.hypot(gbuffer.position[:, 0], gbuffer.position[:, 1]) * radius
    assert (covered[from_middle < radius - width - 2] == 0).all()
    assert (covered[from_middle > radius - width + 2] == 1).all()


def test_outlines_are_drawn_on_the_nearer_surface():
    """Two walls, one in front of the other: the far one has no line where it is occluded."""
    walls = [make_wall(half=1.0), make_wall(half=1.0, matrix=moved(0.7, 1.0, 0.3))]
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 240, 240, scale=4.0)
    gbuffer = project(walls, camera)
    covered = outline_coverage(gbuffer, pixel_look(Look(outline=3.0)))
    first, second = gbuffer.instance_id == 0, gbuffer.instance_id == 1
    x, y = gbuffer.position[:, 0] * 60, gbuffer.position[:, 1] * 60
    to_border = 60 - np.maximum(np.abs(x), np.abs(y))
    assert (covered[first] == (to_border[first] < 3)).all()
    hidden_by = second & (np.maximum(np.abs(x), np.abs(y)) < 65) & (x > -14) & (y > -38)
    assert hidden_by.sum() > 300 and (covered[hidden_by] == 0).all()


# --- specks --------------------------------------------------------------------------------------


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("name", ["torus", "sphere"])
def test_noise_makes_no_specks(name, flat):
    instance = make_instance(noisy(name, flat))
    camera = orbit_camera(instance.face_points(), 30.0, 35.0, SIZE, SIZE)
    lengths = mark_lengths(outline_of(instance, camera))
    assert lengths.max() > SIZE / 2 and (lengths >= MIN_LENGTH).all()


@pytest.mark.parametrize("supersampling", [2, 3])
def test_lengths_of_marks_are_in_pixels_of_the_finished_picture(supersampling):
    instance = make_instance(noisy("torus", False))
    side = 200 * supersampling
    camera = orbit_camera(instance.face_points(), 30.0, 35.0, side, side)
    samples = {"outline": WIDTH * supersampling, "supersampling": supersampling}
    coverage = outline_of(instance, camera, **samples)
    blocks = coverage.reshape(200, supersampling, 200, supersampling).max(axis=(1, 3))
    assert (mark_lengths(blocks) >= MIN_LENGTH).all()


def hills() -> Surface:
    """A landscape with slopes that many views see edge-on, behind other slopes."""
    flat = plane(159, 159, 6.0)
    x, y, _ = flat.vertices.T
    z = 0.35 * np.sin(2.2 * x) * np.cos(2 * y) + 0.15 * np.sin(3 * y + x)
    return rebuilt(flat, np.stack([x, y, z], axis=1))


def two_boxes() -> Surface:
    return combined(((0, 0, 0), (1, 1, 0.2)), ((0.2, 0.3, 0.4), (0.3, 0.2, 0.3)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [torus, partial(noisy, "torus", False), partial(cylinder, 64, 4), two_boxes, hills],
    ids=["torus", "noisy torus", "tube", "boxes", "hills"],
)
def test_silhouettes_are_covered(make):
    """At least 0.995 of the silhouettes that a search over all edges finds."""
    instance = make_instance(make())
    for angles in ((30.0, 35.0), (-70.0, 8.0), (0.0, 20.0)):
        camera = orbit_camera(instance.face_points(), *angles, SIZE, SIZE)
        points, lengths = visible_silhouettes(instance, camera)
        assert lengths.sum() > SIZE
        assert covered_share(outline_of(instance, camera), points, lengths) >= 0.995


def test_tiny_parts_keep_their_outlines():
    """A bolt of 5 pixels in front of a plate, also where it belongs to the same mesh."""
    plate, bolt = ((0, 0, 0), (1, 0.1, 1)), ((0.305, -0.4, 0.205), (0.023, 0.1, 0.023))
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 240, 240, scale=2.4)
    coverage = outline_of(make_instance(combined(plate, bolt)), camera)
    assert sorted(mark_lengths(coverage))[0] == 5
    bare = outline_of(make_instance(combined(bolt)), camera)
    np.testing.assert_array_equal(bare > 0, (coverage > 0) & (bare > 0))
    assert (bare > 0.9).sum() >= 12


# --- creases -------------------------------------------------------------------------------------


def line_is_covered(coverage, camera, start, end, least=0.6) -> bool:
    """Whether all points on a line in space have a coverage in the picture, within a pixel."""
    clip = np.c_[np.linspace(start, end, 400), np.ones(400)] @ (camera.projection @ camera.view).T
    place = (clip[:, :2] / clip[:, 3:] * 0.5 + 0.5) * (camera.width, camera.height)
    column, row = place.astype(int).T
    return bool((maximum_filter(coverage, 3)[row, column] >= least).all())


@pytest.mark.parametrize("side", [24, 100, SIZE])
@pytest.mark.parametrize("sharp", [False, True])
def test_all_edges_of_a_cube_are_drawn(sharp, side):
    """Without gaps, at any size, also if the normals are interpolated across its edges."""
    box = sharp_cube() if sharp else cube()
    instance = make_instance(box)
    camera = orbit_camera(instance.face_points(), 35.0, 25.0, side, side)
    coverage = outline_of(instance, camera)
    corner = box.vertices[np.argmin(np.linalg.norm(box.vertices - camera.eye, axis=1))]
    for axis in range(3):
        end = corner.copy()
        end[axis] = 1 - end[axis]
        assert line_is_covered(coverage, camera, corner, end)


@pytest.mark.slow
def test_creases_of_dense_meshes_have_no_gaps():
    """A ridge whose triangles are smaller than a pixel."""
    flat = plane(300, 300)
    x, y, _ = flat.vertices.T
    points = np.stack([x, y, -0.6 * np.abs(y - 1e-3)], axis=1)
    instance = make_instance(from_triangles(points, flat.triangle_vertex))
    camera = orbit_camera(instance.face_points(), 20.0, 50.0, 200, 200)
    coverage = outline_of(instance, camera)
    top = points[np.argmax(points[:301, 2])]
    assert line_is_covered(coverage, camera, (-0.95, top[1], top[2]), (0.95, top[1], top[2]))


def test_hidden_creases_are_not_drawn():
    """A wall in front of a box hides its edges."""
    boxes = combined(((0, 0, 0), (0.5, 0.5, 0.5)), ((0, -1.5, 0), (1, 0.1, 1)))
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 200, 200, scale=2.4)
    coverage = outline_of(make_instance(boxes), camera)
    assert not coverage[30:170, 30:170].any() and coverage.any()


def test_parts_that_intersect_have_a_line_between_them():
    boxes = combined(((0, 0, 0), (1, 1, 0.1)), ((0, 0, 0.3), (0.4, 0.4, 0.4)))
    camera = orbit_camera(boxes.vertices, 30.0, 40.0, SIZE, SIZE)
    coverage = outline_of(make_instance(boxes), camera)
    near = 0.4 * np.sign(camera.eye[:2])
    for end in ((-near[0], near[1]), (near[0], -near[1])):
        assert line_is_covered(coverage, camera, (*near, 0.1), (*end, 0.1))
    crossing = outline_of(make_instance(boxes), camera, crease_angle=np.pi)
    assert not line_is_covered(crossing, camera, (*near, 0.1), (-near[0], near[1], 0.1))


# --- motion --------------------------------------------------------------------------------------


@pytest.mark.parametrize("block_side", [1, 2])
def test_marks_grow_without_a_jump(block_side):
    """The width of the line of a mark increases with its length, from 0 to the full width."""
    lengths = np.arange(2, FULL_MARK_LENGTH + 4)
    frame = np.zeros((4 * len(lengths), 60), dtype=bool)
    for index, length in enumerate(lengths):
        frame[4 * index : 4 * index + 2, 10 : 10 + length] = True
    frame = frame.repeat(block_side, axis=0).repeat(block_side, axis=1)
    pixel = np.flatnonzero(frame).astype(np.int32)
    border = np.zeros(len(pixel), dtype=np.uint8)
    strength = _mark_strength(pixel, border, frame.shape[1], block_side)
    mark = pixel // frame.shape[1] // (4 * block_side)
    by_length = np.array([np.unique(strength[mark == k]).item() for k in range(len(lengths))])
    assert not by_length[lengths < MIN_MARK_LENGTH].any()
    assert (by_length[lengths >= FULL_MARK_LENGTH] == 1).all()
    assert (np.diff(by_length) >= 0).all() and np.diff(by_length).max() < 0.2


def test_deformed_meshes_keep_their_creases():
    """Creases are those of the rest shape, so that none appears or vanishes in an animation."""
    points = cube().vertices
    sheared = points + 2.0 * points[:, [2]] * (1, 0, 0)
    deformed = rebuilt(cube(), sheared, sharp_angle=0.1, rest_vertices=points)
    assert len(outline_mesh(deformed, np.eye(3), 1.4).crease_ends) == 12

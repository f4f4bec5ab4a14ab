"""Dots and labels of singularities: their places, sizes and colors, in pictures and in drawings."""

import re

import numpy as np
import pytest
from harness.stroke_tracing import planar_strokes
from shapes import globe, icosphere, instance_of, plane, torus

from rosy_addon.annotation.draw_marks import draw_marks
from rosy_addon.annotation.index_labels import (
    LETTERS,
    place_indices,
    placed_labels,
    text_segments,
    text_width,
)
from rosy_addon.annotation.singularity_marks import (
    COLOR_BY_SIGN,
    OUTLINE,
    SingularityMarks,
    shown_singularities,
    singularity_marks,
)
from rosy_addon.compositor.look import Look
from rosy_addon.core.cache import Cache
from rosy_addon.core.color import from_hex, to_linear
from rosy_addon.field.prescribed import prescribed_field
from rosy_addon.field.singularities import find_singularities, format_index
from rosy_addon.line_drawing.pipeline import draw_instances
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.line_drawing.svg import svg_text
from rosy_addon.line_drawing.visibility import project_to_pixels
from rosy_addon.projection.camera import look_at, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

CAMERA = perspective_camera(look_at((2.5, -3.0, 1.5), (0, 0, 0)), 240, 200, fov=0.7)


def marks(position, index, depth=1.0, is_visible=True, **settings) -> SingularityMarks:
    """Marks of a field of degree 4 in a frame of 160 x 100 pixels."""
    place, index, count = np.array(position, dtype=float), np.array(index), len(position)
    depth = np.broadcast_to(depth, count).astype(float)
    is_visible = np.broadcast_to(is_visible, count).astype(bool)
    degree = np.full(count, 4)
    return SingularityMarks(place, index, degree, depth, is_visible, (160, 100), **settings)


def gray(height=60, width=80):
    return np.full((height, width, 4), (0.2, 0.2, 0.2, 1), dtype=np.float32)


def view_of(surface, degree, **settings):
    look = Look(length=8).with_settings(settings)
    return ViewInput((instance_of(surface, degree),), CAMERA, look)


def rendered(view):
    return draw_picture(view).rgba


@pytest.mark.parametrize("index", [1, -2, 4])
def test_the_area_of_a_dot_is_proportional_to_its_index(index):
    picture = np.zeros((60, 80, 4), dtype=np.float32)
    picture = draw_marks(picture, marks([(30.3, 20.8)], [index], size=10.0))
    radius = 5 * abs(index) ** 0.5 + OUTLINE * 10
    assert picture[..., 3].sum() == pytest.approx(np.pi * radius**2, rel=0.01)
    fill = to_linear(from_hex(COLOR_BY_SIGN[np.sign(index)]))
    np.testing.assert_allclose(picture[20, 30, :3], fill, atol=1e-6)
    x, y = (picture[..., 3].sum(axis=axis) @ (np.arange(n) + 0.5) for axis, n in ((0, 80), (1, 60)))
    np.testing.assert_allclose((x, y) / picture[..., 3].sum(), (30.3, 20.8), atol=0.02)


def test_nearer_dots_are_above_and_hidden_ones_faint():
    positions = [(20, 20), (24, 20), (24, 16)]
    dots = marks(positions, [1, -1, 1], depth=[1, 2, 0.5], is_visible=[1, 1, 0])
    picture = draw_marks(gray(), dots)
    colors = {sign: to_linear(from_hex(code)) for sign, code in COLOR_BY_SIGN.items()}
    np.testing.assert_allclose(picture[19, 21, :3], colors[1], atol=1e-6)
    np.testing.assert_allclose(picture[20, 27, :3], colors[-1], atol=1e-6)
    faint = draw_marks(gray(), marks([(40, 30)], [1], is_visible=False, has_labels=True))
    np.testing.assert_allclose(faint[30, 40, :3], 0.7 * 0.2 + 0.3 * colors[1], atol=1e-6)
    assert (faint != gray()).any(axis=2).sum() < 200  # no label


def test_dots_beside_the_frame_and_none_at_all():
    np.testing.assert_array_equal(draw_marks(gray(), marks(np.zeros((0, 2)), [])), gray())
    np.testing.assert_array_equal(draw_marks(gray(), marks([(-40, 10), (9e9, 3)], [1, 1])), gray())
    assert (draw_marks(gray(), marks([(-2, 30)], [1]))[30, 0, :3] != 0.2).any()


def test_labels_say_the_index_and_cover_no_dot():
    dots = marks([(40, 40), (70, 75), (120, 40)], [1, -2, 6], has_labels=True)
    labels = placed_labels(dots)
    assert [label.text for label in labels] == ["+1/4", "-1/2", "+3/2"]
    unlabeled = marks(dots.position, dots.index)
    picture, plain = (draw_marks(gray(100, 160), shown) for shown in (dots, unlabeled))
    is_dot = np.zeros((100, 160), dtype=bool)
    y, x = np.mgrid[:100, :160] + 0.5
    for (dot_x, dot_y), radius in zip(dots.position, dots.radius, strict=True):
        is_dot |= np.hypot(x - dot_x, y - dot_y) < radius
    np.testing.assert_array_equal(picture[is_dot], plain[is_dot])
    assert (picture != plain).any(axis=2).sum() > 150
    beside = placed_labels(marks([(157, 50), (80, 97)], [1, 1], has_labels=True))
    assert len(beside) == 2 and beside[0].left < 130 and beside[1].bottom < 90
    assert not placed_labels(marks(np.zeros((251, 2)), [1] * 251, has_labels=True))


def test_every_index_can_be_written():
    for degree in range(1, 13):
        for index in range(-30, 31):
            text = format_index(index, degree)
            segments = text_segments(text)
            assert np.isfinite(segments).all() and segments[..., 0].max() < text_width(text) + 1e-9
    shapes = {text_segments(letter).tobytes() for letter in LETTERS}
    assert len(shapes) == len(LETTERS) == 13


def test_visible_singularities_of_a_mesh_have_dots_at_their_vertices():
    """And nothing else is changed; those behind the surface have none."""
    surface = icosphere(3)
    view, plain = view_of(surface, 4, singularity_dots="visible"), view_of(surface, 4)
    picture, without = rendered(view), rendered(plain)
    vertex, index = find_singularities(surface, view.instances[0].field)
    towards_eye = (surface.vertices[vertex] * (CAMERA.eye - surface.vertices[vertex])).sum(axis=1)
    place, _ = project_to_pixels(surface.vertices[vertex], CAMERA)
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width] + 0.5
    near = np.zeros(x.shape, dtype=bool)
    for (dot_x, dot_y), sign, dot in zip(place, np.sign(index), towards_eye, strict=True):
        color = picture[int(dot_y), int(dot_x), :3]
        if dot > 0.4:
            np.testing.assert_allclose(color, to_linear(from_hex(COLOR_BY_SIGN[sign])), atol=1e-6)
        if dot > -0.4:
            near |= np.hypot(x - dot_x, y - dot_y) < 12
    assert near.any()
    np.testing.assert_array_equal(picture[~near], without[~near])


def test_clusters_have_one_dot_with_the_sum_of_their_indices():
    """Singularities two edges apart are 1.6 % of the size apart."""
    surface = plane(128, 128)
    vertex, index = [60 * 129 + 64, 70 * 129 + 64, 100 * 129 + 20, 102 * 129 + 20], [1, 1, 1, -1]
    field = prescribed_field(surface, 4, vertex, index)
    instance = MeshInstance(surface, np.eye(4), field)
    for kind, expected in (("visible", vertex), ("clusters", vertex[:2])):
        shown, _ = shown_singularities(instance, Look(singularity_dots=kind), Cache())
        assert shown.tolist() == expected
    dots = singularity_marks([instance], CAMERA, Look(singularity_dots="clusters"))
    assert len(dots) == 2 and dots.has_labels


@pytest.mark.slow
@pytest.mark.parametrize(
    ("degree", "shown"), [(4, {"singularity_dots": "all"}), (3, {"arrows": 40.0})]
)
def test_supersampling_draws_the_same_marks(degree, shown):
    surface, changed = globe(48, 96), []
    for samples in (1, 2):
        looks = {"supersampling": samples}, {"supersampling": samples, **shown}
        plain, marked = (rendered(view_of(surface, degree, **settings)) for settings in looks)
        changed.append((plain != marked).any(axis=2))
    assert changed[0].any()
    np.testing.assert_array_equal(*changed)


@pytest.mark.slow
def test_drawings_have_the_same_dots_as_pictures():
    instances = [instance_of(torus(48, 24), 4), instance_of(icosphere(3), 4)]
    style = StrokeStyle(spacing=80.0, singularity_dots="all_indices")
    drawing = draw_instances(instances, CAMERA, style)
    text = svg_text(drawing.strokes, CAMERA, None, drawing.marks)
    circles = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="([\d.]+)" fill="(#\w+)"', text)
    expected = drawing.marks.in_drawing_order()
    assert len(circles) == len(expected) >= 8
    centers = [(float(x), CAMERA.height - float(y)) for x, y, *_ in circles]
    np.testing.assert_allclose(centers, expected.position, atol=0.01)
    assert text.count("opacity=") == (~expected.is_visible).sum() > 0
    assert text.count('<path fill="none" stroke="#ffffff"') == expected.is_visible.sum()
    assert "circle" not in svg_text(drawing.strokes, CAMERA)


@pytest.mark.parametrize("size, width, halo", [(3.0, 1.0, 1.96), (12.0, 2.04, 5.88)])
def test_lines_of_labels_in_drawings_are_at_least_a_pixel_wide(size, width, halo):
    strokes = planar_strokes(np.eye(3)[None], np.eye(3), 1.0)
    labeled = marks([(80, 50)], [1], size=size, has_labels=True)
    layer = svg_text(strokes, CAMERA, None, labeled).partition('id="singularities"')[2]
    widths = re.findall(r'<path [^>]*stroke="(#\w+)" stroke-width="([\d.]+)"', layer)
    assert widths == [("#ffffff", f"{halo:g}"), ("#141414", f"{width:g}")]


@pytest.mark.parametrize("size", [1.0, 3.0, 12.0])
def test_labels_stay_in_the_frame_with_their_halos(size):
    reach = max(0.17 * size, 1.0) / 2 + 0.16 * size
    ends = []
    for x in np.linspace(80, 160, 801):
        (label,) = placed_labels(marks([(x, 50)], [1], size=size, has_labels=True))
        ends.append(label.segments()[..., 0].max())
    assert 160 - reach - 0.11 < max(ends) < 160 - reach + 1e-9


def test_a_label_is_above_and_to_the_right_of_its_dot():
    dots = np.array([(10, 20)]), np.array([1]), np.array([4])
    assert place_indices(*dots, 10.0, lambda _: (30, 12), (90, 90)) == [("+1/4", 17.0, 27.0)]


def test_labels_cover_neither_each_other_nor_dots():
    random = np.random.default_rng(1)
    dots, index = random.uniform(0, 400, (120, 2)), random.integers(1, 5, 120)

    def label_size(text):
        return 6.0 * len(text) + 4, 3.0 * len(text)

    labels = place_indices(dots, index, np.full(120, 4), 6.0, label_size, (400, 400))
    assert 40 < len(labels) < 120
    low = np.array([label[1:] for label in labels])
    high = low + [label_size(text) for text, _, _ in labels]
    assert low.min() >= 0 and high.max() <= 400
    overlaps = ((low[:, None] < high) & (high[:, None] > low)).all(axis=2)
    assert overlaps.sum() == len(low)
    radii = 3.0 * np.sqrt(index)[:, None, None]
    assert not ((dots[:, None] + radii > low) & (dots[:, None] - radii < high)).all(axis=2).any()

"""Keys: coverage of triangles, round numbers, layouts without overlaps, and the colors of the bar."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from shapes import icosphere, moved

from rosy_addon.annotation.draw_key import DARK_PLATES, LIGHT_PLATES, draw_key, triangle_coverage
from rosy_addon.annotation.key_contents import ColorScale, IndexCount, PictureKey
from rosy_addon.annotation.key_layout import (
    MIN_TEXT_SIZE,
    TEXT_SIZE,
    KeyParts,
    lay_out_key,
    wrapped,
)
from rosy_addon.annotation.round_numbers import (
    format_number,
    round_above,
    round_below,
    tick_labels,
    tick_values,
)
from rosy_addon.annotation.singularity_marks import COLOR_BY_SIGN
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.picture_key import fixed_color_range, picture_key
from rosy_addon.core.color import from_hex, luminance, map_colors, to_display
from rosy_addon.field.generate import generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

SCALE = ColorScale("Magnitude (1/m)", "viridis", 0.0, 0.874)
INDICES = (IndexCount(2, 4, 3), IndexCount(1, 4, 12), IndexCount(-1, 4, 7))
PARTS = KeyParts(SCALE, INDICES, 9.0, True, (150.0, "50 cm"), "A head with its field.\nBy RoSy.")


def text_width(text):
    """As if each letter were 0.55 wide."""
    return 0.55 * len(text)


def text_triangles(text):
    """Blocks in place of letters."""
    left = 0.55 * np.array([i for i, letter in enumerate(text) if letter != " "])
    steps = np.array([[(0, 0), (0.45, 0), (0.45, 0.7)], [(0, 0), (0.45, 0.7), (0, 0.7)]])
    return (steps[:, None] + np.stack([left, 0 * left], 1)[:, None]).reshape(-1, 3, 2)


# --- coverage ------------------------------------------------------------------------------------


def test_coverage_of_a_rectangle_is_exact():
    triangles = np.array([[(1.25, 1.5), (4.5, 1.5), (4.5, 3)], [(1.25, 1.5), (4.5, 3), (1.25, 3)]])
    x, y = np.array([0, 0.75, 1, 1, 0.5, 0]), np.array([0, 0.5, 1, 0])
    np.testing.assert_allclose(triangle_coverage(triangles, 6, 4), np.outer(y, x), atol=1e-6)


def test_coverage_of_triangles_sums_to_their_area():
    rng = np.random.default_rng(3)
    for corners in rng.uniform(2, 38, (40, 3, 2)):
        a, b = corners[1] - corners[0], corners[2] - corners[0]
        area = abs(a[0] * b[1] - a[1] * b[0]) / 2
        coverage = triangle_coverage(corners[None], 40, 40)
        assert coverage.sum() == pytest.approx(area, abs=0.15 + 0.005 * area)
        for order in ([1, 0, 2], [2, 1, 0]):
            again = triangle_coverage(corners[order][None], 40, 40)
            np.testing.assert_allclose(again, coverage, atol=1e-6)


def test_coverage_is_cut_at_the_window():
    triangle = np.array([[(-3.0, -4.0), (12.0, 3.0), (4.0, 14.0)]])
    whole = triangle_coverage(triangle + 5, 20, 20)
    np.testing.assert_allclose(triangle_coverage(triangle, 8, 7), whole[5:12, 5:13], atol=1e-6)
    assert not triangle_coverage(np.empty((0, 3, 2)), 3, 2).any()


# --- numbers -------------------------------------------------------------------------------------


def test_every_round_number_is_the_nearest():
    for value in [1.0, 2e-7, 0.05, *np.geomspace(1e-9, 1e9, 500).tolist()]:
        below, above = round_below(value), round_above(value)
        assert below <= value * (1 + 1e-9) and above >= value * (1 - 1e-9) and above / below < 2.51
        assert f"{below:.0e}"[0] in "125" and float(f"{below:.0e}") == below


def test_ticks_are_round_and_inside():
    np.testing.assert_allclose(tick_values(0.0, 0.874, 5), [0, 0.2, 0.4, 0.6, 0.8])
    np.testing.assert_allclose(tick_values(-3.0, 7.5, 6), [-2, 0, 2, 4, 6])
    values, labels = zip(*tick_labels(0.0, 0.874, 5, 0.1), strict=True)
    assert values == pytest.approx((0, 0.2, 0.4, 0.6, 0.874))
    assert labels == ("0", "0.2", "0.4", "0.6", "0.874")
    labels = [label for _, label in tick_labels(0.0, 3e-7, 3, 0.1)]
    assert labels == ["0", "1×10⁻⁷", "2×10⁻⁷", "3×10⁻⁷"]
    assert tick_labels(2.0, 2.0, 4, 0.1) == [(2.0, "2")]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        *((0, "0"), (0.8741, "0.874"), (9.9996, "10"), (-0.25, "−0.25"), (123456, "123456")),
        *((0.000321, "0.000321"), (1.5e6, "1.5×10⁶"), (-2e-9, "−2×10⁻⁹")),
    ],
)
def test_numbers_as_text(value, text):
    assert format_number(value) == text


# --- layout --------------------------------------------------------------------------------------

SIDES = (320, 240), (512, 512), (1920, 1080), (4096, 400)


def pair_count(boxes):
    """The number of pairs of boxes that overlap."""
    low, high = boxes[:, :2], boxes[:, 2:]
    overlaps = ((low[:, None] < high) & (high[:, None] > low)).all(axis=2)
    return (overlaps.sum() - len(boxes)) // 2


@pytest.mark.parametrize("size", [*SIDES, *((h, w) for w, h in SIDES)], ids=str)
def test_nothing_overlaps(size):
    width, _ = size
    captions = "", "Short.", "A caption that is so long that it has several lines. " * 3
    for caption, indices, scale, bar, dot, text_size in product(
        captions, ((), INDICES), (None, 0.2 * width), (None, SCALE), (9.0, 30.0), (0.0, 40.0)
    ):
        ruler = None if scale is None else (scale, "50 cm")
        parts = KeyParts(bar, indices, dot, True, ruler, caption)
        layout = lay_out_key(parts, size, text_width, text_size)
        count = bool(caption) + bool(indices) + (scale is not None) + (bar is not None)
        assert len(layout.plates) == count
        assert layout.text_size >= min(text_size or max(TEXT_SIZE * min(size), MIN_TEXT_SIZE), 5.5)
        boxes = np.array(layout.plates).reshape(-1, 4)
        assert (boxes >= 0).all() and (boxes[:, 2:] <= size).all() and pair_count(boxes) == 0
        low = np.array([(text.left, text.baseline) for text in layout.texts]).reshape(-1, 2)
        width = [text_width(text.text) for text in layout.texts]
        letters = np.hstack([low, low + layout.text_size * np.c_[width, np.full(len(low), 0.7)]])
        assert pair_count(letters) == 0
        inside = (boxes[None, :, :2] <= letters[:, None, :2] + 0.5).all(axis=2)
        inside &= (boxes[None, :, 2:] >= letters[:, None, 2:] - 0.5).all(axis=2)
        assert inside.any(axis=1).all()


def test_a_key_scales_with_the_frame():
    parts = replace(PARTS, caption="", scale=None)
    small = lay_out_key(parts, (960, 540), text_width)
    large = lay_out_key(replace(parts, dot_size=36.0), (3840, 2160), text_width)
    assert large.text_size == pytest.approx(4 * small.text_size)
    np.testing.assert_allclose(np.array(large.plates), 4 * np.array(small.plates), atol=8)
    radii = ([dot.radius for dot in layout.dots] for layout in (large, small))
    np.testing.assert_allclose(next(radii), 4 * np.array(next(radii)))


def test_dots_of_the_legend_are_as_large_as_drawn():
    dots = lay_out_key(PARTS, (960, 540), text_width).dots
    assert [dot.radius for dot in dots] == pytest.approx([4.5 * 2**0.5, 4.5, 4.5])


def test_text_is_wrapped_at_spaces():
    lines = wrapped("one two three\n\n incomprehensibilities so", 6.0, text_width)
    assert lines == ["one two", "three", "", "incomprehensibilities", "so"]
    assert wrapped(" ", 5.0, text_width) == []


# --- drawing -------------------------------------------------------------------------------------


@pytest.fixture(params=[LIGHT_PLATES, DARK_PLATES], ids=["light", "dark"])
def drawn(request):
    layout = lay_out_key(PARTS, (640, 480), text_width)
    rgba = np.zeros((480, 640, 4), dtype=np.float32)
    draw_key(rgba, layout, ColorScale("", "magma", 0.0, 1.0), text_triangles, request.param)
    return rgba, layout


def test_the_bar_has_the_colors_of_its_map(drawn):
    rgba, layout = drawn
    left, bottom, right, top = (int(value) for value in layout.color_bar)
    bar = rgba[bottom:top, left:right]
    expected = map_colors((np.arange(top - bottom) + 0.5) / (top - bottom), "magma")
    expected = expected[:, None] + 0 * bar[..., :3]
    np.testing.assert_allclose(to_display(bar[..., :3]), expected, atol=0.5 / 255)
    assert (bar[..., 3] == 1).all()


def test_nothing_is_drawn_outside_of_the_plates(drawn):
    rgba, layout = drawn
    for left, bottom, right, top in layout.plates:
        rgba[int(bottom) : int(top), int(left) : int(right)] = 0
    assert not rgba.any()


def test_dots_have_the_colors_of_their_signs(drawn):
    rgba, layout = drawn
    for dot in layout.dots:
        color = to_display(rgba[int(dot.y), int(dot.x), :3])
        np.testing.assert_allclose(color, from_hex(COLOR_BY_SIGN[np.sign(dot.index)]), atol=2e-3)


@pytest.mark.parametrize("background", [0.0, 0.2, 1.0])
def test_text_can_be_read_on_any_background(drawn, background):
    """The contrast of text and plate is at least 4.5, as WCAG 2.2 asks for."""
    rgba, layout = drawn
    mixed = rgba.copy()
    mixed[..., :3] = rgba[..., 3:] * rgba[..., :3] + (1 - rgba[..., 3:]) * background
    mixed[..., 3] = 1.0
    light = luminance(mixed)
    text = layout.texts[0]
    x, y = text.left + 0.2 * layout.text_size, text.baseline + 0.3 * layout.text_size
    plate = light[int(layout.plates[0][1]) + 3, int(text.left)]
    darker, lighter = sorted((light[int(y), int(x)], plate))
    assert (lighter + 0.05) / (darker + 0.05) >= 4.5


# --- contents ------------------------------------------------------------------------------------


def view(look, instances=None, camera=None):
    surface = icosphere(3)
    vectors = generate(surface, "smoothest", 4).vectors
    vectors *= (0.2 + surface.face_normal[:, 2] ** 2)[:, None]
    instance = MeshInstance(surface, np.eye(4), RosyField(4, vectors))
    camera = camera or perspective_camera(look_at((2.5, -3.0, 1.5), (0, 0, 0)), 160, 120, fov=0.7)
    return ViewInput(instances or (instance,), camera, look)


def test_the_range_is_the_largest_visible_magnitude():
    look = Look(hue="magnitude", supersampling=1)
    view_input = view(look)
    picture = draw_picture(view_input)
    gbuffer = project(view_input.instances, view_input.camera)
    low, high = picture.color_range
    assert low == 0 and high == pytest.approx(np.abs(gbuffer.representation).max(), rel=1e-6)
    # A look with this range gives the same picture.
    again = draw_picture(view(replace(look, color_range=(0.0, high))))
    np.testing.assert_array_equal(again.rgba, picture.rgba)
    assert again.color_range == (0.0, high)
    scale = picture_key(look, picture).color_scale
    assert scale == ColorScale("Magnitude", look.color_map, 0.0, high)


def test_fields_with_ranges_of_their_own_have_no_common_one():
    first = view(Look()).instances[0]
    other = MeshInstance(first.surface, moved(x=1.5), RosyField(2, 0.5 * first.field.vectors))
    camera = orthographic_camera(look_at((0.7, -5, 0), (0.7, 0, 0)), 160, 120, scale=4.0)
    for top, expected in ((0.0, None), (0.7, (0.0, 0.7))):
        look = Look(hue="magnitude", color_range=(0.0, top))
        picture = draw_picture(view(look, (first, other), camera))
        assert picture.color_range == expected
        assert picture_key(look, picture).color_scale.high == (top or None)


def test_the_legend_has_the_visible_singularities():
    look = Look(singularity_dots="all", singularity_size=7.0)
    picture = draw_picture(view(look))
    key = picture_key(look, picture)
    marks = picture.marks
    assert key.color_scale is None and key.dot_size == 7.0
    assert sum(entry.count for entry in key.indices) == marks.is_visible.sum() > 0
    for entry in key.indices:
        assert entry.count == (marks.is_visible & (marks.index == entry.index)).sum()
    assert PictureKey.from_json(key.to_json()) == key
    assert PictureKey.from_json("") == PictureKey.from_json('{"a": 1}') == PictureKey()
    assert picture_key(Look(), draw_picture(view(Look()))) == PictureKey()


@pytest.mark.parametrize("ends", [(0.0, 0.0), (5.0, 2.0)])
def test_the_range_of_numbers_as_colors(ends):
    """That of the look, or else of all numbers, visible or not; also of pictures in bands."""
    instance = view(Look()).instances[0]
    heights = instance.surface.vertices[instance.surface.corner_vertex, 2].astype(np.float32)
    colored = replace(instance, color_values=heights)
    look = Look(hue="values", color_range=ends)
    picture = draw_picture(view(look, (colored,)))
    expected = ends if any(ends) else (float(heights.min()), float(heights.max()))
    assert picture.color_range == expected == fixed_color_range(look, (colored,))
    assert fixed_color_range(look) == (ends if any(ends) else None)
    assert picture_key(look, picture).color_scale == ColorScale("", look.color_map, *expected)


@pytest.mark.parametrize(
    ("ends", "expected"),
    [((2.0, 5.0), "2 5"), ((5.0, 2.0), "2 5"), ((None, None), "min max"), ((0.0, None), "0 max")],
)
def test_the_ends_of_the_color_bar(ends, expected):
    layout = lay_out_key(KeyParts(ColorScale("", "magma", *ends)), (640, 480), text_width)
    labels = [line.text for line in sorted(layout.texts, key=lambda line: line.baseline)]
    assert f"{labels[0]} {labels[-1]}" == expected


def test_the_larger_number_is_at_the_top_of_the_color_bar():
    upright, inverted = (ColorScale("", "magma", *ends).colors(9) for ends in ((0, 1), (1, 0)))
    np.testing.assert_array_equal(upright, inverted[::-1])
    np.testing.assert_array_equal(upright, map_colors((np.arange(9) + 0.5) / 9, "magma"))

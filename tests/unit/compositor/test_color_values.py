"""Numbers on surfaces as colors: where they are in the color map, and their pictures."""

from dataclasses import replace

import numpy as np
import pytest
from hatched import camera_above
from shapes import icosphere, placed, plane

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.core.color import map_colors, to_linear
from rosy_addon.field.generate import axis_field
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.projection.surface_sampling import surface_values
from rosy_addon.rendering.draw import draw_picture, picture_groups
from rosy_addon.rendering.view_input import ViewInput

#: Pixels along each side. The pictures show a square from -1.2 to 1.2.
SIZE, SIDE = 96, 2.4
CAMERA = camera_above(SIDE, SIZE, (0, 0, 4))
PIXEL_CENTERS = ((np.arange(SIZE) + 0.5) / SIZE - 0.5) * SIDE
BALL, GRID = icosphere(4), plane(4, 4)

#: Streaks without contrast, and no shading: the pixels have the colors of the map.
FLAT = Look(hue="values", gain=0.0, shading=0.0, length=3)
#: The ink alone, which covers everything.
INK = replace(FLAT, ink="hatch", tone_levels=(2.0, 3.0, 1.0), paper_color="#ffffff00")


def numbered(surface, values, shift=(0, 0, 0)):
    field, numbers = axis_field(surface, 2, (1.0, 0.3, 0.2)), np.asarray(values, dtype=np.float32)
    return MeshInstance(surface, placed(shift=shift), field, color_values=numbers)


def of_vertices(surface, values, shift=(0, 0, 0)):
    return numbered(surface, np.asarray(values)[surface.corner_vertex], shift)


def drawn(instances, look):
    """The linear colors of a picture, and the x of its pixels."""
    rgba = draw_picture(ViewInput(tuple(instances), CAMERA, look)).rgba
    row, column = np.nonzero(rgba[..., 3])
    return rgba[row, column, :3], PIXEL_CENTERS[column]


def mapped(position, name="viridis"):
    return to_linear(map_colors(np.asarray(position), name))


@pytest.mark.parametrize("look", [FLAT, INK], ids=["soft", "hatched"])
@pytest.mark.parametrize("name", ["viridis", "magma"])
def test_colors_are_those_of_interpolated_numbers(look, name):
    """x is linear on the triangles of a ball, so at each pixel the number is its x."""
    colors, x = drawn([of_vertices(BALL, BALL.vertices[:, 0])], replace(look, color_map=name))
    low, high = BALL.vertices[:, 0].min(), BALL.vertices[:, 0].max()
    np.testing.assert_allclose(colors, mapped((x - low) / (high - low), name), atol=2e-3)


@pytest.mark.parametrize(
    ("low", "high", "position"),
    [
        (0.5, -0.5, lambda x: 0.5 - x),
        (0.0, 1.0, lambda x: x),
        (-1.0, 0.0, lambda x: x + 1),
        (0.3, 0.3, lambda x: x > 0.3),
    ],
    ids=["inverted", "from 0", "to 0", "a step"],
)
def test_the_range_of_the_look(low, high, position):
    """Numbers beyond it have the colors at its ends."""
    look = replace(FLAT, color_range=(low, high))
    colors, x = drawn([of_vertices(BALL, BALL.vertices[:, 0])], look)
    away = np.abs(x - 0.3) > 1e-3
    expected = mapped(np.clip(position(x), 0, 1))
    np.testing.assert_allclose(colors[away], expected[away], atol=2e-3)


def test_numbers_of_faces_are_constant_on_them():
    """Exactly: no rounding shows, even of large numbers that differ little."""
    numbers = 1e6 + np.arange(GRID.face_count)
    gbuffer = project([numbered(GRID, numbers[GRID.corner_face])], CAMERA)
    expected = numbers[GRID.triangle_face[gbuffer.triangle]]
    np.testing.assert_array_equal(surface_values(gbuffer), expected)


def test_the_range_is_that_of_all_instances_with_a_field():
    """Those that are out of view count, those without a field do not."""
    seen = of_vertices(BALL, BALL.vertices[:, 0])
    unseen = of_vertices(BALL, 3 * BALL.vertices[:, 0] + 1, shift=(0, 0, 90))
    occluder = replace(numbered(BALL, seen.color_values * 50, shift=(0, 0, 90)), field=None)
    colors, x = drawn([seen, unseen, occluder], FLAT)
    low, high = unseen.color_values.min(), unseen.color_values.max()
    np.testing.assert_allclose(colors, mapped((x - low) / (high - low)), atol=2e-3)


def test_one_number_has_the_color_at_the_bottom():
    colors, _ = drawn([numbered(BALL, np.full(len(BALL.corner_vertex), 7.0))], FLAT)
    np.testing.assert_array_equal(colors, np.broadcast_to(mapped([0.0]), colors.shape))


@pytest.mark.parametrize("look", [replace(FLAT, gain=2.5), replace(INK, ink_color="#204060")])
def test_pixels_without_a_number(look):
    """They are as with one hue, and do not count for the range."""
    values = BALL.vertices[:, 0].copy()
    values[BALL.vertices[:, 1] > 0.2] = np.nan
    gbuffer = project([of_vertices(BALL, values)], CAMERA)
    missing = np.isnan(surface_values(gbuffer))
    assert 0.2 < missing.mean() < 0.6
    of_values, of_one = (
        compose(gbuffer, replace(look, hue=hue)).rgba.reshape(-1, 4)[gbuffer.pixel, :3]
        for hue in ("values", "one")
    )
    np.testing.assert_array_equal(of_values[missing], of_one[missing])
    assert (np.ptp(of_values[~missing], axis=1) > 0.05).mean() > 0.5


@pytest.mark.slow
def test_processes_draw_the_same_bytes():
    """The range of a band is that of the picture."""
    instance = of_vertices(BALL, BALL.vertices[:, 1])
    # Fields with many lines need many strips.
    instance = replace(instance, field=axis_field(BALL, 11, (0, 0, 1)))
    look = replace(FLAT, gain=1.0, length=10)
    view = ViewInput((instance,), CAMERA.resized(320, 1216), look)
    alone = draw_picture(view).rgba
    assert len(picture_groups(view, 2)) == 2
    assert draw_picture(view, workers=2).rgba.tobytes() == alone.tobytes()

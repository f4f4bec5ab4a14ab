"""Textures show the field of the surface, whatever the charts of their UV map."""

import numpy as np
import pytest
from harness.streaks import correlation
from shapes import cube, instance_of, plane, torus
from uv_maps import colors_at, patches_uv, surface_points, torus_uv

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import MESH_PIXELS
from rosy_addon.compositor.shading import Light
from rosy_addon.field.generate import generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.surface_lines import cached_surface_lines
from rosy_addon.surface_texture import hatching
from rosy_addon.surface_texture.draw import draw_texture

#: Lines that are wide enough for a small texture to show them well.
WIDE = Look(length=20, line_width=10.0, line_distance=20.0, high_pass=40.0)
WIDER = Look(length=40, line_width=20.0, line_distance=40.0, high_pass=80.0)


def texture_colors(instance, uv, look, size, points, **options):
    """The (n,) colors of a texture at points of the surface."""
    texture = draw_texture(instance, uv, look, size, **options)
    return colors_at(texture.rgba, instance.surface, uv, points)


#: A torus, and two UV maps of it: a single chart, and square ones, turned and mirrored at random.
TORUS = torus(48, 24)
MAPS = SINGLE, PATCHES = torus_uv(48, 24), patches_uv(1, 48, 24, 6)
POINTS = surface_points(TORUS, 20_000)


LAMP = Light("sun", np.array([0.5, -0.6, 0.6]) / np.sqrt(0.97), np.ones(3), 1.0)
UNEVEN = {"ink": "hatch", "wobble": 0.5, "breaks": 0.5, "paper_grain": 0.3}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("degree", "settings", "lights", "least"),
    [
        (1, {}, None, 0.95),
        (4, {}, None, 0.95),
        (4, {"hue": "noise"}, None, 0.93),
        (4, {"hue": "magnitude", "magnitude_length": True}, None, 0.93),
        (4, {"method": "ibfv"}, None, 0.93),
        (4, {"ink": "even"}, None, 0.85),
        (4, UNEVEN, [LAMP], 0.85),
    ],
    ids=["one member", "four", "noise", "magnitude", "ibfv", "even lines", "uneven lines"],
)
def test_texture_does_not_depend_on_the_charts(degree, settings, lights, least):
    """64 square charts, turned and mirrored at random, show the picture of a single one.

    Edges of lines and the grain of the paper are as fine as texels, which sample them differently.
    """
    field = generate(TORUS, "smoothest", degree)
    middle = np.linalg.norm(TORUS.face_center, axis=1, keepdims=True)
    instance = MeshInstance(TORUS, np.eye(4), RosyField(degree, field.vectors * middle))
    colors = []
    for uv in MAPS:
        texture = draw_texture(instance, uv, WIDER.with_settings(settings), 512, lights=lights)
        assert texture.overlap < 0.1
        assert texture.is_data == ("ink" in settings and lights is None)
        colors.append(colors_at(texture.rgba, TORUS, uv, POINTS))
    assert correlation(*colors) > least


@pytest.mark.slow
def test_stretched_charts_show_the_same_lines():
    """A map that is four times as fine along u shows the texture of an even one."""
    surface = plane(16, 16)
    instance, points = instance_of(surface, 4), surface_points(surface, 20_000)
    even = surface.vertices[surface.corner_vertex, :2] / 4 + 0.5
    maps = (even, 512), (even * [1, 0.25], 1024)
    colors = [texture_colors(instance, uv, WIDER, size, points) for uv, size in maps]
    assert correlation(*colors) > 0.95


#: A pixel of a look: a 1024th of the side of a square as large as the torus.
PIXEL = float(np.sqrt(4 * np.pi**2 * 0.4)) / MESH_PIXELS


@pytest.mark.slow
@pytest.mark.parametrize(
    ("look", "size", "offset"),
    [
        (WIDER, 1024, (0, 0)),
        (WIDER.with_settings({"unit": "scene", "unit_size": PIXEL}), 512, (0, 0)),
        (WIDER, 512, (3, -2)),
        (WIDER, 512, (0.5, 0.8)),
    ],
    ids=["twice the size", "Blender units", "other tiles", "across tiles"],
)
def test_textures_show_the_same_points_in_the_same_colors(look, size, offset):
    """At any size, in any unit, and anywhere on the UV plane, whose tiles repeat."""
    instance, uv = instance_of(TORUS, 4), SINGLE
    expected = texture_colors(instance, uv, WIDER, 512, POINTS)
    assert correlation(texture_colors(instance, uv + offset, look, size, POINTS), expected) > 0.95


def test_udim_tiles_are_pictures_of_their_own():
    """Charts of two tiles at the same place do not overlap, and streamlines go from one to the other."""
    instance, uv = instance_of(TORUS, 4), SINGLE
    second = np.repeat(np.arange(len(uv) // 4) >= len(uv) // 8, 4)
    moved = uv + np.where(second[:, None], (0.55, 0), (0.05, 0))
    tiles = draw_texture(instance, moved, WIDER, 512, is_udim=True).tiles()
    assert list(tiles) == [1001, 1002] and all(t.shape == (512, 512, 4) for t in tiles.values())
    single = texture_colors(instance, uv, WIDER, 512, POINTS)
    in_second = second[TORUS.triangles[POINTS[0], 0]]
    for tile, chosen in ((1001, ~in_second), (1002, in_second)):
        points = POINTS[0][chosen], POINTS[1][chosen]
        assert correlation(colors_at(tiles[tile], TORUS, moved, points), single[chosen]) > 0.95


@pytest.mark.slow
def test_margin_continues_the_surface():
    """Beside a seam, the margin has the colors of the other chart: no filter sees an edge."""
    instance, uv = instance_of(TORUS, 1), SINGLE
    image = draw_texture(instance, uv, WIDER, 512, margin=8).rgba[..., 0]
    low, high = round(0.05 * 512), round(0.95 * 512)
    rows = slice(round(0.1 * 512), round(0.4 * 512))
    # The chart closes along the large circle: its left border continues at its right one.
    for border, outer, beyond in ((low, low - 1, high - 1), (high - 1, high, low)):
        shown, own, expected = (image[rows, column] for column in (outer, border, beyond))
        assert np.abs(shown - expected).mean() < 0.5 * np.abs(own - expected).mean()
    without = draw_texture(instance, uv, WIDER, 512, margin=0).rgba[..., 0]
    assert np.ptp(without[rows, low - 2]) == 0 and np.ptp(image[rows, low - 8]) > 0
    assert np.ptp(image[rows, low - 10]) == 0


def test_overlapping_charts_are_counted():
    """Mirrored halves share their texels."""
    uv = SINGLE.copy()
    uv[:, 0] = np.abs(uv[:, 0] - 0.5)
    texture = draw_texture(instance_of(TORUS, 4), uv, WIDE, 256)
    assert texture.overlap == pytest.approx(0.5, abs=0.01)


@pytest.mark.slow
def test_lines_are_spaced_on_no_more_triangles_than_texels_can_show(monkeypatch):
    """Where all charts lie on each other, a texel shows little of the surface."""
    counts = []

    def counted(*args):
        lines = cached_surface_lines(*args)
        counts.append(len(lines.tree.leaf_root))
        return lines

    monkeypatch.setattr(hatching, "cached_surface_lines", counted)
    surface = plane(10, 20)
    uv = np.tile([(0.0, 0.0), (1, 0), (1, 1), (0, 1)], (surface.face_count, 1))
    look = Look(line_distance=2.0).with_settings({"ink": "even"})
    draw_texture(instance_of(surface, 2), uv, look, 16)
    assert counts[0] < 2 * hatching.TRIANGLES_PER_TEXEL * 16**2


def test_faces_without_area_in_the_map_end_streamlines():
    """Faces that the map collapses are not drawn, and all others are."""
    uv = SINGLE.copy()
    uv[: 4 * 24] = uv[0]
    texture = draw_texture(instance_of(TORUS, 4), uv, WIDE, 256)
    assert np.isfinite(texture.rgba).all() and texture.rgba[..., 0].std() > 0.05


def test_bad_maps_and_looks_are_named(error_of):
    """Each is refused in one line that says what to do."""
    instance = instance_of(cube(), 1)
    uv = np.tile([(0.0, 0.0), (1, 0), (1, 1), (0, 1)], (6, 1))
    wrong = uv.copy()
    wrong[9] = np.nan
    for bad_uv, options, message in (
        (0 * uv, {}, "no face has an area in the UV map"),
        (wrong, {}, "face 2 has a UV coordinate that is not finite"),
        (uv * 50, {}, "more than 100 tiles"),
        (uv - 1, {"is_udim": True}, "UDIM"),
        (uv * 1e-3, {}, "has no texel"),
    ):
        assert message in error_of(draw_texture, instance, bad_uv, WIDE, 64, **options)


def test_textures_are_refused_before_they_are_drawn(error_of, monkeypatch):
    monkeypatch.setattr("rosy_addon.core.memory.available_memory", lambda: 10**9)
    message = error_of(draw_texture, instance_of(torus(8, 12), 4), torus_uv(8, 12), Look(), 16384)
    assert message.startswith("a texture of 16384 x 16384 texels needs about ")
    assert message.endswith(" of memory, 1.0 GB are free: choose a smaller size")

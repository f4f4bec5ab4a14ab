"""Textures show the field of the surface, whatever the charts of their UV map."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import long, mainly
from shapes import cube, from_quads, plane, torus
from uv_maps import colors_at, patches_uv, surface_points, torus_uv

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import build_surface
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.surface_lines import cached_surface_lines
from rosy_addon.surface_texture import hatching
from rosy_addon.surface_texture.draw import SURFACE_PIXELS, draw_texture

#: Lines that are wide enough for a small texture to show them well.
WIDE = Look(length=20, line_width=10.0, line_distance=20.0, high_pass=40.0)
WIDER = Look(length=40, line_width=20.0, line_distance=40.0, high_pass=80.0)


def instance_of(surface, degree: int, kind: str = "smoothest") -> MeshInstance:
    """The surface with a field."""
    settings = GeneratorSettings(kind)
    return MeshInstance(surface, np.eye(4), generate(surface, settings, degree))


@pytest.mark.parametrize("degree", mainly([1, 4], [1, 2, 3, 4, 6]))
def test_texture_does_not_depend_on_the_charts(degree):
    """64 square charts, turned and mirrored at random, show the picture of a single one."""
    surface = torus()
    instance = instance_of(surface, degree)
    points = surface_points(surface, 20_000)
    colors = []
    for uv in (torus_uv(), patches_uv(1)):
        texture = draw_texture(instance, uv, WIDE, 1024)
        assert texture.overlap < 0.01
        colors.append(colors_at(texture.rgba, surface, uv, points))
    assert np.corrcoef(colors)[0, 1] > 0.96


@pytest.mark.slow
def test_colors_of_all_kinds_do_not_depend_on_the_charts():
    """Colored noise, families of lines, and magnitude as color and length."""
    surface = torus()
    settings = GeneratorSettings("curvature")
    field = generate(surface, settings, 4)
    middle = np.linalg.norm(surface.face_center, axis=1, keepdims=True)
    instance = MeshInstance(surface, np.eye(4), RosyField(4, field.vectors * middle))
    points = surface_points(surface, 20_000)
    for changes in (
        {"hue": "noise"},
        {"hue": "magnitude", "magnitude_length": True},
        {"fade": "ends"},
        {"method": "ibfv"},
    ):
        look = WIDER.with_settings(changes)
        colors = [
            colors_at(draw_texture(instance, uv, look, 512).rgba, surface, uv, points)
            for uv in (torus_uv(), patches_uv(1))
        ]
        assert np.corrcoef(colors)[0, 1] > 0.93, changes


LAMP = Light("sun", np.array([0.5, -0.6, 0.6]) / np.sqrt(0.97), np.ones(3), 1.0)
UNEVEN = {"wobble": 0.5, "breaks": 0.5, "paper_grain": 0.3}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "lights"),
    [
        ({"ink": "even"}, None),
        (UNEVEN, [LAMP]),
        *long(({"ink": "even"}, [LAMP]), (UNEVEN, None)),
    ],
    ids=str,
)
def test_hatching_does_not_depend_on_the_charts(settings, lights):
    """Evenly spaced lines and uneven ones, their order, and the ink for a lamp.

    Edges of lines and the grain of the paper are as fine as texels, which sample them differently.
    """
    surface = torus()
    instance = instance_of(surface, 4)
    points = surface_points(surface, 20_000)
    look = WIDER.with_settings({"ink": "hatch", **settings})
    colors = []
    for uv in (torus_uv(), patches_uv(1)):
        texture = draw_texture(instance, uv, look, 512, lights=lights)
        assert texture.is_data == (lights is None)
        colors.append(colors_at(texture.rgba, surface, uv, points))
    assert np.corrcoef(colors)[0, 1] > 0.85


def test_stretched_charts_show_the_same_lines():
    """A map that is four times as fine along u shows the texture of an even one."""
    surface = plane(16, 16)
    instance = instance_of(surface, 4)
    points = surface_points(surface, 20_000)
    even = surface.vertices[surface.corner_vertex, :2] / 4 + 0.5
    stretched = even * [1, 0.25]
    colors = [
        colors_at(draw_texture(instance, uv, WIDER, size).rgba, surface, uv, points)
        for uv, size in ((even, 512), (stretched, 1024))
    ]
    assert np.corrcoef(colors)[0, 1] > 0.95


def test_lines_have_the_same_size_in_all_textures():
    """The same points have the same colors in a texture of twice the size."""
    surface = torus()
    instance, uv = instance_of(surface, 2), torus_uv()
    points = surface_points(surface, 20_000)
    colors = [
        colors_at(draw_texture(instance, uv, WIDER, size).rgba, surface, uv, points)
        for size in (512, 1024)
    ]
    assert np.corrcoef(colors)[0, 1] > 0.95


def test_unit_is_blender_units():
    """A pixel of the look is a 1024th of the side of a square, or as long as the look says."""
    surface = torus()
    instance, uv = instance_of(surface, 4), torus_uv()
    area = 4 * np.pi**2 * 0.4
    size = float(np.sqrt(area)) / SURFACE_PIXELS
    world = WIDER.with_settings({"unit_size": size})
    by_pixels, by_units = (draw_texture(instance, uv, look, 256).rgba for look in (WIDER, world))
    colors = [picture[..., 0].ravel() for picture in (by_pixels, by_units)]
    assert np.corrcoef(colors)[0, 1] > 0.95


def test_charts_beyond_the_first_tile_repeat():
    """A map moved by whole tiles, or across the border of one, gives the same picture."""
    surface = torus()
    instance, uv = instance_of(surface, 4), torus_uv()
    points = surface_points(surface, 20_000)
    first = draw_texture(instance, uv, WIDER, 512).rgba
    moved = draw_texture(instance, uv + [3, -2], WIDER, 512).rgba
    assert np.corrcoef(moved[..., 0].ravel(), first[..., 0].ravel())[0, 1] > 0.99
    across = uv + [0.5, 0.8]
    colors = [
        colors_at(first, surface, uv, points),
        colors_at(draw_texture(instance, across, WIDER, 512).rgba, surface, across, points),
    ]
    assert np.corrcoef(colors)[0, 1] > 0.95


def test_udim_tiles_are_pictures_of_their_own():
    """Charts of two tiles at the same place do not overlap, and streamlines go from one to the other."""
    surface = torus()
    instance = instance_of(surface, 4)
    points = surface_points(surface, 20_000)
    uv = torus_uv()
    second = np.repeat(np.arange(len(uv) // 4) >= len(uv) // 8, 4)
    moved = uv.copy()
    moved[second] += [0.55, 0]
    moved[~second, 0] += 0.05
    texture = draw_texture(instance, moved, WIDER, 512, is_udim=True)
    tiles = texture.tiles()
    assert list(tiles) == [1001, 1002] and all(t.shape == (512, 512, 4) for t in tiles.values())
    single = colors_at(draw_texture(instance, uv, WIDER, 512).rgba, surface, uv, points)
    in_second = second[surface.triangles[points[0], 0]]
    for tile, chosen in ((1001, ~in_second), (1002, in_second)):
        chosen_points = points[0][chosen], points[1][chosen]
        colors = colors_at(tiles[tile], surface, moved, chosen_points)
        assert np.corrcoef(colors, single[chosen])[0, 1] > 0.95


def test_margin_continues_the_surface():
    """Beside a seam, the margin has the colors of the other chart: no filter sees an edge."""
    surface = torus()
    instance, uv = instance_of(surface, 1), torus_uv()
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
    surface = torus()
    uv = torus_uv()
    uv[:, 0] = np.abs(uv[:, 0] - 0.5)
    assert draw_texture(instance_of(surface, 4), uv, WIDE, 256).overlap == pytest.approx(
        0.5, abs=0.01
    )


@pytest.mark.slow
def test_lines_are_spaced_on_no_more_triangles_than_texels_can_show(monkeypatch):
    """Where all charts lie on each other, a texel shows little of the surface."""
    counts = []

    def counted(*args):
        lines = cached_surface_lines(*args)
        counts.append(len(lines.tree.leaf_root))
        return lines

    monkeypatch.setattr(hatching, "cached_surface_lines", counted)
    grid = plane(1, 200)
    surface = build_surface(grid.vertices * (1, 0.1, 1), grid.corner_vertex, grid.face_start)
    uv = np.tile([(0.0, 0.0), (1, 0), (1, 1), (0, 1)], (surface.face_count, 1))
    look = Look(line_distance=2.0).with_settings({"ink": "even"})
    draw_texture(instance_of(surface, 2), uv, look, 16)
    assert counts[0] < 2 * hatching.TRIANGLES_PER_TEXEL * 16**2


def test_faces_without_area_in_the_map_end_streamlines():
    """Faces that the map collapses are not drawn, and all others are."""
    surface = torus()
    uv = torus_uv()
    uv[: 4 * 48] = uv[0]
    texture = draw_texture(instance_of(surface, 4), uv, WIDE, 256)
    assert np.isfinite(texture.rgba).all() and texture.rgba[..., 0].std() > 0.05


def test_bad_maps_and_looks_are_named(error_of):
    """Each is refused in one line that says what to do."""
    surface = cube()
    instance = instance_of(surface, 4)
    uv = np.tile([(0.0, 0.0), (1, 0), (1, 1), (0, 1)], (6, 1))
    nothing = error_of(draw_texture, instance, np.zeros((24, 2)), WIDE, 64)
    assert "no face has an area in the UV map" in nothing
    wrong = uv.copy()
    wrong[9] = np.nan
    assert "face 2 has a UV coordinate that is not finite" in error_of(
        draw_texture, instance, wrong, WIDE, 64
    )
    assert "more than 100 tiles" in error_of(draw_texture, instance, uv * 50, WIDE, 64)
    assert "UDIM" in error_of(draw_texture, instance, uv - 1, WIDE, 64, is_udim=True)
    assert "has no texel" in error_of(draw_texture, instance, uv * 1e-3, WIDE, 64)


def test_textures_are_refused_before_they_are_drawn(error_of, monkeypatch):
    monkeypatch.setattr("rosy_addon.core.memory.available_memory", lambda: 10**9)
    surface = torus(8, 12)
    message = error_of(draw_texture, instance_of(surface, 4), torus_uv(8, 12), Look(), 16384)
    assert message.startswith("a texture of 16384 x 16384 texels needs about ")
    assert message.endswith(" of memory, 1.0 GB are free: choose a smaller size")


def test_single_triangles_and_quads():
    """The smallest meshes have textures, too."""
    square = from_quads(
        np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]), np.array([[0, 1, 2, 3]])
    )
    uv = np.array([(0.0, 0.0), (1, 0), (1, 1), (0, 1)])
    texture = draw_texture(instance_of(square, 2), uv, WIDE, 64)
    assert texture.rgba[..., 0].std() > 0.02

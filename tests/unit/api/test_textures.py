"""Textures from scripts and from the command line."""

import warnings

import numpy as np
import pytest
from command_helpers import write_obj
from shapes import icosphere

import rosy_addon.api as rf
from rosy_addon.cli.parser import main
from rosy_addon.image_io.png import read_png

SQUARE = ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
UV = np.array(SQUARE[0])[:, :2] * 0.9 + 0.05


def test_the_command_draws_the_same_texture(tmp_path):
    """Also that of the preset, the light and the settings."""
    path = write_obj(tmp_path / "square.obj", *SQUARE, UV)
    out = tmp_path / "square.png"
    common = ["--generate", "uv", "--degree", "2", "--size", "64", "--margin", "3"]
    words = ["--preset", "engraving", "--set", "seed=3", "--light-direction", "-1,0.5,2"]
    assert main(["texture", str(path), "-o", str(out), *common, *words]) == 0
    surface = rf.Surface(path)
    options = {"preset": "engraving", "light_direction": (-1, 0.5, 2), "seed": 3}
    texture = rf.texture(surface, rf.along_uv(surface, 2), size=64, margin=3, **options)
    assert list(texture.tiles) == [1001] and texture.overlap == 0
    (picture,) = texture.tiles.values()
    picture.save(tmp_path / "same.png")
    assert out.read_bytes() == (tmp_path / "same.png").read_bytes()
    assert (read_png(out)[..., 3] == 1).all()


def test_numbers_as_colors(error_of):
    """u, from 0 to 1 between the borders of the chart, is the gray of the texels."""
    square = rf.Surface(*SQUARE, name="square", uv=UV)
    flat = {"gain": 0.0, "color_map": "gray", "color_range": (0.0, 1.0), "margin": 0, "size": 64}
    texture = rf.texture(square, rf.along_uv(square, 2), color_values=square.vertices[:, 0], **flat)
    gray = np.asarray(texture.tiles[1001])[32, 4:60, 0]
    expected = ((np.arange(4, 60) + 0.5) / 64 - 0.05) / 0.9
    np.testing.assert_allclose(gray, 17 + 238 * expected, atol=1)
    assert "'values' needs numbers" in error_of(rf.texture, square, hue="values")
    hatched = {"color_values": [1.0], "preset": "engraving"}
    assert "choose the ink 'soft'" in error_of(rf.texture, square, **hatched)


def test_tiles_have_files_of_their_own(tmp_path, error_of):
    square = rf.Surface(*SQUARE, name="square", uv=UV * [2, 1])
    texture = rf.texture(square, rf.along_uv(square, 2), size=32, udim=True)
    assert repr(texture) == "<Texture: 32 x 32 texels, 2 tiles>"
    texture.save(tmp_path / "square.<UDIM>.png")
    assert {path.name for path in tmp_path.iterdir()} == {"square.1001.png", "square.1002.png"}
    assert "no <UDIM>" in error_of(texture.save, tmp_path / "square.png")


def test_tiles_end_where_blender_numbers_none(error_of):
    """It has 1001 to 2000; a tile above was written, and was missing in Blender."""
    square = rf.Surface(*SQUARE, name="square", uv=UV + (9, 99))
    assert list(rf.texture(square, rf.along_uv(square), size=16, udim=True).tiles) == [2000]
    for beyond in ((9, 100), (10, 99), (-1, 0)):
        square = rf.Surface(*SQUARE, name="square", uv=UV + beyond)
        message = error_of(rf.texture, square, rf.along_uv(square), size=16, udim=True)
        assert "move its charts to u from 0 to 10 and v from 0 to 100" in message


def test_a_texture_without_tiles_is_tile_1001():
    """Wherever its charts are."""
    square = rf.Surface(*SQUARE, name="square", uv=UV * (1, 0.7) - (2.0, 1.0))
    assert list(rf.texture(square, rf.along_uv(square, 2), size=32).tiles) == [1001]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("draw", [rf.render, rf.texture])
def test_a_constant_magnitude_has_one_color(draw):
    """Also around singularities, where directions cancel."""
    surface = icosphere(2)
    angle = np.arctan2(*surface.vertices[surface.corner_vertex][:, 1::-1].T) / (2 * np.pi) + 0.5
    height = surface.vertices[surface.corner_vertex][:, 2] / 3 + 0.5
    ball = rf.Surface(surface.vertices, surface.faces, uv=np.stack([angle, height], axis=1))
    field = rf.smoothest(ball)
    assert len(field.singularities.index) == 8
    flat = {"hue": "magnitude", "gain": 0.0, "shading": 0.0}
    drawn = draw(ball, field, size=(160, 160) if draw is rf.render else 64, **flat)
    picture = np.asarray(drawn if draw is rf.render else drawn.tiles[1001])
    color = picture[picture[..., 3] == 255][:, :3]
    assert len(color) > 1000 and np.ptp(color.astype(int), axis=0).max() <= 1


@pytest.mark.slow
@pytest.mark.parametrize("draw", [rf.render, rf.texture])
@pytest.mark.parametrize("ink", ["soft", "hatch", "even"])
def test_regions_without_data_are_left_out(draw, ink):
    """Two of four squares have no data: their halves of the picture are transparent, or without lines."""
    points = [[x, y, 0] for x in range(3) for y in range(3)]
    faces = [[i, i + 3, i + 4, i + 1] for i in (0, 1, 3, 4)]
    surface = rf.Surface(points, faces, uv=np.array(points)[:, :2] / 2)
    field = rf.from_vectors(surface, [[0, 1, 0]] * 2 + [[0, 0, 0]] * 2, 1)
    shown = {"size": 64} if draw is rf.texture else {"size": (64, 64), "view": (0, 90)}
    if draw is rf.texture and ink != "soft":
        shown |= {"light_direction": (0, 1, 1)}

    def picture(**look):
        drawn = draw(surface, field, ink=ink, tone_levels=(0.0, 2.0, 1.0), **shown, **look)
        pixels = np.asarray(drawn.tiles[1001] if draw is rf.texture else drawn).astype(int)
        return pixels[6:-6, 6:28], pixels[6:-6, 36:-6]

    for look in ({"hue": "magnitude"}, {"undefined": "hidden"}):
        data, gap = picture(**look)
        assert (data[..., 3] == 255).all() and not gap[..., 3].any()
    data, gap = picture(undefined="paper")
    assert (gap[..., 3] == 255).all() and np.ptp(gap, axis=(0, 1)).max() <= 2
    if draw is rf.render:
        assert np.ptp(data, axis=(0, 1)).max() > 50
    data, gap = picture(hue="magnitude", undefined="texture")
    assert (gap[..., 3] == 255).all()


def test_overlaps_are_a_warning():
    square = rf.Surface(*SQUARE, name="square", uv=UV * [2, 1])
    with pytest.warns(rf.RosyWarning, match="square: 4.% of its UV map lies under other charts"):
        rf.texture(square, rf.along_uv(square, 2), size=32)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rf.texture(square, rf.along_uv(square, 2), size=32, udim=True)


def test_textures_that_are_refused(error_of):
    square = rf.Surface(*SQUARE, name="square", uv=UV)
    field = rf.along_uv(square)
    for keywords, expected in (
        ({"size": 8}, "a size of 8 texels: choose 16 to 16384"),
        ({"margin": -1}, "a margin of -1 texels"),
        ({"lenght": 3}, "lenght"),
    ):
        assert expected in error_of(rf.texture, square, field, **keywords)
    assert "has no UV map" in error_of(rf.texture, rf.Surface(*SQUARE, name="square"))


@pytest.mark.slow
def test_hatching_for_one_light():
    """The ink of a texture has the tone of the light; without a light it has thresholds of all tones."""
    square = rf.Surface(*SQUARE, name="square", uv=np.array(SQUARE[0])[:, :2])
    field = rf.along_axis(square, (1, 0.4, 0), 4)
    settings = {"ink": "hatch", "line_width": 3, "shading": 1, "ink_color": "#000000"}
    thresholds = rf.texture(square, field, size=512, margin=0, **settings).tiles[1001]
    red, green = (np.asarray(thresholds)[..., channel].ravel() / 255 for channel in (0, 1))
    np.testing.assert_allclose(np.quantile(red, [0.2, 0.5, 0.8]), [0.2, 0.5, 0.8], atol=0.03)
    assert abs(np.corrcoef(red, green)[0, 1]) < 0.1
    for cosine, length in ((0.2, 1.0), (0.5, 1e-260), (0.9, 1e200)):
        light = (0, length * np.sqrt(1 - cosine**2), length * cosine)
        options = settings | {"size": 128, "margin": 0, "light_direction": light}
        ink = rf.texture(square, field, **options).tiles[1001]
        assert ink.rgba[..., 0].mean() == pytest.approx(cosine, abs=0.03)
    clear = rf.texture(square, field, paper_color="#ffffff00", **options).tiles[1001]
    assert clear.rgba[..., 3].mean() == pytest.approx(1 - cosine, abs=0.03)
    assert clear.rgba[..., :3].max() < 0.01

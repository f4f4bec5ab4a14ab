"""SVG files of strokes, as a browser and Inkscape draw them. Skipped without these programs."""

import os
import shutil
import subprocess

import numpy as np
import pytest
from harness.streaks import correlation
from harness.stroke_tracing import trace_strokes, visible_strokes, write_svg
from PIL import Image, ImageDraw
from scipy.ndimage import gaussian_filter
from shapes import instance_of, torus

from rosy_addon.line_drawing.outline import outline_strokes
from rosy_addon.line_drawing.stroke_set import Strokes
from rosy_addon.line_drawing.svg import Pen
from rosy_addon.line_drawing.visibility import pixel_size
from rosy_addon.projection.camera import orbit_camera

pytestmark = pytest.mark.slow

WIDTH, HEIGHT = 480, 360

BROWSERS = "chromium", "chromium-browser", "google-chrome", "chrome"
BROWSER = next(filter(shutil.which, BROWSERS), None)
INKSCAPE = shutil.which("inkscape")

#: Option of Inkscape to list the layers of a file.
LAYERS = "--actions=select-all:layers;select-list"

#: Width of the pen in pixels.
PEN_WIDTH = 1.5

needs_browser = pytest.mark.skipif(not BROWSER, reason="no Chromium on the PATH")
needs_inkscape = pytest.mark.skipif(not INKSCAPE, reason="no Inkscape on the PATH")


def run(*command) -> str:
    """Run a command and return its standard output."""
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    options = {"capture_output": True, "text": True, "timeout": 240, "check": True}
    return subprocess.run([str(word) for word in command], env=environment, **options).stdout


def browser(svg, png):
    """Draw an SVG file with Chromium."""
    run(
        BROWSER,
        *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
        *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
        *("--hide-scrollbars", f"--user-data-dir={png.parent / 'profile'}"),
        *(f"--window-size={WIDTH},{HEIGHT}", f"--screenshot={png}", svg.as_uri()),
    )


def inkscape(svg, png, *options):
    """Draw an SVG file with Inkscape."""
    run(INKSCAPE, svg, "--export-type=png", f"--export-filename={png}", *options)


PROGRAMS = pytest.param(browser, marks=needs_browser), pytest.param(inkscape, marks=needs_inkscape)


def ink_of(png):
    """Return the (H, W) ink in a picture, from 0 (paper) to 1. Row 0 is at the top."""
    image = Image.open(png).convert("RGBA")
    paper = Image.new("RGBA", image.size, "white")
    return 1 - np.asarray(Image.alpha_composite(paper, image).convert("L")) / 255.0


def raster(strokes, camera, width, scale=16):
    """Return the (H, W) coverage of pixels by strokes, drawn at a multiple of the size. Row 0 is at the top.

    The points are projected by the matrices of the camera, without the code in `strokes`.
    """
    clip = np.column_stack([strokes.points, np.ones(len(strokes.points))])
    clip = clip @ (camera.projection @ camera.view).T
    size = np.array([camera.width, camera.height])
    places = (clip[:, :2] / clip[:, 3:] * (1, -1) + 1) / 2 * size * scale
    radius = strokes.width * width * scale / 2
    image = Image.new("L", (camera.width * scale, camera.height * scale))
    draw = ImageDraw.Draw(image)
    for index in np.flatnonzero(np.diff(strokes.stroke) == 0):
        line_width = round(radius[index] + radius[index + 1])
        draw.line(places[index : index + 2].ravel().tolist(), 255, line_width)
    for place, of_disc in zip(places, radius, strict=True):
        draw.circle(place.tolist(), of_disc - 0.5, 255)  # the border is drawn as well
    return np.asarray(image.resize(size.tolist(), Image.Resampling.BOX)) / 255


@pytest.fixture(scope="module")
def scene():
    """A torus with a field along its axis, and a camera."""
    instance = instance_of(torus(), 2, "axis")
    return instance, orbit_camera(instance.surface.vertices, -25, 40, WIDTH, HEIGHT)


@pytest.fixture(scope="module")
def strokes(scene):
    """Tapered strokes along and across the axis, and silhouettes."""
    instance, camera = scene
    crossed = instance_of(instance.surface, 4, "axis")
    lines = trace_strokes(crossed, 9.0 * pixel_size(crossed.world_points(), camera))
    lines = Strokes.concatenate(lines.tapered(0.8, 0.15), outline_strokes(instance, camera))
    return visible_strokes(lines, [instance], camera)


@pytest.mark.parametrize("program", PROGRAMS)
def test_programs_draw_the_strokes_where_the_camera_sees_them(program, strokes, scene, tmp_path):
    write_svg(tmp_path / "a.svg", strokes, scene[1], Pen(width=PEN_WIDTH))
    program(tmp_path / "a.svg", tmp_path / "a.png")
    found = ink_of(tmp_path / "a.png")
    expected = raster(strokes, scene[1], PEN_WIDTH)
    assert found.shape == expected.shape and correlation(found, expected) > 0.98
    assert correlation(gaussian_filter(found, 3.0), gaussian_filter(expected, 3.0)) > 0.998
    assert abs(found.sum() / expected.sum() - 1) < 0.01


@needs_inkscape
def test_inkscape_finds_one_layer_per_family(strokes, scene, tmp_path):
    svg = tmp_path / "a.svg"
    write_svg(svg, strokes, scene[1], Pen(width=PEN_WIDTH))
    found = [line.split()[0] for line in run(INKSCAPE, LAYERS, svg).splitlines()]
    families = np.unique(strokes.family)
    assert found == ["paper", *(f"layer{family + 1}" for family in families)]
    options = "--export-id=layer2", "--export-id-only", "--export-area-page"
    inkscape(svg, tmp_path / "a.png", *options)
    expected = raster(strokes.select(strokes.family == 1), scene[1], PEN_WIDTH)
    assert correlation(ink_of(tmp_path / "a.png"), expected) > 0.98


@needs_inkscape
def test_the_page_has_its_width_in_millimeters(strokes, scene, tmp_path):
    write_svg(tmp_path / "a.svg", strokes, scene[1], Pen(width=PEN_WIDTH, millimeters=48))
    # 254 dpi are ten pixels per millimeter.
    inkscape(tmp_path / "a.svg", tmp_path / "a.png", "--export-dpi=254")
    assert correlation(ink_of(tmp_path / "a.png"), raster(strokes, scene[1], PEN_WIDTH)) > 0.98

"""Strokes in the programs that open them: a browser, and Inkscape. Skipped without these."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from conftest import long
from PIL import Image
from scipy.ndimage import binary_erosion, gaussian_filter, sobel
from shapes import plane, torus

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import KEY_LIGHT
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.projection.camera import look_at, orbit_camera, orthographic_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.strokes.outline import outline
from rosy_addon.strokes.pipeline import draw_instances
from rosy_addon.strokes.spacing import pixel_spacing
from rosy_addon.strokes.stroke_set import Strokes
from rosy_addon.strokes.style import StrokeStyle
from rosy_addon.strokes.svg import Pen, write_svg
from rosy_addon.strokes.trace import trace_strokes
from rosy_addon.strokes.visibility import clip_to_visible

pytestmark = pytest.mark.slow

WIDTH, HEIGHT = 480, 360

BROWSER = next(
    filter(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome")), None
)
INKSCAPE = shutil.which("inkscape")

#: For Inkscape: to list what it takes for layers.
LAYERS = "--actions=select-all:layers;select-list"

#: Of the pen, pixels.
WIDE = 1.5

needs_inkscape = pytest.mark.skipif(not INKSCAPE, reason="no Inkscape on the PATH")


def run(*command) -> str:
    done = subprocess.run(
        [str(word) for word in command],
        capture_output=True,
        text=True,
        timeout=240,
        check=True,
        env={key: value for key, value in os.environ.items() if key != "DISPLAY"},
    )
    return done.stdout


def browser(svg, png):
    if BROWSER is None:
        pytest.skip("no Chromium on the PATH")
    run(
        BROWSER,
        *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
        *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
        f"--user-data-dir={png.parent / 'profile'}",
        f"--window-size={WIDTH},{HEIGHT}",
        "--hide-scrollbars",
        f"--screenshot={png}",
        svg.as_uri(),
    )


def inkscape(svg, png, *more):
    if INKSCAPE is None:
        pytest.skip("no Inkscape on the PATH")
    run(INKSCAPE, svg, "--export-type=png", f"--export-filename={png}", *more)


def ink_of(png):
    """(H, W) from 0, paper, to 1, from the top."""
    image = Image.open(png).convert("RGBA")
    paper = Image.new("RGBA", image.size, "white")
    return 1 - np.asarray(Image.alpha_composite(paper, image).convert("L")) / 255.0


def raster(strokes, camera, width, finer=4):
    """What of each pixel strokes cover, by discs stamped along them: (H, W) from the top.

    The points go through the camera's matrices here, not through anything in the strokes' room.
    """
    clip = np.column_stack([strokes.points, np.ones(len(strokes.points))])
    clip = clip @ (camera.projection @ camera.view).T
    place = (clip[:, :2] / clip[:, 3:] * (1, -1) + 1) / 2 * (camera.width, camera.height) * finer
    radius = strokes.width * width * finer / 2
    piece = np.flatnonzero(np.diff(strokes.stroke) == 0)
    count = np.ceil(np.linalg.norm(place[piece + 1] - place[piece], axis=1) * 2).astype(int) + 1
    share = np.concatenate([np.linspace(0, 1, n) for n in count])
    piece = np.repeat(piece, count)
    at = place[piece] + share[:, None] * (place[piece + 1] - place[piece])
    wide = radius[piece] + share * (radius[piece + 1] - radius[piece])
    covered = np.zeros((camera.height * finer, camera.width * finer), dtype=bool)
    reach = int(np.ceil(radius.max())) + 1
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            column, row = np.floor(at[:, 0]).astype(int) + i, np.floor(at[:, 1]).astype(int) + j
            near = np.hypot(column + 0.5 - at[:, 0], row + 0.5 - at[:, 1]) <= wide
            near &= (column >= 0) & (row >= 0)
            near &= (column < covered.shape[1]) & (row < covered.shape[0])
            covered[row[near], column[near]] = True
    return covered.reshape(camera.height, finer, camera.width, finer).mean(axis=(1, 3))


def correlation(some, other, blur=0.0):
    return float(
        np.corrcoef(gaussian_filter(some, blur).ravel(), gaussian_filter(other, blur).ravel())[0, 1]
    )


@pytest.fixture(scope="module")
def scene():
    surface = torus(96, 48)
    instance = MeshInstance(surface, np.eye(4), generate(surface, "axis", 2))
    return instance, orbit_camera(surface, -25, 40, WIDTH, HEIGHT)


@pytest.fixture(scope="module")
def drawn(scene):
    """Two families of lines of the axis and across, tapered, and the silhouettes."""
    instance, camera = scene
    crossed = MeshInstance(instance.surface, instance.matrix, generate(instance.surface, "axis", 4))
    lines = trace_strokes(crossed, pixel_spacing(crossed, camera, 9.0)).tapered(0.8, 0.15)
    return clip_to_visible(
        Strokes.concatenate(lines, outline(instance, camera)), [instance], camera
    )


@pytest.mark.parametrize("width", [WIDE, 5.0])
@pytest.mark.parametrize("program", [browser, inkscape])
def test_programs_draw_the_strokes_where_the_camera_sees_them(
    program, width, drawn, scene, tmp_path
):
    write_svg(tmp_path / "a.svg", drawn, scene[1], Pen(width=width))
    program(tmp_path / "a.svg", tmp_path / "a.png")
    found = ink_of(tmp_path / "a.png")
    expected = raster(drawn, scene[1], width)
    assert found.shape == expected.shape
    assert correlation(found, expected) > 0.98
    assert correlation(found, expected, 3.0) > 0.998
    assert abs(found.sum() / expected.sum() - 1) < 0.01


@pytest.mark.parametrize("program", [browser, inkscape])
def test_closed_paths_are_drawn_as_open_ones(program, scene, tmp_path):
    """As lines that come back to where they began."""
    instance, camera = scene
    rings = MeshInstance(instance.surface, instance.matrix, generate(instance.surface, "axis", 4))
    lines = clip_to_visible(
        trace_strokes(rings, pixel_spacing(rings, camera, 14.0)), [rings], camera
    )
    lines = Strokes.concatenate(
        lines, clip_to_visible(outline(instance, camera), [instance], camera)
    )
    assert lines.closed.sum() >= 3
    pictures = []
    for name, strokes in (
        ("closed", lines),
        ("open", replace(lines, closed=np.zeros_like(lines.closed))),
    ):
        write_svg(tmp_path / f"{name}.svg", strokes, camera, Pen(width=4.0))
        program(tmp_path / f"{name}.svg", tmp_path / f"{name}.png")
        pictures.append(ink_of(tmp_path / f"{name}.png"))
    assert (tmp_path / "closed.svg").read_text().count("Z") == lines.closed.sum()
    assert np.abs(pictures[0] - pictures[1]).max() < 0.02


@needs_inkscape
def test_inkscape_finds_a_layer_a_family(drawn, scene, tmp_path):
    svg = tmp_path / "a.svg"
    write_svg(svg, drawn, scene[1], Pen(width=WIDE))
    found = [line.split()[0] for line in run(INKSCAPE, LAYERS, svg).splitlines()]
    families = np.unique(drawn.family)
    assert found == ["paper", *(f"layer{family + 1}" for family in families)]
    inkscape(
        svg, tmp_path / "a.png", "--export-id=layer2", "--export-id-only", "--export-area-page"
    )
    alone = raster(drawn.chosen(drawn.family == 1), scene[1], WIDE)
    assert correlation(ink_of(tmp_path / "a.png"), alone) > 0.98


@needs_inkscape
def test_millimetres_are_those_of_the_page(drawn, scene, tmp_path):
    write_svg(tmp_path / "a.svg", drawn, scene[1], Pen(width=WIDE, millimetres=48))
    # Ten pixels a millimetre.
    inkscape(tmp_path / "a.svg", tmp_path / "a.png", "--export-dpi=254")
    assert correlation(ink_of(tmp_path / "a.png"), raster(drawn, scene[1], WIDE)) > 0.98


@pytest.mark.parametrize("program", [browser, inkscape])
def test_where_strokes_are_half_clear_there_is_half_the_ink(program, tmp_path):
    surface = plane()
    instance = MeshInstance(
        surface, np.eye(4), generate(surface, GeneratorSettings("axis", (1.0, 0.0, 0.0)), 2)
    )
    eye = look_at((0, 0, 5), (0, 0, 0), (0, 1, 0))
    camera = orthographic_camera(eye, WIDTH, HEIGHT, scale=2.0)
    lines = clip_to_visible(trace_strokes(instance, 0.1), [instance], camera)
    right = lines.points[:, 0] > 0
    lines = replace(lines, opacity=np.where(right, 0.25, 0.5))
    write_svg(tmp_path / "a.svg", lines, camera, Pen(width=3))
    program(tmp_path / "a.svg", tmp_path / "a.png")
    left, right = np.split(ink_of(tmp_path / "a.png"), 2, axis=1)
    # Pieces that met in round ends would be darker where they lie over each other.
    assert 0.48 < left.max() < 0.52
    assert right[:, 1:].max() < 0.27
    assert abs(right.sum() / left.sum() - 0.5) < 0.02


@pytest.mark.parametrize("program", [browser, *long(inkscape)])
def test_lines_run_as_in_the_render(program, scene, tmp_path):
    instance, camera = scene
    lines = clip_to_visible(
        trace_strokes(instance, pixel_spacing(instance, camera, 5.0)), [instance], camera
    )
    write_svg(tmp_path / "a.svg", lines, camera)
    program(tmp_path / "a.svg", tmp_path / "a.png")
    picture, inside = rendered(scene, Look(shading=0.0), border=12)
    both = along(ink_of(tmp_path / "a.png")) * along(picture).conj()
    off = np.degrees(np.abs(np.angle(both[inside])) / 2)
    assert np.median(off) < 3
    assert np.cos(np.radians(2 * off)).mean() > 0.93


@pytest.mark.parametrize("program", [inkscape, *long(browser)])
def test_strokes_are_as_dark_as_the_render(program, scene, tmp_path):
    instance, camera = scene
    manner = StrokeStyle(spacing=4.0, tone=True, light="lamp")
    drawn = draw_instances([instance], camera, manner, lights=[KEY_LIGHT]).strokes
    write_svg(tmp_path / "a.svg", drawn, camera, Pen(width=2.0))
    program(tmp_path / "a.svg", tmp_path / "a.png")
    strokes = ink_of(tmp_path / "a.png")
    picture, inside = rendered(scene, Look(ink="hatch", shading=1.0, light="lamp"), border=4)
    share = np.maximum(gaussian_filter(inside * 1.0, 12), 1e-9)
    far = [gaussian_filter(np.where(inside, ink, 0), 12) / share for ink in (strokes, 1 - picture)]
    assert np.corrcoef(far[0][inside], far[1][inside])[0, 1] > 0.9


def rendered(scene, look, border):
    """(H, W) linear light of a picture, from the top, and what is some pixels inside the body."""
    instance, camera = scene
    rgba = compose(project([instance], camera), look).rgba[::-1]
    return rgba[..., :3].mean(axis=2), binary_erosion(rgba[..., 3] > 0.99, iterations=border)


def along(image):
    """(H, W) complex: twice the angle of lines, by the structure tensor over a few pixels."""
    smooth = gaussian_filter(image, 1.0)
    x, y = sobel(smooth, axis=1), sobel(smooth, axis=0)
    return -gaussian_filter(x**2 - y**2, 6) - 2j * gaussian_filter(x * y, 6)

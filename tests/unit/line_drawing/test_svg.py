"""SVG files of strokes: layers, paths, outlines of lines, and the order of a plotter."""

import re
import sys
import xml.etree.ElementTree as ElementTree
from itertools import pairwise

import numpy as np
import pytest
from field_helpers import write_off
from harness.stroke_tracing import latitudes, trace_strokes, turned, visible_strokes
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import icosphere, plane

from rosy_addon.cli.parser import main
from rosy_addon.line_drawing.svg import Pen, plotter_order, simplify_mask, svg_text
from rosy_addon.line_drawing.visibility import project_to_pixels
from rosy_addon.projection.camera import look_at, orthographic_camera

CAMERA = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 200, 100, scale=4.0)


def svg_of(**pen_options):
    """Return the root element of an SVG file, and its strokes."""
    instance = turned(plane(), 4)
    strokes = visible_strokes(trace_strokes(instance, 0.2).tapered(1.0), [instance], CAMERA)
    return ElementTree.fromstring(svg_text(strokes, CAMERA, Pen(**pen_options))), strokes


def path_points(data):
    """Return the (n, 2) points of SVG path data, without the radii of arcs."""
    without_arcs = re.sub(r"A\S+ 0 0 1", "", data)
    return np.array(re.findall(r"(-?[\d.]+),(-?[\d.]+)", without_arcs), dtype=float)


@pytest.mark.parametrize("color", ["", "\x1b[31m", "blakc", "#12", "#gggggg", 'red" x="', "#00f\n"])
def test_color_must_be_one_of_svg(color, error_of):
    assert "is not a color" in error_of(Pen, colors=("Navy", "#00F", color))


def test_svg_has_one_layer_per_family_and_one_path_per_stroke():
    root, strokes = svg_of(millimeters=100, colors=("red", "#00f"))
    inkscape = "{http://www.inkscape.org/namespaces/inkscape}"
    layers = root.findall("{http://www.w3.org/2000/svg}g")
    assert [layer.get(inkscape + "label") for layer in layers] == ["paper", "family 1", "family 2"]
    assert all(layer.get(inkscape + "groupmode") == "layer" for layer in layers)
    assert [layer.get("stroke") for layer in layers[1:]] == ["red", "#00f"]
    assert (root.get("width"), root.get("height")) == ("100mm", "50mm")
    assert root.get("viewBox") == "0 0 200 100"
    paths = list(root.iter("{http://www.w3.org/2000/svg}path"))
    assert len(paths) == len(strokes)
    for path in paths:
        assert path.get("d").endswith("Z") == (path.get("stroke") == "none")
        # An outline is half the width of the pen away from its stroke.
        points = path_points(path.get("d"))
        assert len(points) >= 2 and (points >= -0.51).all() and (points <= (200.51, 100.51)).all()


@pytest.mark.slow
@pytest.mark.parametrize("plotter", [False, True])
def test_closed_strokes_are_closed_paths(plotter):
    """Without their last point, which is the first one. Strokes that are cut are open."""
    instance = latitudes(icosphere(3))
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 300, 200, scale=3.3)
    strokes = visible_strokes(trace_strokes(instance, 0.15), [instance], camera)
    cut = strokes.runs_where(strokes.points[:, 0] > 0)
    for part in (strokes.select(strokes.closed), cut):
        text = svg_text(part, camera, Pen(plotter=plotter))
        paths = [path.get("d") for path in ElementTree.fromstring(text).iter() if path.get("d")]
        assert paths and all(data.endswith("Z") == part.closed.any() for data in paths)
        for data in paths:
            points = path_points(data)
            assert not (points[0] == points[-1]).all()


def test_outlines_hold_as_much_ink_as_their_strokes():
    """The area of an outline is the mean width times the length, without the round ends."""
    root, strokes = svg_of(width=3.0, paper=None)
    pixels, _ = project_to_pixels(strokes.points, CAMERA)
    length = np.hypot(*np.diff(pixels, axis=0).T) * (np.diff(strokes.stroke) == 0)
    mean_width = (strokes.width[1:] + strokes.width[:-1]) / 2
    expected = np.bincount(strokes.stroke[1:], 3.0 * mean_width * length)
    areas = []
    for path in root.iter("{http://www.w3.org/2000/svg}path"):
        x, y = path_points(path.get("d")).T
        areas.append(abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2)
    by_family = np.argsort(strokes.family, kind="stable")
    assert np.allclose(areas, expected[by_family], rtol=0.03, atol=0.2)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 60), st.integers(0, 10**6))
def test_plotter_order_is_a_permutation_with_little_travel(count, seed):
    first, last = np.random.default_rng(seed).random((2, count, 2))
    order, is_reversed = plotter_order(first, last)
    assert sorted(order.tolist()) == list(range(count))
    begin = np.where(is_reversed[:, None], last[order], first[order])
    end = np.where(is_reversed[:, None], first[order], last[order])
    travel = np.linalg.norm(begin[1:] - end[:-1], axis=1).sum()
    unordered_travel = np.linalg.norm(first[1:] - last[:-1], axis=1).sum()
    assert travel <= unordered_travel + 1e-9 or count < 6


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(2, 40), min_size=1, max_size=4), st.integers(0, 10**6))
def test_simplified_lines_stay_within_the_tolerance(sizes, seed):
    random = np.random.default_rng(seed)
    start = np.concatenate([[0], np.cumsum(sizes)])
    points = np.cumsum(random.normal(size=(start[-1], 2)), axis=0)
    kept = simplify_mask(points, start, 0.5)
    assert kept[start[:-1]].all() and kept[start[1:] - 1].all()
    for a, b in pairwise(start):
        simplified = points[a:b][kept[a:b]]
        chord = np.diff(simplified, axis=0)
        delta = points[a:b, None] - simplified[:-1]
        fraction = np.clip((delta * chord).sum(axis=2) / (chord**2).sum(axis=1), 0, 1)
        distance = np.linalg.norm(delta - fraction[..., None] * chord, axis=2)
        assert distance.min(axis=1).max() <= 0.5 + 1e-9


@pytest.mark.slow
def test_command_line(tmp_path, capsys, monkeypatch):
    mesh, out = write_off(tmp_path / "ball.off", icosphere(3)), tmp_path / "ball.svg"
    words = "--generate smoothest --set spacing=12 -o"
    command = ["strokes", str(mesh), *words.split(), str(out)]
    options = "--size 150x100 --set outline=1 --set gaps=0.3 --set light=lamp"
    assert main([*command, *options.split()]) == 0
    root = ElementTree.fromstring(out.read_bytes())
    assert len(root.findall("{http://www.w3.org/2000/svg}g")) == 4
    for arguments, message in (
        (["-o", str(tmp_path / "ball.png")], "ball.png"),
        (["--camera", "Close"], "ball.off: --camera applies only to .blend files"),
        (["--frames", "1-3"], "ball.off: --frames applies only to .blend files"),
        (["--set", "taper=-1"], "setting 'taper' is -1.0, expected a number from 0"),
    ):
        assert main([*command, *arguments]) == 2 and message in capsys.readouterr().err
    assert main(["strokes", "-o", str(out)]) == 2 and "give a mesh file" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "bpy", None)
    assert main(["strokes", "scene.blend", "-o", str(out)]) == 2
    assert "needs Blender" in capsys.readouterr().err

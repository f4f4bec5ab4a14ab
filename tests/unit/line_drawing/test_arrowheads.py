"""Arrowheads point along the members of fields of odd degree, evenly spaced along strokes."""

from dataclasses import replace

import numpy as np
import pytest
from harness.stroke_tracing import planar_strokes
from shapes import icosphere, torus

from rosy_addon.field.directional_field import field_directions
from rosy_addon.field.frames import normalize
from rosy_addon.field.generate import generate
from rosy_addon.line_drawing.arrowheads import arrowheads
from rosy_addon.line_drawing.pipeline import draw_instances
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance


def drawn(surface, field, **settings):
    """The strokes of a surface, and its arrowheads: their (n, 3, 3) points, and their faces."""
    camera = orbit_camera(surface.vertices, -25, 30, 400, 400)
    style = StrokeStyle(**{"spacing": 20.0, "arrows": 4.0} | settings)
    instance = MeshInstance(surface, np.eye(4), field)
    with_arrows = draw_instances([instance], camera, style).strokes
    without = draw_instances([instance], camera, replace(style, arrows=0.0)).strokes
    heads = with_arrows.select(np.arange(len(without), len(with_arrows)))
    assert np.array_equal(with_arrows.points[: len(without.points)], without.points)
    assert (np.diff(heads.start) == 3).all()
    return without, heads.points.reshape(-1, 3, 3), heads.face[::3]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "degree", "settings"),
    [
        (icosphere(3), 3, {"light": "headlight", "gaps": 0.3, "outline": 1.0, "overshoot": 6.0}),
        (torus(48, 24), 1, {"hidden": True, "cross_creases": True}),
    ],
    ids=["with tones", "with hidden strokes"],
)
def test_arrowheads_point_along_a_member(shape, degree, settings):
    field = generate(shape, "smoothest", degree)
    _, heads, face = drawn(shape, field, **settings)
    direction = normalize(heads[:, 1] - (heads[:, 0] + heads[:, 2]) / 2)
    members = normalize(field_directions(shape, field)[face])
    cosine = np.einsum("nk,nmk->nm", direction, members).max(axis=1)
    # The opposite of a member is pi / N away from the nearest one.
    is_right = cosine > np.cos(np.pi / degree / 2)
    assert len(heads) > 10 and is_right.all()


@pytest.mark.slow
def test_lines_without_a_direction_have_no_arrowheads():
    ball = icosphere(2)
    assert len(drawn(ball, generate(ball, "smoothest", 4), spacing=40.0)[1]) == 0


def test_arrowheads_are_evenly_spaced():
    """In the middles of equal parts of strokes, which are about as long as asked for."""
    points = np.linspace(0, [3.1, 1.1], 31).T[..., None] * [1.0, 0.0, 0.0]
    strokes = planar_strokes(points, np.tile((1.0, 0, 0), (62, 1)), 0.1)
    heads = arrowheads(strokes, 4.0, np.ones(2, dtype=bool)).points.reshape(-1, 3, 3)
    x = [(np.arange(count) + 0.5) / count * length for count, length in ((8, 3.1), (3, 1.1))]
    middle = heads[:, 1] / 2 + (heads[:, 0] + heads[:, 2]) / 4  # of the tip and the barbs
    np.testing.assert_allclose(middle, np.concatenate(x)[:, None] * [1, 0, 0], atol=1e-12)
    none = arrowheads(strokes, 4.0, np.zeros(2, dtype=bool))
    assert len(none) == 0 and none.names == strokes.names

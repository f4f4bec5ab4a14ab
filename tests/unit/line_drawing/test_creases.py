"""Strokes at creases and silhouettes: even spacing, with the tone and width of their own side."""

import numpy as np
import pytest
from shapes import instance_of, sharp_cube

from rosy_addon.compositor.shading import Light
from rosy_addon.field.generate import axis_field
from rosy_addon.line_drawing.pipeline import draw_instances
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.projection.camera import look_at, orthographic_camera
from rosy_addon.projection.gbuffer import MeshInstance

pytestmark = pytest.mark.slow

CAMERA = orthographic_camera(look_at((3, -5, 4), (0, 0, 0)), 300, 300, scale=2.0)

#: Different tones on the three faces of the cube that the camera sees.
SIDE_LIGHT = Light("sun", np.array([-0.8, 0.3, 0.52]), np.ones(3), 0.9)


CUBE = MeshInstance(sharp_cube(), np.eye(4), axis_field(sharp_cube(), 4, (0.2, 1.0, 0.1)))


@pytest.mark.parametrize("light", ["none", "scene"])
def test_spacing_and_width_are_even_up_to_creases(light):
    """A flat face under a sun has one tone and, without perspective, one spacing."""
    style = StrokeStyle(spacing=7.0, light=light, layering=0.0, taper=0.0)
    strokes = draw_instances([CUBE], CAMERA, style, lights=[SIDE_LIGHT]).strokes
    assert len(np.unique(strokes.face)) == 3
    spacings = set()
    for face in np.unique(strokes.face):
        spacing, width = strokes.spacing[strokes.face == face], strokes.width[strokes.face == face]
        assert np.ptp(spacing) < 1e-6 * spacing.max() and np.ptp(width) < 1e-6
        spacings.add(round(float(spacing[0]), 6))
    assert len(spacings) == 3


def test_strokes_reach_creases_at_full_width():
    """Only ends inside faces are tapered: at creases, tapered ends leave a pale margin."""
    instance = instance_of(sharp_cube(), 4)
    strokes = draw_instances([instance], CAMERA, StrokeStyle(spacing=7.0, taper=0.8)).strokes
    ends = np.concatenate([strokes.start[:-1], strokes.start[1:] - 1])
    at_crease = (np.abs(np.abs(strokes.points[ends] - 0.5) - 0.5) < 1e-6).sum(axis=1) >= 2
    assert at_crease.sum() > 60 and strokes.width[ends][at_crease].min() == 1
    assert strokes.width[ends][~at_crease].min() < 0.5

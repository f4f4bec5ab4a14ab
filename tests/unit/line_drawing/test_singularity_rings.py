"""Around an isolated singularity, the ends of strokes do not form a ring."""

from __future__ import annotations

import numpy as np
import pytest
from harness.stroke_tracing import trace_strokes
from shapes import plane

from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.gbuffer import MeshInstance


@pytest.mark.slow
@pytest.mark.parametrize(("degree", "before"), [(2, 0.45), (4, 0.72)])
def test_ends_of_strokes_do_not_form_a_ring_around_a_singularity(degree, before):
    """`before` is the number of ends per squared spacing if strokes stop after three spacings."""
    center, spacing = np.array([0.013, -0.007]), 0.06
    surface = plane(50, 50)
    face_center = surface.face_center[:, :2] - center
    angle = np.arctan2(face_center[:, 1], face_center[:, 0]) / degree + 0.3
    vectors = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    strokes = trace_strokes(MeshInstance(surface, np.eye(4), RosyField(degree, vectors)), spacing)
    ends = np.concatenate([strokes.start[:-1], strokes.start[1:] - 1])
    distance = np.linalg.norm(strokes.points[ends, :2] - center, axis=1) / spacing
    in_ring = (distance >= 2) & (distance < 4)
    assert in_ring.sum() / (np.pi * (4**2 - 2**2)) < 0.6 * before

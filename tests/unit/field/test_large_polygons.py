"""Faces with hundreds of corners: solvers need memory for each corner, not for each pair of corners."""

import numpy as np
import pytest
from conftest import traced_peak
from shapes import capped_cylinder

import rosy_addon as rf
from rosy_addon.field import triangulate
from rosy_addon.field.blocks import concatenated_ranges
from rosy_addon.field.triangulate import MAX_FAN, chain_corners

SOLVERS = {
    "form": rf.form,
    "guided": lambda surface: rf.guided(surface, strokes=[[[0.1, 0, -1], [0.6, 0.1, -1]]]),
    "prescribed": lambda surface: rf.prescribed(surface, {1: 1}, add_missing=True),
    "smoothed": lambda surface: rf.along_axis(surface, (1, 0.3, 0.2)).smoothed(0.1),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SOLVERS)
def test_memory(name):
    surface = capped_cylinder(700)
    assert traced_peak(lambda: SOLVERS[name](surface)) < 50e6


def test_a_strip_and_a_fan_give_the_same_field(monkeypatch):
    """All corners are on a circle, so the weights of all diagonals are 0."""
    given = {300 // 8 * 2 * k: 1 for k in range(8)}
    strip = rf.prescribed(capped_cylinder(300), given).representation
    monkeypatch.setattr(triangulate, "MAX_FAN", 1000)
    fan = rf.prescribed(capped_cylinder(300), given).representation
    assert MAX_FAN < 300 and strip == pytest.approx(fan, abs=1e-5)


def test_triangles_of_a_strip():
    """Each triangle is counter-clockwise and continues the previous one, and no corner is in many."""
    count = MAX_FAN + 1
    angle = np.arange(count) * 2 * np.pi / count
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    strip = chain_corners(np.arange(count - 2), np.full(count - 2, count))
    a, b, c = points[strip].swapaxes(0, 1)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert areas.min() > 0 and areas.sum() == pytest.approx(count / 2 * np.sin(2 * np.pi / count))
    for row in range(count - 3):
        assert set(strip[row + 1][:2]) < set(strip[row])
    corners = np.arange(count, dtype=np.int32)
    triangles, _ = triangulate.triangulate(points, corners, np.array([0, count], np.int32))
    assert np.array_equal(triangles, strip) and np.bincount(strip.ravel()).max() == 3


def test_estimate(monkeypatch, error_of):
    """Where every pair of neighbors counts, as around a vertex of many faces, memory is estimated first."""
    monkeypatch.setattr("rosy_addon.core.memory.available_memory", lambda: 10**9)
    message = error_of(concatenated_ranges, np.zeros(3, dtype=np.intp), np.full(3, 10**7))
    assert message.startswith("a matrix with 30,000,000 terms needs about 1.5 GB of memory")

"""Tapers, ends that meet, and gaps where strokes cross."""

from functools import lru_cache

import numpy as np
import pytest
from harness.stroke_tracing import planar_strokes, trace_strokes, turned
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapes import instance_of, plane

from rosy_addon.field.frames import normalize
from rosy_addon.line_drawing.crossings import cut_intervals, find_crossings, with_crossing_gaps
from rosy_addon.line_drawing.stroke_ends import head_on_ends


def test_taper_and_closed_strokes():
    strokes = trace_strokes(turned(plane(), 2), 0.1).tapered(2.0, 0.2)
    assert np.allclose(strokes.width[strokes.start[:-1]], 0.2)
    assert strokes.width.max() == 1.0 and (strokes.width >= 0.2 - 1e-9).all()


def test_ends_that_meet_head_on_are_not_tapered():
    """Stroke 1 continues stroke 0 at half a spacing, 2 is beside 0, and 3 is perpendicular to it."""
    along = np.linspace(0, 1, 11)[:, None] * np.array([1.0, 0, 0])
    points = [along, along + (1.05, 0.05, 0), along + (0, 0.1, 0)]
    points.append(along[:, [1, 0, 2]] + (1.02, 0, 0))
    directions = np.repeat([[1.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]], 11, axis=0)
    strokes = planar_strokes(np.array(points), directions, 0.1)
    # The last end of stroke 2 is beside that of stroke 0, and also meets stroke 1.
    assert head_on_ends(strokes).tolist() == [[0, 1], [1, 0], [0, 1], [0, 0]]
    tapered = strokes.tapered(2.0, 0.2, ~head_on_ends(strokes))
    first, last = tapered.start[:-1], tapered.start[1:] - 1
    end_width = np.stack([tapered.width[first], tapered.width[last]], axis=1)
    assert np.allclose(end_width, [[0.2, 1], [1, 0.2], [0.2, 1], [0.2, 0.2]])


def test_parallel_strokes_do_not_cross():
    """Their direction and their places are exact, but for rounding off the plane."""
    random = np.random.default_rng(0)
    step = np.array([1 / 64, 1 / 128, 0])
    start = random.integers(0, 1024, (100, 1, 3)) / 1024 * (1, 1, 0)
    points = start + np.arange(11)[:, None] * step
    points[..., 2] = random.normal(scale=1e-16, size=points.shape[:2])
    directions = np.tile(normalize(step), (points[..., 0].size, 1))
    assert not len(find_crossings(planar_strokes(points, directions, 0.1)).stroke)


@pytest.mark.parametrize("columns", [3, 7])
def test_gaps_at_crossings(columns):
    """All strokes cross all others once; some do so at the edges of triangles."""
    strokes = trace_strokes(instance_of(plane(columns, columns), 4), 0.2)
    crossings = find_crossings(strokes)
    max_count = (strokes.family == 0).sum() * (strokes.family == 1).sum()
    assert len(crossings.stroke) == max_count
    gapped = with_crossing_gaps(strokes, 0.3)
    assert not len(find_crossings(gapped).stroke)
    removed_length = strokes.length.sum() - gapped.length.sum()
    assert np.isclose(removed_length, len(crossings.stroke) * 0.3 * 0.2, rtol=0.1)
    for family in (0, 1):  # strokes pass over and under in turn: each family has half of the gaps
        cut = strokes.length[strokes.family == family].sum()
        cut -= gapped.length[gapped.family == family].sum()
        assert np.isclose(cut, removed_length / 2, rtol=0.1)


@lru_cache(maxsize=1)
def lines():
    return trace_strokes(instance_of(plane(3, 3), 2), 0.2)


@settings(max_examples=30)
@given(st.floats(0.01, 1.9), st.floats(0.01, 0.5))
def test_cut_intervals_remove_their_length(low, size):
    strokes = lines()
    remaining = cut_intervals(strokes, np.array([0]), np.array([low]), np.array([low + size]))
    total = strokes.length[0]
    assume(low + size < total - 1e-6 or low + size > total + 1e-6)
    removed_length = min(low + size, total) - min(low, total)
    assert np.isclose(strokes.length.sum() - remaining.length.sum(), removed_length, atol=1e-9)

"""Seeds are compared with strokes in steps that do not grow with their number."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import torus

from rosy_addon.field.generate import axis_field
from rosy_addon.line_drawing import seeding
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.line_drawing.trace import trace_on_mesh
from rosy_addon.progress import as_task
from rosy_addon.projection.gbuffer import MeshInstance


def traced(monkeypatch, batch_size):
    """Return the strokes on a torus, and the number of steps in which seeds are compared."""
    monkeypatch.setattr(seeding, "SEED_BATCH_SIZE", batch_size)
    surface = torus(32, 16)
    instance = MeshInstance(surface, np.eye(4), axis_field(surface, 4, (0.2, 0.3, 1.0)))
    mesh = build_tangent_mesh(instance)
    task = as_task(trace_on_mesh, mesh, np.full(len(surface.vertices), 0.1), surface_name="torus")
    steps = 0
    while True:
        try:
            steps += next(task).label == "looking for gaps"
        except StopIteration as end:
            return end.value, steps


@pytest.mark.slow
def test_small_batches_of_seeds_change_nothing(monkeypatch):
    strokes, few_steps = traced(monkeypatch, 1 << 12)
    again, many_steps = traced(monkeypatch, 1 << 6)
    assert np.array_equal(again.points, strokes.points)
    assert np.array_equal(again.start, strokes.start)
    assert many_steps > 4 * few_steps


def test_a_batch_is_small():
    """4096 seeds are compared within a tenth of a second."""
    assert seeding.SEED_BATCH_SIZE <= 1 << 12

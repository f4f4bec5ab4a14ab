"""Samples along traced paths, and tips that grow by several samples at once."""

import numpy as np
from harness.stroke_tracing import turned
from shapes import icosphere, instance_of, plane

from rosy_addon.line_drawing import placement
from rosy_addon.line_drawing.lateral_neighbors import SeparationRules
from rosy_addon.line_drawing.path_samples import SampledPath
from rosy_addon.line_drawing.seeding import candidate_seeds, thinned_seeds
from rosy_addon.line_drawing.spacing import CornerSpacing
from rosy_addon.line_drawing.surface_particles import advance
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.projection.pixel_blocks import part_of


def test_samples_of_a_straight_path():
    """Steps grow by a tenth each; the last sample is at the border. Paths end where they are cut."""
    mesh = build_tangent_mesh(turned(plane(7, 7), 1))
    seeds = candidate_seeds(mesh, np.full((len(mesh.points), 3), 0.4))
    x, y, _ = mesh.points_at(seeds.triangle, seeds.weights).T
    length = np.full(len(seeds), 10.0)
    _, _, ended, traced = advance(
        mesh, seeds, length, max_segment_length=np.full(len(seeds), 0.05), max_segments=1000
    )
    assert ended.all()
    path = SampledPath(traced, seeds.sign)
    np.testing.assert_allclose(path.length, 1 - x, atol=1e-9)

    def next_step(position, particle):
        return 0.1 + 0.1 * (mesh.points_at(position.triangle, position.weights)[:, 0] - x[particle])

    samples = path.samples(np.full(len(seeds), 0.1), next_step, ended)
    points = mesh.points_at(samples.position.triangle, samples.position.weights)
    np.testing.assert_allclose(points[:, 0], x[samples.particle] + samples.arc, atol=1e-9)
    np.testing.assert_allclose(points[:, 1], y[samples.particle], atol=1e-9)
    expected = np.minimum(1.1 ** (samples.rank + 1) - 1, path.length[samples.particle])
    np.testing.assert_allclose(samples.arc, expected, atol=1e-9)
    later = samples.previous >= 0
    assert (samples.rank[later] == samples.rank[samples.previous[later]] + 1).all()
    assert (samples.particle[later] == samples.particle[samples.previous[later]]).all()
    last = np.zeros(len(seeds))
    np.maximum.at(last, samples.particle, samples.arc)
    np.testing.assert_allclose(last, path.length, atol=1e-9)

    cut = path.cut(0.37 * path.length)
    np.testing.assert_allclose(np.bincount(cut.particle, cut.length), 0.37 * path.length, atol=1e-9)
    end = np.flatnonzero(np.diff(cut.particle, append=-1))
    reached = mesh.points_at(cut.triangle[end], cut.end_weights[end])[:, 0]
    np.testing.assert_allclose(reached, x + 0.37 * path.length, atol=1e-9)

    # Paths that are much shorter than a step, and begin with a segment without length.
    first = np.unique(path.path.particle, return_index=True)[1]
    short = part_of(path.path, np.repeat(first, 2))
    short.length[::2], short.length[1::2] = 0, 1e-12
    short.end_weights[:] = short.begin_weights
    samples = SampledPath(short, seeds.sign).samples(np.full(len(seeds), 0.1), next_step, ended)
    np.testing.assert_array_equal(samples.particle, np.arange(len(seeds)))
    points = mesh.points_at(samples.position.triangle, samples.position.weights)
    np.testing.assert_allclose(points[:, 0], x, atol=1e-9)


def test_samples_are_accepted_one_after_the_other(monkeypatch):
    """Tips that grow by six samples at once reach as far as those that grow six times by one.

    Tips that are rejected end. Otherwise they would try again, but at different times.
    """
    monkeypatch.setattr(placement, "MIN_STEP_SCALE", 1.0)
    monkeypatch.setattr(placement, "MIN_SEGMENTS", 100)
    mesh = build_tangent_mesh(instance_of(icosphere(3), 4))
    spacing = CornerSpacing(np.full((len(mesh.points), 3), 0.1))
    reached = []
    for sample_counts in ((6,), (1,) * 6):
        placer = placement.StreamlinePlacer(mesh, spacing)
        placer.rules = SeparationRules(min_length=0.0, max_gap=np.inf)
        seeds = candidate_seeds(mesh, spacing.values)
        placer.add_seeds(thinned_seeds(mesh, seeds, 0.2, np.ones(len(seeds))))
        for count in sample_counts:
            placer.grow(count)
        strokes = placer.strokes
        reached.append(np.stack([strokes.min_arc, strokes.max_arc], axis=1)[: strokes.count])
    at_once, by_one = np.abs(reached)
    assert 0.1 < np.mean(at_once > 0.299) < 0.9
    # The paths differ by less than a thousandth of a spacing, which decides for a few samples.
    assert np.mean(np.abs(at_once - by_one) < 1e-4) > 0.99

"""Singularities that are added to given ones, where they cost least."""

from __future__ import annotations

import awkward
import numpy as np
import pytest
from shapes import cylinder, icosphere, torus

from rosy_addon.core.errors import RosyError
from rosy_addon.field.analysis import dirichlet_energy
from rosy_addon.field.cheapest_singularities import cheapest_singularities
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.prescribed import prescribed_field
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.smoothest import smoothest_field
from rosy_addon.field.surface import Surface


def energy_of(surface, degree, vertex, index):
    return dirichlet_energy(surface, prescribed_field(surface, degree, vertex, index))


def test_what_is_missing_costs_as_much_as_at_the_opposite_point():
    """With one singularity of index 1 on a sphere, the other one belongs there."""
    ball = icosphere(4)
    vertex, index = cheapest_singularities(ball, 1, [7], [1])
    assert vertex[0] == 7 and index.tolist() == [1, 1]
    opposite = int((ball.vertices @ ball.vertices[7]).argmin())
    assert energy_of(ball, 1, vertex, index) < 1.03 * energy_of(ball, 1, [7, opposite], [1, 1])


@pytest.mark.slow
def test_given_ones_stay_and_the_sum_is_right():
    """Also where the smoothest field wants one of the others at the vertex of a given one."""
    random = np.random.default_rng(4)
    for surface, characteristic in ((torus(24, 12), 0), (icosphere(3), 2)):
        for count in (1, 2, 4, 4):
            given = random.choice(len(surface.vertices), count, replace=False)
            sign = random.choice([-1, 1], count)
            vertex, index = cheapest_singularities(surface, 4, given, sign)
            assert vertex[:count].tolist() == given.tolist()
            assert index[:count].tolist() == sign.tolist()
            assert len(set(vertex.tolist())) == len(vertex)
            assert index.sum() == 4 * characteristic


@pytest.mark.parametrize("points, faces", [awkward.octahedron(), awkward.cube()], ids=["8", "6"])
def test_given_ones_are_found_on_few_faces_or_refused(points, faces):
    """Where all neighbors of a given vertex are singular, what is added stayed at the given one."""
    random, made = np.random.default_rng(5), 0
    surface = Surface(points, faces)
    for _ in range(40):
        given = random.permutation(len(points))[: random.integers(1, 4)]
        index, degree = random.integers(-1, 3, len(given)), int(random.choice([1, 2, 4, 6]))
        settings = GeneratorSettings("prescribed", singularities=(given, index), add_missing=True)
        try:
            field = generate(surface, settings, degree)
        except RosyError:
            continue
        found = np.zeros(len(points), dtype=int)
        vertex, found_index = find_singularities(surface, field)
        found[vertex] = found_index
        assert found[given].tolist() == index.tolist()
        made += 1
    assert made > 10


def test_one_given_costs_no_more_than_the_smoothest_field():
    """The sphere can be turned so that one of its singularities is there."""
    ball = icosphere(4)
    vertex, index = cheapest_singularities(ball, 4, [7], [1])
    assert index.tolist() == [1] * 8
    energy = energy_of(ball, 4, vertex, index)
    # The search places the singularities on the eigenvector; the smoothest field has moved them further.
    assert energy < 1.1 * dirichlet_energy(ball, smoothest_field(ball, 4))


def test_a_field_with_a_border_needs_no_more():
    tube = cylinder(24, 12)
    given = np.array([150]), np.array([1])
    settings = GeneratorSettings("prescribed", singularities=given, add_missing=True)
    vertex, index = find_singularities(tube, generate(tube, settings, 4))
    assert vertex.tolist() == [150] and index.tolist() == [1]

"""Smoothest fields have the least energy of unit vectors: closed forms, random starts, other generators."""

from __future__ import annotations

import awkward
import numpy as np
import pytest
from field_helpers import bumpy
from scipy.optimize import minimize
from shapes import (
    cube,
    from_quads,
    from_triangles,
    icosphere,
    joined,
    rebuilt,
    tetrahedron,
    torus,
    walls_of,
)

from rosy_addon.core.errors import RosyError
from rosy_addon.field import smoothest
from rosy_addon.field.analysis import dirichlet_energy
from rosy_addon.field.generate import generate
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.smoothest import smoothest_field
from rosy_addon.field.unit_descent import face_energy

CUBE_OF_TRIANGLES = from_triangles(cube().vertices, cube().triangle_vertex)
OCTAHEDRON = from_triangles(*awkward.octahedron())


@pytest.mark.parametrize(
    ("surface", "degree", "index"),
    [
        (cube(), 4, [1] * 8),
        (CUBE_OF_TRIANGLES, 4, [1] * 8),
        (OCTAHEDRON, 3, [1] * 6),
        (OCTAHEDRON, 6, [2] * 6),
        (tetrahedron(), 4, [2] * 4),
    ],
)
def test_fields_that_turn_nowhere(surface, degree, index):
    """The angle defect of each vertex is a multiple of 2 pi / N: such a field has no energy."""
    field = smoothest_field(surface, degree)
    assert dirichlet_energy(surface, field) == pytest.approx(0, abs=1e-6)
    assert find_singularities(surface, field)[1].tolist() == index


@pytest.mark.parametrize("degree", [1, 2, 4, 6])
@pytest.mark.parametrize("subdivisions", [0, 1, 2])
def test_no_random_start_has_less_energy(degree, subdivisions):
    surface = bumpy(icosphere(subdivisions))
    energy = face_energy(surface, degree, np.ones(surface.face_count, dtype=bool))

    def value(angle):
        products = energy.products(np.exp(1j * angle))
        return 2 * (energy.weight - products.real).sum(), 2 * energy.sums(products.imag)

    random = np.random.default_rng(1)
    starts = random.uniform(0, 2 * np.pi, (20, surface.face_count))
    least = min(minimize(value, start, jac=True, method="L-BFGS-B").fun for start in starts)
    assert dirichlet_energy(surface, smoothest_field(surface, degree)) <= 1.001 * least + 1e-6


@pytest.mark.parametrize(("degree", "least"), [(2, 60.0819), (4, 0.0)])
def test_a_frame_of_few_quads(degree, least):
    """Genus 2. The least energy of 90 random starts; degree 4 turns nowhere, as angle defects are multiples of 90."""
    solid = np.ones((9, 7, 2), dtype=bool)
    solid[[2, 3, 5, 6], 2:5] = False
    frame = from_quads(*walls_of(solid))
    assert frame.face_count == 206 and frame.euler_characteristic == -2
    assert dirichlet_energy(frame, smoothest_field(frame, degree)) <= 1.001 * least + 1e-6


def test_another_eigenvector_gives_less_energy():
    """From the second one, the field has no singularities. From the first, it has four, and an energy of 73."""
    surface = bumpy(torus(60, 30))
    field = smoothest_field(surface, 2)
    assert dirichlet_energy(surface, field) < 41
    assert not len(find_singularities(surface, field)[0])


@pytest.mark.slow
def test_coarse_start_reaches_the_energy_of_a_fine_one(monkeypatch):
    """The search starts on a coarse multigrid level."""
    surface = bumpy(icosphere(4))
    energies = []
    for unknowns in (smoothest.START_UNKNOWNS, 50_000):
        monkeypatch.setattr(smoothest, "START_UNKNOWNS", unknowns)
        energies.append(dirichlet_energy(surface, smoothest.smoothest_field(surface, 4)))
    assert energies[0] < 1.02 * energies[1]


@pytest.mark.slow
@pytest.mark.parametrize("degree", [2, 4])
@pytest.mark.parametrize(
    "surface", [bumpy(icosphere(4)), bumpy(torus(60, 30))], ids=["ball", "torus"]
)
def test_no_other_kind_has_less_energy(surface, degree):
    energy = dirichlet_energy(surface, smoothest_field(surface, degree))
    for kind in ("form", "curvature", "features"):
        try:
            other = generate(surface, kind, degree)
        except RosyError:  # no sharp edge
            continue
        assert energy <= 1.001 * dirichlet_energy(surface, other)


def test_parts_of_very_different_sizes_are_solved_alone():
    """Diffusion times are relative to the area of each component."""
    ball = bumpy(icosphere(3))
    alone = dirichlet_energy(ball, smoothest_field(ball, 4))
    both = joined(ball, rebuilt(ball, 1e-3 * ball.vertices + 9))
    assert dirichlet_energy(both, smoothest_field(both, 4)) == pytest.approx(2 * alone, rel=0.04)


def test_slivers_do_not_hide_other_faces():
    """Half of the edges are those of slivers, whose height is a rounding error. The search ends."""
    x, y, z = 2.942049503326416, 2.4556283950805664, 2.0361483097076416
    corners = cube().vertices * (x, y, z)
    line = np.outer(range(1, 5), np.float32([-0.0346824, 0.05744636, 0.0728727]))
    slivers = [[0, 8, 9], [0, 9, 10], [0, 10, 11]]
    triangles = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], *slivers]
    surface = from_triangles(np.concatenate([corners, line]), triangles)
    assert generate(surface, "form", 4).vectors[:4].any(axis=1).all()

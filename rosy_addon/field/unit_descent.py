"""Reduce the energy of a field of unit vectors on the faces: the one that `analysis.dirichlet_energy` reports.

The least eigenvector of `smoothest` minimizes the energy for a given mean square. It is small in some regions, and
in these its directions cost nothing. The field that is drawn has length 1 everywhere, so its energy is reduced
further: first by diffusion, over shorter and shorter distances, after each of which the field gets length 1
again (Merriman, Bence and Osher 1992; for crosses, Viertel and Osting 2019). This moves singularities and cancels
pairs. Then the angles of the faces descend to the nearest minimum, by nonlinear conjugate gradients.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..core.progress import progress, report
from .analysis import edge_lengths
from .blocks import by_rows
from .conjugate_gradient import conjugate_gradient
from .connectivity import connected_components
from .representation import edge_unfolding, power, unit_complex
from .sparse_multigrid import (
    SINGULAR_SHIFT,
    Level,
    add_diagonal,
    from_edges,
    hierarchy,
    w_cycle,
)
from .surface import Surface

#: Diffusion times, relative to the area. Of nine schedules on six meshes, degrees 1 and 4, this one gave the least energy
#: or up to 2 % more.
DIFFUSION_TIMES = (0.03, 0.01, 0.003, 0.001, 0.0003)

#: Largest number of iterations of the linear solver for each diffusion time, and of steps of the descent.
DIFFUSION_ITERATIONS, MAX_STEPS = 60, 100

#: Largest weight of an edge, relative to the median. Edges of slivers would make the matrix ill-conditioned.
MAX_WEIGHT_RATIO = 1e4

#: With more faces, the multigrid levels of the descent are rougher. On 200,000 faces, the whole search takes a tenth less
#: time, and ends at 0.02 % more energy.
SMOOTHED_FACES = 60_000

#: Smallest second derivative along the search direction, relative to that of a field that turns nowhere.
MIN_CURVATURE_RATIO = 0.1

#: Smallest gain that makes another minimum the better one, relative to the energy plus 1: no rounding error.
MIN_GAIN = 1e-6

#: With at most this number of faces, the search has this number of random starts as well. On a frame with two holes of
#: 206 quads, one of about 40 reaches the least energy at degree 2. They take 0.1 seconds.
FEW_FACES, RANDOM_STARTS = 400, 80

#: Largest turn of the phase of a face that leaves a saddle point: far above rounding errors, far below those of a minimum.
SMALL_TURN = 1e-2

#: Decrease of the energy at which the descent stops, relative to the energy, to choose between starts and to try moves.
CHOICE_TOLERANCE = 1e-4

#: Smallest gain by which another start than the first eigenvector is chosen, relative to the energy. Fields with less energy
#: often lack the symmetry of the surface: on a head with a mirror plane, such a field of degree 2 has 8 % less.
LEAST_START_GAIN = 0.1

#: Difference of gains, relative to them, that is a rounding error; tolerance of the angles after a move.
EQUAL_GAIN, MOVE_TOLERANCE = 1e-3, 1e-3

#: Number of edges across which singularities are moved, if this reduces the energy.
MOVES_TRIED = 12

LABEL = "smoothing the field of unit vectors"


@dataclass(frozen=True, eq=False)
class FaceEnergy:
    """The energy of representations z on F faces: the sum of w ``|z_g - r z_f|^2`` over I edges.

    Attributes
    ----------
    source, target : (I,) int32 ndarray
        The two faces f and g of each edge.
    weight : (I,) float64 ndarray
        w, as in `analysis.dirichlet_energy`, but limited.
    transport : (I,) complex128 ndarray
        r, of modulus 1.
    ends : (I, 2) int32 ndarray
        The vertices of each edge.
    area : (F,) float64 ndarray
        Areas of the faces, always positive.
    """

    source: np.ndarray
    target: np.ndarray
    weight: np.ndarray
    transport: np.ndarray
    ends: np.ndarray
    area: np.ndarray

    def products(self, z: np.ndarray) -> np.ndarray:
        """Return (I,) complex128: w times the rotation from the transported z of the source to the target's."""
        products = z.take(self.source)
        products *= self.transport
        np.conjugate(products, out=products)
        products *= z.take(self.target)
        products *= self.weight
        return products

    def of(self, z: np.ndarray) -> float:
        """Return the energy of (F,) representations of modulus 1."""
        return 2 * float((self.weight - self.products(z).real).sum())

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return (F,) sums of (I,) real values: added at the target of each edge, subtracted at its source."""
        count = len(self.area)
        return np.bincount(self.target, values, count) - np.bincount(self.source, values, count)

    def least(
        self, starts: list[np.ndarray], found: list[np.ndarray], least_gain: float
    ) -> np.ndarray:
        """Return (F,) representations: on each connected component, the start from which the best field was found.

        `found` has a field of modulus 1 for each of `starts`. A later start has to reduce the energy by the fraction
        `least_gain`.
        """
        pairs = np.stack([self.source, self.target], axis=1)
        component = connected_components(len(self.area), pairs)
        best, least = starts[0], np.full(int(component.max()) + 1, np.inf)
        for start, z in zip(starts, found, strict=True):
            terms = self.weight - self.products(z).real
            value = np.bincount(component[self.source], terms, len(least))
            is_better = value < (1 - least_gain) * least - MIN_GAIN * (1 + value)
            best = np.where(is_better[component], start, best)
            least = np.where(is_better, value, least)
        return best

    @cached_property
    def diagonal(self) -> np.ndarray:
        """(F,) float64: the sum of the weights around each face; 1 where it is 0."""
        ends = np.concatenate([self.source, self.target])
        total = np.bincount(ends, np.tile(self.weight, 2), len(self.area))
        return np.where(total > 0, total, 1.0)

    @cached_property
    def levels(self) -> list[Level]:
        """Multigrid levels for changes of the angles: of a real matrix, that of a field that turns nowhere."""
        diagonal = self.diagonal * (1 + SINGULAR_SHIFT)
        matrix = from_edges(self.target, self.source, -self.weight, diagonal)
        return hierarchy(matrix, SMOOTHED_FACES)


def face_energy(surface: Surface, degree: int, is_defined: np.ndarray) -> FaceEnergy:
    """Return the energy of fields of degree N that are defined on the given faces, (F,) bool."""
    halfedges = surface.edges.halfedges
    halfedges = halfedges[is_defined[surface.corner_face[halfedges]].all(axis=1)]
    a, b = halfedges.T
    length, distance = by_rows(partial(edge_lengths, surface), a, b)
    weight = np.divide(length, distance, out=np.zeros_like(length), where=distance > 0)
    weight = np.minimum(weight, MAX_WEIGHT_RATIO * np.median(weight)) if len(a) else weight
    transport = power(by_rows(partial(edge_unfolding, surface), a, b), degree)
    area = surface.face_area
    area = np.maximum(area, 1e-12 * max(float(area.mean()), 1e-300))
    ends = surface.corner_vertex[halfedges]
    faces = surface.corner_face[halfedges]
    return FaceEnergy(*faces.T, weight, transport, ends, area)


def least_unit_field(
    energy: FaceEnergy, starts: list[np.ndarray], tolerance: float, rounds: int
) -> np.ndarray:
    """Return representations of modulus 1 at a local minimum of the energy, the least one that is found.

    On each connected component, the best of the starts is taken. On meshes of few faces, there are also random ones.

    Parameters
    ----------
    energy : FaceEnergy
    starts : list of (F,) complex128 ndarray
        Representations of modulus 1 from which the search starts; those that are 0 stay 0.
    tolerance : float
        The descent stops when a step reduces the energy by less than this fraction of it.
    rounds : int
        How many times singularities are moved.
    """
    is_small = len(energy.area) <= FEW_FACES
    if is_small:
        turns = np.random.default_rng(0).random((len(energy.area), RANDOM_STARTS)).T
        phases = np.where(starts[0] == 0, 0, np.exp(2j * np.pi * turns))
        # Rounding errors must not choose the way from a symmetric saddle point.
        turned = [start * np.exp(SMALL_TURN * 1j * turns[0]) for start in starts]
        starts = [*turned, *phases]
    if len(starts) > 1:
        found = [descend(energy, start, CHOICE_TOLERANCE) for start in starts]
        z = energy.least(starts, found, 0 if is_small else LEAST_START_GAIN)
    else:
        z = starts[0]
    z = descend(energy, z, tolerance)
    if is_small:
        return _with_moves_in_few_faces(energy, z, tolerance)
    return _with_moves(energy, z, tolerance, rounds)


def _with_moves(energy: FaceEnergy, z: np.ndarray, tolerance: float, rounds: int) -> np.ndarray:
    """Move singularities of a local minimum across edges, many at a time, while this reduces the energy.

    See `_with_moves_in_few_faces`. Here, the resistance is an estimate: beside the edge, half the conductance of a
    path over the other edges of both faces, which is exact for equilateral triangles.
    """
    weight, ends = energy.weight, energy.ends
    beside = energy.diagonal[np.stack([energy.source, energy.target])] - weight
    detour = 0.5 * beside.prod(axis=0) / np.maximum(beside.sum(axis=0), 1e-300)
    barrier = np.pi * detour / np.maximum(weight + detour, 1e-300)
    least, least_gain = energy.of(z), 0.0
    for _ in range(rounds):
        turn = np.angle(energy.products(z))
        gain = weight * (np.abs(turn) - barrier)
        # Take the best edge of both of its vertices; of equal ones none, so that symmetric fields stay symmetric.
        best = np.zeros(int(ends.max(initial=0)) + 1)
        np.maximum.at(best, ends.ravel(), np.repeat(gain, 2))
        chosen = (gain > least_gain) & (gain >= (1 - EQUAL_GAIN) * best[ends].max(axis=1))
        chosen &= (np.bincount(ends[chosen].ravel(), minlength=len(best))[ends] == 1).all(axis=1)
        if not chosen.any():
            break
        jump = np.where(chosen, 2 * np.pi * np.sign(turn), 0)
        matrix, precondition = energy.levels[0].matrix, partial(w_cycle, energy.levels)
        change = conjugate_gradient(
            matrix, energy.sums(weight * jump), MOVE_TOLERANCE, precondition, LABEL
        )
        found = descend(energy, z * np.exp(1j * change), max(tolerance, CHOICE_TOLERANCE))
        if energy.of(found) < (1 + CHOICE_TOLERANCE) * least:
            found = descend(energy, found, tolerance)
        value = energy.of(found)
        if value < least - MIN_GAIN * (1 + least):
            z, least = found, value
        else:
            least_gain = (1 + EQUAL_GAIN) * float(np.median(gain[chosen]))
    return z


def _with_moves_in_few_faces(energy: FaceEnergy, z: np.ndarray, tolerance: float) -> np.ndarray:
    """Move singularities of a local minimum across edges, one at a time, as long as this reduces the energy.

    A singularity crosses an edge if the phase there turns by 2 pi more or less. If the other angles adapt, this changes
    the energy, to second order, by ``4 pi w (pi (1 - w R) - |turn|)``, where R is the resistance between both faces in the
    graph of the faces, with conductances w (Doyle and Snell 1984). The most promising edges are tried.
    """
    count = len(z)
    laplacian = np.diag(energy.diagonal * (1 + 1e-9))
    np.subtract.at(laplacian, (energy.target, energy.source), energy.weight)
    np.subtract.at(laplacian, (energy.source, energy.target), energy.weight)
    response = np.linalg.inv(laplacian)
    # Phases of the faces when the phase at an edge turns by 1 more, per unit of its weight.
    per_edge = response[energy.target] - response[energy.source]
    edges = np.arange(len(energy.weight))
    resistance = per_edge[edges, energy.target] - per_edge[edges, energy.source]
    barrier = np.pi * (1 - energy.weight * resistance)
    least, improved = energy.of(z), count > 2
    while improved:
        improved = False
        turn = np.angle(energy.products(z))
        gain = energy.weight * (np.abs(turn) - barrier)
        # Equal gains of mirror images, of which rounding errors must not choose: the first edge is tried first.
        rank = np.round(gain / (EQUAL_GAIN * max(float(np.abs(gain).max(initial=0)), 1e-300)))
        for edge in np.argsort(-rank, kind="stable")[:MOVES_TRIED].tolist():
            change = 2 * np.pi * np.sign(turn[edge]) * energy.weight[edge] * per_edge[edge]
            found = descend(energy, z * np.exp(1j * change), tolerance)
            value = energy.of(found)
            if value < least - MIN_GAIN * (1 + least):
                z, least, improved = found, value, True
                break
    return z


def diffuse(
    levels: list[Level],
    mass: np.ndarray,
    area: np.ndarray,
    z: np.ndarray,
    times: Sequence[float],
    tolerance: float,
) -> np.ndarray:
    """Diffuse representations over shorter and shorter distances, and normalize them after each time.

    Parameters
    ----------
    levels : list of Level
        Multigrid levels of the connection Laplacian.
    mass, area : (n,) float64 ndarray
        Mass of each node, and the sum of the masses on its connected component.
    z : (n,) complex128 ndarray
        Representations at the nodes.
    times : sequence of float
        Diffusion times, relative to the area.
    tolerance : float
        Residual norm at which the linear solver stops, relative to the norm of the right-hand side.
    """
    z = unit_complex(z)
    for index, time in enumerate(times):
        with progress(index / len(times), (index + 1) / len(times)):
            rate = mass / (time * area)
            shifted = add_diagonal(levels, rate)
            solve = partial(conjugate_gradient, shifted[0].matrix, rate * z, label=LABEL, start=z)
            precondition = partial(w_cycle, shifted)
            z = unit_complex(
                solve(
                    tolerance=tolerance,
                    precondition=precondition,
                    max_iterations=DIFFUSION_ITERATIONS,
                )
            )
    return z


def descend(energy: FaceEnergy, z: np.ndarray, tolerance: float) -> np.ndarray:
    """Rotate each representation until the energy is at a local minimum (Polak and Ribière 1969).

    The second derivative along a search direction is at most `bound`, that of a field that turns nowhere. A step of
    this length reduces the energy surely; it is taken if the longer one does not.
    """
    search, old_gradient, old_norm = np.zeros(len(z)), np.zeros(len(z)), 1.0
    products, total = energy.products(z), energy.weight.sum()
    for step in range(MAX_STEPS):
        report(1 - 0.9**step, LABEL)
        gradient = energy.sums(products.imag)
        smooth = w_cycle(energy.levels, gradient)
        norm = float(gradient @ smooth)
        search *= max(0.0, (norm - float(old_gradient @ smooth)) / old_norm)
        search -= smooth
        if gradient @ search >= 0:
            search = -smooth
        old_gradient, old_norm = gradient, norm
        change = search.take(energy.target) - search.take(energy.source)
        change *= change
        bound, slope = float(energy.weight @ change), -float(gradient @ search)
        if not bound > 0 or not slope > 0:
            break
        before = products.real.sum()
        curvature = max(float(products.real @ change), MIN_CURVATURE_RATIO * bound)
        for length in (slope / curvature, slope / bound):
            angle = length * search
            turned = z * (np.cos(angle) + 1j * np.sin(angle))
            products = energy.products(turned)
            if products.real.sum() >= before:
                z = turned
                break
        else:
            break
        after = products.real.sum()
        if after - before < tolerance * (total - after + 1e-6):
            break
    return z

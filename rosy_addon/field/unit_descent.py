"""Reduce the energy of a field of unit vectors on the faces: the one that `analysis.dirichlet_energy` reports.

The least eigenvector of `smoothest` minimizes the energy for a given mean square. It is small in some regions, and
in these its directions cost nothing. The field that is drawn has length 1 everywhere, so its energy is reduced
further: first by diffusion, over shorter and shorter distances, after each of which the field gets length 1
again (Merriman, Bence and Osher 1992; for crosses, Viertel and Osting 2019). This moves singularities and cancels
pairs. Then the angles of the faces descend to the nearest minimum, by nonlinear conjugate gradients.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..core.progress import progress, report
from .analysis import edge_lengths
from .conjugate_gradient import conjugate_gradient
from .representation import edge_unfolding, power, unit_complex
from .sparse_multigrid import CSRMatrix, Level, add_diagonal, from_edges, hierarchy, w_cycle
from .surface import Surface

#: Diffusion times, relative to the area of the surface. Of schedules from 0.1 to 0.0003 these gave the least energy,
#: or within 1 % of it, on the meshes of ../shared and on double tori.
DIFFUSION_TIMES = (0.01, 0.003, 0.001, 0.0003)

#: Iterations of the linear solver for each diffusion time.
DIFFUSION_ITERATIONS = 3

#: The descent stops when no angle of a representation changes by more than this in a step, in radians.
ANGLE_TOLERANCE, MAX_STEPS = 1e-5, 200

#: Largest weight of an edge, relative to the median. Edges of slivers would make the matrix ill-conditioned.
MAX_WEIGHT_RATIO = 1e4

#: Smallest second derivative along the search direction, relative to that of a field that turns nowhere.
MIN_CURVATURE_RATIO = 0.1

#: With at most this number of faces, the search starts from several eigenvectors, of which this number is used.
FEW_FACES, START_COUNT = 200, 12

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
    area : (F,) float64 ndarray
        Areas of the faces, always positive.
    """

    source: np.ndarray
    target: np.ndarray
    weight: np.ndarray
    transport: np.ndarray
    area: np.ndarray

    def products(self, z: np.ndarray) -> np.ndarray:
        """Return (I,) complex128: w times the rotation from the transported z of the source to the target's."""
        return self.weight * z[self.target] * (z[self.source] * self.transport).conj()

    def of(self, z: np.ndarray) -> float:
        """Return the energy of (F,) representations of modulus 1."""
        return 2 * float((self.weight - self.products(z).real).sum())

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return (F,) sums of (I,) real values: added at the target of each edge, subtracted at its source."""
        count = len(self.area)
        return np.bincount(self.target, values, count) - np.bincount(self.source, values, count)

    @cached_property
    def matrix(self) -> CSRMatrix:
        """The (F, F) Hermitian matrix of the energy."""
        ends = np.concatenate([self.source, self.target])
        diagonal = np.bincount(ends, np.tile(self.weight, 2), len(self.area))
        diagonal[diagonal <= 0] = 1.0
        return from_edges(self.target, self.source, -self.weight * self.transport, diagonal)

    @cached_property
    def levels(self) -> list[Level]:
        """Multigrid levels of the matrix, with a diagonal that the longest diffusion time leaves."""
        return hierarchy(self.matrix.plus_diagonal(self.area / self.area.sum()))


def face_energy(surface: Surface, degree: int, is_defined: np.ndarray) -> FaceEnergy:
    """Return the energy of fields of degree N that are defined on the given faces, (F,) bool."""
    halfedges = surface.edges.halfedges
    halfedges = halfedges[is_defined[surface.corner_face[halfedges]].all(axis=1)]
    a, b = halfedges.T
    length, distance = edge_lengths(surface, a, b)
    weight = np.divide(length, distance, out=np.zeros_like(length), where=distance > 0)
    weight = np.minimum(weight, MAX_WEIGHT_RATIO * np.median(weight)) if len(a) else weight
    transport = power(edge_unfolding(surface, a, b), degree)
    area = surface.face_area
    area = np.maximum(area, 1e-12 * max(float(area.mean()), 1e-300))
    return FaceEnergy(surface.corner_face[a], surface.corner_face[b], weight, transport, area)


def least_unit_field(energy: FaceEnergy, z: np.ndarray) -> np.ndarray:
    """Return representations of modulus 1 with less energy than the given ones, at a local minimum.

    Parameters
    ----------
    energy : FaceEnergy
    z : (F,) complex128 ndarray
        Representations of modulus 1; those that are 0 stay 0.
    """
    with progress(0.0, 0.6, LABEL):
        best = descend(energy, diffuse(energy, z))
    if len(z) > FEW_FACES:
        return best
    least = energy.of(best)
    for start in [z, *_eigenvectors(energy)]:
        found = descend(energy, np.where(z == 0, 0, unit_complex(start, otherwise=1)))
        value = energy.of(found)
        if value < least - 1e-6 * (1 + least):
            best, least = found, value
    return best


def diffuse(energy: FaceEnergy, z: np.ndarray) -> np.ndarray:
    """Diffuse representations over shorter and shorter distances, with modulus 1 after each time."""
    for index, time in enumerate(DIFFUSION_TIMES):
        with progress(index / len(DIFFUSION_TIMES), (index + 1) / len(DIFFUSION_TIMES), LABEL):
            mass = energy.area / (time * energy.area.sum())
            levels = add_diagonal(energy.levels, mass)
            precondition = partial(w_cycle, levels)
            z = unit_complex(
                conjugate_gradient(
                    levels[0].matrix, mass * z, 1e-3, precondition, LABEL, z,
                    max_iterations=DIFFUSION_ITERATIONS,
                )
            )
    return z


def descend(energy: FaceEnergy, z: np.ndarray) -> np.ndarray:
    """Rotate each representation until the energy is at a local minimum (Polak and Ribière 1969).

    The second derivative of a step is at most that of a field that turns nowhere. A step with this bound
    reduces the energy surely; it is taken if the usual step does not.
    """
    value, search, old_gradient, old_norm = energy.of(z), None, None, 1.0
    for step in range(MAX_STEPS):
        report(1 - 0.9**step, LABEL)
        products = energy.products(z)
        gradient = energy.sums(products.imag)
        # The matrix acts on representations; a change of the angle is a multiple of i z.
        smooth = (w_cycle(energy.levels, 1j * z * gradient) * z.conj()).imag
        norm = gradient @ smooth
        beta = 0.0 if search is None else max(0.0, (norm - old_gradient @ smooth) / old_norm)
        search = -smooth if beta == 0 else beta * search - smooth
        if gradient @ search >= 0:
            search = -smooth
        old_gradient, old_norm = gradient, norm
        change = (search[energy.target] - search[energy.source]) ** 2
        bound = float(energy.weight @ change)
        if not bound > 0 or not norm > 0:
            break
        curvature = max(float(products.real @ change), MIN_CURVATURE_RATIO * bound)
        slope = -float(gradient @ search)
        for length in (slope / curvature, slope / bound):
            turned = z * np.exp(1j * length * search)
            new_value = energy.of(turned)
            if new_value <= value:
                break
        if new_value > value:
            break
        z, value = turned, new_value
        if np.abs(length * search).max() < ANGLE_TOLERANCE:
            break
    return z


def _eigenvectors(energy: FaceEnergy) -> np.ndarray:
    """Return up to `START_COUNT` eigenvectors of the energy with the least eigenvalues, as rows."""
    count = len(energy.area)
    dense = np.zeros((count, count), dtype=np.complex128)
    np.add.at(dense, (energy.matrix.row_indices, energy.matrix.indices), energy.matrix.data)
    root = np.sqrt(energy.area)
    _, vectors = np.linalg.eigh(dense / (root[:, None] * root))
    return (vectors[:, :START_COUNT] / root[:, None]).T

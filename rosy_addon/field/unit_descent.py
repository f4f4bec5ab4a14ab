"""Minimize the Dirichlet energy (`analysis.dirichlet_energy`) of a field of unit vectors on the faces.

The vectors are rotated to a local minimum by nonlinear conjugate gradients. On meshes of few faces, singularities are
moved across edges as well.
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..core.progress import report
from .analysis import edge_lengths
from .blocks import by_rows
from .connectivity import connected_components
from .representation import edge_unfolding, power, unit_complex
from .sparse_matrix import CSRMatrix, from_edges
from .sparse_multigrid import dense_inverse
from .surface import Surface

#: The descent stops when the last steps together reduce the energy by less than this fraction. With 1e-3, it takes up to a
#: fourth less time, and directions depend on rounding errors by up to 0.2 degrees.
LAST_STEPS, LEAST_GAIN, MAX_STEPS = 5, 1e-5, 300

#: Largest weight of an edge, relative to the median. Edges of slivers would make the matrix ill-conditioned.
MAX_WEIGHT_RATIO = 1e4

#: Upper limit for this median. Weights are near 1 on good meshes. If most faces are slivers, their weights would be so
#: large that the energies of all other edges would be rounding errors.
MAX_MEDIAN = 1e4

#: Smallest second derivative along the search direction, relative to the second derivative for a parallel field.
MIN_CURVATURE_RATIO = 0.1

#: With at most this number of faces, singularities are moved across edges, if this reduces the energy. This many edges are
#: tried: with 100, the energy was less in one of 24 cases.
FEW_FACES, MOVES_TRIED = 400, 30

#: Time for which the direction of a face is diffused, relative to the area. With 0.03, energies are equal on average.
TRANSPORT_TIME = 0.01

#: Values in place of `LEAST_GAIN`: for fields that are only compared, and to end exactly at the minimum.
CHOICE_GAIN, EXACT_GAIN = 1e-4, 1e-14

#: Gains whose difference is less than this fraction of the largest one count as equal.
EQUAL_GAIN = 1e-3

#: Another minimum is better if its energy is lower by more than this fraction of the energy plus 1. Less is a rounding
#: error.
MIN_GAIN = 1e-6

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
        """Return (I,) complex128: ``w conj(r z_f) z_g``, whose phase is the turn of z across the edge."""
        products = z.take(self.source)
        products *= self.transport
        np.conjugate(products, out=products)
        products *= z.take(self.target)
        products *= self.weight
        return products

    def of(self, z: np.ndarray) -> float:
        """Return the energy of (F,) representations of modulus 1."""
        return 2 * float((self.weight - self.products(z).real).sum())

    def of_components(self, z: np.ndarray, component: np.ndarray) -> np.ndarray:
        """Return the energy on each connected component, given the (F,) component of each face."""
        values = 2 * (self.weight - self.products(z).real)
        return np.bincount(component[self.target], values, int(component.max()) + 1)

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return (F,) sums of (I,) real values: added at the target of each edge, subtracted at its source."""
        count = len(self.area)
        return np.bincount(self.target, values, count) - np.bincount(self.source, values, count)

    @cached_property
    def diagonal(self) -> np.ndarray:
        """(F,) float64: the sum of the weights around each face; 1 where it is 0."""
        ends = np.concatenate([self.source, self.target])
        total = np.bincount(ends, np.tile(self.weight, 2), len(self.area))
        return np.where(total > 0, total, 1.0)

    @cached_property
    def component(self) -> np.ndarray:
        """(F,) int32: the connected component of each face."""
        return connected_components(len(self.area), np.stack([self.source, self.target], axis=1))

    @cached_property
    def edge_response(self) -> np.ndarray:
        """(I, F) float64: for each edge, the solution x of L x = (1 at its target, -1 at its source, 0 elsewhere).

        L is the Laplacian matrix of the graph of the faces, with the weights of the edges.
        """
        diagonal = self.diagonal * (1 + 1e-9)
        response = dense_inverse(from_edges(self.target, self.source, -self.weight, diagonal))
        return response[self.target] - response[self.source]

    def matrix(self, shift: float) -> CSRMatrix:
        """Return the (F, F) matrix A for which z* A z is the energy, plus `shift` times the areas on the diagonal."""
        diagonal = self.diagonal + shift * self.area
        return from_edges(self.target, self.source, -self.weight * self.transport, diagonal)


def face_energy(surface: Surface, degree: int, is_defined: np.ndarray) -> FaceEnergy:
    """Return the energy of fields of degree N that are defined on the given faces, (F,) bool."""
    halfedges = surface.edges.halfedges
    halfedges = halfedges[is_defined[surface.corner_face[halfedges]].all(axis=1)]
    a, b = halfedges.T
    length, distance = by_rows(partial(edge_lengths, surface), a, b)
    weight = np.divide(length, distance, out=np.zeros_like(length), where=distance > 0)
    largest = MAX_WEIGHT_RATIO * min(float(np.median(weight)), MAX_MEDIAN) if len(a) else 0.0
    weight = np.minimum(weight, largest)
    transport = power(by_rows(partial(edge_unfolding, surface), a, b), degree)
    area = surface.face_area
    area = np.maximum(area, 1e-12 * max(float(area.mean()), 1e-300))
    faces = surface.corner_face[halfedges]
    return FaceEnergy(*faces.T, weight, transport, area)


def least_of_few(energy: FaceEnergy, z: np.ndarray) -> np.ndarray:
    """Return the better of two local minima of the energy, for meshes of few faces.

    `with_moves` searches them from two starts. One is the given field z. The other is a vector on one face of each
    connected component, transported to all other faces by diffusion; the face is chosen for the least energy. On a
    frame with two holes (206 quads, degree 2), the second start reaches the least energy of 90 random starts. For the
    parameters, see `with_moves`.
    """
    shift = 1 / (TRANSPORT_TIME * float(energy.area.sum()))
    columns = unit_complex(dense_inverse(energy.matrix(shift)), otherwise=1)
    cosine = (
        columns[energy.target] * (energy.transport[:, None] * columns[energy.source]).conj()
    ).real
    part, value = energy.component, np.zeros((int(energy.component.max()) + 1, len(z)))
    np.add.at(value, part[energy.source], -energy.weight[:, None] * cosine)
    other = np.where(z == 0, 0, columns[np.arange(len(z)), value.argmin(axis=1)[part]])
    z, other = with_moves(energy, z), with_moves(energy, other)
    least = energy.of(z)
    return other if energy.of(other) < least - MIN_GAIN * (1 + least) else z


def with_moves(energy: FaceEnergy, z: np.ndarray) -> np.ndarray:
    """Descend to a local minimum, and move singularities across edges, one by one, while this reduces the energy.

    A singularity moves across an edge when 2 pi is added to or subtracted from the turn of z across the edge. After all
    other phases have adapted, the energy has changed, to second order, by ``4 pi w (pi (1 - w R) - |turn|)``. Here R is
    the effective resistance between the two faces, in the graph of the faces with the conductances w (Doyle and Snell
    1984). The edges at which the energy would decrease most are tried.

    This is for meshes of few faces: a dense matrix of the faces is inverted.

    Parameters
    ----------
    energy : FaceEnergy
    z : (F,) complex128 ndarray
        Representations of modulus 1; those that are 0 stay 0.
    """
    count, per_edge = len(z), energy.edge_response
    edges = np.arange(len(energy.weight))
    resistance = per_edge[edges, energy.target] - per_edge[edges, energy.source]
    barrier = np.pi * (1 - energy.weight * resistance)
    z = descend(energy, z, CHOICE_GAIN)
    least, improved = energy.of(z), count > 2
    while improved:
        improved = False
        turn = np.angle(energy.products(z))
        gain = energy.weight * (np.abs(turn) - barrier)
        # Rounded, the gains of mirror images are equal, and the first edge is tried first.
        rank = np.round(gain / (EQUAL_GAIN * max(float(np.abs(gain).max(initial=0)), 1e-300)))
        for edge in np.argsort(-rank, kind="stable")[:MOVES_TRIED].tolist():
            change = 2 * np.pi * np.sign(turn[edge]) * energy.weight[edge] * per_edge[edge]
            found = descend(energy, z * np.exp(1j * change), CHOICE_GAIN)
            value = energy.of(found)
            if value < least - MIN_GAIN * (1 + least):
                z, least, improved = found, value, True
                break
    return descend(energy, z, EXACT_GAIN)


def descend(energy: FaceEnergy, z: np.ndarray, tolerance: float = LEAST_GAIN) -> np.ndarray:
    """Rotate each representation until the energy is near a local minimum (Polak and Ribière 1969).

    Along a search direction, a Newton step is tried first. If it does not reduce the energy, a shorter step is taken,
    which always does: it replaces the second derivative by its upper bound, the second derivative for a parallel field.
    """
    search, old_gradient, old_norm = np.zeros(len(z)), np.zeros(len(z)), 1.0
    products, total = energy.products(z), energy.weight.sum()
    gains = [products.real.sum()]
    for step in range(MAX_STEPS):
        report(1 - 0.9**step, LABEL)
        gradient = energy.sums(products.imag)
        scaled = gradient / energy.diagonal
        norm = float(gradient @ scaled)
        search *= max(0.0, (norm - float(old_gradient @ scaled)) / old_norm)
        search -= scaled
        if gradient @ search >= 0:
            search = -scaled
        old_gradient, old_norm = gradient, norm
        change = search.take(energy.target) - search.take(energy.source)
        change *= change
        bound, slope = float(energy.weight @ change), -float(gradient @ search)
        if not bound > 0 or not slope > 0:
            break
        curvature = max(float(products.real @ change), MIN_CURVATURE_RATIO * bound)
        for length in (slope / curvature, slope / bound):
            angle = length * search
            turned = z * (np.cos(angle) + 1j * np.sin(angle))
            products = energy.products(turned)
            if products.real.sum() >= gains[-1]:
                z = turned
                break
        else:
            break
        gains.append(products.real.sum())
        if step >= LAST_STEPS and gains[-1] - gains[-1 - LAST_STEPS] < tolerance * (
            total - gains[-1] + 1e-6
        ):
            break
    return z

"""Compute the smoothest field of degree N (Knöppel, Crane, Pinkall and Schröder, SIGGRAPH 2013).

The eigenvector of the connection Laplacian of degree N that has the smallest eigenvalue is computed at the nodes, which
are the vertices (see `field.connection`), and transported to the faces. Then the energy of unit vectors is reduced.
Disconnected components of a mesh are solved separately.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..core.errors import RosyError
from ..core.memory import raise_mmap_threshold
from ..core.progress import progress, report
from .connection import Connection, build_connection, laplacian
from .free_rotation import freely_rotated
from .representation import complex_bincount, from_representation, unit_complex
from .rosy_field import RosyField, check_degree
from .sparse_multigrid import CSRMatrix, Level, hierarchy, w_cycle
from .surface import Surface
from .surface_averages import SurfaceAverages
from .unit_descent import DIFFUSION_TIMES, diffuse, face_energy, least_unit_field

#: The eigensolver stops when the eigenvector changes by less than this in an iteration (the sine of
#: an angle). With `TOLERANCE`, the energy has about eight correct digits. Meshes of up to
#: `SMALL_MESH_NODES` nodes use the smaller tolerance, so that the field does not depend on the
#: numbering of the vertices. On larger meshes, separating almost equal eigenvectors would take
#: seconds and make no visible difference.
TOLERANCE, SMALL_MESH_TOLERANCE, SMALL_MESH_NODES = 1e-4, 1e-8, 30_000
MAX_ITERATIONS = 60

#: The starts are computed on the finest multigrid level with at most this number of nodes.
START_NODES = 5_000


class Effort(NamedTuple):
    """How exactly the energy of unit vectors is minimized, on meshes of up to a number of nodes.

    Attributes
    ----------
    most_nodes : float
    eigenvector, diffusion : float
        Tolerances of the eigenvectors from which the descent starts, and of their diffusion.
    descent : float
        The descent ends when a step reduces the energy by less than this fraction.
    rounds : int
        How many times singularities are moved.
    """

    most_nodes: float
    eigenvector: float
    diffusion: float
    descent: float
    rounds: int


#: The first makes the field independent of the numbering, to 0.1 degrees, except where two minima are as good. In the
#: others, the gain of the last step is about what is left to gain: with 1e-4, energies were 0.02 to 0.06 % above those of
#: a descent to the end, and 0.03 % with 1e-3 on 200,000 faces: less than 0.1 %.
EFFORTS = (
    Effort(START_NODES, 1e-7, 1e-7, 1e-13, 8),
    Effort(SMALL_MESH_NODES, 1e-3, 1e-2, 1e-4, 1),
    Effort(np.inf, 1e-3, 1e-2, 1e-3, 0),
)

#: Number of eigenvectors that are starts. On a bumpy torus of 1,800
#: faces, the second one leads to 45 % less energy at degree 2. With five, the energy of ten fields was the same to 0.1 %,
#: except for one that was 1.5 % lower.
START_COUNT = 3

#: Largest number of iterations on each intermediate multigrid level. They save iterations on the finest
#: level.
COARSE_ITERATIONS = 12

#: Factor of the mass matrix that is added to the matrix for multigrid, in units of 4 pi / area.
SPECTRAL_SHIFT = 0.02


def smoothest_field(surface: Surface, degree: int) -> RosyField:
    """Compute the field of unit vectors with the least Dirichlet energy that is found.

    It starts from fields with little energy among all fields of the same L2 norm; see `field.unit_descent`.

    Parameters
    ----------
    surface : Surface
    degree : int
        N.

    Returns
    -------
    RosyField
        A field of magnitude 1; zero on faces without area. A rotation of the whole field does not change its
        energy; see `field.free_rotation`.

    Raises
    ------
    RosyError
        If no face has an area, or the degree is out of range.
    """
    degree = check_degree(degree)
    raise_mmap_threshold()
    connection = build_connection(surface)
    if not connection.mass.any():
        raise RosyError(f"{surface.name}: no face has an area")
    mass, component = connection.positive_mass, connection.component
    effort = next(each for each in EFFORTS if len(mass) <= each.most_nodes)
    with progress(0.1, 0.3):
        levels = hierarchy(laplacian(connection, degree, spectral_shift(mass)), SMALL_MESH_NODES)
    with progress(0.3, 0.6):
        starts = _starts(_eigenproblem(levels, mass, component), effort)
    del levels
    report(0.6, "averaging the field on the faces")
    x, y = surface.face_frames
    averages = SurfaceAverages(surface, connection, x, y)
    is_defined = (surface.face_area > 0) & x.any(axis=1)
    means = [unit_complex(averages.face_sums(z, degree), otherwise=1) for z in starts]
    with progress(0.6, 0.95):
        energy = face_energy(surface, degree, is_defined)
        means = [np.where(is_defined, mean, 0) for mean in means]
        z = least_unit_field(energy, means, effort.descent, effort.rounds)
    del connection, averages, energy  # they take as much memory as the rest needs
    report(0.95, "rotating the field")
    z = freely_rotated(surface, z, degree)
    return RosyField(degree, from_representation(z, x, y, degree))


def smallest_eigenvectors(connection: Connection, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Compute, on each connected component, the eigenvector of L z = e M z with the smallest eigenvalue e.

    L is the connection Laplacian of this degree, and M the mass matrix.

    Returns
    -------
    z : (n,) complex128 ndarray
        Values of the eigenvectors at the nodes; z* M z is 1 on each component.
    energy : (components,) float64 ndarray
        The eigenvalues e.
    """
    mass = connection.positive_mass
    shift = spectral_shift(mass)
    z, energy = eigenproblem(laplacian(connection, degree, shift), mass, connection.component)
    return z, energy - shift


def spectral_shift(mass: np.ndarray) -> float:
    """Return the factor s for which multigrid converges well for A + s M, where A is the matrix of an energy.

    M is the mass matrix: the diagonal matrix of the masses of the nodes.
    """
    return SPECTRAL_SHIFT * 4 * np.pi / float(mass.sum())


def eigenproblem(
    matrix: CSRMatrix, mass: np.ndarray, component: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute, on each connected component, the eigenvector of A z = e M z with the smallest eigenvalue e.

    Parameters
    ----------
    matrix : (n, n) CSRMatrix
        A + s M, where A is Hermitian and s is the result of `spectral_shift`.
    mass : (n,) float64 ndarray
        The diagonal of M.
    component : (n,) int32 ndarray
        Connected component of each node.

    Returns
    -------
    z : (n,) complex128 ndarray
        Values of the eigenvectors at the nodes; z* M z is 1 on each component.
    energy : (components,) float64 ndarray
        The eigenvalues e.
    """
    with progress(0.0, 0.35):
        levels = hierarchy(matrix)
    tolerance = TOLERANCE if len(matrix) > SMALL_MESH_NODES else SMALL_MESH_TOLERANCE
    with progress(0.35, 1.0):
        vectors, energy = _eigenvectors(_eigenproblem(levels, mass, component), tolerance)
    return vectors[0], energy


class _Eigenproblem(NamedTuple):
    """An `eigenproblem` on the levels of a multigrid hierarchy, from the finest to the coarsest.

    Attributes
    ----------
    levels : list of Level
    masses, components : list of (n,) ndarray
        Mass and connected component of each unknown of each level.
    """

    levels: list[Level]
    masses: list[np.ndarray]
    components: list[np.ndarray]

    def below(self, index: int) -> _Eigenproblem:
        """Return the problem whose finest level has the given index here."""
        return _Eigenproblem(*(each[index:] for each in self))

    def diffused(self, z: np.ndarray, times: Sequence[float], tolerance: float) -> np.ndarray:
        """Return (n,) representations on the finest level, diffused; see `unit_descent.diffuse`."""
        mass, component = self.masses[0], self.components[0]
        area = np.bincount(component, mass)[component]
        return diffuse(self.levels, mass, area, z, times, tolerance)


def _eigenproblem(levels: list[Level], mass: np.ndarray, component: np.ndarray) -> _Eigenproblem:
    """Return the problem, given the mass and the connected component of each unknown of the finest level."""
    masses, components = [mass], [component]
    for level in levels[:-1]:
        p = level.prolongation
        terms = masses[-1][p.row_indices] * np.abs(p.data)
        masses.append(np.bincount(p.indices, terms, p.column_count))
        coarse_component = np.zeros(p.column_count, dtype=component.dtype)
        coarse_component[p.indices] = components[-1][p.row_indices]
        components.append(coarse_component)
    return _Eigenproblem(levels, masses, components)


def _starts(problem: _Eigenproblem, effort: Effort) -> list[np.ndarray]:
    """Return representations of modulus 1 at n nodes from which the descent starts.

    They are the eigenvectors with the least eigenvalues, diffused. On meshes with more than `START_NODES` nodes there is
    only one: of the eigenvectors on a coarse level, on each connected component the one with the least energy when it is
    diffused. It is interpolated to the nodes, and diffused on the way.
    """
    is_small = [len(level.matrix) <= START_NODES for level in problem.levels]
    first = is_small.index(True) if is_small[-1] else len(is_small) - 1
    coarse = problem.below(first)
    eigenvectors: list[list[np.ndarray]] = []
    starts = []
    for index in range(START_COUNT):
        with progress(index / START_COUNT, (index + 1) / START_COUNT):
            vectors, _ = _eigenvectors(coarse, effort.eigenvector, eigenvectors)
            eigenvectors.append(vectors)
            starts.append(coarse.diffused(vectors[0], DIFFUSION_TIMES, effort.diffusion))
    if first == 0:
        return starts
    products = _ComponentProducts(coarse.masses[0], coarse.components[0])
    energies = [products.sums(z.conj() * (coarse.levels[0].matrix @ z)).real for z in starts]
    z = np.choose(np.argmin(energies, axis=0)[coarse.components[0]], starts)
    for index in reversed(range(first)):
        z = unit_complex(problem.levels[index].prolongation @ z)
        if index:
            z = problem.below(index).diffused(z, DIFFUSION_TIMES[-1:], effort.diffusion)
    return [z]


def _eigenvectors(
    problem: _Eigenproblem, tolerance: float, others: Sequence[list[np.ndarray]] = ()
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the eigenvectors of `eigenproblem` on all levels, and the eigenvalues on the finest.

    Parameters
    ----------
    problem : _Eigenproblem
    tolerance : float
        See `_lobpcg`.
    others : sequence of list
        Earlier results, with smaller eigenvalues. The new eigenvectors are orthogonal to these.
    """
    levels, masses, components = problem
    random = np.random.default_rng(0)
    count = len(masses[-1])
    z = random.standard_normal(count) + 1j * random.standard_normal(count)
    vectors: list[np.ndarray] = []
    for index in reversed(range(len(levels))):
        is_between = 0 < index < len(levels) - 1
        max_iterations = COARSE_ITERATIONS if is_between else MAX_ITERATIONS
        start = 0.3 - 0.3 * index / len(levels)
        with progress(start, start + 0.3 / len(levels) if index else 1.0):
            known = [other[index] for other in others]
            parts = levels[index:], masses[index], components[index]
            z, energy = _lobpcg(*parts, z, tolerance, max_iterations, known)
        vectors.insert(0, z)
        if index:
            z = levels[index - 1].prolongation @ z
    return vectors, energy


def _lobpcg(
    levels: list[Level],
    mass: np.ndarray,
    component: np.ndarray,
    z: np.ndarray,
    tolerance: float,
    max_iterations: int,
    known: Sequence[np.ndarray] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """Minimize the Rayleigh quotient on each connected component by LOBPCG (Knyazev 2001).

    Parameters
    ----------
    levels : list of Level
        Multigrid levels. The first holds the matrix; a W-cycle over all of them is the preconditioner.
    mass : (n,) float64 ndarray
        Masses of the nodes.
    component : (n,) int32 ndarray
        Connected component of each node.
    z : (n,) complex128 ndarray
        The initial vector.
    tolerance : float
        Change of the vector in an iteration, a sine of an angle, at which the iteration stops.
    max_iterations : int
    known : sequence of (n,) complex128 ndarray
        Orthonormal vectors to which the result is orthogonal on each component: eigenvectors found before.

    Returns
    -------
    z : (n,) complex128 ndarray
        The vector with the least Rayleigh quotients.
    energy : (components,) float64 ndarray
        Its Rayleigh quotient on each component.
    """
    matrix, products = levels[0].matrix, _ComponentProducts(mass, component)
    # Each vector is stored as a pair with its image: the product of the matrix and the vector.
    z = products.without(known, z)
    current = products.normalize(np.stack([z, matrix @ z]))
    previous_step: list[np.ndarray] = []
    energy = products.sums(current[0].conj() * current[1]).real
    for iteration in range(max_iterations):
        # The progress bar is scaled for 20 to 50 iterations, the usual number.
        report(1 - 0.95**iteration, "solving for the smoothest field")
        z, image = current
        direction = w_cycle(levels, image - products.at_nodes(energy) * (mass * z))
        direction = products.without([*known, z], direction)
        search = products.normalize(np.stack([direction, matrix @ direction]))
        basis = [current, search, *previous_step]
        vectors, images = zip(*basis, strict=True)
        coefficients, energy = _rayleigh_ritz(
            products.gram_matrices(vectors, images),
            products.gram_matrices(vectors, [mass * vector for vector in vectors]),
        )
        step = products.combine(basis[1:], coefficients[:, 1:])
        change = products.norms(step[0]).max()
        kept = np.stack([coefficients[:, 0], np.ones(len(energy))], axis=1)
        current = products.normalize(products.combine([current, step], kept))
        previous_step = [products.normalize(step)]
        if change < tolerance:
            break
    return current[0], energy


class _ComponentProducts:
    """Inner products and linear combinations of vectors, separately on each connected component.

    Some methods take a *pair*: a (2, n) array of a vector and its image, which is the product of the matrix
    and the vector.
    """

    def __init__(self, mass: np.ndarray, component: np.ndarray) -> None:
        self._mass, self._component = mass, component
        self._count = int(component.max()) + 1

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return (components,) sums of (n,) values over the nodes of each component."""
        return _component_sums(self._component, values, self._count)

    def at_nodes(self, values: np.ndarray) -> np.ndarray:
        """Return (n,) values at the nodes, given one value for each component."""
        return values[self._component] if self._count > 1 else values

    def norms(self, vector: np.ndarray) -> np.ndarray:
        """Return (components,) norms of an (n,) vector on each component, weighted by the masses."""
        return np.sqrt(self.sums(self._mass * (vector.real**2 + vector.imag**2)).real)

    def without(self, known: Sequence[np.ndarray], vector: np.ndarray) -> np.ndarray:
        """Return the part of a vector that is orthogonal to known orthonormal vectors, on each component."""
        for each in known:
            overlap = self.sums(self._mass * (each.conj() * vector))
            vector = vector - self.at_nodes(overlap) * each
        return vector

    def normalize(self, pair: np.ndarray) -> np.ndarray:
        """Divide a pair in place by the norm of the vector, on each component, and return it.

        See `norms`. A component on which the norm is 0 stays 0.
        """
        norm = self.norms(pair[0])
        pair *= self.at_nodes(1 / np.where(norm > 0, norm, 1))
        return pair

    def combine(self, pairs: list[np.ndarray], coefficients: np.ndarray) -> np.ndarray:
        """Return a linear combination of k pairs, as a new pair; `coefficients` is (components, k)."""
        total = pairs[0] * self.at_nodes(coefficients[:, 0])
        for index, pair in enumerate(pairs[1:], 1):
            total += pair * self.at_nodes(coefficients[:, index])
        return total

    def gram_matrices(self, a: Sequence[np.ndarray], b: Sequence[np.ndarray]) -> np.ndarray:
        """Return (components, k, k) inner products a_i* b_j on each component: Hermitian matrices.

        The vectors a and b must be such that these matrices are Hermitian: only one triangle is computed.
        """
        gram = np.empty((self._count, len(a), len(b)), dtype=np.complex128)
        for i, vector in enumerate(a):
            conjugate = vector.conj()
            for j in range(i, len(b)):
                gram[:, i, j] = self.sums(conjugate * b[j])
                gram[:, j, i] = gram[:, i, j].conj()
        return gram


def _rayleigh_ritz(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solve small generalized eigenproblems A x = e B x, one for each component, for the smallest e.

    Directions in which B is nearly singular are excluded.

    Parameters
    ----------
    a, b : (components, k, k) complex128 ndarray
        The Hermitian matrices A and B.

    Returns
    -------
    coefficients : (components, k) complex128 ndarray
        Eigenvectors x, with a real first coefficient.
    energy : (components,) float64 ndarray
        Eigenvalues e.
    """
    eigenvalue, basis = np.linalg.eigh(b)
    usable = eigenvalue > 1e-10 * eigenvalue[:, -1:]
    scale = np.where(usable, 1 / np.sqrt(np.where(usable, eigenvalue, 1)), 0)
    whitening = basis * scale[:, None, :]
    reduced = whitening.conj().swapaxes(1, 2) @ a @ whitening
    penalty = np.abs(reduced).max(axis=(1, 2)) * 10 + 1
    reduced += np.einsum("pk,kl->pkl", np.where(usable, 0, penalty[:, None]), np.eye(a.shape[1]))
    energy, eigenvectors = np.linalg.eigh(reduced)
    coefficients = (whitening @ eigenvectors[:, :, :1])[:, :, 0]
    # Make the coefficient of the current vector real and positive, so that the change of the vector in an
    # iteration measures convergence.
    phase = np.where(coefficients[:, 0] == 0, 1, coefficients[:, 0])
    return coefficients * (np.abs(phase) / phase)[:, None], energy[:, 0]


def _component_sums(component: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Return (count,) complex128 sums of (n,) values over the nodes of each component."""
    if count == 1:
        return np.array([values.sum()], dtype=np.complex128)
    return complex_bincount(component, values, count)

"""Compute the smoothest field of degree N: of several local minima of the Dirichlet energy, the least one.

The energy is a sum over the edges between faces (`unit_descent.FaceEnergy`). The eigenvector with its smallest
eigenvalue minimizes it among all fields of the same L2 norm (Knöppel, Crane, Pinkall and Schröder, SIGGRAPH 2013).
But in regions where the eigenvector is short, its directions hardly change the energy. For unit vectors, the energy
has many local minima, so the search has several starts:

1. On a coarse multigrid level, compute some eigenvectors with small eigenvalues.
2. Diffuse each of them over shorter and shorter distances, and normalize the vectors after each step (Merriman, Bence
   and Osher 1992; for crosses, Viertel and Osting 2019). This moves singularities and cancels pairs.
3. Rotate the vectors to a local minimum of the energy (`unit_descent.descend`).
4. On each finer level, repeat steps 2 and 3 over shorter distances with the fields of least energy. The finer the
   level, the fewer fields are kept.

Eigenvectors of a torus have zeros, and lead to fields with singularities. So on closed components that are tori, the
field without singularities that turns least is another start.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from ..core.errors import RosyError
from ..core.memory import raise_mmap_threshold
from ..core.progress import progress, report
from .conjugate_gradient import conjugate_gradient
from .face_graph import face_graph
from .free_rotation import freely_rotated
from .representation import complex_bincount, from_representation, is_tie, unit_complex
from .rosy_field import RosyField, check_degree
from .sparse_matrix import CSRMatrix
from .sparse_multigrid import Level, hierarchy, w_cycle
from .surface import Surface
from .turning_angles import turning_angles
from .unit_descent import CHOICE_GAIN, FEW_FACES, FaceEnergy, descend, face_energy, least_of_few

#: The eigensolver stops when the eigenvector changes by less than this in an iteration (the sine of an angle), so that the
#: field does not depend on the random numbers from which it starts.
TOLERANCE = 1e-10
MAX_ITERATIONS = 100

#: Largest number of iterations on each intermediate multigrid level. They save iterations on the finest
#: level.
COARSE_ITERATIONS = 12

#: Number of eigenvectors from which the search starts, on the finest multigrid level with at most this number of unknowns.
#: With four, energies are 0.5 % higher on average of 21 meshes and 4 degrees; with twelve, they are equal, and the time on
#: small meshes is 1.3 times as long.
START_COUNT, START_UNKNOWNS = 8, 500

#: Largest total number of unknowns of the fields that are kept for a finer level; at least one field is kept. The field
#: of least energy on a coarse level is often not the best one on the finest level: if only one is kept, energies are
#: 1 % higher on average, and a third higher on one mesh. With 20,000 unknowns, energies are equal.
CANDIDATE_UNKNOWNS = 12_000

#: Energies above the least one by at most this fraction count as equal; the field of the earlier eigenvector is then
#: preferred.
EQUAL_ENERGY = 1e-3

#: On a torus, the field without singularities is taken if its energy is lower by more than this fraction.
LESS_ENERGY = 1e-3

#: Gradient of the energy at a face, relative to the sum of the weights there, below which it is a rounding error.
#: Standard deviation of the random angles, in radians, that are added at a saddle point.
SADDLE_GRADIENT, SADDLE_NUDGE = 1e-6, 0.1

#: Diffusion times of the starts, relative to the area of the connected component, and on each finer level, relative to the
#: mean area of its unknowns.
START_TIMES, LEVEL_TIMES = (0.1, 0.03, 0.01, 0.003), (8.0, 4.0, 2.0, 1.0)

#: Residual of the linear solver, relative to the right-hand side. With 1e-2, energies are 0.5 % higher on average.
DIFFUSION_TOLERANCE = 5e-2

#: Factor of the mass matrix that is added to the matrix for multigrid, in units of 4 pi / area.
SPECTRAL_SHIFT = 0.02

LABEL = "diffusing the field"


def smoothest_field(surface: Surface, degree: int) -> RosyField:
    """Compute the field of unit vectors with the least Dirichlet energy, of several local minima.

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
    x, y = surface.face_frames
    is_defined = (surface.face_area > 0) & x.any(axis=1)
    if not is_defined.any():
        raise RosyError(f"{surface.name}: no face has an area")
    energy = face_energy(surface, degree, is_defined)
    mass = energy.area
    with progress(0.1, 0.4):
        levels = hierarchy(energy.matrix(spectral_shift(mass)))
    with progress(0.4, 0.8):
        z = _diffused_eigenvector(_eigenproblem(levels, mass, energy.component))
    del levels
    with progress(0.8, 0.95):
        z = np.where(is_defined, z, 0)
        z = least_of_few(energy, z) if len(z) <= FEW_FACES else descend(energy, z)
        z = _with_smooth_tori(surface, degree, energy, z)
    report(0.95, "rotating the field")
    z = freely_rotated(surface, z, degree)
    return RosyField(degree, from_representation(z, x, y, degree))


def _with_smooth_tori(
    surface: Surface, degree: int, energy: FaceEnergy, z: np.ndarray
) -> np.ndarray:
    """Return (F,) representations z, replaced on tori by a field without singularities if it has less energy.

    Tori are the closed components of Euler characteristic 0.
    """
    component = energy.component
    corner_component, count = component[surface.corner_face], int(component.max()) + 1
    vertex_component = np.zeros(len(surface.vertices), dtype=component.dtype)
    vertex_component[surface.corner_vertex] = corner_component
    elements = vertex_component[surface.used_vertices], component[energy.source], component
    vertices, edges, faces = (np.bincount(each, minlength=count) for each in elements)
    is_closed = np.bincount(corner_component, minlength=count) == 2 * edges
    on_torus = (is_closed & (vertices - edges + faces == 0))[component]
    if not on_torus.any():
        return z
    graph = face_graph(surface, on_torus)
    _, direction = turning_angles(graph, degree, -graph.defect)
    smooth = descend(energy, np.where(on_torus, np.exp(1j * degree * direction), z))
    energies = [energy.of_components(each, component) for each in (smooth, z)]
    is_less = energies[0] < (1 - LESS_ENERGY) * energies[1]
    return np.where(on_torus & is_less[component], smooth, z)


def spectral_shift(mass: np.ndarray) -> float:
    """Return the factor s for which multigrid converges well for A + s M, where A is the matrix of an energy.

    M is the mass matrix: the diagonal matrix of the masses of the nodes.
    """
    return SPECTRAL_SHIFT * 4 * np.pi / float(mass.sum())


def eigenproblem(
    matrix: CSRMatrix, mass: np.ndarray, component: np.ndarray, tolerance: float = TOLERANCE
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
    tolerance : float
        Change of the vector in an iteration at which the iteration stops, as the sine of an angle. With 1e-4, the
        eigenvalue has about eight correct digits.

    Returns
    -------
    z : (n,) complex128 ndarray
        Values of the eigenvectors at the nodes; z* M z is 1 on each component.
    energy : (components,) float64 ndarray
        The eigenvalues e.
    """
    with progress(0.0, 0.35):
        levels = hierarchy(matrix)
    with progress(0.35, 1.0):
        problem = _eigenproblem(levels, mass, component)
        return _eigenvector(problem, tolerance)


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
        """Return the same problem without the levels that are finer than level `index`."""
        return _Eigenproblem(*(each[index:] for each in self))

    def energy(self) -> FaceEnergy:
        """Return the quadratic form of the matrix of the finest level, up to a constant, for values of modulus 1."""
        matrix = self.levels[0].matrix
        entry = np.flatnonzero((matrix.indices < matrix.row_indices) & (matrix.data != 0))
        value = matrix.data[entry]
        weight = np.abs(value)
        ends = matrix.indices[entry], matrix.row_indices[entry]
        return FaceEnergy(*ends, weight, -value / weight, self.masses[0])

    def least_eigenvectors(self, count: int) -> np.ndarray:
        """Return (count, n) vectors: row k is the eigenvector k, by ascending eigenvalue, of each connected component.

        They are computed with dense matrices, on the finest level. If a component has fewer unknowns than `count`,
        its first eigenvector is repeated in the other rows.
        """
        mass, component = self.masses[0], self.components[0]
        vectors = np.empty((count, len(mass)), dtype=np.complex128)
        parts = np.split(
            np.argsort(component, kind="stable"), np.cumsum(np.bincount(component))[:-1]
        )
        for part in parts:
            report(0.0, LABEL)
            scale = 1 / np.sqrt(mass[part])
            matrix = self.levels[0].matrix.rows(part).columns(part).dense()
            eigenvectors = np.linalg.eigh(scale[:, None] * matrix * scale)[1]
            column = np.where(np.arange(count) < len(part), np.arange(count), 0)
            vectors[:, part] = (scale[:, None] * eigenvectors[:, column]).T
        return vectors

    def diffused(self, z: np.ndarray, times: Sequence[float]) -> np.ndarray:
        """Diffuse (n,) representations on the finest level by each of the times in turn, and normalize after each.

        Times are relative to the area of the connected component.
        """
        mass, component, z = self.masses[0], self.components[0], unit_complex(z, otherwise=1)
        area = np.bincount(component, mass)[component]
        for index, time in enumerate(times):
            rate = mass / (time * area)
            matrix = self.levels[0].matrix.plus_diagonal(rate)
            scale = partial(np.multiply, 1 / matrix.diagonal)
            with progress(index / len(times), (index + 1) / len(times)):
                z = conjugate_gradient(matrix, rate * z, DIFFUSION_TOLERANCE, scale, LABEL, z)
            z = unit_complex(z, otherwise=1)
        return z

    def least_fields(
        self, fields: list[np.ndarray], times: Sequence[float], count: int
    ) -> list[np.ndarray]:
        """Diffuse some fields, (n,) representations, and minimize their energy. Return those with the least energy.

        At most `count` fields are returned, but at least one. Connected components are sorted independently: the first
        result combines the best fields of all components, the second one the second best, and so on.
        """
        energy, component, random = self.energy(), self.components[0], np.random.default_rng(0)
        found = []
        for index, z in enumerate(fields):
            with progress(index / len(fields), (index + 1) / len(fields)):
                z = self.diffused(z, times)
                if _is_at_saddle(energy, z):
                    z = z * np.exp(1j * SADDLE_NUDGE * random.standard_normal(len(z)))
                found.append(descend(energy, z, CHOICE_GAIN))
        energies = np.stack([energy.of_components(z, component) for z in found])
        energies = np.maximum(energies, (1 + EQUAL_ENERGY) * energies.min(axis=0))
        order = np.argsort(energies, axis=0, kind="stable")
        fields = np.take_along_axis(np.stack(found), order[:, component], axis=0)
        return list(fields[: max(count, 1)])


def _eigenproblem(levels: list[Level], mass: np.ndarray, component: np.ndarray) -> _Eigenproblem:
    """Return the eigenproblem on all levels, given the mass and the component of each unknown of the finest level."""
    masses, components = [mass], [component]
    for level in levels[:-1]:
        p = level.prolongation
        terms = masses[-1][p.row_indices] * np.abs(p.data)
        masses.append(np.bincount(p.indices, terms, p.column_count))
        coarse_component = np.zeros(p.column_count, dtype=component.dtype)
        coarse_component[p.indices] = components[-1][p.row_indices]
        components.append(coarse_component)
    return _Eigenproblem(levels, masses, components)


def _diffused_eigenvector(problem: _Eigenproblem) -> np.ndarray:
    """Return (n,) representations of modulus 1 with a low energy, found from several eigenvectors.

    This is the search that the module describes. It starts on the finest level with at most `START_UNKNOWNS` unknowns.
    When the number of unknowns doubles from level to level, half as many fields are kept, so all levels take about the
    same time.
    """
    sizes = [len(mass) for mass in problem.masses]
    first = next(
        (index for index, size in enumerate(sizes) if size <= START_UNKNOWNS), len(sizes) - 1
    )
    fields = list(problem.below(first).least_eigenvectors(START_COUNT))
    for index in reversed(range(first + 1)):
        level = problem.below(index)
        times = [time / sizes[index] for time in LEVEL_TIMES] if index < first else START_TIMES
        with progress(1 - (index + 1) / (first + 1), 1 - index / (first + 1)):
            count = CANDIDATE_UNKNOWNS // sizes[max(index - 1, 0)]
            fields = level.least_fields(fields, times, count)
        if index:
            fields = [problem.levels[index - 1].prolongation @ z for z in fields]
    return fields[0]


def _is_at_saddle(energy: FaceEnergy, z: np.ndarray) -> bool:
    """Return whether (n,) representations are a saddle point: the gradient is 0, and the phase across an edge is pi.

    On some solids, the phases of eigenvectors differ by exactly pi across edges. The energy of such an edge is at its
    maximum, but a descent along the gradient would not leave it.
    """
    products = energy.products(z)
    has_gradient = np.abs(energy.sums(products.imag)) > SADDLE_GRADIENT * energy.diagonal
    return bool(is_tie(np.angle(products)).any() and not has_gradient.any())


def _eigenvector(problem: _Eigenproblem, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Solve an `eigenproblem` on each level, starting from the interpolated solution of the next coarser one."""
    levels, masses, components = problem
    random = np.random.default_rng(0)
    count = len(masses[-1])
    z = random.standard_normal(count) + 1j * random.standard_normal(count)
    for index in reversed(range(len(levels))):
        is_between = 0 < index < len(levels) - 1
        max_iterations = COARSE_ITERATIONS if is_between else MAX_ITERATIONS
        start = 0.3 - 0.3 * index / len(levels)
        with progress(start, start + 0.3 / len(levels) if index else 1.0):
            parts = levels[index:], masses[index], components[index]
            z, energy = _lobpcg(*parts, z, max_iterations, tolerance)
        if index:
            z = levels[index - 1].prolongation @ z
    return z, energy


def _lobpcg(
    levels: list[Level],
    mass: np.ndarray,
    component: np.ndarray,
    z: np.ndarray,
    max_iterations: int,
    tolerance: float,
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
    max_iterations : int
    tolerance : float
        Change of the vector in an iteration at which the iteration stops, as the sine of an angle.

    Returns
    -------
    z : (n,) complex128 ndarray
        The vector with the least Rayleigh quotients.
    energy : (components,) float64 ndarray
        Its Rayleigh quotient on each component.
    """
    matrix, products = levels[0].matrix, _ComponentProducts(mass, component)
    # Each vector is stored as a pair with its image: the product of the matrix and the vector.
    current = products.normalize(np.stack([z, matrix @ z]))
    previous_step: list[np.ndarray] = []
    energy = products.sums(current[0].conj() * current[1]).real
    for iteration in range(max_iterations):
        # The progress bar is scaled for 20 to 50 iterations, the usual number.
        report(1 - 0.95**iteration, "solving for the smoothest field")
        z, image = current
        direction = w_cycle(levels, image - products.at_nodes(energy) * (mass * z))
        direction = products.without(z, direction)
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

    def without(self, known: np.ndarray, vector: np.ndarray) -> np.ndarray:
        """Return the part of a vector that is orthogonal to a known vector of norm 1, on each component."""
        overlap = self.sums(self._mass * (known.conj() * vector))
        return vector - self.at_nodes(overlap) * known

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

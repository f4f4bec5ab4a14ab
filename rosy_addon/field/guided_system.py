"""Smooth fields that follow guides, and the linear system that computes them.

A *guide* is a member vector on a face that the field should follow. The field minimizes its Dirichlet
energy plus a penalty for the difference from the guides (Knöppel, Crane, Pinkall and Schröder, SIGGRAPH
2013, section 4). The weight of the penalty may vary between faces. *Hard* guides are constraints instead of
penalties: the field follows them exactly.

The system of a surface can be reused when its guides change, because guides only add to the diagonal of the
matrix.
"""

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ..core.errors import RosyError
from ..core.memory import raise_mmap_threshold
from ..core.progress import progress, report
from .blocks import mask
from .conjugate_gradient import RELATIVE_TOLERANCE, conjugate_gradient
from .connection import build_connection, laplacian
from .representation import complex_bincount, from_representation, to_representation, unit_complex
from .rosy_field import RosyField, check_degree
from .smoothest import smoothest_field
from .sparse_matrix import CSRMatrix
from .sparse_multigrid import Level, add_diagonal, hierarchy, w_cycle
from .surface import Surface
from .surface_averages import SurfaceAverages

#: Residual norm at which `GuidedSystem.solve_near` stops, relative to the norm of the right-hand side.
NEAR_TOLERANCE = 1e-4

#: Guides of at least this firmness (see `firmness_weights`) are followed exactly. It is less than 1 because
#: stored guides are rounded.
EXACT_FIRMNESS = 1 - 1e-4

#: Added to the diagonal of the Laplacian, relative to it, so that the system is regular on connected
#: components without a guide.
REGULAR_SHIFT = 1e-12


@dataclass(frozen=True, eq=False)
class NodeGuides:
    """Guides of a field at the n nodes, in the form in which they enter the linear system.

    Attributes
    ----------
    penalty : (n,) float64 ndarray
        Sum of the weights of the guides around each node.
    rhs : (n,) complex128 ndarray
        Sum of the representations of these guides times their weights.
    is_fixed : (n,) bool ndarray
        Whether the value at the node is given by hard guides, which are followed exactly.
    fixed : (n,) complex128 ndarray
        The given representations, of modulus 1, at fixed nodes; 0 at all other nodes.
    """

    penalty: np.ndarray
    rhs: np.ndarray
    is_fixed: np.ndarray
    fixed: np.ndarray


@dataclass(frozen=True, eq=False)
class GuidedSystem:
    """The linear system for guided fields of one degree on a surface, without the guides.

    It has n unknowns: representations at the nodes, which are the vertices (see `field.connection`).

    Attributes
    ----------
    surface : Surface
    degree : int
        N.
    averages : SurfaceAverages
        Averages between faces and nodes, in the frames `Surface.face_frames`.
    laplacian : (n, n) CSRMatrix
        The connection Laplacian.
    levels : list of Level
        Multigrid levels of `laplacian`; empty until `solve` is called the first time.
    """

    surface: Surface
    degree: int
    averages: SurfaceAverages
    laplacian: CSRMatrix
    levels: list[Level] = field(default_factory=list)

    def to_representation(self, vectors: np.ndarray) -> np.ndarray:
        """Convert (F, 3) member vectors to (F,) representations in the frames of the faces."""
        return to_representation(vectors, self.averages.x, self.averages.y, self.degree)

    def to_vectors(self, z: np.ndarray) -> np.ndarray:
        """Convert (F,) representations in the frames of the faces to (F, 3) member vectors."""
        return from_representation(z, self.averages.x, self.averages.y, self.degree)

    def node_guides(
        self,
        target: np.ndarray,
        weight: np.ndarray,
        is_hard: np.ndarray,
        corner: np.ndarray | slice = slice(None),
    ) -> NodeGuides:
        """Return guides at the nodes, given guides on the faces.

        Parameters
        ----------
        target : (F,) complex128 ndarray
            Representations of the guides in the frames of the faces; 0 on faces without a guide.
        weight : (F,) float64 ndarray
            Weights of the guides, in units of 1 / area.
        is_hard : (F,) bool ndarray
            Faces whose guides are followed exactly.
        corner : (m,) int ndarray or slice
            Corners of triangles that are included; all by default. A node gets the value 0 if none of its
            corners is included.
        """
        sums = self.averages.node_sums
        penalty = sums(weight, 0, corner)
        rhs = sums(weight * target, self.degree, corner)
        # Nodes of faces with hard guides are fixed at the mean guide, unless the guides cancel.
        fixed = sums(is_hard * target, self.degree, corner)
        is_fixed = np.abs(fixed) > 1e-6 * sums(is_hard * np.abs(target), 0, corner)
        return NodeGuides(penalty, rhs, is_fixed, unit_complex(np.where(is_fixed, fixed, 0)))

    def solve(
        self,
        guides: NodeGuides,
        start: np.ndarray | None = None,
        tolerance: float = RELATIVE_TOLERANCE,
    ) -> np.ndarray:
        """Solve the linear system: return the field that follows the guides, as representations at the nodes.

        Parameters
        ----------
        guides : NodeGuides
        start : (n,) complex128 ndarray, optional
            Estimate from which the iteration starts; 0 by default.
        tolerance : float
            Residual norm at which the solver stops, relative to the norm of the right-hand side.

        Returns
        -------
        (n,) complex128 ndarray
        """
        label = "interpolating between the guides"
        if not self.levels:
            with progress(0.0, 0.5, label):
                self.levels.extend(hierarchy(self.laplacian))
        # Fixed nodes have a large diagonal in the preconditioner, so that it hardly changes them.
        diagonal = np.where(guides.is_fixed, self.laplacian.diagonal, guides.penalty)
        report(0.5, label)
        levels = add_diagonal(self.levels, diagonal)
        start = guides.fixed if start is None else np.where(guides.is_fixed, guides.fixed, start)
        matrix, cycle, is_fixed = levels[0].matrix, partial(w_cycle, levels), guides.is_fixed
        with progress(0.5, 1.0, label):
            return conjugate_gradient(matrix, guides.rhs, tolerance, cycle, label, start, is_fixed)

    def solve_near(
        self, guides: NodeGuides, z: np.ndarray, nodes: np.ndarray, max_iterations: int
    ) -> np.ndarray:
        """Solve the linear system for some of the nodes, with the values at all other nodes held fixed.

        Parameters
        ----------
        guides : NodeGuides
        z : (n,) complex128 ndarray
            Approximate solution at all nodes. The iteration starts from it.
        nodes : (m,) int ndarray
            The nodes to solve for, without duplicates.
        max_iterations : int
            Number of iterations after which the solver stops.

        Returns
        -------
        (m,) complex128 ndarray
            The new values at these nodes.
        """
        z = np.where(guides.is_fixed, guides.fixed, z)
        start = z[nodes]
        z[nodes] = 0
        rows = self.laplacian.rows(nodes)
        matrix = rows.columns(nodes).plus_diagonal(guides.penalty[nodes])
        rhs, scale = guides.rhs[nodes] - rows @ z, partial(np.multiply, 1 / matrix.diagonal)
        limits = {"is_fixed": guides.is_fixed[nodes], "max_iterations": max_iterations}
        return conjugate_gradient(matrix, rhs, NEAR_TOLERANCE, scale, start=start, **limits)

    def face_representations_at(self, z: np.ndarray, face: np.ndarray) -> np.ndarray:
        """Return (m,) complex128 sums of the values z at the corners of the given faces, weighted by area.

        z holds (n,) representations at the nodes. The sums are in the frames of the faces.
        """
        corner, averages = self._corners_of_faces(face), self.averages
        connection, corner_face = averages.connection, averages.corner_face[corner]
        value = z[connection.corner_node[corner]] * connection.corner_area[corner]
        value *= np.exp(1j * self.degree * averages.frame_angle[corner])
        return complex_bincount(corner_face, value, self.surface.face_count)[face]

    def neighbor_means(self, values: np.ndarray, face: np.ndarray) -> np.ndarray:
        """Return (m,) complex128 means of (F,) representations: on each given face, over the faces around it.

        The face itself and all faces that share a node with it are included, weighted by area.
        """
        averages = self.averages
        corner = self.corners_of_nodes(self.nodes_of_faces(face))
        total = averages.node_sums(values, self.degree, corner)
        mass = averages.node_sums(np.ones(self.surface.face_count), 0, corner)
        mean = total / np.maximum(mass, 1e-300)
        corner_face, area = averages.corner_face[corner], averages.connection.corner_area[corner]
        face_area = np.bincount(corner_face, area, self.surface.face_count)[face]
        return self.face_representations_at(mean, face) / np.maximum(face_area, 1e-300)

    def _corners_of_faces(self, face: np.ndarray) -> np.ndarray:
        """Return the (k,) intp corners of all triangles of the given faces, in ascending order."""
        return np.flatnonzero(mask(self.surface.face_count, face)[self.averages.corner_face])

    def nodes_of_faces(self, face: np.ndarray) -> np.ndarray:
        """Return the (k,) intp nodes at the corners of the given faces, in ascending order."""
        connection = self.averages.connection
        node = connection.corner_node[self._corners_of_faces(face)]
        return np.flatnonzero(mask(connection.node_count, node))

    def corners_of_nodes(self, node: np.ndarray) -> np.ndarray:
        """Return the (k,) intp corners of triangles that lie at the given nodes, in ascending order."""
        return np.flatnonzero(mask(len(self.laplacian), node)[self.averages.connection.corner_node])

    def nodes_near(self, node: np.ndarray, count: int) -> np.ndarray:
        """Add rings of neighbors to a set of nodes until it has at least `count` nodes.

        It stays smaller if the connected components of the nodes have fewer nodes in total.

        Parameters
        ----------
        node : (m,) int ndarray
            The initial nodes.
        count : int
            Number of nodes at which to stop.

        Returns
        -------
        (k,) intp ndarray
            Nodes in ascending order.
        """
        is_near = mask(len(self.laplacian), node)
        total, ring = len(node), node
        while len(ring) and total < count:
            neighbor = self.laplacian.indices[self.laplacian.entries_of_rows(ring)]
            ring = np.unique(neighbor[~is_near[neighbor]])
            is_near[ring] = True
            total += len(ring)
        return np.flatnonzero(is_near)


def firmness_weights(
    firmness: np.ndarray, edge_length: float, reach: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Convert the firmness of guides (how strictly a field follows them, from 0 to 1) to penalty weights.

    The weight w of a guide of firmness f satisfies ``1 / w = reach**2 + edge_length**2 * (1 / f - 1)``. The
    influence of the guide falls off over the distance 1 / sqrt(w). If `reach` is 0, this is the mean length
    of an edge for the firmness 1/2, and a guide of firmness 1 is followed exactly.

    Parameters
    ----------
    firmness : (F,) ndarray
        Firmness of the guide of each face, from 0 to 1.
    edge_length : float
        Mean length of the edges, in object space.
    reach : float
        Distance over which the influence of a guide of firmness 1 falls off, in object space. A greater
        distance makes all weights smaller, so guides are smoothed more.

    Returns
    -------
    weight : (F,) float64 ndarray
        Weights in units of 1 / area; 0 where a guide is followed exactly.
    is_exact : (F,) bool ndarray
        Whether the guide of the face is followed exactly.
    """
    is_exact = (firmness >= EXACT_FIRMNESS) & (reach == 0)
    firmness = np.where(is_exact, 0.0, np.minimum(firmness, 1.0))
    area = reach**2 * firmness + edge_length**2 * (1 - firmness)
    return firmness / np.maximum(area, np.finfo(np.float64).tiny), is_exact


def guided_system(surface: Surface, degree: int) -> GuidedSystem:
    """Build the linear system for guided fields of this degree on a surface."""
    connection = build_connection(surface)
    averages = SurfaceAverages(surface, connection, *surface.face_frames)
    matrix = laplacian(connection, degree)
    matrix = matrix.plus_diagonal(REGULAR_SHIFT * matrix.diagonal)
    return GuidedSystem(surface, degree, averages, matrix)


def guided_field(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float | None = None,
    hard: np.ndarray | None = None,
    tolerance: float = RELATIVE_TOLERANCE,
) -> RosyField:
    """Compute a smooth field that follows guides: given vectors on some of the faces.

    Connected components without a guide get the smoothest field.

    Parameters
    ----------
    surface : Surface
    degree : int
        N.
    guides : (F, 3) ndarray
        One member vector for each face, in object space; zero where there is no guide. Lengths matter: the
        vectors are compared with the field before it is normalized, so a shorter guide has less influence.
    weight : (F,) ndarray or float, optional
        Weight of the guide of each face, in units of 1 / area. The influence of a guide of weight w
        falls off over a distance of about 1 / sqrt(w). If not given, all guides are followed exactly.
    hard : (F,) bool ndarray, optional
        Faces on which the guide is followed exactly.
    tolerance : float
        Residual norm at which the solver stops, relative to the norm of the right-hand side.

    Returns
    -------
    RosyField
        A field of magnitude 1; zero on faces without area.

    Raises
    ------
    RosyError
        If no face with an area has a guide, or the degree is out of range.
    """
    degree = check_degree(degree)
    raise_mmap_threshold()
    if weight is None:
        weight, hard = 0.0, guides.any(axis=1)
    system = guided_system(surface, degree)
    target = system.to_representation(np.asarray(guides, dtype=np.float64))
    if not target.any():
        raise RosyError(f"{surface.name}: all guides are zero, or on faces without area")
    weight = np.where(target != 0, np.broadcast_to(weight, target.shape), 0.0)
    is_hard = np.zeros(surface.face_count, dtype=bool) if hard is None else hard & (target != 0)
    node_guides = system.node_guides(target, weight, is_hard)
    with progress(0.1, 0.75):
        z = system.solve(node_guides, tolerance=tolerance)
    report(0.75, "averaging the field on the faces")
    face_z = unit_representations(system.averages.face_sums(z, degree))
    face_z[is_hard] = unit_complex(target[is_hard])
    vectors = system.to_vectors(face_z)
    del system  # it is large
    unguided = (face_z == 0) & surface.face_normal.any(axis=1)
    if unguided.any():
        with progress(0.8, 1.0):
            vectors[unguided] = smoothest_field(surface, degree).vectors[unguided]
    return RosyField(degree, vectors)


def unit_representations(z: np.ndarray) -> np.ndarray:
    """Return (F,) representations divided by their moduli; 0 where the modulus is only a rounding error."""
    modulus = np.abs(z)
    return unit_complex(np.where(modulus > 1e-9 * max(float(modulus.max()), 1e-300), z, 0))

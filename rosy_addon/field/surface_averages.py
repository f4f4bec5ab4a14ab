"""Averages of the values on faces: at the vertices, back on the faces, and smoothed over a given distance."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .blocks import row_blocks
from .connection import BLOCK_TRIANGLES, Connection, laplacian
from .frames import dot, quotient
from .representation import complex_bincount
from .sparse_matrix import CSRMatrix
from .surface import Surface

#: Relative norm of the residual at which the conjugate gradient method stops.
AVERAGE_TOLERANCE = 1e-2

#: Largest number of steps of the conjugate gradient method.
MAX_STEPS = 500


@dataclass(frozen=True, eq=False)
class SurfaceAverages:
    """Operators that average RoSy representations from F faces to n nodes, and from nodes to faces.

    The nodes are defined by a `Connection`: a node for each vertex, and several for a nonmanifold vertex.

    Attributes
    ----------
    surface : Surface
    connection : Connection
    x, y : (F, 3) float64 ndarray
        Tangent frames of the faces.
    """

    surface: Surface
    connection: Connection
    x: np.ndarray
    y: np.ndarray

    @cached_property
    def frame_angle(self) -> np.ndarray:
        """(3 T,) float64: angle to add to a direction at a node to express it in the frame of a face.

        There is one angle in radians for each corner of a triangle. Directions at the node of the corner are
        angles in polar coordinates (the polar map of `Connection`). The added angle is chosen so that the
        bisector of the corner of the face is the same direction in both.
        """
        surface = self.surface
        angle = np.empty(surface.triangle_vertex.shape)
        for block in row_blocks(len(angle), BLOCK_TRIANGLES):
            face = surface.triangle_face[block]
            x, y = self.x.take(face, axis=0), self.y.take(face, axis=0)
            points = [surface.vertices.take(v, axis=0) for v in surface.triangle_vertex[block].T]
            for corner in range(3):
                edge = points[(corner + 1) % 3] - points[corner]
                angle[block, corner] = np.arctan2(dot(edge, y), dot(edge, x))
        first, angle, span = angle, angle.ravel(), self.connection.corner_angle
        if len(surface.triangles) == surface.face_count:
            return angle + 0.5 * span - self.connection.bisector_direction
        # On a face that is not planar, the two edges of a corner span another angle in the frame.
        last = np.roll(first, 1, axis=1).ravel() + np.pi
        angle = angle + 0.5 * span + 0.5 * np.angle(np.exp(1j * (last - angle - span)))
        angle -= self.connection.bisector_direction
        # If triangles share a corner of a face, take the mean of their angles, weighted by the angles that they span.
        corner, reference = surface.triangles.ravel(), np.empty(len(surface.corner_vertex))
        reference[corner] = angle
        turn = np.angle(np.exp(1j * (angle - reference[corner])))
        total = np.maximum(np.bincount(corner, span), 1e-300)
        return (reference + np.bincount(corner, span * turn) / total)[corner]

    @cached_property
    def corner_face(self) -> np.ndarray:
        """(3 T,) int32: the face of each corner of the triangles."""
        return np.repeat(self.surface.triangle_face, 3)

    def node_sums(
        self, values: np.ndarray, degree: int, corner: np.ndarray | slice = slice(None)
    ) -> np.ndarray:
        """Sum face values at the nodes (vertices), weighted by the corners' shares of the face areas.

        Parameters
        ----------
        values : (F,) ndarray
            RoSy representations in the frames of the faces; real numbers if `degree` is 0.
        degree : int
            N of the representations; 0 for real numbers.
        corner : (m,) int ndarray or slice
            Corners of triangles that are included in the sums, as indices 3 t + k; all by default.

        Returns
        -------
        (n,) ndarray
            Sums in the tangent frames of the nodes (see `Connection`); complex if the degree is not 0.
        """
        terms = self.connection.corner_area[corner] * values[self.corner_face[corner]]
        node, count = self.connection.corner_node[corner], self.connection.node_count
        if not degree:
            return np.bincount(node, terms, count)
        to_node = np.exp(-1j * degree * self.frame_angle[corner])
        return complex_bincount(node, terms * to_node, count)

    def face_sums(self, values: np.ndarray, degree: int) -> np.ndarray:
        """Return (F,) complex128 sums of (n,) node values at the triangle corners of each face.

        Node values are representations of `degree`, and are converted to the frame of the face. The weight of
        a corner is three times its share in the area of the face (`corner_area`). If the face is a triangle,
        this is the area of the face.
        """
        area = self.connection.corner_area.reshape(-1, 3)
        weighted = np.empty(area.shape, dtype=np.complex128)
        node = self.connection.corner_node.reshape(-1, 3)
        frame_angle = self.frame_angle.reshape(-1, 3)
        for block in row_blocks(len(weighted), BLOCK_TRIANGLES):
            angle = degree * frame_angle[block]
            to_face = np.cos(angle) + 1j * np.sin(angle)
            np.multiply(values.take(node[block]), to_face, out=weighted[block])
            weighted[block] *= 3 * area[block]
        surface = self.surface
        return complex_bincount(surface.triangle_face, weighted.sum(axis=1), surface.face_count)

    def face_means(self, values: np.ndarray, degree: int) -> np.ndarray:
        """Return (F,) complex128 means of (n,) node values on each face, weighted by triangle areas.

        Node values are representations of `degree`, and are converted to the frame of the face. The mean is 0
        on faces without area.
        """
        total, surface = self.face_sums(values, degree), self.surface
        area = np.bincount(surface.triangle_face, 3 * self.connection.area, surface.face_count)
        return quotient(total, area)

    def laplacian(self, degree: int) -> CSRMatrix:
        """Return the matrix of `connection.laplacian`, as complex64 (as float32 if the degree is 0)."""
        matrix = laplacian(self.connection, degree)
        if degree:
            return replace(matrix, data=matrix.data.astype(np.complex64))
        return replace(matrix, data=matrix.data.real.astype(np.float32))

    def smooth(
        self, matrix: CSRMatrix, area: float, sums: np.ndarray, start: np.ndarray | None = None
    ) -> np.ndarray:
        """Smooth node values: solve (M + area L) z = sums by the conjugate gradient method.

        M is the diagonal matrix of the masses of the nodes, and L the Laplacian.

        Parameters
        ----------
        matrix : CSRMatrix
            L, the result of `laplacian`.
        area : float
            The square of the smoothing distance.
        sums : (n,) ndarray
            Result of `node_sums`.
        start : (n,) ndarray, optional
            An estimate of the solution from which the iteration starts; zeros by default.

        Returns
        -------
        (n,) ndarray
            Solution in the precision of `sums`.
        """
        dtype = matrix.data.dtype
        scale = float(np.abs(sums).max())
        if scale < np.finfo(np.float64).tiny:
            return np.zeros_like(sums)
        # Scale all numbers to order 1, so that single precision is enough for a mesh of any size.
        mass = self.connection.positive_mass
        mean_mass = mass.mean()
        mass, area = (mass / mean_mass).astype(np.float32), np.float32(area / mean_mass)
        diagonal = mass + area * matrix.diagonal.astype(np.float32)

        def apply(vector: np.ndarray) -> np.ndarray:
            return mass * vector + area * (matrix @ vector)

        right = (sums / scale).astype(dtype)
        unit = scale / mean_mass
        solution = np.zeros_like(right) if start is None else (start / unit).astype(dtype)
        residual = right - apply(solution)
        limit = AVERAGE_TOLERANCE**2 * np.vdot(right, right / diagonal).real
        direction, previous = np.zeros_like(right), np.float32(1.0)
        for _ in range(MAX_STEPS):
            preconditioned = residual / diagonal
            current = np.vdot(residual, preconditioned).real
            if current <= limit:
                break
            direction = preconditioned + current / previous * direction
            image = apply(direction)
            curvature = np.vdot(direction, image).real
            if not curvature > 0:
                break  # obtuse triangles can make the Laplacian indefinite
            length = current / curvature
            solution += length * direction
            residual -= length * image
            previous = current
        return solution.astype(sums.dtype) * unit

"""Curvature of faces, and averages of face values over lengths on a surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..progress import progress, report
from .connection import Connection
from .curvature import TINY, face_curvature
from .frames import dot
from .representation import complex_bincount
from .smoothest import corner_frame_angles, node_sum_per_face
from .sparse_multigrid import CSRMatrix
from .surface import Surface, build_surface, face_area_vectors

#: Relative residual norm at which conjugate gradients stop.
AVERAGE_TOLERANCE = 1e-2

#: Largest number of steps of conjugate gradients.
MAX_STEPS = 500


def of_unit_extent(surface: Surface) -> Surface:
    """Return a surface of extent 1 around the origin, so that no number is very large or small."""
    used = surface.used_vertices
    vertices = np.zeros_like(surface.vertices)
    low, high = surface.vertices[used].min(axis=0), surface.vertices[used].max(axis=0)
    vertices[used] = (surface.vertices[used] - 0.5 * (low + high)) / surface.extent
    return replace(surface, vertices=vertices, rest_vertices=None)


def bounded_curvature(
    surface: Surface, corner_fan: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Curvature of each face, with normals that are smooth within the given fans of corners.

    A larger curvature than the inverse size of the face is reduced to it: slivers have no better one.
    """
    with progress(0.0, 0.6, "averaging normals"):
        smooth = build_surface(
            surface.vertices,
            surface.corner_vertex,
            surface.face_start,
            name=surface.name,
            corner_fan=corner_fan,
            triangles=surface.triangles,
            triangle_face=surface.triangle_face,
        )
    mean, deviator = face_curvature(smooth, x, y)
    vectors = face_area_vectors(surface.vertices, surface.corner_vertex, surface.face_start)
    limit = np.maximum(0.5 * np.sqrt(dot(vectors, vectors)), 1e-300) ** -0.5
    modulus = np.abs(deviator)
    deviator = deviator * np.divide(limit, modulus, out=np.ones_like(limit), where=modulus > limit)
    return np.clip(mean, -limit, limit), deviator


class SurfaceAverages:
    """Averages of face values over a length, by way of the nodes of a connection.

    Parameters
    ----------
    surface : Surface
    connection : Connection
    x, y : (F, 3) float64 ndarray
        Frames of the faces.
    """

    def __init__(
        self, surface: Surface, connection: Connection, x: np.ndarray, y: np.ndarray
    ) -> None:
        self.surface, self.connection = surface, connection
        self.frame_angle = corner_frame_angles(surface, connection, x, y)
        self.corner_face = np.repeat(surface.triangle_face, 3)
        self.corner_area = np.repeat(connection.area / 3, 3)
        self.mass = connection.positive_mass

    def node_sums(self, values: np.ndarray, degree: int) -> np.ndarray:
        """(n,) ndarray: integrals of face values around the nodes; complex if the degree is not 0."""
        terms = self.corner_area * values[self.corner_face]
        node, count = self.connection.corner_node, self.connection.node_count
        if not degree:
            return np.bincount(node, terms, count)
        return complex_bincount(node, terms * np.exp(-1j * degree * self.frame_angle), count)

    def face_means(self, values: np.ndarray, degree: int) -> np.ndarray:
        """(F,) complex128: mean of the node values of a degree on each face."""
        total = node_sum_per_face(self.surface, self.connection, values, self.frame_angle, degree)
        area = np.bincount(
            self.surface.triangle_face, 3 * self.connection.area, self.surface.face_count
        )
        return np.divide(total, area, out=np.zeros_like(total), where=area > 0)

    def smooth(
        self, matrix: CSRMatrix, area: float, sums: np.ndarray, start: np.ndarray | None = None
    ) -> np.ndarray:
        """Solve (M + area L) z = sums by conjugate gradients, with M the masses and L the Laplacian.

        Parameters
        ----------
        matrix : CSRMatrix
            L, of single precision.
        area : float
            The square of the length of the average.
        sums : (n,) ndarray
            From `node_sums`.
        start : (n,) ndarray, optional
            An estimate of the solution.

        Returns
        -------
        (n,) ndarray
            Of the precision of `sums`.
        """
        dtype = matrix.data.dtype
        scale = float(np.abs(sums).max())
        if scale < TINY:
            return np.zeros_like(sums)
        # All numbers are of order 1 after this, whatever the size of the mesh.
        mass = (self.mass / self.mass.mean()).astype(np.float32)
        area = np.float32(area / self.mass.mean())
        diagonal = mass + area * matrix.diagonal.astype(np.float32)

        def apply(vector: np.ndarray) -> np.ndarray:
            return mass * vector + area * (matrix @ vector)

        right = (sums / scale).astype(dtype)
        unit = scale / self.mass.mean()
        solution = np.zeros_like(right) if start is None else (start / unit).astype(dtype)
        residual = right - apply(solution)
        limit = AVERAGE_TOLERANCE**2 * np.vdot(right, right / diagonal).real
        direction, previous = np.zeros_like(right), np.float32(1.0)
        for step in range(MAX_STEPS):
            report(1 - 0.95**step, "averaging curvature")
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

"""The noise of the vertices of a surface: how large it is, and a sample of it."""

from __future__ import annotations

import numpy as np

from .frames import angle_between, dot, normalize
from .salient_edges import weighted_median
from .surface import Edges, Surface, face_area_vectors

#: Seed of the sample.
SEED = 777

#: Displacement at which the effect of noise on the normals is measured, relative to the square root
#: of the mean face area. It must be small.
PROBE = 1e-3


def noise_sample(surface: Surface, edges: Edges, noise_angle: float) -> np.ndarray:
    """Sample noise as strong as that of the vertices along their normals.

    Two properties are compared with those of white noise of unit amplitude: the angle by which it
    turns the face normals, and its difference from the mean of the neighbors. The form of the surface
    adds to both, to the first on coarse meshes and to the second at creases, so the smaller result
    is used.

    Parameters
    ----------
    surface : Surface
    edges : Edges
    noise_angle : float
        From `salient_edges.filtered_normals`.

    Returns
    -------
    (V, 3) float64 ndarray
        Displacements of the vertices, in Blender units.
    """
    count = len(surface.vertices)
    normal = np.stack(
        [np.bincount(surface.corner_vertex, n, count) for n in surface.corner_normal.T], axis=1
    )
    normal = normalize(normal)
    sample = np.random.default_rng(SEED).standard_normal(count)[:, None] * normal
    vectors = face_area_vectors(surface.vertices, surface.corner_vertex, surface.face_start)
    area = np.sqrt(dot(vectors, vectors))
    probe = PROBE * np.sqrt(area.mean())
    displaced = face_area_vectors(
        surface.vertices + probe * sample, surface.corner_vertex, surface.face_start
    )
    turn = weighted_median(angle_between(vectors, displaced), area)
    by_angle = probe * noise_angle / turn if turn > 0 else 0.0
    used = surface.used_vertices
    actual = np.median(np.abs(_roughness(surface.vertices, normal, edges.ends)[used]))
    unit = np.median(np.abs(_roughness(sample, normal, edges.ends)[used]))
    by_roughness = actual / unit if unit > 0 else 0.0
    return min(by_angle, by_roughness) * sample


def _roughness(points: np.ndarray, normal: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(V,) the bi-Laplacian of points along the normals, with weights of 1 for all edges."""
    tail, head = ends.T
    degree = np.maximum(np.bincount(ends.ravel(), minlength=len(points)), 1)

    def difference_from_neighbors(values: np.ndarray) -> np.ndarray:
        total = np.bincount(tail, values[head], len(points))
        total += np.bincount(head, values[tail], len(points))
        return values - total / degree

    height = np.stack([difference_from_neighbors(column) for column in points.T], axis=1)
    return difference_from_neighbors(dot(height, normal))

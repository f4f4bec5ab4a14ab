"""Curvature of the features of a surface, for lines that are narrower on small features."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..progress import progress, report
from .connection import build_connection, laplacian
from .frames import dot, normalize
from .representation import face_frames
from .salient_edges import filtered_normals, salient_edges
from .surface import Surface, build_edges, build_surface, smooth_fans
from .surface_averages import SurfaceAverages, bounded_curvature, of_unit_extent
from .vertex_noise import noise_sample

#: Length over which curvature is averaged, relative to `Surface.extent`.
SCALE = 0.01

#: Ratio of curvature and noise below which there is no feature.
MIN_NOISE_RATIO = 2.0


def feature_curvature(surface: Surface) -> np.ndarray:
    """Compute the curvature of the features at the corners of the triangles.

    It is the larger absolute principal curvature, averaged over `SCALE`. The curvature of noise is
    subtracted, and sharp edges have none. The rest shape is used if there is one, so that a
    deformation does not change the result.

    Parameters
    ----------
    surface : Surface

    Returns
    -------
    (T, 3) float32 ndarray
        In 1 / Blender unit of object space. 0 is flat.
    """
    if surface.rest_vertices is not None:
        with progress(0.0, 0.05):
            surface = build_surface(
                surface.rest_vertices,
                surface.corner_vertex,
                surface.face_start,
                triangles=surface.triangles,
                triangle_face=surface.triangle_face,
            )
    if not surface.face_normal.any():
        return np.zeros((len(surface.triangles), 3), dtype=np.float32)
    extent, surface = surface.extent, of_unit_extent(surface)
    with progress(0.05, 0.1, "finding edges"):
        edges = build_edges(surface.corner_vertex, surface.face_start)
    with progress(0.1, 0.25):
        normals, noise_angle = filtered_normals(surface, edges)
    ends = salient_edges(surface, edges, normals, noise_angle)
    noise = noise_sample(surface, edges, noise_angle)
    with progress(0.35, 0.45):
        fans = smooth_fans(
            surface.vertices, surface.corner_vertex, surface.face_start, sharp_edges=ends
        )
    x, y = face_frames(surface)
    with progress(0.45, 0.55, "measuring features"):
        mean, deviator = bounded_curvature(surface, fans, x, y)
    noisy = replace(surface, vertices=surface.vertices + noise)
    report(0.55, "measuring features")
    normal = noisy.face_normal
    x_noisy = normalize(x - dot(x, normal)[:, None] * normal)
    with progress(0.55, 0.65, "measuring features"):
        mean_noisy, deviator_noisy = bounded_curvature(
            noisy, fans, x_noisy, np.cross(normal, x_noisy)
        )
    with progress(0.65, 0.75, "measuring features"):
        connection = build_connection(surface)
    averages = SurfaceAverages(surface, connection, x, y)
    scalar = laplacian(connection, 0)
    scalar = scalar.with_values(scalar.data.real.astype(np.float32))
    line = laplacian(connection, 2)
    line = line.with_values(line.data.astype(np.complex64))
    area = SCALE**2
    results = []
    for matrix, values, order in (
        (scalar, mean, 0),
        (line, deviator, 2),
        (scalar, mean_noisy - mean, 0),
        (line, deviator_noisy - deviator, 2),
    ):
        sums, start = averages.node_sums(values, order), 0.8 + 0.04 * len(results)
        with progress(start, start + 0.04):
            results.append(averages.smooth(matrix, area, sums))
    mean, deviator, mean_noise, deviator_noise = map(np.abs, results)
    curvature = mean + deviator
    power = averages.mass * (mean_noise + deviator_noise) ** 2
    with progress(0.96, 1.0):
        power = averages.smooth(scalar, 16 * area, power)
    signal = curvature**2 - MIN_NOISE_RATIO**2 * np.maximum(power, 0.0)
    curvature = np.sqrt(np.maximum(signal, 0.0)) / extent
    return curvature.astype(np.float32)[connection.corner_node].reshape(-1, 3)

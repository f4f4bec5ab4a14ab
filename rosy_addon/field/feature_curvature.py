"""Curvature of the features of a surface, for lines that are narrower on small features."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..progress import Progress, Task, subtask
from .connection import connection_task, laplacian_task
from .frames import dot, normalize
from .representation import face_frames
from .salient_edges import filtered_normals_task, salient_edges_task
from .surface import Surface, edges_task, smooth_fans_task, surface_task
from .surface_averages import SurfaceAverages, bounded_curvature_task, of_unit_extent
from .vertex_noise import noise_sample_task

#: Length over which curvature is averaged, relative to `Surface.extent`.
SCALE = 0.01

#: Ratio of curvature and noise below which there is no feature.
MIN_NOISE_RATIO = 2.0


def feature_curvature_task(surface: Surface) -> Task[np.ndarray]:
    """Compute the curvature of the features at the corners of the triangles.

    It is the larger absolute principal curvature, averaged over `SCALE`. The curvature of noise is
    subtracted, and sharp edges have none. The rest shape is used if there is one, so that a
    deformation does not change the result.

    Parameters
    ----------
    surface : Surface

    Yields
    ------
    Progress

    Returns
    -------
    (T, 3) float32 ndarray
        In 1 / Blender unit of object space. 0 is flat.
    """
    if surface.rest_vertices is not None:
        task = surface_task(
            surface.rest_vertices,
            surface.corner_vertex,
            surface.face_start,
            triangles=surface.triangles,
            triangle_face=surface.triangle_face,
        )
        surface = yield from subtask(task, 0.0, 0.0, "measuring features")
    if not surface.face_normal.any():
        return np.zeros((len(surface.triangles), 3), dtype=np.float32)
    extent, surface = surface.extent, of_unit_extent(surface)
    edges = yield from subtask(
        edges_task(surface.corner_vertex, surface.face_start), 0.0, 0.1, "finding edges"
    )
    normals, noise_angle = yield from subtask(filtered_normals_task(surface, edges), 0.1, 0.25)
    task = salient_edges_task(surface, edges, normals, noise_angle)
    ends = yield from subtask(task, 0.25, 0.3)
    noise = yield from subtask(noise_sample_task(surface, edges, noise_angle), 0.3, 0.35)
    task = smooth_fans_task(
        surface.vertices, surface.corner_vertex, surface.face_start, sharp_edges=ends
    )
    fans = yield from subtask(task, 0.35, 0.45)
    x, y = face_frames(surface)
    yield Progress(0.45, "measuring features")
    task = bounded_curvature_task(surface, fans, x, y)
    mean, deviator = yield from subtask(task, 0.45, 0.55, "measuring features")
    noisy = replace(surface, vertices=surface.vertices + noise)
    yield Progress(0.55, "measuring features")
    normal = noisy.face_normal
    x_noisy = normalize(x - dot(x, normal)[:, None] * normal)
    task = bounded_curvature_task(noisy, fans, x_noisy, np.cross(normal, x_noisy))
    mean_noisy, deviator_noisy = yield from subtask(task, 0.55, 0.65, "measuring features")
    connection = yield from subtask(connection_task(surface), 0.65, 0.75, "measuring features")
    averages = SurfaceAverages(surface, connection, x, y)
    yield Progress(0.75, "measuring features")
    scalar = yield from laplacian_task(connection, 0)
    scalar = scalar.with_values(scalar.data.real.astype(np.float32))
    line = yield from laplacian_task(connection, 2)
    line = line.with_values(line.data.astype(np.complex64))
    area = SCALE**2
    results = []
    for matrix, values, order in (
        (scalar, mean, 0),
        (line, deviator, 2),
        (scalar, mean_noisy - mean, 0),
        (line, deviator_noisy - deviator, 2),
    ):
        yield Progress(0.8, "measuring features")
        sums = averages.node_sums(values, order)
        results.append((yield from averages.smooth_task(matrix, area, sums)))
    mean, deviator, mean_noise, deviator_noise = map(np.abs, results)
    yield Progress(0.95, "measuring features")
    curvature = mean + deviator
    power = averages.mass * (mean_noise + deviator_noise) ** 2
    power = yield from averages.smooth_task(scalar, 16 * area, power)
    signal = curvature**2 - MIN_NOISE_RATIO**2 * np.maximum(power, 0.0)
    curvature = np.sqrt(np.maximum(signal, 0.0)) / extent
    return curvature.astype(np.float32)[connection.corner_node].reshape(-1, 3)

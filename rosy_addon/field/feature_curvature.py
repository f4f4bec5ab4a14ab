"""Curvature of the features of a surface, for lines that are narrower on small features."""

from __future__ import annotations

import numpy as np

from ..progress import progress
from .curvature import with_smooth_normals
from .noisy_curvature import noisy_curvature, of_unit_extent
from .surface import Surface

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
            surface = with_smooth_normals(surface.in_rest_shape())
    if not surface.face_normal.any():
        return np.zeros((len(surface.triangles), 3), dtype=np.float32)
    extent, surface = surface.extent, of_unit_extent(surface)
    with progress(0.05, 0.75):
        measured = noisy_curvature(surface)
    averages = measured.averages
    scalar, line = averages.laplacian(0), averages.laplacian(2)
    area = SCALE**2
    results = []
    for matrix, values, order in (
        (scalar, measured.mean, 0),
        (line, measured.deviator, 2),
        (scalar, measured.mean_noise, 0),
        (line, measured.deviator_noise, 2),
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
    return curvature.astype(np.float32)[averages.connection.corner_node].reshape(-1, 3)

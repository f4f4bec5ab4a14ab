"""Curvature of features at the corners of triangles, and at the pixels of a G-buffer."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..cache import Cache
from ..field.feature_curvature import feature_curvature
from ..field.surface import Surface
from ..progress import progress, report
from .gbuffer import GBuffer
from .pixel_blocks import pixel_blocks

#: Label of the progress.
LABEL = "measuring features"


def cached_feature_curvature(surface: Surface, cache: Cache) -> np.ndarray:
    """Compute `feature_curvature` of a surface, or find it in the cache.

    A deformed mesh finds it again.
    """
    key = "feature curvature", surface.rest_shape_key
    return cache.get_or_create(key, partial(feature_curvature, surface))


def feature_curvatures(gbuffer: GBuffer, cache: Cache) -> np.ndarray:
    """Interpolate the curvature of features at the pixels of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
        With its mesh instances.
    cache : Cache
        Stores the curvatures of the surfaces.

    Returns
    -------
    (P,) float32 ndarray
        In 1 / Blender unit of object space.
    """
    curvature = np.zeros(len(gbuffer.pixel), dtype=np.float32)
    present = np.flatnonzero(np.bincount(gbuffer.instance_id)).tolist()
    for number, index in enumerate(present):
        start, stop = number / len(present), (number + 1) / len(present)
        with progress(start, stop):
            corners = cached_feature_curvature(gbuffer.instances[index].surface, cache)
        pixels = np.flatnonzero(gbuffer.instance_id == index)
        for block in pixel_blocks(len(pixels)):
            report(stop, LABEL)
            part = pixels[block]
            values = corners.take(gbuffer.triangle[part], axis=0)
            curvature[part] = np.einsum("ij,ij->i", values, gbuffer.barycentric[part])
    return np.maximum(curvature, 0, out=curvature)

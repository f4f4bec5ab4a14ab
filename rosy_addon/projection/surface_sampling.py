"""Sampling of surfaces at the pixels of a G-buffer: tones, values for the color map, feature curvatures."""

from functools import partial

import numpy as np

from ..core.cache import Cache, cached
from ..core.progress import progress, report
from ..field.feature_curvature import feature_curvature
from ..field.frames import dot
from .gbuffer import GBuffer, MeshInstance

#: Lower bound of the cosine between normal and view direction. Bounds the area of the surface that
#: a pixel covers.
MIN_FACING_COSINE = 0.1


def surface_tones(gbuffer: GBuffer) -> np.ndarray:
    """Sample the tones of surfaces at the pixels of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer

    Returns
    -------
    (P,) float32 ndarray
        Linear tones, from 0 (dark) to 1 (light). NaN where the mesh instance has no tone.
    """
    tones = np.full(len(gbuffer.pixel), np.nan, dtype=np.float32)
    for _, instance, blocks, _ in gbuffer.instance_blocks():
        tone = instance.tone
        if tone is None:
            continue
        for block in blocks:
            corners = instance.surface.triangles.take(gbuffer.triangle[block], axis=0)
            sampled = np.einsum("pi,pik->kp", gbuffer.barycentric[block], tone.values[corners])
            if tone.image is None:
                tones[block] = sampled[0]
            else:
                level = 0.5 * np.log2(_texel_footprint(gbuffer, instance, block, corners) + 1e-12)
                tones[block] = tone.mip_map.sample(*sampled, level, repeat=True)
    return tones


def surface_values(gbuffer: GBuffer) -> np.ndarray:
    """Interpolate the values for the color map (`MeshInstance.color_values`) at the pixels of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer

    Returns
    -------
    (P,) float32 ndarray
        The values. NaN where the surface has none.
    """
    values = np.full(len(gbuffer.pixel), np.nan, dtype=np.float32)
    for _, instance, blocks, _ in gbuffer.instance_blocks():
        if instance.color_values is not None:
            for block in blocks:
                place = gbuffer.triangle[block], gbuffer.barycentric[block]
                values[block] = values_in_triangles(instance, *place)
    return values


def values_in_triangles(
    instance: MeshInstance, triangle: np.ndarray, barycentric: np.ndarray
) -> np.ndarray:
    """Interpolate the values for the color map at points in triangles of one surface.

    Parameters
    ----------
    instance : MeshInstance
        An instance that has `color_values`.
    triangle : (n,) ndarray of int
        Triangle of each point.
    barycentric : (n, 3) float32 ndarray
        Barycentric coordinates of each point in its triangle.

    Returns
    -------
    (n,) float32 ndarray
        The values. NaN where a corner of the triangle has none. Where all corners have equal values, the
        result is exactly this value.
    """
    corners = instance.surface.triangles.take(triangle, axis=0)
    first, second, third = instance.color_values.take(corners).T
    return first + barycentric[:, 1] * (second - first) + barycentric[:, 2] * (third - first)


def feature_curvatures(gbuffer: GBuffer, cache: Cache) -> np.ndarray:
    """Return the curvature of the surfaces at the pixels of a G-buffer, interpolated between vertices.

    It is the larger absolute principal curvature. The curvature that noise of the vertices causes is
    subtracted, and the bend at sharp edges does not count; see `field.feature_curvature`.

    Parameters
    ----------
    gbuffer : GBuffer
    cache : Cache
        Stores the curvatures of the surfaces. Deformations of a mesh share them.

    Returns
    -------
    (P,) float32 ndarray
        1 / Blender units, object space.
    """
    curvature = np.zeros(len(gbuffer.pixel), dtype=np.float32)
    for _, instance, blocks, (start, stop) in gbuffer.instance_blocks():
        create, key = partial(feature_curvature, instance.surface), instance.surface.rest_shape_key
        with progress(start, stop):
            corners = cached(cache, create, "feature curvature", key)
        for block in blocks:
            report(stop, "measuring features")
            values = corners.take(gbuffer.triangle[block], axis=0)
            curvature[block] = np.einsum("ij,ij->i", values, gbuffer.barycentric[block])
    return np.maximum(curvature, 0, out=curvature)


def _texel_footprint(
    gbuffer: GBuffer, instance: MeshInstance, pixels: slice | np.ndarray, corners: np.ndarray
) -> np.ndarray:
    """Return the (n,) areas, in texels of the image of a tone, that pixels of the picture cover.

    `pixels` are indices into the G-buffer, all on one instance. `corners`, (n, 3), are the face corners of
    the visible triangles at these pixels.
    """
    surface, tone = instance.surface, instance.tone
    linear = np.asarray(instance.matrix, dtype=np.float64)[:3, :3]
    positions = surface.vertices[surface.corner_vertex[corners]] @ linear.T
    edge_1, edge_2 = positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]
    surface_area = np.linalg.norm(np.cross(edge_1, edge_2), axis=1)
    u, v = np.moveaxis(tone.values[corners], -1, 0).astype(np.float64)
    uv_area = (u[:, 1] - u[:, 0]) * (v[:, 2] - v[:, 0]) - (u[:, 2] - u[:, 0]) * (v[:, 1] - v[:, 0])
    camera = gbuffer.camera
    depth = -gbuffer.position[pixels, 2] if camera.is_perspective else 1.0
    cosine = np.abs(dot(gbuffer.geometric_normal[pixels], gbuffer.view_direction[pixels]))
    pixel_area = (depth / camera.pixels_per_unit) ** 2 / np.maximum(cosine, MIN_FACING_COSINE)
    return np.abs(uv_area) * tone.image.size * pixel_area / np.maximum(surface_area, 1e-30)

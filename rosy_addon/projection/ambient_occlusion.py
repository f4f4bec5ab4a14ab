"""Ambient occlusion at the corners of a surface, from shadow maps in many directions."""

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress
from ..field.blocks import bincount_rows
from ..field.frames import dot, normalize
from .gbuffer import MeshInstance, MeshInstances
from .shadow_maps import NORMAL_BIAS_PIXELS, render_depth_map, sun_camera, visibility_from
from .vector_components import cofactor_matrix

#: Number of light directions by default, and width and height of each shadow map in pixels.
DIRECTION_COUNT, DEPTH_MAP_SIZE = 256, 512

#: Sample points are moved from their vertex into the adjacent faces: by this many pixels of the
#: shadow map, but at most by this fraction of the distance to the mean of the face centers.
#: Otherwise half of the filter window of a sample on an edge between a floor and a wall would lie behind
#: the wall.
SAMPLE_INSET_PIXELS, MAX_INSET_FRACTION = 2 * NORMAL_BIAS_PIXELS, 0.3


def ambient_occlusion(
    instances: MeshInstances, instance_id: int, direction_count: int = DIRECTION_COUNT
) -> np.ndarray:
    """Compute the ambient occlusion at the corners of one mesh instance.

    Parameters
    ----------
    instances : sequence of MeshInstance
        All occluders, including the instance itself.
    instance_id : int
        Index of the instance whose occlusion is computed.
    direction_count : int
        Number of light directions, spread evenly over the sphere.

    Returns
    -------
    (C,) float32 ndarray
        Visible part of the hemisphere over each corner, weighted by the cosine to the normal:
        1 is fully open, 0 fully occluded. Corners of one smooth fan have equal values.

    Raises
    ------
    RosyError
        If `direction_count` is less than 1.
    """
    if direction_count < 1:
        raise RosyError(f"{direction_count} directions of light: choose 1 or more")
    instance = instances[instance_id]
    receiver_points = instance.world_bounds()
    caster_points = np.concatenate([caster.world_bounds() for caster in instances])
    pixel_size = float(np.ptp(receiver_points, axis=0).max()) / DEPTH_MAP_SIZE
    points, normals = _sample_points(instance, SAMPLE_INSET_PIXELS * pixel_size)
    visible_weight, total_weight = np.zeros(len(points)), np.zeros(len(points))
    for index, direction in enumerate(fibonacci_sphere(direction_count)):
        cosine = normals @ direction
        facing_light = np.flatnonzero(cosine > 0)
        camera = sun_camera(direction, caster_points, receiver_points, DEPTH_MAP_SIZE)
        start, stop = index / direction_count, (index + 1) / direction_count
        with progress(start, stop, "sampling directions of light"):
            depth_map = render_depth_map(instances, camera)
        total_weight[facing_light] += cosine[facing_light]
        receivers = points[facing_light], normals[facing_light]
        visibility = visibility_from(camera, depth_map, *receivers)
        visible_weight[facing_light] += cosine[facing_light] * visibility
    faces_light, visible_fraction = total_weight > 0, np.ones(len(points))
    np.divide(visible_weight, total_weight, out=visible_fraction, where=faces_light)
    return visible_fraction[instance.surface.corner_fan].astype(np.float32)


def fibonacci_sphere(count: int) -> np.ndarray:
    """Return (count, 3) unit vectors, spread evenly on a spiral of golden angles."""
    index = np.arange(count)
    z = 1 - (2 * index + 1) / count
    azimuth = index * (np.pi * (3 - np.sqrt(5)))
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1)


def _sample_points(instance: MeshInstance, inset: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a (K, 3) sample point and a (K, 3) unit normal for each of K fans of corners.

    Both are in world space. The points are moved from the vertices toward the mean of the centers of the
    adjacent faces by `inset`, a distance in world space, but at most by `MAX_INSET_FRACTION` of the way.
    """
    surface, linear = instance.surface, np.asarray(instance.matrix, dtype=np.float64)[:3, :3]
    vertex = np.empty((len(surface.fan_normal), 3))
    vertex[surface.corner_fan] = surface.vertices[surface.corner_vertex]
    center_sums = bincount_rows(surface.corner_fan, surface.face_center[surface.corner_face])
    center = instance.to_world(center_sums / np.bincount(surface.corner_fan)[:, None])
    position = instance.to_world(vertex)
    offset = center - position
    length = np.sqrt(dot(offset, offset))
    fraction = np.minimum(MAX_INSET_FRACTION, inset / np.maximum(length, 1e-30))
    normals = normalize(surface.fan_normal @ cofactor_matrix(linear).T)
    return position + fraction[:, None] * offset, normals

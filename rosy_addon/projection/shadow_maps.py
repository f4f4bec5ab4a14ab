"""Shadow maps: cameras of lights, their depth maps, and the visibility of points from a light.

Depth maps are rendered by the same rasterizer as the G-buffer. A point is lit if the depth map has
no nearer surface. The results of neighboring pixels of the depth map are averaged
(percentage-closer filtering), which gives soft shadow borders. To prevent self-shadowing, points
are moved along their normal, by as much as the filter width requires (Holbert, "Saying Goodbye to
Shadow Acne", 2011).
"""

from collections.abc import Sequence

import numpy as np

from ..core.progress import progress
from ..field.frames import normalize, transformed
from .camera import Camera, look_at, orthographic_camera, perspective_camera, z_at_depth
from .gbuffer import GBuffer, MeshInstances, with_field
from .pixel_blocks import reported_blocks
from .project import rasterize_instances

#: Width and height of the shadow maps of lights, in pixels.
SHADOW_MAP_SIZE = 2048

#: Width of the percentage-closer filter, in pixels of the shadow map.
PCF_WIDTH = 3

#: Distance by which points are moved along their normal, in pixels of the shadow map: half of
#: `PCF_WIDTH` plus half a pixel, along the diagonal, plus a reserve for curved surfaces.
NORMAL_BIAS_PIXELS = 3.2

#: Least distance of a point light from the center of the receivers for which a single shadow map is
#: used, in radii of the receivers. Nearer lights use six.
SINGLE_VIEW_MIN_RADII = 1.3

#: Text that the user sees while this step runs.
LABEL = "casting shadows"


def light_cameras(
    instances: MeshInstances, camera: Camera, kind: str, vector: np.ndarray
) -> list[Camera]:
    """Return the cameras of the shadow maps of a light.

    Parameters
    ----------
    instances : sequence of MeshInstance
        All shadow casters. Instances with a field are the receivers, which the shadow maps cover.
    camera : Camera
        The camera in whose space `vector` is given.
    kind : {"sun", "point"}
    vector : (3,) ndarray
        Camera space: the unit direction to a sun, or the position of a point light.

    Returns
    -------
    list of Camera
        One camera, or six in all directions for a point light near or among the receivers.
    """
    camera_to_world = camera.view[:3, :3].T
    caster_points = np.concatenate([instance.world_bounds() for instance in instances])
    receiver_points = np.concatenate([item.world_bounds() for item in with_field(instances)])
    vector = np.asarray(vector, dtype=np.float64)
    if kind == "sun":
        direction = camera_to_world @ vector
        return [sun_camera(direction, caster_points, receiver_points, SHADOW_MAP_SIZE)]
    light_position = camera_to_world @ (vector - camera.view[:3, 3])
    return _point_cameras(light_position, caster_points, receiver_points)


def sun_camera(
    direction: np.ndarray, caster_points: np.ndarray, receiver_points: np.ndarray, resolution: int
) -> Camera:
    """Return the orthographic camera of the shadow map of a sun.

    Parameters
    ----------
    direction : (3,) ndarray
        Direction to the sun, world space.
    caster_points, receiver_points : (n, 3) ndarray
        Bounding points of shadow casters and receivers, world space. The frame covers the
        receivers, the clip range covers the casters.
    resolution : int
        Width and height in pixels.
    """
    direction = normalize(direction)
    up = np.eye(3)[np.argmin(np.abs(direction))]
    view = look_at(direction, (0, 0, 0), up)
    projected = receiver_points @ view[:2, :3].T
    low, high = projected.min(axis=0), projected.max(axis=0)
    height = caster_points @ direction
    scale = max(float((high - low).max()), 1e-9) * (1 + 4 * NORMAL_BIAS_PIXELS / resolution)
    # The camera is slightly in front of the first caster.
    margin = 0.01 * max(float(np.ptp(height)), scale)
    view[:2, 3] = -(low + high) / 2
    view[2, 3] = -(height.max() + margin)
    clip = 0.0, float(np.ptp(height)) + 2 * margin
    return orthographic_camera(view, resolution, resolution, scale=scale, clip=clip, name="sun")


def _point_cameras(
    light_position: np.ndarray, caster_points: np.ndarray, receiver_points: np.ndarray
) -> list[Camera]:
    """Return the cameras of the shadow maps of a point light, all arguments in world space."""
    center = (receiver_points.min(axis=0) + receiver_points.max(axis=0)) / 2
    radius = float(np.linalg.norm(receiver_points - center, axis=1).max())
    distance = float(np.linalg.norm(center - light_position))
    far = float(np.linalg.norm(caster_points - light_position, axis=1).max()) * 1.01 + 1e-9
    fov = np.pi / 2
    views = [
        look_at(light_position, light_position + sign * np.eye(3)[axis], np.eye(3)[axis - 2])
        for axis in range(3)
        for sign in (1, -1)
    ]
    if distance > SINGLE_VIEW_MIN_RADII * radius:
        up = np.eye(3)[np.argmin(np.abs(center - light_position))]
        fov = 2 * np.arcsin(radius / distance) * (1 + 4 * NORMAL_BIAS_PIXELS / SHADOW_MAP_SIZE)
        views = [look_at(light_position, center, up)]
    size, clip = SHADOW_MAP_SIZE, (1e-3 * far, far)
    return [perspective_camera(view, size, size, fov=fov, clip=clip, name="lamp") for view in views]


def render_depth_map(instances: MeshInstances, camera: Camera) -> np.ndarray:
    """Return the (H, W) float32 depths of the nearest surfaces along the camera axis; inf at empty pixels."""
    fragments = rasterize_instances(instances, camera)
    depth = np.full(camera.width * camera.height, np.inf, dtype=np.float32)
    # The cameras of lights are not sheared, so the depth is the same for all rays.
    depth[fragments.pixel] = -z_at_depth(camera, 0, 0, fragments.depth)
    return depth.reshape(camera.height, camera.width)


def shadow_visibility(gbuffer: GBuffer, cameras: Sequence[Camera]) -> np.ndarray:
    """Compute the visibility of a light at the pixels of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
    cameras : sequence of Camera
        Result of `light_cameras`.

    Returns
    -------
    (P,) float32 ndarray
        From 0, in shadow, to 1, lit.
    """
    rotation, translation = gbuffer.camera.view[:3, :3], gbuffer.camera.view[:3, 3]
    result = np.ones(len(gbuffer.pixel), dtype=np.float32)
    for index, camera in enumerate(cameras):
        rendered, done = (index + 0.5) / len(cameras), (index + 1) / len(cameras)
        with progress(index / len(cameras), rendered, LABEL):
            depth_map = render_depth_map(gbuffer.instances, camera)
        for block in reported_blocks(len(result), LABEL, rendered, done):
            points = (gbuffer.position[block] - translation) @ rotation
            normals = gbuffer.normal[block] @ rotation
            result[block] *= visibility_from(camera, depth_map, points, normals)
    return result


def visibility_from(
    camera: Camera, depth_map: np.ndarray, points: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Return the visibility of points from a camera, averaged over neighboring pixels of its depth map.

    Parameters
    ----------
    camera : Camera
    depth_map : (H, W) ndarray
        Result of `render_depth_map` with the same camera.
    points, normals : (n, 3) ndarray
        World space. The normals are unit vectors.

    Returns
    -------
    (n,) float32 ndarray
        From 0, hidden, to 1, visible. 1 outside the frame and behind the camera.
    """
    rotation, translation = camera.view[:3, :3], camera.view[:3, 3]
    position = points @ rotation.T + translation
    bias_distance = np.abs(position[:, 2:]) if camera.is_perspective else 1.0
    normals = normals @ rotation.T
    position = position + NORMAL_BIAS_PIXELS / camera.pixels_per_unit * bias_distance * normals
    clip = transformed(position, camera.projection[:3])
    # Positive in front of the camera. Points behind it stay visible.
    axial_depth = -position[:, 2]
    divisor = np.where(axial_depth > 0, axial_depth, 1.0) if camera.is_perspective else 1.0
    x, y = clip[:, 0] / divisor, clip[:, 1] / divisor
    in_frustum = np.flatnonzero((np.abs(x) <= 1) & (np.abs(y) <= 1) & (axial_depth > 0))
    visibility = np.ones(len(points), dtype=np.float32)
    pixel = (np.stack([x[in_frustum], y[in_frustum]], axis=1) * 0.5 + 0.5) * camera.size
    visibility[in_frustum] = _pcf_visibility(depth_map, pixel, axial_depth[in_frustum])
    return visibility


def _pcf_visibility(
    depth_map: np.ndarray, pixel: np.ndarray, axial_depth: np.ndarray
) -> np.ndarray:
    """Return the (n,) float32 fractions of filter windows in which no surface is nearer than `axial_depth`.

    Parameters
    ----------
    depth_map : (H, W) ndarray
    pixel : (n, 2) ndarray
        Center of the window: x and y in pixels from the lower left corner, as in `Camera`.
    axial_depth : (n,) ndarray
        Depth along the camera axis to compare with the depth map.
    """
    height, width = depth_map.shape
    corner = pixel - 0.5 * PCF_WIDTH
    first = np.floor(corner)
    fraction = (corner - first).astype(np.float32)
    first = first.astype(np.intp)
    axial_depth = axial_depth.astype(np.float32)
    columns = [np.clip(first[:, 0] + step, 0, width - 1) for step in range(PCF_WIDTH + 1)]
    rows = [np.clip(first[:, 1] + step, 0, height - 1) * width for step in range(PCF_WIDTH + 1)]
    # The window covers the first and the last pixel partly; their weights sum up to 1.
    tap_weights = [1 - fraction.T, *[np.ones_like(fraction.T)] * (PCF_WIDTH - 1), fraction.T]
    hidden = np.zeros(len(pixel), dtype=np.float32)
    for row, (_, weight_y) in zip(rows, tap_weights, strict=True):
        row_hidden = np.zeros(len(pixel), dtype=np.float32)
        for column, (weight_x, _) in zip(columns, tap_weights, strict=True):
            row_hidden += weight_x * (depth_map.take(row + column) < axial_depth)
        hidden += weight_y * row_hidden
    return np.maximum(1 - hidden / np.float32(PCF_WIDTH**2), 0)

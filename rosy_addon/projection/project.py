"""Projection: compute the G-buffer from mesh instances and a camera.

The rasterizer finds the visible pixels. The field is interpolated from the corners of the triangles
(`corner_field`) to the pixels, and is transported from the tangent plane of each pixel to the view
plane. Both steps work on the representation z = rho exp(i N t), so that the result does not depend
on which of the N members is stored.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from ..core.cache import Cache
from ..core.errors import NothingInViewError, RosyError, counted
from ..core.memory import raise_mmap_threshold
from ..core.progress import progress, report
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import transform_components
from .barycentrics import LABEL, barycentrics
from .camera import Camera, pixel_rays, z_at_depth
from .corner_field import cached_corner_field
from .gbuffer import GBuffer, MeshInstance, MeshInstances, SurfacePoints, with_field
from .pixel_blocks import part_of, reported_blocks
from .pixel_coverage import pixel_coverage
from .pixel_values import fill_pixels
from .rasterized_samples import SampledTriangles, rasterize_samples
from .rasterizer import Fragments, Rows, rasterize

#: How a field is shown: averaged over smooth fans and interpolated, or constant on each face.
DISPLAYS = ("smooth", "flat")


def project(
    instances: MeshInstances,
    camera: Camera,
    display: str = "smooth",
    cache: Cache | None = None,
    samples: int = 1,
    rows: Rows = None,
) -> GBuffer:
    """Compute the G-buffer: the visible pixels of all surfaces with a field, and the field there.

    Parameters
    ----------
    instances : sequence of MeshInstance
        Instances without a field only occlude others.
    camera : Camera
    display : {"smooth", "flat"}
        "smooth": average values and normals over smooth fans, and interpolate them. "flat": keep the
        values and the normal of each face.
    cache : Cache, optional
        Stores corner fields, which do not depend on the camera.
    samples : int
        Samples along each side of a pixel. If there are several, the G-buffer contains each pixel where
        at least one sample shows a field, and its `coverage` and `samples` are set.
    rows : (int, int) or None
        First row of the frame to project, and the row after the last one. None for all rows.

    Returns
    -------
    GBuffer
        It has at least one pixel.

    Raises
    ------
    RosyError
        If `display` is unknown, no instance has a field, a field does not fit its surface or is not
        finite, or a matrix is not finite.
    NothingInViewError
        If no surface with a field is visible.
    """
    check_instances(instances, camera, display)
    raise_mmap_threshold()
    report(0.0, LABEL)
    sampled = None
    with progress(0.0, 0.3):
        if samples > 1:
            fragments, sampled = _visible_samples(instances, camera, samples, rows)
        else:
            fragments = _visible_pixels(instances, camera, rows)
    if not len(fragments.pixel):
        raise_nothing_in_view(instances, camera)
    with progress(0.3, 0.4):
        gbuffer = _new_gbuffer(instances, camera, fragments)
    with progress(0.4, 1.0 if sampled is None else 0.9):
        geometric_normals = _fill_instances(gbuffer, display, cache)
    if sampled is None:
        return gbuffer
    other_instance, other_triangle = _split_triangles(instances, sampled.other_triangle)
    other_normal = np.zeros((3, len(other_triangle)), dtype=np.float32)
    for instance_id, normal in geometric_normals.items():
        of_instance = np.flatnonzero(other_instance == instance_id)
        other_normal[:, of_instance] = normal.take(other_triangle[of_instance], axis=1)
    with progress(0.9, 1.0):
        coverage, pixel_samples = pixel_coverage(
            gbuffer, sampled, samples, other_instance, other_normal
        )
    return replace(gbuffer, coverage=coverage, samples=pixel_samples)


def project_samples(
    gbuffer: GBuffer, entries: np.ndarray, display: str, cache: Cache | None = None
) -> tuple[GBuffer, np.ndarray, np.ndarray]:
    """Compute the G-buffer of all samples of some pixels.

    Parameters
    ----------
    gbuffer : GBuffer
        Result of `project` with several samples.
    entries : (n,) intp ndarray
        The pixels, as indices into the G-buffer.
    display : {"smooth", "flat"}
        Whether the field is interpolated, or constant on each face.
    cache : Cache, optional
        Cache for corner fields.

    Returns
    -------
    samples : GBuffer
        G-buffer of Q samples. Its frame has a pixel for each sample.
    home, shown : (Q,) int32 ndarray
        Two pixels for each sample, as indices into `gbuffer`: the pixel that contains the sample, and
        the pixel whose surface the sample shows.
    """
    report(0.0, LABEL)
    pixel_samples, instances = gbuffer.samples, gbuffer.instances
    side = pixel_samples.side
    camera = gbuffer.camera.scaled(side)
    width = np.int32(gbuffer.camera.width)
    first_triangle = first_triangles(instances)
    # The samples, their two indices into `gbuffer`, and their triangles, counted over all instances.
    columns = []
    row, column = np.divmod(gbuffer.pixel[entries], width)
    for bit in range(side * side):
        is_own = (pixel_samples.own[entries] >> np.uint16(bit) & 1).astype(bool)
        home = entries[is_own].astype(np.int32)
        sample = (row[is_own] * np.int32(side) + np.int32(bit // side)) * (width * np.int32(side))
        sample += column[is_own] * np.int32(side) + np.int32(bit % side)
        triangle = gbuffer.triangle[home] + first_triangle[gbuffer.instance_id[home]]
        columns.append((sample, home, home, triangle))
    row, column = np.divmod(pixel_samples.other, width * np.int32(side))
    pixel = row // np.int32(side) * width + column // np.int32(side)
    place = np.minimum(np.searchsorted(gbuffer.pixel[entries], pixel), len(entries) - 1)
    others = np.flatnonzero(gbuffer.pixel[entries].take(place) == pixel)
    home = entries[place[others]].astype(np.int32)
    shown, triangle = pixel_samples.other_entry[others], pixel_samples.other_triangle[others]
    columns.append((pixel_samples.other[others], home, shown, triangle))
    columns = [np.concatenate(values) for values in zip(*columns, strict=True)]
    order = np.argsort(columns[0], kind="stable")
    sample, home, shown, triangle = (values[order] for values in columns)
    clip, triangles = all_triangles(instances, camera)
    with progress(0.1, 0.3):
        weights, front_facing = barycentrics(clip, triangles, sample, triangle, *camera.size)
    z, w = np.einsum("nc,nck->kn", weights, clip[triangles[triangle], 2:])
    fragments = Fragments(sample, triangle, weights, front_facing, z / w)
    with progress(0.3, 0.5):
        samples = _new_gbuffer(instances, camera, fragments)
    with progress(0.5, 1.0):
        _fill_instances(samples, display, cache)
    return samples, home, shown


def surface_points(
    instances: MeshInstances,
    camera: Camera,
    display: str,
    points: SurfacePoints,
    position: np.ndarray,
    cache: Cache | None = None,
) -> GBuffer:
    """Compute the G-buffer at points of surfaces, visible or not.

    Parameters
    ----------
    instances : sequence of MeshInstance
    camera : Camera
        Camera in whose space the G-buffer is.
    display : {"smooth", "flat"}
        Whether the field is interpolated, or constant on each face.
    points : SurfacePoints
        P points of instances with a field, in front of the camera.
    position : (P, 2) float64 ndarray
        Their positions in the frame, in pixels from the lower left.
    cache : Cache, optional
        Cache for corner fields.

    Returns
    -------
    GBuffer
        It has one element for each point, in the order of `points`. Several points may have the same
        pixel.
    """
    report(0.0, "finding directions")
    clip, triangles = all_triangles(instances, camera)
    triangle = points.triangle + first_triangles(instances)[points.instance_id]
    corners = clip[triangles[triangle]]
    a, b, c = np.moveaxis(corners[..., (0, 1, 3)], 1, 0)
    front_facing = (a * np.cross(b, c)).sum(axis=1) > 0
    z, w = (points.barycentric[:, :, None] * corners[..., 2:]).sum(axis=1).T
    column, row = np.clip(position.astype(np.int64), 0, np.array(camera.size) - 1).T
    pixel, triangle = (row * camera.width + column).astype(np.int32), triangle.astype(np.int32)
    barycentric = points.barycentric.astype(np.float32)
    fragments = Fragments(pixel, triangle, barycentric, front_facing, z / w)
    with progress(0.0, 0.1):
        gbuffer = _new_gbuffer(instances, camera, fragments)
    for instance_id in np.unique(points.instance_id).tolist():
        chosen = np.flatnonzero(points.instance_id == instance_id)
        instance = instances[instance_id]
        with progress(0.1, 1.0):
            corner_field = cached_corner_field(instance, display, cache)
        corner_field = part_of(corner_field, (..., points.triangle[chosen]))
        corner_field = corner_field.rotated(camera.view[:3, :3])
        fill_pixels(gbuffer, chosen, np.arange(len(chosen)), corner_field)
    return gbuffer


def cached_project(
    instances: MeshInstances, camera: Camera, display: str, cache: Cache, samples: int = 1
) -> GBuffer:
    """Return the G-buffer of all rows, the result of `project`, and store it in a cache.

    The key consists of the instances (by identity), the camera (by value), the display and the
    number of samples.
    """
    key = "G-buffer", tuple(instances), camera.key, camera.name, display, samples
    return cache.get_or_create(key, partial(project, instances, camera, display, cache, samples))


def check_instances(instances: MeshInstances, camera: Camera, display: str) -> None:
    """Check that mesh instances can be projected. `camera` is only named in an error message.

    Raises
    ------
    RosyError
        If `display` is unknown, no instance has a field, a field does not fit its surface or is not
        finite, or a matrix is not finite.
    """
    if display not in DISPLAYS:
        raise RosyError(f"unknown display {display!r}: choose {', '.join(DISPLAYS)}")
    if all(instance.field is None for instance in instances):
        raise RosyError(f"camera '{camera.name}': no object has a RoSy field")
    for instance in instances:
        name = instance.surface.name
        if np.shape(instance.matrix) != (4, 4) or not np.isfinite(instance.matrix).all():
            raise RosyError(f"{name}: its matrix must be 4 x 4 finite numbers")
        if instance.field is None:
            continue
        vector_count, face_count = len(instance.field.vectors), instance.surface.face_count
        if vector_count != face_count:
            raise RosyError(
                f"{name}: its field has {counted(vector_count, 'vector')}, but the mesh has "
                f"{counted(face_count, 'face')}"
            )
        if not np.isfinite(instance.field.vectors).all():
            face = int(np.argmin(np.isfinite(instance.field.vectors).all(axis=1)))
            raise RosyError(f"{name}: its field is not finite on face {face}")


# --- visibility --------------------------------------------------------------------------------


def _visible_pixels(instances: MeshInstances, camera: Camera, rows: Rows) -> Fragments:
    """Find the pixels where the nearest surface has a field, in the given rows or all."""
    fragments = rasterize_instances(instances, camera, rows)
    has_field = _triangles_with_field(instances)
    if not has_field.all():
        kept = np.flatnonzero(has_field.take(fragments.triangle))
        fragments = Fragments(*(values[kept] for values in fragments))
    return fragments


def _visible_samples(
    instances: MeshInstances, camera: Camera, samples: int, rows: Rows
) -> tuple[Fragments, SampledTriangles]:
    """Find the main triangle of each pixel (see `SampledTriangles`), and the visible triangles at all samples."""
    clip, triangles = all_triangles(instances, camera)
    has_field = _triangles_with_field(instances)
    with progress(0.0, 0.8):
        sampled = rasterize_samples(clip, triangles, has_field, *camera.size, samples, rows)
    pixel, triangle = sampled.pixel, sampled.triangle
    with progress(0.8, 1.0):
        weights, front_facing = barycentrics(clip, triangles, pixel, triangle, *camera.size)
    return Fragments(pixel, triangle, weights, front_facing, sampled.depth), sampled


def _triangles_with_field(instances: MeshInstances) -> np.ndarray:
    """Return (T,) bool: which triangles of all instances have a field."""
    counts = [len(instance.surface.triangles) for instance in instances]
    return np.repeat([instance.field is not None for instance in instances], counts)


def first_triangles(instances: MeshInstances) -> np.ndarray:
    """Return the index of the first triangle of each instance, counted over all instances, (B,) int32."""
    counts = [len(instance.surface.triangles) for instance in instances]
    return offsets_from_sizes(counts)[:-1].astype(np.int32)


def _split_triangles(
    instances: MeshInstances, triangle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the instance of each of (n,) triangles, and the triangle's index in its instance, as int32.

    The indices in `triangle` are counted over all instances.
    """
    if len(instances) == 1:
        return np.zeros(len(triangle), dtype=np.int32), triangle
    first_triangle = first_triangles(instances)
    instance_id = np.searchsorted(first_triangle, triangle, side="right").astype(np.int32) - 1
    return instance_id, triangle - first_triangle[instance_id]


def rasterize_instances(instances: MeshInstances, camera: Camera, rows: Rows = None) -> Fragments:
    """Rasterize all mesh instances together, in the given rows of the frame or in all.

    Triangles are counted over all instances, in their order.
    """
    return rasterize(*all_triangles(instances, camera), *camera.size, rows)


def all_triangles(instances: MeshInstances, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and triangles of all instances, in the order of instances.

    Returns
    -------
    clip : (V, 4) float64 ndarray
        Vertices in clip space.
    triangles : (T, 3) int32 ndarray
        Indices into `clip`.
    """
    clip = np.concatenate([clip_vertices(instance, camera) for instance in instances], axis=1)
    triangles, vertex_offset = [], 0
    for instance in instances:
        triangles.append(instance.surface.triangle_vertex + np.int32(vertex_offset))
        vertex_offset += len(instance.surface.vertices)
    return clip.T, np.concatenate(triangles)


def clip_vertices(instance: MeshInstance, camera: Camera) -> np.ndarray:
    """Return the (4, V) float64 vertices of an instance in clip space."""
    matrix = camera.projection @ camera.view @ np.asarray(instance.matrix, dtype=np.float64)
    vertices = np.ascontiguousarray(instance.surface.vertices.T)
    return transform_components(vertices, matrix[:, :3], matrix[:, 3])


def raise_nothing_in_view(instances: MeshInstances, camera: Camera) -> None:
    """Raise the error for a camera that sees no surface with a field.

    Raises
    ------
    NothingInViewError
        Always. The message says whether the surfaces are hidden, cover no pixel, or are outside the
        frame.
    """
    field_instances = with_field(instances)
    names = ", ".join(instance.surface.name for instance in field_instances)
    clip, triangles = all_triangles(field_instances, camera)
    if len(rasterize(clip, triangles, *camera.size).pixel):
        reason = "hidden behind other objects"
    elif (np.abs(clip[triangles, :3]).max(axis=2) <= clip[triangles, 3]).any():
        reason = "seen exactly edge-on, or smaller than a pixel: turn the camera, or move it closer"
    else:
        reason = "outside the frame"
    raise NothingInViewError(
        f"no RoSy object is in view of camera '{camera.name}': {names} is {reason}"
    )


def _new_gbuffer(instances: MeshInstances, camera: Camera, fragments: Fragments) -> GBuffer:
    """Return a G-buffer of rasterized pixels. Its normals and representation are not yet initialized."""
    count = len(fragments.pixel)
    instance_id, triangle = _split_triangles(instances, fragments.triangle)
    position, view_direction = _empty_vectors(count), _empty_vectors(count)
    for block in reported_blocks(count, LABEL):
        x, y = pixel_rays(camera, fragments.pixel[block])
        z = z_at_depth(camera, x, y, fragments.depth[block]).astype(np.float32)
        if camera.is_perspective:
            inverse_length = 1 / np.sqrt(x * x + y * y + 1)
            view_direction.T[:, block] = -x * inverse_length, -y * inverse_length, inverse_length
            x, y = -z * x, -z * y
        position.T[:, block] = x, y, z
    if not camera.is_perspective:
        view_direction[:] = (0.0, 0.0, 1.0)
    return GBuffer(
        camera=camera,
        instances=tuple(instances),
        pixel=fragments.pixel,
        instance_id=instance_id,
        triangle=triangle,
        barycentric=fragments.barycentric,
        position=position,
        normal=_empty_vectors(count),
        view_direction=view_direction,
        representation=np.empty(count, dtype=np.complex64),
        geometric_normal=_empty_vectors(count),
        front_facing=fragments.front_facing,
        channels={},
    )


def _empty_vectors(count: int) -> np.ndarray:
    """Return an uninitialized (P, 3) float32 array, with each component contiguous in memory."""
    return np.empty((3, count), dtype=np.float32).T


# --- pixels --------------------------------------------------------------------------------------


def _fill_instances(gbuffer: GBuffer, display: str, cache: Cache | None) -> dict[int, np.ndarray]:
    """Write the normals, the representation and the channels of a new G-buffer.

    Returns
    -------
    dict of int to (3, T) float32 ndarray
        Normals of the triangles of each visible instance, in camera space.
    """
    geometric_normals = {}
    for instance_id, instance, blocks, (start, stop) in gbuffer.instance_blocks():
        middle = (start + stop) / 2
        with progress(start, middle):
            corner_field = cached_corner_field(instance, display, cache)
        corner_field = corner_field.rotated(gbuffer.camera.view[:3, :3])
        geometric_normals[instance_id] = corner_field.geometric_normal
        label = "rotating the field into the view plane"
        report(middle, label)
        for number, block in enumerate(blocks, 1):
            fill_pixels(gbuffer, block, gbuffer.triangle[block], corner_field)
            report(middle + (stop - middle) * number / len(blocks), label)
    return geometric_normals

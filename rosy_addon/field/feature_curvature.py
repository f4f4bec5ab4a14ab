"""Measure the curvature of a surface between its sharp edges, and how noise of the vertices changes it."""

from dataclasses import dataclass

import numpy as np

from .blocks import bincount_rows
from .connection import build_connection
from .connectivity import smooth_fans
from .creases import filtered_normals, principal_extent, salient_edges, weighted_median
from .curvature import face_curvature, with_smooth_normals
from .frames import angle_between, dot, normalize, transport
from .polygon_arrays import face_area_vectors
from .surface import Surface
from .surface_averages import SurfaceAverages

#: Distance over which curvature is averaged, relative to `principal_extent`.
SCALE = 0.01

#: Ratio of curvature to the curvature of noise below which a part of the surface has no feature.
MIN_NOISE_RATIO = 2.0

#: The noise at a vertex is a function of its distance from the center of area and of the area of the faces around it, each
#: relative to the mean. These differ by more than 1e-3 at most neighboring vertices, so the noise there is independent. In
#: single precision, they are exact to 1e-7, so the noise is exact to 1e-2.
NOISE_RATE = 1e5

#: Displacement at which the effect of noise on the normals is measured, relative to the square root
#: of the mean face area. It must be small.
PROBE = 1e-3


@dataclass(frozen=True, eq=False)
class NoisyCurvature:
    """The curvature of a surface between its salient edges (sharp edges and borders), and its noise.

    Mean curvature and deviator are explained in `curvature.face_curvature`.

    Attributes
    ----------
    salient_ends : (E, 2) int32 ndarray
        The salient edges, as pairs of vertices.
    averages : SurfaceAverages
        Averages between faces and vertices, in the frames of the faces.
    mean : (F,) float64 ndarray
        Mean curvature of each face, in units of 1 / length in object space.
    deviator : (F,) complex128 ndarray
        Deviator of each face: half the difference of the principal curvatures, and their directions.
    mean_noise : (F,) float64 ndarray
    deviator_noise : (F,) complex128 ndarray
        Mean curvature and deviator after random displacements of the vertices that are as strong as the noise
        of the mesh, minus `mean` and `deviator`.
    """

    salient_ends: np.ndarray
    averages: SurfaceAverages
    mean: np.ndarray
    deviator: np.ndarray
    mean_noise: np.ndarray
    deviator_noise: np.ndarray


def of_unit_extent(surface: Surface) -> Surface:
    """Return the surface, scaled to the principal extent 1 and centered at the origin.

    This avoids very large and very small numbers.
    """
    used = surface.used_vertices
    vertices = np.zeros_like(surface.vertices)
    low, high = surface.vertices[used].min(axis=0), surface.vertices[used].max(axis=0)
    vertices[used] = (surface.vertices[used] - 0.5 * (low + high)) / principal_extent(surface)
    return surface.with_vertices(vertices)


def noisy_curvature(surface: Surface) -> NoisyCurvature:
    """Measure the curvature of a surface, and its change by random noise; see `NoisyCurvature`."""
    normals, noise_angle = filtered_normals(surface)
    ends = salient_edges(surface, normals, noise_angle)
    noise = noise_sample(surface, noise_angle)
    fans = smooth_fans(surface.vertices, surface.corner_vertex, surface.face_start, ends)
    x, y = surface.face_frames
    mean, deviator = _bounded_curvature(surface, fans, x, y)
    noisy = surface.with_parts(vertices=surface.vertices + noise)
    frames_noisy = (transport(each, surface.face_normal, noisy.face_normal) for each in (x, y))
    mean_noisy, deviator_noisy = _bounded_curvature(noisy, fans, *frames_noisy)
    averages = SurfaceAverages(surface, build_connection(surface), x, y)
    noise = mean_noisy - mean, deviator_noisy - deviator
    return NoisyCurvature(ends, averages, mean, deviator, *noise)


def _bounded_curvature(
    surface: Surface, corner_fan: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the (F,) mean curvature and the (F,) complex deviator of the faces, as `face_curvature` does.

    x, y are the (F, 3) tangent frames of the faces, in which the deviator is given. Normals are averaged over
    the smooth fans: `corner_fan` holds the (C,) index of the fan of each corner. The curvature is limited to
    the inverse of the square root of the face area, because a face cannot resolve more.
    """
    mean, deviator = face_curvature(with_smooth_normals(surface, corner_fan), x, y)
    vectors = face_area_vectors(surface.vertices, surface.corner_vertex, surface.face_start)
    limit = np.maximum(0.5 * np.sqrt(dot(vectors, vectors)), 1e-300) ** -0.5
    modulus = np.abs(deviator)
    deviator = deviator * np.divide(limit, modulus, out=np.ones_like(limit), where=modulus > limit)
    return np.clip(mean, -limit, limit), deviator


def noise_sample(surface: Surface, noise_angle: float) -> np.ndarray:
    """Return random displacements of the vertices along their normals, as strong as the noise of the mesh.

    The noise is white. It does not depend on the position, the scale and the numbering of the mesh, and is
    the same at vertices that are images of each other under a symmetry. Its amplitude is estimated in two
    ways, by comparing the mesh with a mesh that has white noise of unit amplitude: from the angle by which
    noise rotates the face normals, and from the difference of vertices from the mean of their neighbors. The
    form of the surface increases the first estimate on coarse meshes, and the second one at creases. So the
    smaller estimate is used.

    Parameters
    ----------
    surface : Surface
    noise_angle : float
        Median angle in radians by which noise rotates the face normals (see `creases.filtered_normals`).

    Returns
    -------
    (V, 3) float64 ndarray
        Displacements of the vertices, in object space.
    """
    count = len(surface.vertices)
    normal = normalize(bincount_rows(surface.corner_vertex, surface.corner_normal, count))
    center = np.average(surface.face_center, axis=0, weights=surface.face_area)
    distance = np.linalg.norm(surface.vertices - center, axis=1)
    around = np.bincount(surface.corner_vertex, surface.face_area[surface.corner_face], count)
    used = surface.used_vertices
    measures = [each / max(float(each[used].mean()), 1e-300) for each in (distance, around)]
    place = NOISE_RATE * sum(measures) % 1
    # Uniform from -1 to 1, times the square root of 3: the variance is 1. Displacements are outward, also if all faces
    # are reversed.
    volume = surface.face_area @ dot(surface.face_center - center, surface.face_normal)
    sample = np.copysign(np.sqrt(3), volume) * (2 * place - 1)[:, None] * normal
    faces = surface.corner_vertex, surface.face_start
    vectors = face_area_vectors(surface.vertices, *faces)
    area = np.sqrt(dot(vectors, vectors))
    probe = PROBE * np.sqrt(area.mean())
    displaced = face_area_vectors(surface.vertices + probe * sample, *faces)
    turn = weighted_median(angle_between(vectors, displaced), area)
    by_angle = probe * noise_angle / turn if turn > 0 else 0.0
    ends = surface.edges.ends
    actual = np.median(np.abs(_roughness(surface.vertices, normal, ends)[used]))
    unit = np.median(np.abs(_roughness(sample, normal, ends)[used]))
    by_roughness = actual / unit if unit > 0 else 0.0
    return min(by_angle, by_roughness) * sample


def _roughness(points: np.ndarray, normal: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return (V,) float64: the Laplacian of the normal component of the Laplacian of (V, 3) points.

    The Laplacian of a value is its difference from the mean of its neighbors. `normal` holds the (V, 3) unit
    normals of the points, and `ends` the (E, 2) pairs of neighboring points: the ends of the edges.
    """
    tail, head = ends.T
    degree = np.maximum(np.bincount(ends.ravel(), minlength=len(points)), 1)

    def difference_from_neighbors(values: np.ndarray) -> np.ndarray:
        total = np.bincount(tail, values[head], len(points))
        total += np.bincount(head, values[tail], len(points))
        return values - total / degree

    height = np.stack([difference_from_neighbors(column) for column in points.T], axis=1)
    return difference_from_neighbors(dot(height, normal))


def feature_curvature(surface: Surface) -> np.ndarray:
    """Compute the curvature of the features of a surface at the corners of its triangles.

    It is the larger absolute principal curvature, averaged over the distance `SCALE`, a fraction of
    `principal_extent`. The curvature of noise is subtracted, and the bend at sharp edges does not count. The
    rest shape is used if there is one, so that a deformation does not change the result.

    Parameters
    ----------
    surface : Surface

    Returns
    -------
    (T, 3) float32 ndarray
        Curvature in units of 1 / length, in object space; 0 where the surface is flat.
    """
    if surface.rest_vertices is not None:
        surface = with_smooth_normals(surface.in_rest_shape())
    if not surface.face_normal.any():
        return np.zeros((len(surface.triangles), 3), dtype=np.float32)
    extent, surface = principal_extent(surface), of_unit_extent(surface)
    measured = noisy_curvature(surface)
    averages = measured.averages
    laplacians, area = {degree: averages.laplacian(degree) for degree in (0, 2)}, SCALE**2

    def smooth(values: np.ndarray, degree: int) -> np.ndarray:
        return np.abs(averages.smooth(laplacians[degree], area, averages.node_sums(values, degree)))

    curvature = smooth(measured.mean, 0) + smooth(measured.deviator, 2)
    noise = smooth(measured.mean_noise, 0) + smooth(measured.deviator_noise, 2)
    power = averages.connection.positive_mass * noise**2
    power = averages.smooth(laplacians[0], 16 * area, power)
    signal = curvature**2 - MIN_NOISE_RATIO**2 * np.maximum(power, 0.0)
    curvature = np.sqrt(np.maximum(signal, 0.0)) / extent
    return curvature.astype(np.float32)[averages.connection.corner_node].reshape(-1, 3)

"""Find creases of a surface: chains of sharp edges that are not caused by noise or coarse faces.

A chain with enough strong edges may also contain weak edges. This is hysteresis, as in the edge detector of
Canny, "A Computational Approach to Edge Detection", PAMI 1986. The result does not depend on the view, so
creases do not flicker in animations.
"""

import numpy as np

from ..core.progress import report
from .blocks import bincount_rows, mask
from .connectivity import connected_components
from .frames import angle_between, dot, normalize
from .polygon_arrays import face_area_vectors
from .surface import Surface

#: Number of rounds of the bilateral filter of the normals, and its width: the length of the difference of two
#: unit normals.
FILTER_ROUNDS, FILTER_WIDTH = 8, 0.35

#: An edge is salient if the angle between its faces is at least `SHARP_ANGLE` radians. If the angle is
#: between `MIN_ANGLE` and `SHARP_ANGLE`, the edge is salient if its angle is at least `MIN_RATIO` times the
#: angle of each other edge of its two faces.
MIN_ANGLE, SHARP_ANGLE = np.pi / 6, np.pi / 3
MIN_RATIO = 2.0

#: Both angles are raised to at least this multiple of the median angle by which noise rotates the normals.
NOISE_MULTIPLE = 5.0

#: Shortest chain of salient edges, relative to `principal_extent`.
MIN_LINE_LENGTH = 0.05


#: An edge is weak, and may belong to a chain, if its angle is at least this fraction of the crease angle.
WEAK_SHARE = 0.5

#: A chain is kept if its edges with the full crease angle make up at least this fraction of its length.
MIN_STRONG_SHARE = 0.25

#: Smallest angle between the filtered normals at a crease, relative to the angle between the unfiltered
#: normals.
MIN_FILTERED_SHARE = 0.1

#: Shortest chain on a noisy mesh, in mean edge lengths per radian of noise.
MIN_EDGES_PER_NOISE = 100.0

#: Mean edge length, relative to `Surface.extent`, above which the thresholds for noise are reduced: sharp
#: edges of a coarse mesh are intended.
NOISY_EDGE_LENGTH = 0.02

#: Number of rings of faces around sharp edges in which normals are filtered.
FILTER_RINGS = 4

#: Rounding error of angles in radians, for coordinates in single precision and edges of a thousandth of the size
#: of the mesh. Edges at exactly a threshold are judged in the same way wherever they are.
ROUNDING_ANGLE = 1e-4

#: Smallest crease angle in radians. Smaller angles between normals may be rounding errors.
MIN_CREASE_ANGLE = 1e-3


def weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    """Return the weighted median of (n,) values with (n,) weights; 0 if the total weight is 0."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    if not len(total) or not total[-1] > 0:
        return 0.0
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def filtered_normals(
    surface: Surface, region: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Return face normals after bilateral filtering, which smooths noise and keeps sharp edges.

    Parameters
    ----------
    surface : Surface
    region : (F,) bool ndarray, optional
        The faces to smooth. Other faces keep their normals and do not influence the result. By default all
        faces.

    Returns
    -------
    normals : (F, 3) float64 ndarray
        Unit normals; zero on faces without area.
    noise_angle : float
        The median angle in radians between the normals before and after filtering, over the faces of the
        region, weighted by area.

    References
    ----------
    Zheng, Fu, Au and Tai, "Bilateral Normal Filtering for Mesh Denoising", TVCG 2011.
    """
    region = np.ones(surface.face_count, dtype=bool) if region is None else region
    sides = surface.corner_face[surface.edges.halfedges]
    face_a, face_b = (np.cumsum(region) - 1)[sides[region[sides].all(axis=1)]].T
    unfiltered = normals = surface.face_normal[region]
    corner_vertex = surface.corner_vertex[region[surface.corner_face]]
    face_start = np.concatenate([[0], np.cumsum(np.diff(surface.face_start)[region])])
    vectors = face_area_vectors(surface.vertices, corner_vertex, face_start)
    area = np.sqrt(dot(vectors, vectors))
    area /= max(float(area.max(initial=0.0)), 1e-300)
    for _ in range(FILTER_ROUNDS):
        normal_a, normal_b = normals[face_a], normals[face_b]
        difference = normal_a - normal_b
        weight = np.exp(dot(difference, difference) * (-0.5 / FILTER_WIDTH**2))
        weight_a, weight_b = weight * area[face_b], weight * area[face_a]
        total = normals * area[:, None]
        total += bincount_rows(face_a, weight_a[:, None] * normal_b, len(area))
        total += bincount_rows(face_b, weight_b[:, None] * normal_a, len(area))
        normals = normalize(total)
    noise_angle = weighted_median(angle_between(unfiltered, normals), area)
    result = surface.face_normal.copy()
    result[region] = normals
    return result, noise_angle


def principal_extent(surface: Surface) -> float:
    """Return the extent of a surface along its principal axis, the axis of largest variance of its area.

    It is the length of a thin straight bar with the same variance: the diameter of a sphere, and the side of
    a flat square. Unlike `Surface.extent`, it does not change when the surface is rotated. For a surface
    without area, it is `Surface.extent`.
    """
    points = surface.vertices[surface.triangle_vertex] - surface.vertices[surface.used_vertices[0]]
    cross = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    area = np.sqrt(dot(cross, cross))
    if not area.any():
        return surface.extent
    area /= area.sum()
    points -= area @ points.mean(axis=1)
    # The mean over a triangle of a product of coordinates is (sum over its corners + product of sums) / 12.
    # A bar of length 1 has the variance 1 / 12.
    samples = np.concatenate([points, points.sum(axis=1)[:, None]], axis=1)
    samples *= np.sqrt(area)[:, None, None]
    samples = samples.reshape(-1, 3)
    return float(np.sqrt(np.linalg.eigvalsh(samples.T @ samples)[-1]))


def salient_edges(surface: Surface, normals: np.ndarray, noise_angle: float) -> np.ndarray:
    """Find the salient edges: border edges, and edges that are clearly sharper than the edges around them.

    On a coarse mesh of a smooth surface, neighboring edges have similar angles, so only very sharp edges are
    salient.

    Parameters
    ----------
    surface : Surface
    normals : (F, 3) float64 ndarray
        Face normals after filtering (`filtered_normals`).
    noise_angle : float
        Median angle in radians by which the filter rotates the normals.

    Returns
    -------
    (n, 2) int32 ndarray
        The two vertices of each salient edge.
    """
    edges = surface.edges
    face_a, face_b = surface.corner_face[edges.halfedges].T
    # Faces without area have no normal, so no angle is computed at their edges.
    filtered = angle_between(normals[face_a], normals[face_b])
    unfiltered = angle_between(surface.face_normal[face_a], surface.face_normal[face_b])
    noise = NOISE_MULTIPLE * noise_angle
    # The filter removes noise, and also some sharp edges of coarse meshes.
    is_sharp = np.maximum(filtered, unfiltered) >= SHARP_ANGLE - ROUNDING_ANGLE
    is_sharp &= filtered >= noise
    for angle in (filtered, unfiltered):
        is_clear = angle >= MIN_RATIO * _largest_of_others(surface, angle) + ROUNDING_ANGLE
        is_sharp |= (angle >= max(MIN_ANGLE - ROUNDING_ANGLE, noise)) & is_clear
    is_salient = np.ones(len(edges.ends), dtype=bool)
    is_salient[edges.interior] = is_sharp
    ends = edges.ends[is_salient]
    if not len(ends):
        return ends
    line = connected_components(len(surface.vertices), ends)[ends[:, 0]]
    length = np.bincount(line, _lengths(surface, ends))[line]
    return ends[length >= MIN_LINE_LENGTH * principal_extent(surface)]


def _largest_of_others(surface: Surface, angle: np.ndarray) -> np.ndarray:
    """Return, for each interior edge, the largest angle of all other edges of its two faces.

    `angle` holds the (I,) angles of the interior edges. The result is (I,).
    """
    edges = surface.edges
    all_angles = np.zeros(len(edges.ends))
    all_angles[edges.interior] = angle
    corner_angle = all_angles[edges.corner_edge]
    first = surface.face_start[:-1]
    largest = np.maximum.reduceat(corner_angle, first)
    is_largest = corner_angle == largest[surface.corner_face]
    second = np.maximum.reduceat(np.where(is_largest, 0.0, corner_angle), first)
    is_tied = np.add.reduceat(is_largest.astype(np.int32), first) > 1
    second = np.where(is_tied, largest, second)
    face = surface.corner_face[edges.halfedges]
    return np.where(is_largest[edges.halfedges], second[face], largest[face]).max(axis=1)


def find_creases(surface: Surface, crease_angle: float) -> np.ndarray:
    """Find the creases of a mesh.

    An edge is strong if the angle between the normals of its faces is at least the crease angle, and weak
    if it is at least half of the crease angle. Two more conditions apply to both. The angle between the
    filtered normals must exceed the noise. If shading normals are interpolated across the edge, its angle
    must also be at least `SHARP_ANGLE`, or clearly larger than the angles of the edges around it. A chain
    of connected edges is kept if enough of it is strong, and if it is long compared to the noise of the
    mesh.

    Parameters
    ----------
    surface : Surface
    crease_angle : float
        Angle in radians.

    Returns
    -------
    (n, 2) int32 ndarray
        The two vertices of each edge that is a crease, the smaller index first. Border edges and edges with more
        than two faces are not creases.
    """
    report(0.0, "finding creases")
    edges = surface.edges
    sides = surface.corner_face[edges.halfedges].T
    # Smaller crease angles have no effect.
    crease_angle = max(crease_angle, MIN_CREASE_ANGLE)
    angle = _large_angles(surface.face_normal, sides, WEAK_SHARE / MIN_RATIO * crease_angle)
    if angle.max(initial=0.0) < crease_angle:
        return np.empty((0, 2), np.int32)
    region = _faces_near(surface, edges.ends[edges.interior[angle >= crease_angle]])
    normals, noise_angle = filtered_normals(surface, region)
    ends = edges.ends[edges.interior]
    length = _lengths(surface, ends)
    mean_length = max(float(length.mean()), 1e-300)
    density = min(1.0, NOISY_EDGE_LENGTH * surface.extent / mean_length) ** 2
    noise_angle *= density
    bent = np.flatnonzero(angle >= WEAK_SHARE * crease_angle)
    least = np.maximum(density * MIN_FILTERED_SHARE * angle[bent], NOISE_MULTIPLE * noise_angle)
    bent = bent[angle_between(*normals[sides[:, bent]]) >= least]
    is_candidate = angle[bent] >= SHARP_ANGLE
    is_candidate |= _is_between_fans(surface, edges.halfedges[bent])
    if not is_candidate.all():
        is_candidate |= angle[bent] >= MIN_RATIO * _largest_of_others(surface, angle)[bent]
    bent = bent[is_candidate]
    ends, length, is_strong = ends[bent], length[bent], angle[bent] >= crease_angle
    chain = connected_components(len(surface.vertices), ends)[ends[:, 0]]
    total = np.bincount(chain, length)[chain]
    is_kept = np.bincount(chain, length * is_strong)[chain] >= MIN_STRONG_SHARE * total
    is_kept &= total >= MIN_EDGES_PER_NOISE * noise_angle * mean_length
    return ends[is_kept]


def _lengths(surface: Surface, ends: np.ndarray) -> np.ndarray:
    """Return the (n,) lengths of edges, given by (n, 2) vertices."""
    edge = surface.vertices[ends[:, 0]] - surface.vertices[ends[:, 1]]
    return np.sqrt(dot(edge, edge))


def _large_angles(normals: np.ndarray, sides: np.ndarray, least: float) -> np.ndarray:
    """Return the (I,) angles in radians between the normals of pairs of faces; 0 for angles below `least`.

    `normals` holds the (F, 3) face normals, and `sides` the pairs of faces: the first ones and the second
    ones, (2, I). `least` is in radians.
    """
    angle = np.zeros(sides.shape[1])
    a, b = sides
    is_large = sum(x[a] * x[b] for x in np.ascontiguousarray(normals.T)) < np.cos(least)
    angle[is_large] = angle_between(normals[a[is_large]], normals[b[is_large]])
    return angle


def _faces_near(surface: Surface, ends: np.ndarray) -> np.ndarray:
    """Return (F,) bool: whether each face is within `FILTER_RINGS` rings of edges.

    `ends` holds the edges, as pairs of vertices.
    """
    is_near = mask(len(surface.vertices), ends)
    for _ in range(FILTER_RINGS):
        faces = np.logical_or.reduceat(is_near[surface.corner_vertex], surface.face_start[:-1])
        is_near[surface.corner_vertex[faces[surface.corner_face]]] = True
    return faces


def _is_between_fans(surface: Surface, halfedges: np.ndarray) -> np.ndarray:
    """Return (n,) bool: whether shading normals are discontinuous across each of n edges.

    `halfedges` is (n, 2): the corners at which an edge starts in its two faces (rows of `Edges.halfedges`).
    """
    fan, following = surface.corner_fan, surface.next_corner
    a, b = halfedges.T
    return (fan[a] != fan[following[b]]) | (fan[following[a]] != fan[b])

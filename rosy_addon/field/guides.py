"""Make guides for generated fields from mesh edges, strokes, UV maps and axes.

A *guide* is a vector on a face that one of the N members of the field should follow. The arrays of guides are
zero on faces without a guide.
"""

from collections.abc import Sequence

import numpy as np

from ..core.errors import RosyError
from .blocks import mask
from .closest_point import closest_triangles
from .connectivity import are_pairs
from .frames import dot, normalize
from .polygon_arrays import mean_per_face, sum_per_face
from .representation import complex_bincount, from_representation, to_representation, unit_complex
from .surface import Surface

#: Largest distance of a stroke point from the surface, relative to `Surface.extent`. Points farther
#: away are ignored.
MAX_STROKE_DISTANCE = 0.05

#: Smallest distance between samples of a stroke, relative to `Surface.extent`. It is used where half the mean
#: edge length is less: on a mesh with a few large faces and many tiny ones.
MIN_STROKE_SPACING = 2.0**-14

#: Upper bound of the rounding errors of the angles between the axes of a UV map, in radians. Where two directions
#: are equally near to both axes, all faces take the clockwise one.
TIE_ANGLE = 1e-6

#: Largest number of samples of all strokes.
MAX_STROKE_SAMPLES = 1_000_000


def guides_from_edges(surface: Surface, ends: np.ndarray, degree: int) -> np.ndarray:
    """Make guides along mesh edges, on the faces to which these edges belong.

    Parameters
    ----------
    surface : Surface
    ends : (E, 2) int ndarray
        Pairs of vertices, in any order. Pairs that are not an edge of the mesh are ignored.
    degree : int
        N of the field. On a face with several of the edges, the guide is the mean of their directions in
        the RoSy representation, which is zero if they cancel. For odd degrees, the direction of an edge
        follows the counter-clockwise order of the vertices of the face.

    Returns
    -------
    (F, 3) float64 ndarray
        Unit vectors; zero on faces without a guide.
    """
    edges, points = surface.edges, surface.vertices[surface.corner_vertex]
    corner = np.flatnonzero(are_pairs(edges.ends, ends)[edges.corner_edge])
    face = surface.corner_face[corner]
    edge = normalize(points[surface.next_corner[corner]] - points[corner])
    # On a face that is not planar, the edge direction is projected to the face plane and normalized again.
    edge -= dot(edge, surface.face_normal[face])[:, None] * surface.face_normal[face]
    return average_guides(surface, face, normalize(edge), degree)


def feature_edges(surface: Surface, angle: float) -> np.ndarray:
    """Find the border edges and the sharp edges of a surface.

    Parameters
    ----------
    surface : Surface
    angle : float
        Smallest angle in radians between the normals of the two faces at a sharp edge.

    Returns
    -------
    (E, 2) int32 ndarray
        Pairs of vertices. Nonmanifold edges count as border edges.
    """
    edges = surface.edges
    is_feature = ~mask(len(edges.ends), edges.interior)
    normal = surface.face_normal
    normal_a, normal_b = (normal[surface.corner_face[side]] for side in edges.halfedges.T)
    # Faces without area have no normal, so no angle is computed at their edges.
    dihedral = np.arccos(np.clip(dot(normal_a, normal_b), -1, 1))
    sharp = (dihedral >= angle) & normal_a.any(axis=1) & normal_b.any(axis=1)
    is_feature[edges.interior[sharp]] = True
    return edges.ends[is_feature]


def guides_from_strokes(surface: Surface, strokes: Sequence[np.ndarray], degree: int) -> np.ndarray:
    """Make guides along strokes, on the faces that they cross.

    Parameters
    ----------
    surface : Surface
    strokes : sequence of (n, 3) float ndarray
        Points of each polyline in object space, in drawing order. Strokes are resampled at a distance of
        half the mean edge length, which removes finer jitter. The distance is at least
        `MIN_STROKE_SPACING`.
    degree : int
        N of the field. The guide of a face is the mean, in the RoSy representation, of the directions of all
        stroke samples on it.

    Returns
    -------
    (F, 3) float64 ndarray
        Unit vectors; zero on faces without a guide.

    Raises
    ------
    RosyError
        If no stroke is within `MAX_STROKE_DISTANCE` of the surface, if all strokes have the length 0, or if
        the strokes need more than `MAX_STROKE_SAMPLES` samples in total.
    """
    spacing = max(0.5 * surface.mean_edge_length, MIN_STROKE_SPACING * surface.extent)
    polylines = [polyline for polyline in map(_polyline, strokes) if len(polyline[0]) > 1]
    if not polylines:
        raise RosyError(f"{surface.name}: no stroke has two different points")
    length = sum(arc_length[-1] for _, arc_length in polylines)
    if length > MAX_STROKE_SAMPLES * spacing:
        raise RosyError(
            f"{surface.name}: the strokes are {length:.3g} long, too long for a mesh of size "
            f"{surface.extent:.3g}: scale them, or move their points to the surface"
        )
    samples = [_resampled(points, arc_length, spacing) for points, arc_length in polylines]
    sample, direction = (np.concatenate(arrays) for arrays in zip(*samples, strict=True))
    max_distance = MAX_STROKE_DISTANCE * surface.extent
    triangle, distance = closest_triangles(surface, sample, max_distance)
    is_close = distance <= max_distance
    face, direction = surface.triangle_face[triangle[is_close]], direction[is_close]
    if not len(face):
        raise RosyError(f"{surface.name}: no stroke is near the surface: draw strokes on it")
    return average_guides(surface, face, direction, degree)


def guides_from_axes(
    surface: Surface, position: np.ndarray, axis: np.ndarray, radius: np.ndarray, degree: int
) -> np.ndarray:
    """Make guides on the faces near points. Each point has an axis, and the guides are its projections to the faces.

    Parameters
    ----------
    surface : Surface
    position, axis : (K, 3) float ndarray
        Positions of the points, and directions of their axes, in object space.
    radius : (K,) float ndarray
        Faces whose center is within this distance of the point get a guide, in object space. If there is
        no such face, the face closest to the point gets the guide.
    degree : int
        N of the field.

    Returns
    -------
    (F, 3) float64 ndarray
        Unit vectors; zero on faces without a guide.
    """
    face = []
    closest_face = surface.triangle_face[closest_triangles(surface, position)[0]]
    for point, max_distance, closest in zip(position, radius, closest_face, strict=True):
        offset = surface.face_center - point
        chosen = np.flatnonzero(dot(offset, offset) <= max_distance**2)
        face.append(chosen if len(chosen) else np.array([closest]))
    directions = np.repeat(axis, list(map(len, face)), axis=0)
    return average_guides(surface, np.concatenate(face), directions, degree)


def guides_from_uv(surface: Surface, uv: np.ndarray, degree: int) -> np.ndarray:
    """Make guides along the axes of a UV map: along u and v if the degree is a multiple of 4, otherwise along u.

    Parameters
    ----------
    surface : Surface
    uv : (C, 2) float ndarray
        Texture coordinates of each corner.
    degree : int
        N of the field. If it is a multiple of 4, members follow the u axis and the v axis. Where the angle
        between these axes is not a multiple of 360/N degrees, no two members can follow both exactly. The member
        nearest to each axis then deviates from it by the same angle, at most 90/N degrees. For other degrees, the
        guide is the direction of increasing u.

    Returns
    -------
    (F, 3) float64 ndarray
        Unit vectors; zero on faces without area in the map.
    """
    x, y = surface.face_frames
    face, uv = surface.corner_face, np.asarray(uv, dtype=np.float64)
    offset = surface.vertices[surface.corner_vertex] - surface.face_center[face]
    position = dot(offset, x[face]) + 1j * dot(offset, y[face])
    u, v = (uv - mean_per_face(uv, surface.face_start)[face]).T
    # Least squares fit of the linear map from (u, v) to the face plane.
    products = u * u, u * v, v * v, u * position, v * position
    uu, uv_sum, vv, up, vp = (sum_per_face(product, surface.face_start) for product in products)
    area = uu * vv - uv_sum**2
    degenerate = area <= 1e-12 * np.maximum(uu * vv, 1e-300)
    along_u, along_v = vv * up - uv_sum * vp, uu * vp - uv_sum * up
    if degree % 4 == 0:
        # Turn from u by half of the angle between the axes, modulo 2 pi / N.
        between = unit_complex(np.conj(along_u) * along_v) ** degree
        angle = (np.angle(between * np.exp(1j * TIE_ANGLE)) - TIE_ANGLE) / (2 * degree)
        along_u = along_u * np.exp(1j * angle)
    along_u = np.where(degenerate, 0, unit_complex(along_u))
    return along_u.real[:, None] * x + along_u.imag[:, None] * y


def average_guides(
    surface: Surface, face: np.ndarray, vectors: np.ndarray, degree: int
) -> np.ndarray:
    """Average the given vectors on each face, in the RoSy representation.

    Vectors are projected to the plane of their face and weighted by their projected length.

    Parameters
    ----------
    surface : Surface
    face : (n,) int ndarray
        Face of each vector.
    vectors : (n, 3) float ndarray
        Member vectors in object space.
    degree : int
        N of the field.

    Returns
    -------
    (F, 3) float64 ndarray
        Unit member vectors of the means; zero on faces without vectors, and where the vectors cancel.
    """
    x, y = surface.face_frames
    z = to_representation(vectors, x[face], y[face], degree)
    total = complex_bincount(face, z, surface.face_count)
    magnitude_sum = np.bincount(face, np.abs(z), surface.face_count)
    defined = np.abs(total) > 1e-6 * np.where(magnitude_sum > 0, magnitude_sum, np.inf)
    total = np.divide(total, np.abs(total), out=np.zeros_like(total), where=defined)
    return from_representation(total, x, y, degree)


def _polyline(stroke: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the (m, 3) points of a stroke without consecutive duplicates, and their (m,) arc lengths."""
    stroke = np.asarray(stroke, dtype=np.float64).reshape(-1, 3)
    with np.errstate(over="ignore"):  # a length may be infinite
        length = np.sqrt((np.diff(stroke, axis=0) ** 2).sum(axis=1))
    is_kept = np.concatenate([[True], length > 0])
    return stroke[is_kept], np.concatenate([[0], np.cumsum(length[length > 0])])


def _resampled(
    points: np.ndarray, arc_length: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Resample a polyline at about equal distances.

    `points` holds its (m, 3) points, and `arc_length` the (m,) arc lengths from its start to these points.

    Returns
    -------
    points : (n, 3) float64 ndarray
        Points along the polyline at distances of about `spacing`.
    directions : (n, 3) float64 ndarray
        Unit directions of the polyline at these points, by central differences.
    """

    def points_at(place: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(place, arc_length, column) for column in points.T], axis=1)

    count = max(int(arc_length[-1] / spacing), 1)
    middle = (np.arange(count) + 0.5) * (arc_length[-1] / count)
    return points_at(middle), normalize(points_at(middle + spacing) - points_at(middle - spacing))

"""Measure a field: its Dirichlet energy, and its difference from another field."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.errors import RosyError
from ..core.progress import progress, report
from .blocks import row_blocks
from .directional_field import direction_coordinates
from .frames import dot, normalize
from .representation import face_representation, matching_angles, unit_complex
from .rosy_field import RosyField
from .singularities import find_singularities, first_pairs
from .surface import Surface

#: Singularities match if their distance is at most this fraction of the longest side of the bounding box.
DEFAULT_REACH = 0.05

#: Number of distances that are computed at once, to bound memory.
DISTANCES_PER_BLOCK = 2_000_000

#: Fraction of the area on which the error is at most `Difference.p95`.
PERCENTILE = 0.95


@dataclass(frozen=True, eq=False)
class Difference:
    """The angle between two fields of the same degree on each face, and statistics of it.

    Attributes
    ----------
    angle : (F,) float64 ndarray
        Angle between a vector of one field and the nearest vector of the other, in radians from 0 to
        pi/N. It is the same for all N vectors of a face. NaN where either field is undefined. If the
        directions of a field are not rotationally symmetric, it is the least mean angle between matched
        directions (see `Field.difference`).
    mean, rms : float
        Mean and root mean square of the angle in radians, weighted by area.
    p95 : float
        95th percentile of the angle in radians, weighted by area.
    max : float
        Largest angle, in radians.
    worst_face : int
        The face with the largest angle; -1 if there is no face on which both fields are defined.
    compared : float
        Fraction of the faces on which both fields are defined, from 0 to 1.
    """

    angle: NDArray[np.float64]
    mean: float
    rms: float
    p95: float
    max: float
    worst_face: int
    compared: float


class SingularityMatching(NamedTuple):
    """M pairs of singularities of two fields that correspond to each other.

    Attributes
    ----------
    first, second : (M,) intp ndarray
        The singularities of each pair: positions in the arrays of the singular vertices of the first and
        of the second field (see `find_singularities`).
    distance : (M,) float64 ndarray
        Distance between the two singularities of each pair, in object space.
    """

    first: np.ndarray
    second: np.ndarray
    distance: np.ndarray


class FieldComparison(NamedTuple):
    """The differences between two fields on the same surface.

    Attributes
    ----------
    difference : Difference
        Angle between the fields on each face, and its statistics.
    singularity_count, other_count : int
        Number of singularities of each field.
    matched_count : int
        Number of pairs of singularities, one of each field, with the same index and a distance of at most
        `DEFAULT_REACH`, a fraction of the longest side of the bounding box.
    """

    difference: Difference
    singularity_count: int
    other_count: int
    matched_count: int


def dirichlet_energy(surface: Surface, field: RosyField) -> float:
    """Compute the Dirichlet energy of the directions of a field.

    The energy is the integral of ``|grad z|^2``, where z is the representation of the field, normalized to
    modulus 1. It is discretized by two-point fluxes, as the sum over the edges between two faces f and g of
    ``w |z_f - r z_g|^2``. Here r, of modulus 1, transports the representation from face g to face f: N times
    the angle between their frames, when the faces are unfolded into a plane. The weight w is the length of
    the edge, divided by the sum of the distances of the two face centers from the edge.

    The energy has no unit, so it does not depend on the scale of the mesh. The smoothest field on a sphere
    has an energy of about 4 pi N. The contribution of each singularity grows slowly with the resolution of
    the mesh. Faces where the field is undefined are ignored.
    """
    z = unit_complex(face_representation(surface, field))
    halfedges = surface.edges.halfedges
    angle = field.degree * matching_angles(surface, z, field.degree)
    length, center_distance = edge_lengths(surface, *halfedges.T)
    defined = (z[surface.corner_face[halfedges]] != 0).all(axis=1) & (center_distance > 0)
    weight = np.divide(length, center_distance, out=np.zeros_like(length), where=defined)
    return float((weight * 2 * (1 - np.cos(angle)))[defined].sum())


def edge_lengths(surface: Surface, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths of I interior edges, and how far the centers of their two faces are from them.

    Parameters
    ----------
    surface : Surface
    a, b : (I,) int ndarray
        For the first and the second face of each edge, the corner at which the edge starts (the columns of
        `Edges.halfedges`).

    Returns
    -------
    length : (I,) float64 ndarray
        Length of each edge, in object space.
    center_distance : (I,) float64 ndarray
        Distance of the center of the first face from the line of the edge, plus the distance of the center
        of the second face from this line, in object space.
    """
    start = surface.vertices[surface.corner_vertex[a]]
    edge = surface.vertices[surface.corner_vertex[b]] - start
    direction = normalize(edge)
    center_distance = np.zeros(len(a))
    for corner in (a, b):
        offset = surface.face_center[surface.corner_face[corner]] - start
        offset -= dot(offset, direction)[:, None] * direction
        center_distance += np.sqrt(dot(offset, offset))
    return np.sqrt(dot(edge, edge)), center_distance


def angle_errors(surface: Surface, field: RosyField, other: RosyField) -> np.ndarray:
    """Compute the angle between two fields of the same degree on each face.

    Parameters
    ----------
    surface : Surface
    field, other : RosyField

    Returns
    -------
    (F,) float64 ndarray
        Angle in radians between a member of `field` and the nearest member of `other`, from 0 to pi / N. NaN
        on faces where either field is undefined. If `field` or `other` has `direction_ratios`, the N
        directions of one field are matched with the N directions of the other, in their order around the
        normal. There are N such matchings. The angle is then the least mean angle between matched directions.

    Raises
    ------
    RosyError
        If the degrees differ.
    """
    if field.degree != other.degree:
        raise RosyError(
            f"{surface.name}: a field of degree {field.degree} cannot be compared with one of "
            f"{other.degree}"
        )
    if field.direction_ratios is None and other.direction_ratios is None:
        z, other_z = (face_representation(surface, f) for f in (field, other))
        error = np.abs(np.angle(z * other_z.conj())) / field.degree
        error[(z == 0) | (other_z == 0)] = np.nan
        return error
    error = _matched_direction_angles(surface, field, other)
    error[~(field.vectors.any(axis=1) & other.vectors.any(axis=1))] = np.nan
    return error


def _matched_direction_angles(surface: Surface, field: RosyField, other: RosyField) -> np.ndarray:
    """Return (F,) mean angles between matched directions of two fields, in radians.

    On each face, the best of the N matchings that keep the order around the normal is used.
    """
    z, other_z = (direction_coordinates(surface, f) for f in (field, other))
    best = np.full(surface.face_count, np.inf)
    for shift in range(field.degree):
        angles = np.abs(np.angle(z * np.roll(other_z, shift, axis=1).conj()))
        np.minimum(best, angles.mean(axis=1), out=best)
    return best


def error_statistics(surface: Surface, error: np.ndarray) -> Difference:
    """Return angular errors with their statistics over the surface, weighted by the areas of the faces.

    If the error is NaN on all faces, all statistics are 0, and `worst_face` is -1.

    Parameters
    ----------
    surface : Surface
    error : (F,) float ndarray
        Errors in radians, such as the result of `angle_errors`. NaN is ignored.
    """
    defined = np.flatnonzero(np.isfinite(error))
    if not len(defined):
        return Difference(error, 0.0, 0.0, 0.0, 0.0, -1, 0.0)
    corner = surface.vertices[surface.triangle_vertex]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.bincount(surface.triangle_face, np.sqrt(dot(cross, cross)) / 2, surface.face_count)
    values, weight = error[defined], area[defined] / max(float(area[defined].sum()), 1e-300)
    order = np.argsort(values, kind="stable")
    rank = np.searchsorted(np.cumsum(weight[order]), PERCENTILE)
    p95 = values[order[min(rank, len(order) - 1)]]
    statistics = weight @ values, np.sqrt(weight @ values**2), p95, values.max()
    worst, compared = int(defined[np.argmax(values)]), len(defined) / len(error)
    return Difference(error, *map(float, statistics), worst, compared)


def format_degrees(degrees: float) -> str:
    """Return an angle as text, rounded to three significant digits and at most three decimal places."""
    return f"{round(degrees, 3):.3g}"


def match_on_surface(
    surface: Surface,
    singularities: tuple[np.ndarray, np.ndarray],
    other: tuple[np.ndarray, np.ndarray],
    reach: float = DEFAULT_REACH,
) -> SingularityMatching:
    """Match singularities of two fields that have the same index and are near to each other.

    The nearest pairs are matched first. Each singularity is in at most one pair.

    Parameters
    ----------
    surface : Surface
    singularities, other : pair of (K,) int ndarrays
        The singular vertices of two fields of the same degree N, and their indices in units of 1/N: results
        of `singularities.find_singularities`.
    reach : float
        Largest straight-line distance between the singularities of a pair, as a fraction of the longest side
        of the bounding box of the mesh.

    Returns
    -------
    SingularityMatching
        Pairs in ascending order of `first`.
    """
    (vertex, index), (other_vertex, other_index) = singularities, other
    points, other_points = surface.vertices[vertex], surface.vertices[other_vertex]
    reach *= surface.extent
    found = []
    rows = max(DISTANCES_PER_BLOCK // max(len(other_index), 1), 1)
    for block in row_blocks(len(index), rows):
        report(block.start / max(len(index), 1), "matching singularities")
        squared = np.zeros((len(index[block]), len(other_index)))
        for coordinate in range(3):
            squared += (points[block, None, coordinate] - other_points[None, :, coordinate]) ** 2
        first, second = np.nonzero((squared <= reach**2) & (index[block, None] == other_index))
        found.append((first + block.start, second, np.sqrt(squared[first, second])))
    first, second, distance = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((second, first, distance))
    # Positions of the candidates in the lists of both fields.
    chosen = order[first_pairs(np.stack([first, len(index) + second], axis=1)[order])]
    chosen = chosen[np.argsort(first[chosen])]
    return SingularityMatching(first[chosen], second[chosen], distance[chosen])


def compare_fields(surface: Surface, field: RosyField, other: RosyField) -> FieldComparison:
    """Compare two fields of the same degree on a surface: their angles and their singularities."""
    report(0.0, "comparing the fields")
    difference = error_statistics(surface, angle_errors(surface, field, other))
    with progress(0.2, 0.5):
        own = find_singularities(surface, field)
    with progress(0.5, 0.8):
        others = find_singularities(surface, other)
    with progress(0.8, 1.0):
        matching = match_on_surface(surface, own, others)
    return FieldComparison(difference, len(own[0]), len(others[0]), len(matching.distance))

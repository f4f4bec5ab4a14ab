"""Rotate a field by one angle on each connected component, to align it with the surface. Its energy does not change.

The angle depends only on the shape: after a reflection, a rigid motion, a scaling or a reversal of all faces, the lines
of the field are the same. On each connected component, the first of these criteria that prefers an angle decides:

1. the principal directions of curvature (even degrees),
2. creases and borders,
3. the directions away from the center of the component,
4. the principal directions, for the members and their opposites (odd degrees),
5. the edges of the mesh, which depend on how it is divided into faces,
6. the edges, for a RoSy of k N directions that contains the N members. Only this criterion decides on solids such as
   a cube.

Criteria 4 and 6 allow k angles (k = 2 in criterion 4), and the one nearest to criterion 3 is taken. If criterion 3
prefers none of them, they are images of each other under the symmetries of the surface, and rounding errors decide.
"""

from collections.abc import Iterator

import numpy as np

from .connectivity import connected_components
from .curvature import face_curvature, with_smooth_normals
from .frames import angle_between, dot
from .polygon_arrays import sum_per_face
from .representation import complex_bincount, power, unit_complex
from .surface import Surface

#: A criterion decides if its sum over a component is at least this fraction of the sum of the moduli. By symmetry the
#: sum is 0 on many shapes. With 0.01, criterion 3 misses degree 3 on a head with one mirror plane.
LEAST_SHARE = 0.003

#: The sum of the moduli has to be at least this fraction of the area. It is smaller if there are only rounding errors,
#: or if the mesh is nearly flat or round.
LEAST_STRENGTH = 1e-3

#: Curvature below which a surface counts as flat, relative to the curvature of a sphere of the same area.
FLAT_CURVATURE = 0.02

#: Largest multiple k of the degree for criterion 6. It is a multiple of 3 and of 4. So for each degree N, there is a k
#: for which the directions along the edges do not cancel on the squares of a cube, and one for triangles.
MAX_MULTIPLE = 12

#: Smallest angle between the faces of a crease, in radians: the angle of sharp edges of *Features*.
CREASE_ANGLE = np.pi / 6


def freely_rotated(surface: Surface, z: np.ndarray, degree: int) -> np.ndarray:
    """Return (F,) representations z of a field, rotated by one angle on each connected component.

    Parameters
    ----------
    surface : Surface
    z : (F,) complex128 ndarray
        Representations in the frames of the faces, of modulus 1 or 0.
    degree : int
        N.
    """
    faces = surface.corner_face[surface.edges.halfedges]
    component = connected_components(surface.face_count, faces)
    area = np.bincount(component, surface.face_area)
    rotation = np.zeros(len(area), dtype=np.complex128)

    def sums(wanted: np.ndarray, present: np.ndarray) -> np.ndarray:
        """Return (components,) complex sums whose phases rotate the field to a criterion; 0 if it does not decide."""
        total = complex_bincount(component, wanted * present.conj(), len(area))
        largest = np.bincount(component, np.abs(wanted), len(area))
        decides = np.abs(total) > LEAST_SHARE * np.maximum(largest, LEAST_STRENGTH * area)
        return np.where(decides, total, 0)

    for wanted in _criteria(surface, degree, component, area):
        rotation = np.where(rotation == 0, unit_complex(sums(wanted, z)), rotation)
        if rotation.all():
            return z * rotation[component]
    away = np.angle(complex_bincount(component, wanted * z.conj(), len(area)))
    for multiple, wanted in _criteria_of_multiples(surface, degree, area[component]):
        total, turn = sums(wanted, power(z, multiple)), 2 * np.pi / multiple
        angle = np.angle(total) / multiple
        angle += turn * np.rint((away - angle) / turn)
        rotation = np.where((rotation == 0) & (total != 0), np.exp(1j * angle), rotation)
        if rotation.all():
            break
    return z * np.where(rotation == 0, 1, rotation)[component]


def _criteria(
    surface: Surface, degree: int, component: np.ndarray, area: np.ndarray
) -> Iterator[np.ndarray]:
    """Yield (F,) representations of the directions that criteria 1 to 3 prefer. Moduli are weights, in units of area.

    `component` holds the (F,) connected component of each face, and `area` the area of each component.
    """
    if degree % 2 == 0:
        yield _curvature(surface, degree, area[component])
    angle = np.full(len(surface.corner_vertex), np.pi / 2)
    halfedges = surface.edges.halfedges
    normals = surface.face_normal[surface.corner_face[halfedges]]
    angle[halfedges] = angle_between(normals[:, 0], normals[:, 1])[:, None]
    yield _along_edges(surface, degree, np.where(angle > CREASE_ANGLE, angle, 0))
    scale = np.maximum(area, 1e-300)
    moments = [np.bincount(component, surface.face_area * c) for c in surface.face_center.T]
    offset = surface.face_center - (np.stack(moments, axis=1) / scale[:, None])[component]
    x, y = surface.face_frames
    away = dot(offset, x) + 1j * dot(offset, y)
    distance = np.abs(away) / np.sqrt(scale)[component]
    yield surface.face_area * distance * power(unit_complex(away), degree)


def _criteria_of_multiples(
    surface: Surface, degree: int, area: np.ndarray
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield, for criteria 4 to 6, k and the directions that they prefer, as (F,) representations of the degree k N.

    N is `degree`. `area` holds, for each face, the area of its connected component: (F,).
    """
    if degree % 2:
        yield 2, _curvature(surface, 2 * degree, area)
    for multiple in range(1, MAX_MULTIPLE + 1):
        yield multiple, _along_edges(surface, multiple * degree)


def _curvature(surface: Surface, degree: int, area: np.ndarray) -> np.ndarray:
    """Return (F,) representations of principal directions, whose moduli are face area times confidence.

    For degrees that are no multiple of 4, only the direction of the principal curvature with the larger modulus counts.
    Unlike the signs of curvatures, it does not change if all faces are reversed. `area` holds, for each face, the area
    of its connected component: (F,).
    """
    smooth = with_smooth_normals(surface)
    mean, deviator = face_curvature(smooth, *smooth.face_frames)
    flat = FLAT_CURVATURE * np.sqrt(4 * np.pi / np.maximum(area, 1e-300))
    larger = np.maximum(np.abs(mean), np.abs(deviator)) + flat
    confidence = np.abs(deviator) / larger
    if degree % 4:
        confidence = confidence * mean / larger
    return surface.face_area * confidence * power(unit_complex(deviator), degree // 2)


def _along_edges(surface: Surface, degree: int, weight: np.ndarray | float = 1.0) -> np.ndarray:
    """Return (F,) complex sums over the edges of each face: their representations, times squared length and weight.

    For odd degrees, a direction differs from its opposite, and edges change their direction if faces are reversed. So
    the direction across the edge, away from the face, is used instead. `weight` has a value for each corner, for the
    edge that starts there.
    """
    x, y = surface.face_frames
    face, points = surface.corner_face, surface.vertices[surface.corner_vertex]
    edge = points[surface.next_corner] - points
    along = dot(edge, x[face]) + 1j * dot(edge, y[face])
    direction = power(unit_complex(along * (-1j if degree % 2 else 1)), degree)
    values = weight * np.abs(along) ** 2 * direction
    start = surface.face_start
    return sum_per_face(values.real, start) + 1j * sum_per_face(values.imag, start)

"""Choose the rotation of a whole field, which does not change its energy.

The rotation depends on the shape alone: mirror images, reversed faces, rigid motions and scales have the same
field of lines. On each connected component, the first criterion that prefers a rotation decides:

1. the principal directions of curvature (even degrees),
2. creases and borders,
3. the directions away from the center of the component,
4. the principal directions, for twice an odd degree,
5. the edges of the mesh, which depend on how it is divided into faces,
6. the edges for multiples of the degree. On solids such as a cube, the other criteria prefer nothing.

Criteria 4 and 6 leave several rotations, and the one nearest to criterion 3 is taken. If criterion 3 prefers
none of them, they are images of each other under the symmetries of the surface, and rounding errors decide.
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

#: The sum of the moduli has to be at least this fraction of the area: less is rounding, or a mesh that is nearly flat
#: or round.
LEAST_STRENGTH = 1e-3

#: Curvature below which a surface counts as flat, relative to that of a sphere of the same area.
FLAT_CURVATURE = 0.02

#: Largest multiple of the degree for criterion 6. It has the order of the symmetries of a cube, or of a tetrahedron, as a
#: factor, for all degrees.
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
        """Return (components,) sums of rotations to a criterion, 0 where it decides nothing."""
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
    """Yield the (F,) representations of criteria 1 to 3, whose moduli are weights with the unit of an area.

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
    """Yield criteria 4 to 6, as pairs of a multiple k and (F,) representations of the degree k N.

    N is `degree`. `area` holds, for each face, the area of its connected component: (F,).
    """
    if degree % 2:
        yield 2, _curvature(surface, 2 * degree, area)
    for multiple in range(1, MAX_MULTIPLE + 1):
        yield multiple, _along_edges(surface, multiple * degree)


def _curvature(surface: Surface, degree: int, area: np.ndarray) -> np.ndarray:
    """Return (F,) representations of principal directions, times the areas of faces and confidences.

    For degrees that are no multiple of 4, only the direction of the curvature with the larger modulus counts.
    It does not change if all faces are reversed, as the signs of curvatures do. `area` holds, for each face,
    the area of its connected component: (F,).
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
    """Return (F,) sums of representations of directions along edges, times squared lengths and weights.

    Odd degrees need a direction with a sign that reversed faces do not change: away from the face, across the
    edge. `weight` has a value for each corner, for the edge that starts there.
    """
    x, y = surface.face_frames
    face, points = surface.corner_face, surface.vertices[surface.corner_vertex]
    edge = points[surface.next_corner] - points
    along = dot(edge, x[face]) + 1j * dot(edge, y[face])
    direction = power(unit_complex(along * (-1j if degree % 2 else 1)), degree)
    values = weight * np.abs(along) ** 2 * direction
    start = surface.face_start
    return sum_per_face(values.real, start) + 1j * sum_per_face(values.imag, start)

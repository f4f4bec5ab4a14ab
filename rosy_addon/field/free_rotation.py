"""Choose the rotation of a whole field, which does not change its energy.

The rotation depends on the shape alone: mirror images, reversed faces, rigid motions and scales give the same
field of lines. On each connected component, the first of these that prefers a rotation decides: the principal
directions of curvature (even degrees), creases and borders, the directions away from the center, and the edges of the
mesh, which depend on the triangulation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .connectivity import connected_components
from .curvature import face_curvature, with_smooth_normals
from .frames import angle_between, dot
from .polygon_arrays import sum_per_face
from .representation import complex_bincount, power, unit_complex
from .surface import Surface

#: A criterion decides if its sum over a component has at least this modulus, relative to the sum without
#: cancellation and to the area. Smaller sums are noise of the mesh: it shifts those of symmetric shapes, which are
#: 0, by up to 1e-3.
LEAST_SHARE = 0.01

#: Curvature below which a surface counts as flat, relative to that of a sphere of the same area.
FLAT_CURVATURE = 0.02

#: Smallest angle between the faces of a crease, in radians: the angle of sharp edges of *Features*.
CREASE_ANGLE = np.pi / 6


def freely_rotated(surface: Surface, z: np.ndarray, degree: int) -> np.ndarray:
    """Return representations z of a field of degree N, rotated by one angle on each connected component.

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
    count = int(component.max(initial=-1)) + 1
    area = np.bincount(component, surface.face_area, count)
    rotation = np.ones(count, dtype=np.complex128)
    is_open = np.ones(count, dtype=bool)
    for wanted in _criteria(surface, degree, component, area):
        total = complex_bincount(component, wanted * z.conj(), count)
        largest = np.bincount(component, np.abs(wanted) * np.abs(z), count)
        decides = np.abs(total) > LEAST_SHARE * np.maximum(largest, LEAST_SHARE * area)
        decides &= is_open
        rotation[decides] = unit_complex(total[decides])
        is_open &= ~decides
        if not is_open.any():
            break
    return z * rotation[component]


def _criteria(
    surface: Surface, degree: int, component: np.ndarray, area: np.ndarray
) -> Iterator[np.ndarray]:
    """Yield (F,) representations that the field should be near to, times areas; see the module docstring.

    `component` is the connected component of each face, `area` that of each component.
    """
    x, y = surface.face_frames
    if degree % 2 == 0:
        smooth = with_smooth_normals(surface)
        mean, deviator = face_curvature(smooth, *smooth.face_frames)
        flat = FLAT_CURVATURE * np.sqrt(4 * np.pi / np.maximum(area, 1e-300))[component]
        larger = np.maximum(np.abs(mean), np.abs(deviator)) + flat
        confidence = np.abs(deviator) / larger
        if degree % 4:
            # Reversed faces change the sign of both: the direction of the larger modulus is the same.
            confidence = confidence * mean / larger
        yield surface.face_area * confidence * power(unit_complex(deviator), degree // 2)
    face, next_corner = surface.corner_face, surface.next_corner
    edge = surface.vertices[surface.corner_vertex]
    edge = edge[next_corner] - edge
    length = np.sqrt(dot(edge, edge))
    # Odd degrees need a direction with a sign that reversed faces do not change: away from the face.
    along = dot(edge, x[face]) + 1j * dot(edge, y[face])
    direction = power(unit_complex(along * (-1j if degree % 2 else 1)), degree)
    angle = np.full(len(face), np.pi / 2)
    halfedges = surface.edges.halfedges
    normals = surface.face_normal[face[halfedges]]
    angle[halfedges] = angle_between(normals[:, 0], normals[:, 1])[:, None]
    crease = np.where(angle > CREASE_ANGLE, angle, 0) * length**2
    yield _face_sums(surface, crease * direction)
    center = [
        np.bincount(component, surface.face_area * column, len(area))
        for column in surface.face_center.T
    ]
    center = np.stack(center, axis=1) / np.maximum(area, 1e-300)[:, None]
    offset = surface.face_center - center[component]
    away = (dot(offset, x) + 1j * dot(offset, y)) / np.sqrt(np.maximum(area, 1e-300))[component]
    yield surface.face_area * np.abs(away) * power(unit_complex(away), degree)
    yield surface.face_area[:] * _face_sums(surface, direction)


def _face_sums(surface: Surface, values: np.ndarray) -> np.ndarray:
    """Return (F,) complex128 sums of (C,) complex values at the corners of each face."""
    start = surface.face_start
    return sum_per_face(values.real, start) + 1j * sum_per_face(values.imag, start)

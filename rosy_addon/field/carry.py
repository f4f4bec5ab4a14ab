"""Rotate the vectors on the faces of a mesh along with the faces, when the mesh is rotated or deformed."""

import numpy as np

from .frames import coordinates, dot, normalize, tangent_frame
from .polygon_arrays import mean_per_face
from .representation import complex_bincount, unit_complex
from .surface import Surface

#: Largest sine of the angle between a tangent vector and the plane of its face before the motion. Steeper
#: vectors are not tangent to the face, and are not changed.
MAX_SINE = 0.87

#: A change of a vector that is smaller than this fraction of its length is a rounding error, and is not made.
ROUNDING = 3e-6


def carried_vectors(surface: Surface, rest_vertices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return vectors on faces after they are rotated with the motion of their faces.

    The rotation in the plane of a face is the one that takes the corners of the face closest to their new
    positions (least squares). The lengths of vectors do not change.

    Parameters
    ----------
    surface : Surface
        The mesh after the motion.
    rest_vertices : (V, 3) array_like
        Positions of its vertices before the motion.
    vectors : (F, 3) or (F, N, 3) ndarray
        Tangent vectors before the motion.

    Returns
    -------
    ndarray
        float64, in the shape of `vectors`. Vectors do not change on faces that have not moved, and on faces
        that have no area before or after the motion.
    """
    result = np.array(vectors, dtype=np.float64)
    rest_vertices = np.asarray(rest_vertices, dtype=np.float64)
    moved_corner = (rest_vertices != surface.vertices).any(axis=1)[surface.corner_vertex]
    moved = np.logical_or.reduceat(moved_corner, surface.face_start[:-1])
    rest = surface.with_vertices(rest_vertices)
    old_frame, old_offset = _planar_corners(rest)
    new_frame, new_offset = _planar_corners(surface)
    corner_face, count = surface.corner_face, surface.face_count
    covariance = complex_bincount(corner_face, new_offset * old_offset.conj(), count)
    has_area = rest.face_normal.any(axis=1) & surface.face_normal.any(axis=1)
    face = np.flatnonzero(moved & has_area & (covariance != 0))
    rotation = covariance[face] / np.abs(covariance[face])
    before = result.reshape(count, -1, 3)[face]
    new_x, new_y = (axis[face, None] for axis in new_frame)
    with np.errstate(invalid="ignore", over="ignore"):  # vectors that are not finite stay
        z = coordinates(before, *(axis[face] for axis in old_frame)) * rotation[:, None]
        length = np.sqrt(dot(before, before))
        after = normalize(z.real[..., None] * new_x + z.imag[..., None] * new_y) * length[..., None]
        change = np.sqrt(dot(after - before, after - before))
        tangent = np.abs(z) >= np.sqrt(1 - MAX_SINE**2) * length
        carried = np.isfinite(length) & tangent & (change > ROUNDING * length)
    result.reshape(count, -1, 3)[face] = np.where(carried[..., None], after, before)
    return result


def vectors_on_rest_shape(
    surface: Surface, rest_vertices: np.ndarray, vectors: np.ndarray
) -> np.ndarray:
    """Return the vectors on the rest shape that renderers transport to given vectors on the deformed mesh.

    Renderers rotate vectors with the faces. The least-squares linear map from the corners w of a rest face to
    the corners u of the deformed face (complex numbers in the face planes) is u = a w + b conj(w). Its
    rotation, by polar decomposition, is a / |a|. This function applies the inverse rotation.

    Parameters
    ----------
    surface : Surface
        The deformed mesh.
    rest_vertices : (V, 3) ndarray
        Positions of its vertices in the rest shape.
    vectors : (F, 3) ndarray
        Tangent vectors on the deformed faces.

    Returns
    -------
    (F, 3) float64 ndarray
        Vectors of the same lengths. They are zero on faces without area in one of the two shapes.

    See Also
    --------
    rosy_addon.projection.face_values : Transport to the deformed mesh.
    """
    (rest_x, rest_y), w = _planar_corners(surface.with_vertices(rest_vertices))
    (x, y), u = _planar_corners(surface)
    face, count = surface.corner_face, surface.face_count
    # Rotations are relative to the first corner of the face, as in `projection.face_values`.
    w, u = (offset - offset[surface.face_start[:-1]][face] for offset in (w, u))
    squared_norm = np.bincount(face, np.abs(w) ** 2, count)
    ww, uw = (complex_bincount(face, product, count) for product in (w * w, u * w))
    rotation = squared_norm * complex_bincount(face, u * w.conj(), count) - ww.conj() * uw
    z = (dot(vectors, x) + 1j * dot(vectors, y)) * unit_complex(rotation).conj()
    return z.real[:, None] * rest_x + z.imag[:, None] * rest_y


def _planar_corners(surface: Surface) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return the tangent frame of each face, and the (C,) complex128 offsets of corners from face centers."""
    x, y = tangent_frame(surface.face_normal)
    face = surface.corner_face
    points = surface.vertices[surface.corner_vertex]
    points = points - mean_per_face(points, surface.face_start)[face]
    return (x, y), dot(points, x[face]) + 1j * dot(points, y[face])

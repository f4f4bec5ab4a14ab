"""Values of faces carried to the corners, mixed over smooth fans, and carried back."""

from __future__ import annotations

import numpy as np

from .frames import carry, dot, tangent_frame
from .representation import complex_sums, power
from .surface import Surface


def corner_rotations(
    face_normal: np.ndarray, face_x: np.ndarray, corner_face: np.ndarray, corner_normal: np.ndarray
) -> np.ndarray:
    """The turn from each face's frame to the frame of each of its corners.

    A tangent vector with the complex coordinate w in the face's frame, carried by the minimal
    rotation from the face's normal to the corner's, has the coordinate ``w * turn`` in
    ``tangent_frame(corner_normal)``. A representation z of degree N becomes ``z * turn ** N``.

    Parameters
    ----------
    face_normal, face_x : (F, 3) ndarray
        Unit normals, and the first axes of the frames.
    corner_face : (C,) int ndarray
    corner_normal : (C, 3) ndarray

    Returns
    -------
    (C,) complex ndarray
        Of modulus 1; 0 for faces without a frame.
    """
    carried = carry(face_x[corner_face], face_normal[corner_face], corner_normal)
    x, y = tangent_frame(corner_normal)
    turn = dot(carried, x) + 1j * dot(carried, y)
    size = np.abs(turn)
    return np.divide(turn, size, out=np.zeros_like(turn), where=size > 0)


def mix_fans(values: np.ndarray, weights: np.ndarray, corner_fan: np.ndarray) -> np.ndarray:
    """(C,) complex: the weighted mean of `values` over the fan that each corner belongs to.

    The corners of a fan must share a normal, and so a frame. Fans of no weight get 0.
    """
    fans = int(corner_fan.max()) + 1
    total = np.bincount(corner_fan, weights, fans)
    mean = complex_sums(corner_fan, weights * values, fans) / np.where(total > 0, total, 1)
    return mean[corner_fan]


def corner_angles(surface: Surface, points: np.ndarray | None = None) -> np.ndarray:
    """(C,) float64: interior angle of each face at each of its corners, radians, 0 to pi.

    `points` are the (V, 3) positions to measure at, the surface's own if not given.
    """
    corner = (surface.vertices if points is None else points)[surface.corner_vertex]
    ahead = corner[surface.next_corner] - corner
    behind = np.empty_like(ahead)
    behind[surface.next_corner] = -ahead
    cross = np.cross(ahead, behind)
    return np.arctan2(np.sqrt(dot(cross, cross)), dot(ahead, behind))


def smooth_faces(
    surface: Surface, z: np.ndarray, turn: np.ndarray, degree: int, weights: np.ndarray
) -> np.ndarray:
    """(F,) complex: values of faces averaged over their corners' fans and back, once.

    Parameters
    ----------
    surface : Surface
        Whose corner normals agree within each fan.
    z : (F,) complex ndarray
        In the frames that `turn` starts from.
    turn : (C,) complex ndarray
        From `corner_rotations`.
    degree : int
    weights : (C,) float ndarray
        Corner angles, say.
    """
    turned = power(turn, degree)
    mixed = mix_fans(z[surface.corner_face] * turned, weights, surface.corner_fan)
    back = mixed * turned.conj()
    return np.add.reduceat(back, surface.face_start[:-1]) / np.diff(surface.face_start)

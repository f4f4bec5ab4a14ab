"""Smooth face values: transport them to corners, average them over smooth fans, and transport them back.

A smooth fan is a set of corners at a vertex that share a normal.
"""

import numpy as np

from .blocks import by_rows
from .frames import angle_between, dot, tangent_frame, transport
from .polygon_arrays import face_blocks, mean_per_face, next_corners
from .representation import complex_bincount, power, unit_complex
from .surface import Surface


def corner_rotations(surface: Surface, corner_normal: np.ndarray) -> np.ndarray:
    """Return the rotation from the frame of each face to the frame of each of its corners.

    Transport is the minimal rotation from the face normal to the corner normal. A tangent vector
    with the complex coordinate w in the frame of the face has the coordinate ``w * rotation`` in
    ``tangent_frame(corner_normal)``. A representation z of degree N becomes ``z * rotation ** N``.

    Parameters
    ----------
    surface : Surface
        Its `Surface.face_frames` are the frames of the faces.
    corner_normal : (C, 3) ndarray
        Unit normals of the corners.

    Returns
    -------
    (C,) complex ndarray
        Numbers of modulus 1; 0 at the corners of faces without a frame (faces without area).
    """
    face_x, _ = surface.face_frames

    def rotations(face: np.ndarray, normal: np.ndarray) -> np.ndarray:
        transported_x = transport(face_x[face], surface.face_normal[face], normal)
        x, y = tangent_frame(normal)
        return unit_complex(dot(transported_x, x) + 1j * dot(transported_x, y))

    return by_rows(rotations, surface.corner_face, corner_normal)


def average_over_fans(
    values: np.ndarray, weights: np.ndarray, corner_fan: np.ndarray
) -> np.ndarray:
    """Return, for each corner, the weighted mean of the values of all corners in its smooth fan.

    The corners of a fan must have the same normal, and therefore the same frame.

    Parameters
    ----------
    values : (C,) complex ndarray
        A value at each corner, in the frame of the corner.
    weights : (C,) float ndarray
        Weight of each value.
    corner_fan : (C,) int ndarray
        Index of the fan of each corner: `Surface.corner_fan`.

    Returns
    -------
    (C,) complex ndarray
        Means; 0 in fans with a total weight of 0.
    """
    fan_count = int(corner_fan.max()) + 1
    weight_sum = np.bincount(corner_fan, weights, fan_count)
    total = complex_bincount(corner_fan, weights * values, fan_count)
    return (total / np.where(weight_sum > 0, weight_sum, 1))[corner_fan]


def corner_angles(surface: Surface) -> np.ndarray:
    """Return (C,) float64 angles between the two edges at each corner of a face, in radians from 0 to pi."""
    angles = np.empty(len(surface.corner_vertex))
    for _, corners, starts in face_blocks(surface.face_start):
        points, following = surface.vertices[surface.corner_vertex[corners]], next_corners(starts)
        to_next = points[following] - points
        to_previous = np.empty_like(to_next)
        to_previous[following] = -to_next
        angles[corners] = angle_between(to_next, to_previous)
    return angles


def smooth_face_values(
    surface: Surface, z: np.ndarray, rotation: np.ndarray, degree: int, weights: np.ndarray
) -> np.ndarray:
    """Smooth face values once: transport to corners, average over fans, transport back, average.

    Parameters
    ----------
    surface : Surface
        Its corner normals must agree within each fan.
    z : (F,) complex ndarray
        Representations, in the same face frames from which `rotation` was computed.
    rotation : (C,) complex ndarray
        Result of `corner_rotations`.
    degree : int
        N of the representations.
    weights : (C,) float ndarray
        Weights of the corners in the averages over fans, for example their angles.

    Returns
    -------
    (F,) complex ndarray
    """
    corner_phase = power(rotation, degree)
    averaged = average_over_fans(z[surface.corner_face] * corner_phase, weights, surface.corner_fan)
    return mean_per_face(averaged * corner_phase.conj(), surface.face_start)

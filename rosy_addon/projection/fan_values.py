"""The field on the smooth fans of a surface, averaged from its faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..field.frames import dot_components, transform_components
from ..field.representation import signed_power
from ..field.surface import Surface
from .face_values import FaceValues
from .field_channel import FieldChannel, rotation_order
from .vector_components import (
    BLOCK_SIZE,
    VectorComponents,
    cofactor_matrix,
    normalize_components,
    tangent_frame_components,
)


@dataclass(frozen=True, eq=False)
class FanValues:
    """Normals and field values of the K smooth fans of corners.

    Attributes
    ----------
    normal : (3, K) float32 ndarray
        Unit normals.
    representation : (K,) complex64 ndarray
        z in the tangent frame of the normal (`tangent_frame_components`).
    channels : dict of FieldChannel to (K,) complex64 ndarray
        Additional values in the same frame.
    """

    normal: np.ndarray
    representation: np.ndarray
    channels: dict[FieldChannel, np.ndarray]


def fan_values(surface: Surface, linear: np.ndarray, faces: FaceValues, degree: int) -> FanValues:
    """Average the values of the faces around each fan, weighted by their corner angles.

    Each value is transported by the minimal rotation from the face normal to the fan normal. Faces
    where the field is undefined have no weight.

    Parameters
    ----------
    surface : Surface
    linear : (3, 3) float64 ndarray
        Object to world space, without the translation.
    faces : FaceValues
        With corner angles.
    degree : int
    """
    normal = np.array(
        normalize_components(transform_components(surface.fan_normal.T, cofactor_matrix(linear)))
    )
    normal = normal.astype(np.float32)
    frame_x, frame_y = tangent_frame_components(normal)
    count, fan_count = len(surface.corner_vertex), normal.shape[1]
    weight = np.empty(count)
    values = [(faces.representation, degree)]
    values += [
        (face_channel, rotation_order(channel, degree))
        for channel, face_channel in faces.channels.items()
    ]
    sums = [(np.empty(count), np.empty(count)) for _ in values]
    for start in range(0, count, BLOCK_SIZE):
        block = slice(start, min(start + BLOCK_SIZE, count))
        face, fan = surface.corner_face[block], surface.corner_fan[block].astype(np.intp)
        phase = transport_phase(
            [component.take(face) for component in faces.normal],
            [component.take(fan) for component in normal],
            [x.take(fan) for x in frame_x],
            [y.take(fan) for y in frame_y],
        )
        np.multiply(
            faces.corner_angle[block], faces.representation.take(face) != 0, out=weight[block]
        )
        for (face_channel, order), (real, imaginary) in zip(values, sums, strict=True):
            z = face_channel.take(face)
            z *= signed_power(phase, order)
            z *= weight[block]
            real[block], imaginary[block] = z.real, z.imag
    total = np.bincount(surface.corner_fan, weight, fan_count)
    total[total == 0] = np.inf
    averages = []
    for real, imaginary in sums:
        z = np.empty(fan_count, dtype=np.complex64)
        z.real = np.bincount(surface.corner_fan, real, fan_count) / total
        z.imag = np.bincount(surface.corner_fan, imaginary, fan_count) / total
        averages.append(z)
    return FanValues(normal, averages[0], dict(zip(faces.channels, averages[1:], strict=True)))


def transport_phase(
    source: VectorComponents, target: VectorComponents, x: VectorComponents, y: VectorComponents
) -> np.ndarray:
    """Return the rotations from the tangent frames of source normals to those of target normals.

    Parameters
    ----------
    source, target : 3 (n,) ndarrays
        Unit normals.
    x, y : 3 (n,) ndarrays
        Tangent frames of `target`.

    Returns
    -------
    (n,) complex64 ndarray
        Unit numbers: the x axis of the tangent frame of `source`, transported to `target`, in the
        frame x, y. Zero if it cannot be transported.

    Notes
    -----
    As in `field.frames.transport`, v at s becomes v - (v.t) / (1 + s.t) (s + t) at t. The term
    along t is left out, because t is perpendicular to the frame.
    """
    tangents, _ = tangent_frame_components(source)
    fraction = dot_components(tangents, target)
    fraction /= np.maximum(1 + dot_components(source, target), np.finfo(fraction.dtype).eps)
    phase = np.empty(len(fraction), dtype=np.complex64)
    phase.real = dot_components(tangents, x) - fraction * dot_components(source, x)
    phase.imag = dot_components(tangents, y) - fraction * dot_components(source, y)
    modulus = np.sqrt(phase.real * phase.real + phase.imag * phase.imag)
    modulus[modulus == 0] = np.inf
    phase *= np.float32(1) / modulus
    return phase

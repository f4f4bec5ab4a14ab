"""The field of a mesh instance at the corners of its triangles, independent of the camera.

A field is given on the faces of the rest shape. The stored member of each face is transported to
the deformed face (`face_values`). From the faces, the field is transported to the corners and
averaged over each smooth fan of corners. All steps but the first work on the representation
z = rho exp(i N t), so that the result does not depend on which of the N members is stored. Lengths are
averaged on their own: the mean of z is shorter where directions differ, as around singularities.

A field can have more values than z: harmonics for directions that are not evenly spaced, and a number
for the family of the stored member, if the directions are labeled. These channels
(`field_channel.FieldChannel`) are complex numbers too and are computed by the same steps, but they
rotate with the frame by other powers (`field_channel.rotation_order`).

Results are in world space without the translation. Vectors are stored by component, each
component contiguous in memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..core.cache import Cache, cached
from ..core.progress import report
from ..field.frames import dot_components, tangent_frame_components, transform_components
from ..field.representation import signed_power
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from .face_values import TangentValues, face_values
from .field_channel import REPRESENTATION, FieldChannel, rotation_order
from .gbuffer import MeshInstance
from .pixel_blocks import pixel_blocks
from .vector_components import (
    VectorComponents,
    cofactor_matrix,
    cross_components,
    normalize_components,
    polygon_normals,
    relative_to_first,
)


@dataclass(frozen=True, eq=False)
class CornerField:
    """The field and the normals at the corners of T triangles, to be interpolated at pixels.

    Attributes
    ----------
    corner_normals : (3, 3, T) float32 ndarray
        Unit normals n_0, n_1, n_2. The first axis is the corner, the second the component.
    reference_tangent : (3, T) float32 ndarray
        A unit tangent at n_0. The angles of all three corners are relative to it.
    normal_dots : (3, T) float32 ndarray
        The scalar products n_0.n_1, n_0.n_2 and n_1.n_2.
    normal_triple_product : (T,) float32 ndarray
        n_0 . (n_1 x n_2).
    geometric_normal : (3, T) float32 ndarray
        Unit normals of the triangles, oriented by the order of their corners.
    degree : int
        N.
    channels : dict of FieldChannel to (3, T) complex64 ndarray
        z, and the other channels of the field, at each corner. The values at corners 1 and 2 are
        transported to corner 0, along the shortest arc between the normals.
    magnitude : (3, T) float32 ndarray
        Length of the members at each corner; 0 where the field is undefined.
    """

    corner_normals: np.ndarray
    reference_tangent: np.ndarray
    normal_dots: np.ndarray
    normal_triple_product: np.ndarray
    geometric_normal: np.ndarray
    degree: int
    channels: dict[FieldChannel, np.ndarray]
    magnitude: np.ndarray

    @property
    def representation(self) -> np.ndarray:
        """z at each corner, (3, T) complex64."""
        return self.channels[REPRESENTATION]

    def rotated(self, rotation: np.ndarray) -> CornerField:
        """Return a copy in another space: all vectors are rotated by a (3, 3) matrix."""
        corner_normals = [transform_components(corner, rotation) for corner in self.corner_normals]
        return replace(
            self,
            corner_normals=np.stack(corner_normals),
            reference_tangent=transform_components(self.reference_tangent, rotation),
            geometric_normal=transform_components(self.geometric_normal, rotation),
        )


def field_at_corners(
    surface: Surface, matrix: np.ndarray, field: RosyField, display: str
) -> CornerField:
    """Transport a field from the rest shape to the triangle corners of the deformed surface.

    Parameters
    ----------
    surface : Surface
    matrix : (4, 4) or (3, 3) float64 ndarray
        Object to world space. The translation has no effect.
    field : RosyField
    display : {"smooth", "flat"}
        Average values and normals over smooth fans, or keep the values and normals of each face.

    Returns
    -------
    CornerField
        World space.
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    deformed = transform_components(np.ascontiguousarray(surface.vertices.T), linear)
    report(0.0, "averaging the field at corners")
    faces, corner_angle = face_values(surface, linear, deformed, field, display == "smooth")
    report(0.4, "averaging the field at corners")
    fans = None
    if corner_angle is not None:
        fans = _fan_values(surface, linear, faces, corner_angle, field.degree)
    report(0.7, "averaging the field at corners")
    count = len(surface.triangles)
    corner_field = CornerField(
        corner_normals=np.empty((3, 3, count), dtype=np.float32),
        reference_tangent=np.empty((3, count), dtype=np.float32),
        normal_dots=np.empty((3, count), dtype=np.float32),
        normal_triple_product=np.empty(count, dtype=np.float32),
        geometric_normal=np.empty((3, count), dtype=np.float32),
        degree=field.degree,
        channels={channel: np.empty((3, count), dtype=np.complex64) for channel in faces.channels},
        magnitude=np.empty((3, count), dtype=np.float32),
    )
    custom_normals = None
    if fans is not None and not surface.fans_share_normals:
        custom_normals = transform_components(surface.corner_normal.T, cofactor_matrix(linear))
    for block in pixel_blocks(count):
        _fill_triangles(corner_field, block, surface, deformed, faces, fans, custom_normals)
    return corner_field


def cached_corner_field(
    instance: MeshInstance, display: str, cache: Cache | None = None
) -> CornerField:
    """Return the result of `field_at_corners` for an instance with a field; store it in a cache if given.

    `display` is "smooth" or "flat": whether the field is interpolated, or constant on each face.
    All cameras, and instances that differ only in their location, share one corner field.
    """
    surface, field = instance.surface, instance.field
    create = partial(field_at_corners, surface, instance.matrix, field, display)
    linear = np.asarray(instance.matrix, dtype=np.float64)[:3, :3]
    return cached(cache, create, "corner field", surface, field, linear, display)


def _fan_values(
    surface: Surface, linear: np.ndarray, faces: TangentValues, angle: np.ndarray, degree: int
) -> TangentValues:
    """Average the values of the faces around each fan, weighted by their corner angles.

    Each value is transported by the minimal rotation from the face normal to the fan normal. Faces
    where the field is undefined have no weight.

    Parameters
    ----------
    surface : Surface
    linear : (3, 3) float64 ndarray
        Object to world space, without the translation.
    faces : TangentValues
        The field on the faces, in world space without the translation.
    angle : (C,) float32 ndarray
        Interior angle of the face at each of its corners, in radians.
    degree : int
        N of the field.

    Returns
    -------
    TangentValues
        The field on the fans, in the same space.
    """
    normal = transform_components(surface.fan_normal.T, cofactor_matrix(linear))
    normal = np.array(normalize_components(normal), dtype=np.float32)
    frames = tangent_frame_components(normal)
    corner_fan, fan_count, count = surface.corner_fan, normal.shape[1], len(surface.corner_fan)
    weight, length = np.empty((2, count))
    weighted = {channel: np.empty((2, count)) for channel in faces.channels}
    for block in pixel_blocks(count):
        face, fan = surface.corner_face[block], corner_fan[block].astype(np.intp)
        x, y = ([component.take(fan) for component in axis] for axis in frames)
        phase = transport_phase(faces.normal.take(face, axis=1), normal.take(fan, axis=1), x, y)
        is_defined = faces.channels[REPRESENTATION].take(face) != 0
        np.multiply(angle[block], is_defined, out=weight[block])
        np.multiply(weight[block], faces.magnitude.take(face), out=length[block])
        for channel, parts in weighted.items():
            z = faces.channels[channel].take(face)
            z *= signed_power(phase, rotation_order(channel, degree))
            z *= weight[block]
            parts[:, block] = z.real, z.imag
    total = np.bincount(corner_fan, weight, fan_count)
    total[total == 0] = np.inf
    averages = {}
    for channel, parts in weighted.items():
        averages[channel] = z = np.empty(fan_count, dtype=np.complex64)
        z.real, z.imag = (np.bincount(corner_fan, part, fan_count) / total for part in parts)
    magnitude = np.bincount(corner_fan, length, fan_count) / total
    return TangentValues(normal, averages, magnitude.astype(np.float32))


def transport_phase(
    source: VectorComponents, target: VectorComponents, x: VectorComponents, y: VectorComponents
) -> np.ndarray:
    """Return the rotations from the tangent frames of source normals to the frames of target normals.

    Parameters
    ----------
    source, target : 3 (n,) ndarrays
        Unit normals, row by row.
    x, y : 3 (n,) ndarrays
        Axes of the tangent frames of `target`.

    Returns
    -------
    (n,) complex64 ndarray
        Unit numbers: the x axis of the tangent frame of `source`, transported to `target`, in the
        frame x, y. They may be 0 if a normal is zero or if the two normals are almost opposite.

    Notes
    -----
    As in `field.frames.transport`, a vector v at the source normal s becomes
    v - (v.t) / (1 + s.t) (s + t) at the target normal t. The term along t is left out, because t is
    perpendicular to the frame.
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


def _fill_triangles(
    corner_field: CornerField,
    block: slice,
    surface: Surface,
    deformed: np.ndarray,
    faces: TangentValues,
    fans: TangentValues | None,
    custom_normals: np.ndarray | None,
) -> None:
    """Write the field and the normals of one block of triangles into `corner_field`.

    `deformed` holds the (3, V) vertices in world space without the translation. `faces` and `fans` are the
    field on the faces and on the smooth fans of the surface. If `fans` is None (flat display), the corners
    get the values and normals of their faces. `custom_normals`, (3, C) or None, are normals at all corners of
    the surface, which replace the normals of the fans.
    """
    corners = surface.triangles[block].T.astype(np.intp)
    face = surface.triangle_face[block]
    geometric_normal = faces.normal.take(face, axis=1)
    if len(surface.triangles) > surface.face_count:
        vertices = [surface.corner_vertex.take(corner) for corner in corners]
        geometric_normal[:] = polygon_normals(relative_to_first(deformed, vertices))
    if fans is None:
        values, index = faces, [face] * 3
        normals, phases = [faces.normal.take(face, axis=1)] * 3, None
    else:
        values, index = fans, surface.corner_fan.take(corners).astype(np.intp)
        normals, phases = _corner_normals(index, corners, fans, custom_normals)
    normals = [_fill_missing_normals(normal, geometric_normal) for normal in normals]
    x, y = tangent_frame_components(normals[0])
    # Where the field of a face is undefined, it is undefined at all corners of the face.
    defined = faces.channels[REPRESENTATION].take(face) != 0
    for corner, normal in enumerate(normals):
        corner_field.corner_normals[corner, :, block] = normal
        magnitude = values.magnitude.take(index[corner])
        np.multiply(magnitude, defined, out=corner_field.magnitude[corner, block])
        rotations = [] if phases is None else [phases[corner]]
        if corner and fans is not None:
            rotations.append(transport_phase(normal, normals[0], x, y))
        for channel, out in corner_field.channels.items():
            order = rotation_order(channel, corner_field.degree)
            z = values.channels[channel].take(index[corner])
            for rotation in rotations:
                z *= signed_power(rotation, order)
            np.multiply(z, defined, out=out[corner, block])
    corner_field.reference_tangent[:, block] = x
    corner_field.geometric_normal[:, block] = geometric_normal
    pairs = (0, 1), (0, 2), (1, 2)
    for out, (first, second) in zip(corner_field.normal_dots, pairs, strict=True):
        out[block] = dot_components(normals[first], normals[second])
    cross_products = cross_components(normals[1], normals[2])
    corner_field.normal_triple_product[block] = dot_components(normals[0], cross_products)


def _fill_missing_normals(normal: np.ndarray, geometric_normal: np.ndarray) -> np.ndarray:
    """Return (3, n) normals in which zero normals are replaced by the geometric normals, (3, n).

    Where a geometric normal is zero too, the result is the z axis.
    """
    missing = dot_components(normal, normal) == 0
    if missing.any():
        replacements = geometric_normal[:, missing]
        replacements[2, ~replacements.any(axis=0)] = 1
        normal = normal.copy()
        normal[:, missing] = replacements
    return normal


def _corner_normals(
    fan: Sequence[np.ndarray], corners: np.ndarray, fans: TangentValues, custom: np.ndarray | None
) -> tuple[list[np.ndarray], list[np.ndarray] | None]:
    """Return the normals at the three corners of triangles, and the rotations of the tangent frames.

    Parameters
    ----------
    fan : 3 (n,) ndarrays of int
        Smooth fans at the first, second and third corner of the triangles.
    corners : (3, n) ndarray of int
        Corners of the triangles, as indices of the corners of the surface.
    fans : TangentValues
        The field on all fans, of which the normals are used.
    custom : (3, C) ndarray or None
        Custom normals at all corners of the surface, of any length. Corners of one fan may differ.

    Returns
    -------
    normals : 3 (3, n) float32 ndarrays
        Unit normals at the first, second and third corner; zero if there is no normal.
    phases : 3 (n,) complex64 ndarrays or None
        Unit complex numbers: the rotations from the tangent frames of the fan normals to the tangent
        frames of the custom normals. None if there are no custom normals.
    """
    normals = [fans.normal.take(index, axis=1) for index in fan]
    if custom is None:
        return normals, None
    targets, phases = [], []
    for normal, corner in zip(normals, corners, strict=True):
        target = normalize_components(custom.take(corner, axis=1))
        targets.append(np.array(target, dtype=np.float32))
        phases.append(transport_phase(normal, targets[-1], *tangent_frame_components(targets[-1])))
    return targets, phases

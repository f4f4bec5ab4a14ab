"""The field on the faces of a deformed surface, transported from the rest shape."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..field.directional_field import field_harmonics
from ..field.frames import tangent_frame_components, transform_components
from ..field.representation import signed_power
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from .field_channel import REPRESENTATION, FieldChannel, rotation_order
from .pixel_blocks import BLOCK_PIXELS, pixel_blocks
from .vector_components import (
    VectorComponents,
    frame_coordinates,
    plane_coordinates,
    polygon_angles,
    polygon_normals,
    relative_to_first,
)

#: Relative tolerance of `similarity_scale`: the rounding error of Blender's single precision
#: matrices.
SIMILARITY_EPS = 2e-6


@dataclass(frozen=True, eq=False)
class TangentValues:
    """The field in the tangent planes of the n faces, or smooth fans, of a deformed surface.

    Attributes
    ----------
    normal : (3, n) float32 ndarray
        Unit normals. Zero for a face without area.
    channels : dict of FieldChannel to (n,) complex64 ndarray
        z, and the other channels of the field, in the tangent frame of the normal
        (`tangent_frame_components`). Zero for a face without area.
    magnitude : (n,) float32 ndarray
        Length of the members: on a fan, the mean of the lengths on its faces. Where directions differ, the
        modulus of z is less.
    """

    normal: np.ndarray
    channels: dict[FieldChannel, np.ndarray]
    magnitude: np.ndarray


def face_values(
    surface: Surface, linear: np.ndarray, deformed: np.ndarray, field: RosyField, with_angles: bool
) -> tuple[TangentValues, np.ndarray | None]:
    """Transport the stored members from the faces of the rest shape to the deformed faces.

    Parameters
    ----------
    surface : Surface
    linear : (3, 3) float64 ndarray
        Object to world space, without the translation.
    deformed : (3, V) float64 ndarray
        The vertices, transformed by `linear`.
    field : RosyField
    with_angles : bool
        Whether to compute the angles of the faces, too.

    Returns
    -------
    faces : TangentValues
    corner_angle : (C,) float32 ndarray or None
        Interior angle of the face at each of its corners, in radians. None without angles.
    """
    count = surface.face_count
    relative = relative_channels(field)
    names = REPRESENTATION, *relative
    channels = {channel: np.empty(count, dtype=np.complex64) for channel in names}
    normals, magnitude = np.empty((3, count), dtype=np.float32), np.empty(count, dtype=np.float32)
    faces = TangentValues(normals, channels, magnitude)
    corner_angle = np.empty(len(surface.corner_vertex), np.float32) if with_angles else None
    scale = similarity_scale(linear) if surface.rest_vertices is None else None
    rest = None if scale else np.ascontiguousarray(surface.in_rest_shape().vertices.T)
    for corner_count, block in _faces_by_size(surface.face_start):
        first_corner = surface.face_start[:-1][block]
        corners = (first_corner + corner for corner in range(corner_count))
        corner_vertex = [surface.corner_vertex.take(corner) for corner in corners]
        points = relative_to_first(deformed, corner_vertex)
        normal = polygon_normals(points)
        faces.normal[:, block] = normal
        frame = tangent_frame_components(faces.normal[:, block].astype(np.float64))
        vectors = [np.ascontiguousarray(component) for component in field.vectors[block].T]
        if rest is None:
            vectors = transform_components(vectors, linear * (1 / scale))
            member = frame_coordinates(vectors, frame)
        else:
            rest_points = relative_to_first(rest, corner_vertex)
            member = _transport_member(rest_points, points, vectors, frame)
        rho = np.abs(member)
        member /= np.maximum(rho, np.finfo(np.float64).tiny)
        has_area = np.logical_or.reduce(normal)
        magnitude[block] = rho * has_area
        for channel, out in faces.channels.items():
            rotation = signed_power(member, rotation_order(channel, field.degree))
            values = rho if channel == REPRESENTATION else relative[channel][block]
            out[block] = values * rotation * has_area
        if with_angles:
            for corner, angle in enumerate(polygon_angles(points)):
                corner_angle[first_corner + corner] = angle
    return faces, corner_angle


def relative_channels(field: RosyField) -> dict[FieldChannel, np.ndarray]:
    """Return the channels of a field besides z: (F,) values relative to the stored members."""
    harmonics = field_harmonics(field).items()
    channels: dict[FieldChannel, np.ndarray] = {("deviation", j): values for j, values in harmonics}
    if field.family_count > 1:
        channels["family", field.family_count] = np.ones(len(field.vectors))
    return channels


def _faces_by_size(face_start: np.ndarray) -> list[tuple[int, slice | np.ndarray]]:
    """Return blocks of faces with equally many corners: pairs of this number and the indices of the faces."""
    corner_counts = np.diff(face_start)
    if (corner_counts == corner_counts[0]).all():
        return [(int(corner_counts[0]), block) for block in pixel_blocks(len(corner_counts))]
    blocks = []
    for corner_count in np.unique(corner_counts).tolist():
        same_count = np.flatnonzero(corner_counts == corner_count)
        # Fewer faces per block if they have many corners, so that blocks need equal memory.
        block_faces = max(4 * BLOCK_PIXELS // max(corner_count, 4), 1)
        parts = pixel_blocks(len(same_count), block_faces)
        blocks += [(corner_count, same_count[part]) for part in parts]
    return blocks


def similarity_scale(linear: np.ndarray, tolerance: float = SIMILARITY_EPS) -> float | None:
    """Return the scale of a (3, 3) linear map, or None if the map is not a similarity.

    A similarity is a uniform scale with a rotation or reflection. `tolerance` is a relative error.
    """
    gram = linear.T @ linear
    squared_scale = np.trace(gram) / 3
    if np.abs(gram - squared_scale * np.eye(3)).max() > tolerance * squared_scale:
        return None
    return float(np.sqrt(squared_scale))


def _transport_member(
    rest: Sequence[VectorComponents],
    deformed: Sequence[VectorComponents],
    vectors: VectorComponents,
    frame: Sequence[VectorComponents],
) -> np.ndarray:
    """Transport vectors from rest faces to deformed faces; return them as complex numbers.

    Parameters
    ----------
    rest, deformed : sequence of vector components
        Corners of the faces in both shapes, as returned by `relative_to_first`.
    vectors : 3 (n,) ndarrays
        Vectors on the rest faces.
    frame : (x, y), each 3 (n,) ndarrays
        Tangent frames of the deformed faces.

    Returns
    -------
    (n,) complex128 ndarray
        The transported vectors in the tangent frames `frame`. Zero for a rest face without area.

    Notes
    -----
    Let the corners, as complex numbers in a frame of their plane, be w in the rest shape and u in
    the deformed shape. The linear map from w to u of least squared error, u = a w + b conj(w), has
    the polar rotation a / |a|. Only this rotation is applied, so the members keep their length and
    their angles of 2 pi / N, even if the face is stretched. Both normals follow from the order of
    the corners, so mirrored faces need no special case.
    """
    rest_normal = polygon_normals(rest)
    rest_frame = tangent_frame_components(rest_normal)
    w, u = plane_coordinates(rest, rest_frame), plane_coordinates(deformed, frame)
    ww = uw = squared_norm = 0
    for w_k, u_k in zip(w, u, strict=True):
        ww, uw = ww + w_k * w_k, uw + u_k * w_k
        squared_norm = squared_norm + (w_k.real**2 + w_k.imag**2)
    rotation = squared_norm * sum(u_k * w_k.conj() for w_k, u_k in zip(w, u, strict=True))
    rotation -= np.conj(ww) * uw
    rotation *= np.logical_or.reduce(rest_normal)
    rotation /= np.maximum(np.abs(rotation), np.finfo(np.float64).tiny)
    return rotation * frame_coordinates(vectors, rest_frame)

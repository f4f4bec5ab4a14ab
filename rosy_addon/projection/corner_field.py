"""The field of a mesh instance at the corners of its triangles, independent of the camera.

A field is given on the faces of the rest shape. The stored member of each face is transported to
the deformed face. From the faces, the field is transported to the corners and averaged over each
smooth fan. All steps but the first work on the representation z = rho exp(i N t), so that the
result does not depend on which of the N members is stored.

A field can have more values than z: the deviations of directions that are not evenly spaced, and
the line that the stored member is on. They are complex numbers too and take the same steps, but
they rotate with the frame by other powers (`rotation_order`).

Results are in world space without the translation. Vectors are stored by component, each
component contiguous in memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..cache import Cache
from ..deterministic_trig import vector_angle
from ..field.directional_field import field_harmonics
from ..field.frames import dot_components, transform_components
from ..field.representation import power, signed_power
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..progress import Progress, Task

#: Faces, corners or triangles per block. Bounds memory, and fits the caches of the processor.
BLOCK_SIZE = 1 << 14

#: Relative tolerance of `_similarity_scale`: the rounding error of Blender's single precision
#: matrices.
SIMILARITY_EPS = 2e-6

#: Vectors as three (n,) arrays: their x, y and z components.
VectorComponents = Sequence[np.ndarray]

#: Key of a value that a field can have in addition to z. ("deviation", j) is the harmonic C_j of
#: `field.directional_field`. ("family", m) is the representation, of degree N / m, of the line that
#: the stored member is on.
FieldChannel = tuple[str, int]


def rotation_order(channel: FieldChannel, degree: int) -> int:
    """Return the power by which a channel rotates with its frame.

    If a unit complex number p rotates z by p^N, it rotates the channel by p to this power.
    """
    kind, number = channel
    return -number if kind == "deviation" else degree // number


@dataclass(frozen=True, eq=False)
class CornerField:
    """The field and the normals at the corners of T triangles, to be interpolated at pixels.

    Attributes
    ----------
    corner_normals : (3, 3, T) float32 ndarray
        Unit normals n_0, n_1, n_2. The first axis is the corner, the second the component.
    reference_tangent : (3, T) float32 ndarray
        A unit tangent at n_0. The angles of all three corners are relative to it.
    representation : (3, T) complex64 ndarray
        z at each corner. The values of corners 1 and 2 are transported along the arc to n_0.
    normal_dots : (3, T) float32 ndarray
        The scalar products n_0.n_1, n_0.n_2 and n_1.n_2.
    normal_triple_product : (T,) float32 ndarray
        n_0 . (n_1 x n_2).
    geometric_normal : (3, T) float32 ndarray
        Unit normals of the triangles, oriented by the order of their corners.
    channels : dict of FieldChannel to (3, T) complex64 ndarray
        Additional values, transported like `representation`.
    """

    corner_normals: np.ndarray
    reference_tangent: np.ndarray
    representation: np.ndarray
    normal_dots: np.ndarray
    normal_triple_product: np.ndarray
    geometric_normal: np.ndarray
    channels: dict[FieldChannel, np.ndarray]

    def rotated(self, rotation: np.ndarray) -> CornerField:
        """Return the same values with all vectors rotated by a (3, 3) matrix into another space."""
        return replace(
            self,
            corner_normals=np.stack(
                [transform_components(corner, rotation) for corner in self.corner_normals]
            ),
            reference_tangent=transform_components(self.reference_tangent, rotation),
            geometric_normal=transform_components(self.geometric_normal, rotation),
        )


def corner_field_task(
    surface: Surface, matrix: np.ndarray, field: RosyField, display: str
) -> Task[CornerField]:
    """Transport a field from the rest shape to the triangle corners of the deformed surface.

    Parameters
    ----------
    surface : Surface
    matrix : (4, 4) float64 ndarray
        Object to world space. The translation has no effect.
    field : RosyField
    display : {"smooth", "flat"}
        Average values and normals over smooth fans, or keep those of each face.

    Yields
    ------
    Progress

    Returns
    -------
    CornerField
        In world space.
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    deformed = transform_components(np.ascontiguousarray(surface.vertices.T), linear)
    yield Progress(0.0, "averaging the field at corners")
    faces = _face_values(surface, linear, deformed, field, with_angles=display == "smooth")
    yield Progress(0.4, "averaging the field at corners")
    fans = _fan_values(surface, linear, faces, field.degree) if display == "smooth" else None
    yield Progress(0.7, "averaging the field at corners")
    count = len(surface.triangles)
    corner_field = CornerField(
        corner_normals=np.empty((3, 3, count), dtype=np.float32),
        reference_tangent=np.empty((3, count), dtype=np.float32),
        representation=np.empty((3, count), dtype=np.complex64),
        normal_dots=np.empty((3, count), dtype=np.float32),
        normal_triple_product=np.empty(count, dtype=np.float32),
        geometric_normal=np.empty((3, count), dtype=np.float32),
        channels={channel: np.empty((3, count), dtype=np.complex64) for channel in faces.channels},
    )
    custom_normals = None
    if fans is not None and not surface.fans_share_normals:
        custom_normals = transform_components(surface.corner_normal.T, _cofactor_matrix(linear))
    for start in range(0, count, BLOCK_SIZE):
        block = slice(start, min(start + BLOCK_SIZE, count))
        _fill_triangles(
            corner_field, block, surface, deformed, faces, fans, custom_normals, field.degree
        )
    return corner_field


def cached_corner_field_task(
    surface: Surface,
    matrix: np.ndarray,
    field: RosyField,
    display: str,
    cache: Cache | None = None,
) -> Task[CornerField]:
    """Do the same as `corner_field_task`, with results stored in a cache if one is given.

    One corner field is shared by all cameras, and by instances that differ only in their location.
    """
    if cache is None:
        return (yield from corner_field_task(surface, matrix, field, display))
    linear = np.ascontiguousarray(np.asarray(matrix, dtype=np.float64)[:3, :3])
    return (
        yield from cache.get_or_create_task(
            ("corner field", surface, field, linear.tobytes(), display),
            lambda: corner_field_task(surface, matrix, field, display),
        )
    )


# --- faces ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _FaceValues:
    """Normals, field values and corner angles of the F deformed faces.

    Attributes
    ----------
    normal : (3, F) float32 ndarray
        Unit normals. Zero for a face without area.
    representation : (F,) complex64 ndarray
        z in the `_tangent_frame` of the normal. Zero for a face without area.
    corner_angle : (C,) float32 ndarray or None
        Interior angle of the face at each of its corners, in radians.
    channels : dict of FieldChannel to (F,) complex64 ndarray
        Additional values in the same frame.
    """

    normal: np.ndarray
    representation: np.ndarray
    corner_angle: np.ndarray | None
    channels: dict[FieldChannel, np.ndarray]


def _face_values(
    surface: Surface, linear: np.ndarray, deformed: np.ndarray, field: RosyField, with_angles: bool
) -> _FaceValues:
    """Transport the stored members from the faces of the rest shape to the deformed faces.

    `deformed` holds the (3, V) vertices in world space, without the translation. Corner angles are
    computed if `with_angles` is set.
    """
    count = surface.face_count
    relative_channels: dict[FieldChannel, np.ndarray] = {
        ("deviation", j): values for j, values in field_harmonics(field).items()
    }
    if field.family_count > 1:
        relative_channels["family", field.family_count] = np.ones(count)
    result = _FaceValues(
        normal=np.empty((3, count), dtype=np.float32),
        representation=np.empty(count, dtype=np.complex64),
        corner_angle=np.empty(len(surface.corner_vertex), dtype=np.float32)
        if with_angles
        else None,
        channels={channel: np.empty(count, dtype=np.complex64) for channel in relative_channels},
    )
    scale = _similarity_scale(linear) if surface.rest_vertices is None else None
    rest = None
    if scale is None:
        rest = np.ascontiguousarray(
            (surface.vertices if surface.rest_vertices is None else surface.rest_vertices).T
        )
    for size, block in _faces_by_size(surface.face_start):
        first_corner = surface.face_start[:-1][block]
        corner_vertex = [
            surface.corner_vertex.take(first_corner + corner) for corner in range(size)
        ]
        points = _relative_to_first(deformed, corner_vertex)
        normal = _polygon_normals(points)
        for component, out in zip(normal, result.normal, strict=True):
            out[block] = component
        x, y = _tangent_frame([component[block].astype(np.float64) for component in result.normal])
        vectors = [np.ascontiguousarray(component) for component in field.vectors[block].T]
        if rest is None:
            vectors = transform_components(vectors, linear * (1 / scale))
            member = dot_components(vectors, x) + 1j * dot_components(vectors, y)
        else:
            member = _transport_member(
                _relative_to_first(rest, corner_vertex), points, vectors, x, y
            )
        size = np.abs(member)
        member /= np.maximum(size, np.finfo(np.float64).tiny)
        has_area = np.logical_or.reduce(normal)
        result.representation[block] = power(member, field.degree) * (size * has_area)
        for channel, values in relative_channels.items():
            rotation = signed_power(member, rotation_order(channel, field.degree))
            result.channels[channel][block] = values[block] * rotation * has_area
        if with_angles:
            for corner, angle in enumerate(_corner_angles(points)):
                result.corner_angle[first_corner + corner] = angle
    return result


def _faces_by_size(face_start: np.ndarray) -> Iterator[tuple[int, slice | np.ndarray]]:
    """Yield blocks of faces that have the same number of corners: this number, and the faces."""
    corner_counts = np.diff(face_start)
    if (corner_counts == corner_counts[0]).all():
        for start in range(0, len(corner_counts), BLOCK_SIZE):
            yield int(corner_counts[0]), slice(start, start + BLOCK_SIZE)
        return
    for corner_count in np.unique(corner_counts).tolist():
        same_count = np.flatnonzero(corner_counts == corner_count)
        # Fewer faces per block if they have many corners, so that blocks need equal memory.
        block_faces = max(4 * BLOCK_SIZE // max(corner_count, 4), 1)
        for start in range(0, len(same_count), block_faces):
            yield corner_count, same_count[start : start + block_faces]


def _similarity_scale(linear: np.ndarray) -> float | None:
    """Return the scale of a (3, 3) linear map, or None if the map is not a similarity.

    A similarity is a uniform scale with a rotation or reflection.
    """
    square = linear.T @ linear
    scale = np.trace(square) / 3
    if not scale > 0 or np.abs(square - scale * np.eye(3)).max() > SIMILARITY_EPS * scale:
        return None
    return float(np.sqrt(scale))


def _relative_to_first(
    points: np.ndarray, corner_vertex: Sequence[np.ndarray]
) -> list[list[np.ndarray]]:
    """Return the positions of the corners of faces relative to the first corner, which is left out.

    Parameters
    ----------
    points : (3, V) ndarray
    corner_vertex : sequence of (n,) ndarray of int
        Vertex of each corner, for n faces.

    Returns
    -------
    list of lists of 3 (n,) ndarrays
        Components of the vectors from corner 0 to the corners 1, 2 and so on.
    """
    origin = [component.take(corner_vertex[0]) for component in points]
    return [
        [component.take(vertex) - base for component, base in zip(points, origin, strict=True)]
        for vertex in corner_vertex[1:]
    ]


def _cross(a: VectorComponents, b: VectorComponents) -> list[np.ndarray]:
    """Return the components of the cross products of vectors."""
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def _normalized(vectors: VectorComponents) -> list[np.ndarray]:
    """Scale vectors to length 1. Zero vectors stay zero."""
    length = np.sqrt(dot_components(vectors, vectors))
    length[length == 0] = np.inf
    return [component / length for component in vectors]


def _polygon_normals(points: Sequence[VectorComponents]) -> list[np.ndarray]:
    """Return the unit normals of polygons.

    A normal is the normalized sum of the area vectors of a triangle fan. It is zero for a polygon
    without area. `points` are the corners as returned by `_relative_to_first`.
    """
    area_vector = _cross(points[0], points[1])
    for one, other in pairwise(points[1:]):
        area_vector = [
            total + component
            for total, component in zip(area_vector, _cross(one, other), strict=True)
        ]
    return _normalized(area_vector)


def _corner_angles(points: Sequence[VectorComponents]) -> list[np.ndarray]:
    """Return the interior angle at each corner of polygons, in radians, float32.

    `points` are the corners as returned by `_relative_to_first`.
    """
    edges = [points[0]]
    edges += [_subtract(after, before) for before, after in pairwise(points)]
    edges.append([-component for component in points[-1]])
    corners = list(zip(edges, edges[-1:] + edges[:-1], strict=True))
    if len(corners) > 3:
        return [
            _edge_angle(next_edge, previous_edge, _cross(previous_edge, next_edge))
            for next_edge, previous_edge in corners
        ]
    area_vector = _cross(edges[0], edges[1])
    angle_0, angle_1 = (
        _edge_angle(next_edge, previous_edge, area_vector)
        for next_edge, previous_edge in corners[:2]
    )
    return [angle_0, angle_1, np.maximum(np.float32(np.pi) - angle_0 - angle_1, 0)]


def _edge_angle(
    next_edge: VectorComponents, previous_edge: VectorComponents, cross_product: VectorComponents
) -> np.ndarray:
    """Return the angle between the edge after a corner and the reversed edge before it, in radians.

    `cross_product` is that of the two edges; only its length is used.
    """
    cross_length = np.sqrt(dot_components(cross_product, cross_product))
    dot_product = dot_components(next_edge, previous_edge)
    larger = np.maximum(cross_length, np.abs(dot_product))
    larger[larger == 0] = 1
    cross_length /= larger
    dot_product /= -larger
    return vector_angle(dot_product.astype(np.float32), cross_length.astype(np.float32))


def _subtract(a: VectorComponents, b: VectorComponents) -> list[np.ndarray]:
    """Return the components of a - b."""
    return [one - other for one, other in zip(a, b, strict=True)]


def _transport_member(
    rest: Sequence[VectorComponents],
    deformed: Sequence[VectorComponents],
    vectors: VectorComponents,
    x: VectorComponents,
    y: VectorComponents,
) -> np.ndarray:
    """Transport vectors from rest faces to deformed faces; return them as complex numbers.

    Parameters
    ----------
    rest, deformed : sequence of vector components
        Corners of the faces in both shapes, as returned by `_relative_to_first`.
    vectors : 3 (n,) ndarrays
        Vectors on the rest faces.
    x, y : 3 (n,) ndarrays
        Tangent frames of the deformed faces.

    Returns
    -------
    (n,) complex128 ndarray
        In the frames x, y. Zero for a rest face without area.

    Notes
    -----
    Write the corners in a frame of their plane as complex numbers: w at rest, u deformed. The
    linear map from w to u of least squared error, u = a w + b conj(w), has the polar rotation
    a / |a|. Only this rotation is applied. So the members keep their length and stay 2 pi / N
    apart, however the face is stretched. Both normals follow from the order of the corners, so
    mirrored faces need no special case.
    """
    rest_normal = _polygon_normals(rest)
    rest_x, rest_y = _tangent_frame(rest_normal)
    w, u = _plane_coordinates(rest, rest_x, rest_y), _plane_coordinates(deformed, x, y)
    ww = uw = squared_norm = 0
    for one, other in zip(w, u, strict=True):
        ww, uw = ww + one * one, uw + other * one
        squared_norm = squared_norm + (one.real**2 + one.imag**2)
    rotation = squared_norm * sum(other * one.conj() for one, other in zip(w, u, strict=True))
    rotation -= np.conj(ww) * uw
    rotation *= np.logical_or.reduce(rest_normal)
    rotation /= np.maximum(np.abs(rotation), np.finfo(np.float64).tiny)
    return rotation * (dot_components(vectors, rest_x) + 1j * dot_components(vectors, rest_y))


def _plane_coordinates(
    points: Sequence[VectorComponents], x: VectorComponents, y: VectorComponents
) -> list[np.ndarray]:
    """Return the corners as complex numbers in the frame x, y, relative to their mean.

    `points` are the corners as returned by `_relative_to_first`. The result includes the first one.
    """
    coordinates = [dot_components(point, x) + 1j * dot_components(point, y) for point in points]
    mean = sum(coordinates) / (len(coordinates) + 1)
    return [-mean, *(point - mean for point in coordinates)]


def _tangent_frame(normal: VectorComponents) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the tangent frame x, y of normals, as `field.frames.tangent_frame`, by components."""
    nx, ny, nz = normal
    sign = np.copysign(nz.dtype.type(1), nz)
    a = -1 / (sign + nz)
    b = nx * ny * a
    x = [1 + sign * nx * nx * a, sign * b, -sign * nx]
    return x, [b, sign + ny * ny * a, -ny]


def _cofactor_matrix(linear: np.ndarray) -> np.ndarray:
    """Return the (3, 3) cofactor matrix of a linear map L, det(L) times the inverse transpose.

    It transforms normals, also if L mirrors or is singular.
    """
    a, b, c = linear
    return np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])


# --- fans ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _FanValues:
    """Normals and field values of the K smooth fans of corners.

    Attributes
    ----------
    normal : (3, K) float32 ndarray
        Unit normals.
    representation : (K,) complex64 ndarray
        z in the `_tangent_frame` of the normal.
    channels : dict of FieldChannel to (K,) complex64 ndarray
        Additional values in the same frame.
    """

    normal: np.ndarray
    representation: np.ndarray
    channels: dict[FieldChannel, np.ndarray]


def _fan_values(
    surface: Surface, linear: np.ndarray, faces: _FaceValues, degree: int
) -> _FanValues:
    """Average the values of the faces around each fan, weighted by their corner angles.

    Each value is transported by the minimal rotation from the face normal to the fan normal. Faces
    where the field is undefined have no weight.
    """
    normal = np.array(
        _normalized(transform_components(surface.fan_normal.T, _cofactor_matrix(linear)))
    )
    normal = normal.astype(np.float32)
    frame_x, frame_y = _tangent_frame(normal)
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
        phase = _transport_phase(
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
    return _FanValues(normal, averages[0], dict(zip(faces.channels, averages[1:], strict=True)))


def _transport_phase(
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
        Unit numbers: the x axis of the `_tangent_frame` of `source`, transported to `target`, in
        the frame x, y. Zero if it cannot be transported.

    Notes
    -----
    As in `field.frames.transport`, v at s becomes v - (v.t) / (1 + s.t) (s + t) at t. The term
    along t is left out, because t is perpendicular to the frame.
    """
    tangents, _ = _tangent_frame(source)
    fraction = dot_components(tangents, target)
    fraction /= np.maximum(1 + dot_components(source, target), np.finfo(fraction.dtype).eps)
    phase = np.empty(len(fraction), dtype=np.complex64)
    phase.real = dot_components(tangents, x) - fraction * dot_components(source, x)
    phase.imag = dot_components(tangents, y) - fraction * dot_components(source, y)
    modulus = np.sqrt(phase.real * phase.real + phase.imag * phase.imag)
    modulus[modulus == 0] = np.inf
    phase *= np.float32(1) / modulus
    return phase


# --- triangles -----------------------------------------------------------------------------------


def _fill_triangles(
    corner_field: CornerField,
    block: slice,
    surface: Surface,
    deformed: np.ndarray,
    faces: _FaceValues,
    fans: _FanValues | None,
    custom_normals: np.ndarray | None,
    degree: int,
) -> None:
    """Write the values of one block of triangles into `corner_field`.

    Without fans (flat display), the corners get the values of their faces.
    """
    corners = surface.triangles[block].T.astype(np.intp)
    face = surface.triangle_face[block]
    geometric_normal = faces.normal.take(face, axis=1)
    if len(surface.triangles) > surface.face_count:
        vertices = [surface.corner_vertex.take(corner) for corner in corners]
        geometric_normal[:] = _polygon_normals(_relative_to_first(deformed, vertices))
    if fans is None:
        normals = [[component.take(face) for component in faces.normal]] * 3
        phases = None
    else:
        fan = [surface.corner_fan.take(corner).astype(np.intp) for corner in corners]
        normals, phases = _corner_normals(fan, corners, fans, custom_normals)
    normals = [_fill_missing_normals(normal, geometric_normal) for normal in normals]
    x, y = _tangent_frame(normals[0])
    # Where the field of a face is undefined, it is undefined at all corners of the face.
    defined = faces.representation.take(face) != 0
    outputs = [
        (corner_field.representation, degree, faces.representation, fans and fans.representation)
    ]
    outputs += [
        (
            out,
            rotation_order(channel, degree),
            faces.channels[channel],
            fans and fans.channels[channel],
        )
        for channel, out in corner_field.channels.items()
    ]
    for corner, normal in enumerate(normals):
        corner_field.corner_normals[corner, :, block] = normal
        to_reference = (
            _transport_phase(normal, normals[0], x, y) if corner and fans is not None else None
        )
        for out, order, face_channel, fan_channel in outputs:
            z = face_channel.take(face) if fan_channel is None else fan_channel.take(fan[corner])
            if phases is not None:
                z *= signed_power(phases[corner], order)
            if to_reference is not None:
                z *= signed_power(to_reference, order)
            np.multiply(z, defined, out=out[corner, block])
    corner_field.reference_tangent[:, block] = x
    corner_field.geometric_normal[:, block] = geometric_normal
    for pair_index, (first_corner, second_corner) in enumerate(((0, 1), (0, 2), (1, 2))):
        corner_field.normal_dots[pair_index, block] = dot_components(
            normals[first_corner], normals[second_corner]
        )
    corner_field.normal_triple_product[block] = dot_components(
        normals[0], _cross(normals[1], normals[2])
    )


def _fill_missing_normals(
    normal: list[np.ndarray], geometric_normal: np.ndarray
) -> list[np.ndarray]:
    """Replace zero normals by the geometric normals, or by the z axis where these are zero too."""
    missing = dot_components(normal, normal) == 0
    if missing.any():
        replacements = geometric_normal[:, missing]
        replacements[2, ~replacements.any(axis=0)] = 1
        normal = [component.copy() for component in normal]
        for component, replacement in zip(normal, replacements, strict=True):
            component[missing] = replacement
    return normal


def _corner_normals(
    fan: Sequence[np.ndarray],
    corners: np.ndarray,
    fans: _FanValues,
    custom_normals: np.ndarray | None,
) -> tuple[list[list[np.ndarray]], list[np.ndarray] | None]:
    """Return the normals at the three corners of triangles, and the rotations of frames to them.

    Parameters
    ----------
    fan : 3 (n,) ndarrays of int
        Fan of each corner.
    corners : (3, n) ndarray of int
        Corners of the triangles.
    fans : _FanValues
    custom_normals : (3, C) ndarray or None
        Normals that differ within fans, of any length.

    Returns
    -------
    normals : 3 lists of 3 (n,) float32 ndarrays
    phases : 3 (n,) complex64 ndarrays or None
        With custom normals, the rotations from the frames of the fan normals to theirs.
    """
    normals = [[component.take(fan_index) for component in fans.normal] for fan_index in fan]
    if custom_normals is None:
        return normals, None
    custom_normals_at_corners = [
        [
            component.astype(np.float32)
            for component in _normalized([part.take(corner) for part in custom_normals])
        ]
        for corner in corners
    ]
    phases = [
        _transport_phase(normal, target, *_tangent_frame(target))
        for normal, target in zip(normals, custom_normals_at_corners, strict=True)
    ]
    return custom_normals_at_corners, phases

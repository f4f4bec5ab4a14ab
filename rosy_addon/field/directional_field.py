"""Fields of N arbitrary directions, stored as the nearest RoSy field and deviations from it.

The directions of polyvector, frame and conjugate fields may have any angles and lengths, so these
fields are not rotationally symmetric. But N directions, sorted around the normal, have a nearest RoSy.
Its N vectors, the *members*, are rotations of each other by 2 pi / N, and the angles between direction k
and member k have the mean 0. The representation z of this RoSy is, up to sign and length, the product of
all directions as complex numbers. This product is the constant coefficient of the polynomial that has the
directions as roots (Diamanti, Vaxman, Panozzo and Sorkine-Hornung 2014). Therefore z does not depend on
the order of the directions, and it is smooth where they are.

Direction k is member k times a complex number delta_k. The numbers delta_k are the values of a
trigonometric polynomial at the angles of the members,

    delta_k = sum_j C_j exp(i j theta_k),   theta_k = t + 2 pi k / N,

where t is the angle of the stored member. The coefficients C_j are called *harmonics* here. They do not
depend on which member is the first. Like z, they can be transported between frames, averaged and
interpolated. For a RoSy, C_0 is 1 and all other harmonics are 0.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .blocks import by_rows, row_blocks
from .frames import coordinates, dot
from .representation import matching_angles, signed_power, to_representation
from .rosy_field import RosyField, check_degree
from .surface import Surface
from .symmetry import FieldSymmetry

#: Directions within these tolerances count as a RoSy: the error of the angle between neighboring
#: directions, in degrees, and the relative difference of lengths. Rounding to six digits, as in
#: text files, gives errors about 100 times smaller.
ANGLE_TOLERANCE_DEG, LENGTH_TOLERANCE = 1.0, 0.01

#: Largest angle between a direction and the reverse of another at which the two count as opposite, in radians. In
#: fields that other programs made, the two lines of a cross meet at 30 degrees or more.
OPPOSITE_TOLERANCE = np.radians(10)

#: Rows of two directions are read as crosses if the two are opposite in at most this fraction of the rows. In a field
#: of degree 2, they are opposite in nearly all rows; in files of crosses, only at some needle faces.
MAX_OPPOSITE_SHARE = 0.01

#: Smallest modulus of a harmonic C_j that is kept (C_0 is about 1). Smaller ones are rounding
#: errors of text files.
MIN_HARMONIC = 1e-4

#: A direction and its opposite form one line. The lines of a field count as separate families if the stored
#: members of neighboring faces lie on matching lines, at least across this fraction of the edges.
MIN_FAMILY_AGREEMENT = 0.98


def field_from_directions(surface: Surface, directions: np.ndarray) -> RosyField:
    """Make a field from N directions on each face.

    Parameters
    ----------
    surface : Surface
        The shape on which the directions are tangent: the rest shape of a deformed mesh.
    directions : (F, N, 3) float64 ndarray
        Vectors in the planes of the faces, in any order. The field is undefined on faces where one of
        the vectors is zero.

    Returns
    -------
    RosyField
        If the directions are a RoSy within `ANGLE_TOLERANCE_DEG` and `LENGTH_TOLERANCE`, its `vectors` are
        the first directions, unchanged. Otherwise it is the nearest RoSy with `direction_ratios`. If the
        first directions of neighboring faces lie on matching lines (`detect_families`), `family_count` is
        the number of lines.

    See Also
    --------
    rosy_addon.field.validate.validated_directions : Check directions from outside first.
    """
    x, y = surface.face_frames
    w = by_rows(coordinates, directions, x, y)
    within_tolerance = all(is_rosy(w[rows]) for rows in row_blocks(len(w)))
    angle, rho, direction_ratios = by_rows(closest_rosy, w)
    if within_tolerance:
        vectors, direction_ratios = directions[:, 0] * (rho > 0)[:, None], None
    else:
        vectors = rho[:, None] * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y)
    return detect_families(surface, RosyField(directions.shape[1], vectors, direction_ratios))


def with_opposites(directions: np.ndarray, degree: int | None = None) -> np.ndarray:
    """Return N directions on each face, given N directions or one of each opposite pair of a cross.

    Programs for quad meshes store a cross by two directions, one for each of its lines. In a field of degree
    2, by contrast, the two directions are mostly opposite.

    Parameters
    ----------
    directions : (n, k, 3) ndarray
        k is N, or 2 for crosses.
    degree : int, optional
        The degree N, if it is known: two directions are then a cross exactly if N is 4. If it is not known,
        they are a cross if at most the fraction `MAX_OPPOSITE_SHARE` of the rows have opposite directions.

    Returns
    -------
    (n, N, 3) ndarray
        The array `directions` itself if nothing is missing.
    """
    if directions.shape[1] != 2 or degree not in (None, 4):
        return directions
    first, second = directions.swapaxes(0, 1)
    with np.errstate(over="ignore", invalid="ignore"):
        norms = np.sqrt(dot(first, first) * dot(second, second))
        is_opposite = dot(first, second) < -np.cos(OPPOSITE_TOLERANCE) * norms
    if degree is None and is_opposite.sum() > MAX_OPPOSITE_SHARE * np.count_nonzero(norms):
        return directions
    return np.concatenate([directions, -directions], axis=1)


def closest_rosy(w: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the RoSy nearest to N directions, and the ratios of the directions to the members of this RoSy.

    Parameters
    ----------
    w : (n, N) complex ndarray
        Each row holds N directions as complex numbers in a tangent frame, in any order.

    Returns
    -------
    first_angle : (n,) float64 ndarray
        Angle in radians from the x axis of the frame to the member that corresponds to the first direction.
    rho : (n,) float64 ndarray
        Length of the members, the mean length of the directions; 0 where a direction is zero.
    direction_ratios : (n, N) complex128 ndarray
        Each direction divided by its member. The order is counter-clockwise from the first direction.
    """
    degree = check_degree(w.shape[1])
    member_angles = 2 * np.pi * np.arange(degree) / degree
    defined = (w != 0).all(axis=1)
    w = np.where(defined[:, None], w, np.exp(1j * member_angles))
    relative_angles = _relative_angles(w)
    order = np.argsort(relative_angles, axis=1, kind="stable")
    relative_angles, w = (np.take_along_axis(each, order, 1) for each in (relative_angles, w))
    first_angle = np.angle(w[:, 0]) + (relative_angles - member_angles).mean(axis=1)
    rho = np.abs(w).mean(axis=1)
    direction_ratios = w / (rho[:, None] * np.exp(1j * (first_angle[:, None] + member_angles)))
    return first_angle, rho * defined, direction_ratios


def is_rosy(w: np.ndarray) -> bool:
    """Return whether all rows of N directions (complex numbers) are rotationally symmetric.

    The tolerances are `ANGLE_TOLERANCE_DEG` and `LENGTH_TOLERANCE`. Rows that contain a zero are ignored.
    """
    w = w[(w != 0).all(axis=1)]
    if not len(w):
        return True
    length = np.abs(w)
    gap = np.diff(np.sort(_relative_angles(w), axis=1), axis=1, append=2 * np.pi)
    angle_error = np.degrees(np.abs(gap - 2 * np.pi / w.shape[1]).max())
    length_error = (1 - length.min(axis=1) / length.max(axis=1)).max()
    return bool(angle_error <= ANGLE_TOLERANCE_DEG and length_error <= LENGTH_TOLERANCE)


def _relative_angles(w: np.ndarray) -> np.ndarray:
    """Return (n, N) counter-clockwise angles from the first direction of a row, in radians from 0 to 2 pi."""
    relative = (np.angle(w) - np.angle(w[:, :1])) % (2 * np.pi)
    relative[:, 0] = 0
    return relative


def detect_families(surface: Surface, field: RosyField) -> RosyField:
    """Return the field with a `family_count` that says whether its lines form separate families.

    A direction and its opposite form one line. If the stored members of neighboring faces lie on matching
    lines, across at least the fraction `MIN_FAMILY_AGREEMENT` of the edges, `family_count` becomes the number
    of lines. Otherwise the field is returned unchanged.
    """
    line_count = field_symmetry(field).line_count
    if line_count == 1:
        return field
    faces, matching = field_matching(surface, field)
    defined = field.vectors.any(axis=1)[faces].all(axis=1)
    if not defined.any() or np.mean(matching[defined] % line_count == 0) < MIN_FAMILY_AGREEMENT:
        return field
    return replace(field, family_count=line_count)


def field_directions(surface: Surface, field: RosyField) -> np.ndarray:
    """Compute all directions of a field on each face.

    Returns
    -------
    (F, N, 3) float64 ndarray
        Vectors in object space, counter-clockwise about the normal. The first direction is the one that
        corresponds to the stored member; for a RoSy it is the stored member.
    """
    perpendicular = np.cross(surface.face_normal, field.vectors)
    factor = np.exp(2j * np.pi * np.arange(field.degree) / field.degree)
    if field.direction_ratios is not None:
        factor = factor * field.direction_ratios
    factor = np.broadcast_to(factor, (len(field.vectors), field.degree))[..., None]
    return factor.real * field.vectors[:, None] + factor.imag * perpendicular[:, None]


def direction_coordinates(surface: Surface, field: RosyField) -> np.ndarray:
    """Return (F, N) complex128: all directions of a field in the tangent frames of `surface.face_frames`."""
    return coordinates(field_directions(surface, field), *surface.face_frames)


def stored_directions(surface: Surface, field: RosyField) -> np.ndarray:
    """Return the (F, N, 3) directions to store for a field: `source_directions` if present, else its directions."""
    rows = field.source_directions
    return field_directions(surface, field) if rows is None else rows


def field_harmonics(field: RosyField) -> dict[int, np.ndarray]:
    """Compute the harmonics of a field, which describe how its directions deviate from a RoSy.

    Returns
    -------
    dict of int to (F,) complex128 ndarray
        For each order j, from -((N - 1) // 2) to N // 2, the product C_j exp(i j t) on each face: the
        harmonic C_j, relative to the angle t of the stored member (see the module docstring). The order 0 is
        always there. Another order is left out if the modulus is at most `MIN_HARMONIC` on all faces. For a
        field without `direction_ratios`, the dict is empty.
    """
    return {} if field.direction_ratios is None else ratio_harmonics(field.direction_ratios)


def ratio_harmonics(direction_ratios: np.ndarray) -> dict[int, np.ndarray]:
    """Return the harmonics of (n, N) `direction_ratios`: (n,) values C_j exp(i j t) by their order j.

    t is the angle of the stored member. Small harmonics are left out, as in `field_harmonics`.
    """
    degree = direction_ratios.shape[1]
    member_angles = 2 * np.pi * np.arange(degree) / degree
    coefficients = {}
    for j in range(-((degree - 1) // 2), degree // 2 + 1):
        values = (direction_ratios * np.exp(-1j * j * member_angles)).mean(axis=1)
        if j == 0 or np.abs(values).max(initial=0.0) > MIN_HARMONIC:
            coefficients[j] = values
    return coefficients


def ratios_from_harmonics(coefficients: dict[int, np.ndarray], degree: int) -> np.ndarray:
    """Return (n, N) `direction_ratios` from harmonics: the inverse of `ratio_harmonics`.

    `coefficients` holds (n,) values C_j exp(i j t) by their order j, and `degree` is N.
    """
    member = np.exp(2j * np.pi * np.arange(degree) / degree)
    return sum(values[:, None] * signed_power(member, j) for j, values in coefficients.items())


def field_symmetry(field: RosyField) -> FieldSymmetry:
    """Return the degree of a field, and the orders j of its harmonics, as a `FieldSymmetry`.

    The harmonics C_j describe how the directions deviate from a RoSy; a RoSy field has none.
    """
    return FieldSymmetry(field.degree, tuple(field_harmonics(field)))


def tensor_field(surface: Surface, tensors: np.ndarray) -> RosyField:
    """Make a field of degree 4 from the eigenvectors of tensors, restricted to the planes of the faces.

    Parameters
    ----------
    surface : Surface
    tensors : (F, 3, 3) float64 ndarray
        Symmetric tensors in object space.

    Returns
    -------
    RosyField
        The stored member lies along the major eigenvector: the one with the greater signed eigenvalue. The
        lengths of the directions are the absolute eigenvalues, or 1/1000 of the larger one if that is more.
        `family_count` is 2. The field is undefined (zero) where the two eigenvalues are equal.
    """
    vectors, ratios = by_rows(_tensor_directions, tensors, *surface.face_frames)
    return RosyField(4, vectors, ratios, 2)


def _tensor_directions(
    tensors: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (F, 3) stored members and (F, 4) `direction_ratios` of the crosses along eigenvectors.

    Each direction has the length of its eigenvalue; the ratios are these lengths relative to their mean.
    `tensors` holds (F, 3, 3) symmetric tensors, and x, y are the (F, 3) face frames (see `tensor_field`).
    """
    a = np.einsum("fi,fij,fj->f", x, tensors, x)
    b = np.einsum("fi,fij,fj->f", x, tensors, y)
    c = np.einsum("fi,fij,fj->f", y, tensors, y)
    mean, deviator = (a + c) / 2, (a - c) / 2 + 1j * b
    deviator_norm = np.abs(deviator)
    angle = np.angle(deviator) / 2
    # A lower bound of the lengths keeps the directions of eigenvalues near 0.
    max_eigenvalue = np.maximum(np.abs(mean) + deviator_norm, 1e-300)
    major = np.maximum(np.abs(mean + deviator_norm), 1e-3 * max_eigenvalue)
    minor = np.maximum(np.abs(mean - deviator_norm), 1e-3 * max_eigenvalue)
    rho = np.where(deviator_norm > 1e-9 * max_eigenvalue, (major + minor) / 2, 0)
    vectors = rho[:, None] * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y)
    major_ratio = np.where(rho > 0, major / np.where(rho > 0, rho, 1), 1)
    return vectors, np.stack([major_ratio, 2 - major_ratio] * 2, axis=1).astype(np.complex128)


def field_matching(surface: Surface, field: RosyField) -> tuple[np.ndarray, np.ndarray]:
    """Match the members of neighboring faces across each interior edge.

    Returns
    -------
    faces : (I, 2) int32 ndarray
        The two faces of each interior edge.
    matching : (I,) int32 ndarray
        Member k of the first face matches member (k + matching) modulo N of the second face: the nearest
        one when the two faces are unfolded into a plane. Members are counted counter-clockwise from the
        stored member of each face. The directions of a field that is not a RoSy match in the same way.
    """
    degree = field.degree
    z, z_stored = (to_representation(field.vectors, *surface.face_frames, n) for n in (degree, 1))
    closest_angle = matching_angles(surface, z, degree)
    stored_angle = matching_angles(surface, z_stored, 1)
    step = np.rint((closest_angle - stored_angle) * degree / (2 * np.pi)).astype(np.int32)
    return surface.corner_face[surface.edges.halfedges], step % degree


def evaluate_harmonics(
    coefficients: Sequence[tuple[int, np.ndarray]], member: np.ndarray
) -> np.ndarray:
    """Return the ratios delta of directions to members: sum over j of C_j times `member` to the power j.

    Parameters
    ----------
    coefficients : sequence of (int, (...) complex ndarray)
        Pairs of an order j and the harmonic C_j.
    member : (...) complex ndarray
        Members as complex numbers of modulus 1, in the same frames as the C_j.

    Returns
    -------
    (...) complex ndarray
        A direction is its member times this ratio.
    """
    return sum(values * signed_power(member, j) for j, values in coefficients)

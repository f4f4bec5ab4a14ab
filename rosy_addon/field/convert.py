"""Convert a field: change its degree, rotate or smooth it, cancel singularities, or replace its magnitudes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from .conjugate_gradient import conjugate_gradient
from .connection import build_connection, laplacian
from .curvature import face_magnitude
from .directional_field import field_matching
from .face_graph import spanning_forest
from .frames import normalize
from .generate import MIN_SMOOTHING_LENGTH
from .representation import face_frames, from_representation, to_representation
from .rosy_field import RosyField, check_degree
from .singularity_changes import cancel_pairs
from .sparse_multigrid import from_coo
from .surface import Surface
from .surface_averages import SurfaceAverages


@dataclass(frozen=True, eq=False)
class Conversion:
    """The steps of a conversion, applied in the order of the attributes.

    Attributes
    ----------
    degree : int or None
        The new degree, a multiple or a divisor of the old one; None to keep it.
    rotation : float
        Counter-clockwise rotation about the normals, radians.
    smoothing_length : float
        Distance of the diffusion relative to `Surface.extent`; 0 for none.
    pair_distance : float
        Distance relative to `Surface.extent` up to which singularities with opposite indices are cancelled; 0
        for none.
    magnitude : str, (F,) ndarray or None
        One of `curvature.MAGNITUDES`, or values; None to keep the magnitudes.
    """

    degree: int | None = None
    rotation: float = 0.0
    smoothing_length: float = 0.0
    pair_distance: float = 0.0
    magnitude: str | np.ndarray | None = None


def convert(surface: Surface, field: RosyField, conversion: Conversion) -> RosyField:
    """Apply the steps of a conversion to a field.

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If a step is not possible; see `change_degree`, `diffuse_field` and `cancel_pairs`.
    """
    report(0.0, "converting the field")
    if conversion.degree is not None:
        with progress(0.0, 0.1):
            field = change_degree(surface, field, conversion.degree)
    if conversion.rotation:
        field = rotate_field(surface, field, conversion.rotation)
    if conversion.smoothing_length >= MIN_SMOOTHING_LENGTH:
        time = (conversion.smoothing_length * surface.extent) ** 2
        with progress(0.1, 0.5):
            field = diffuse_field(surface, field, max(time, np.finfo(np.float64).tiny))
    if conversion.pair_distance > 0:
        with progress(0.5, 0.9):
            field = cancel_pairs(surface, field, conversion.pair_distance * surface.extent)
    magnitude = conversion.magnitude
    if isinstance(magnitude, str):
        with progress(0.9, 1.0):
            magnitude = face_magnitude(surface, magnitude)
    return field if magnitude is None else with_magnitude(field, magnitude)


def change_degree(surface: Surface, field: RosyField, degree: int) -> RosyField:
    """Change the degree of a field to a multiple or a divisor.

    For a multiple, members are added between the existing ones. For a divisor, a subset of the
    members is selected on each face so that the subsets match from face to face. If the subsets do
    not match after a loop around a singularity, a seam remains.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A RoSy.
    degree : int
        The new degree.

    Raises
    ------
    RosyError
        If the degree is neither a multiple nor a divisor, or the directions are not a RoSy.
    """
    degree = check_degree(degree)
    field.check_rosy(surface.name)
    if degree % field.degree == 0:
        return RosyField(degree, field.vectors)
    if field.degree % degree:
        raise RosyError(
            f"{surface.name}: cannot convert degree {field.degree} to {degree}, which is neither a multiple nor a divisor"
        )
    return RosyField(degree, comb_members(surface, field, field.degree // degree))


def comb_members(surface: Surface, field: RosyField, period: int) -> np.ndarray:
    """Choose a member on each face so that the members of neighboring faces match (combing).

    Parameters
    ----------
    surface : Surface
    field : RosyField
    period : int
        Members whose indices are equal modulo this are equivalent; a divisor of N.

    Returns
    -------
    (F, 3) float64 ndarray
        The chosen members.
    """
    faces, matching = field_matching(surface, field)
    defined = field.vectors.any(axis=1)[faces].all(axis=1)
    # Member k of the first face of an edge matches member k + matching of the second.
    tree = spanning_forest(surface.face_count, *faces[defined].T)
    member_index = tree.sums_from_root(matching[defined]) % period
    angle = 2 * np.pi * member_index / field.degree
    return rotate_field(surface, field, angle).vectors


def rotate_field(surface: Surface, field: RosyField, angle: np.ndarray | float) -> RosyField:
    """Rotate a field counter-clockwise about the face normals.

    Parameters
    ----------
    surface : Surface
    field : RosyField
    angle : (F,) ndarray or float
        Radians.
    """
    angle = np.broadcast_to(angle, (len(field.vectors),))[:, None]
    perpendicular = np.cross(surface.face_normal, field.vectors)
    return replace(
        field,
        vectors=np.cos(angle) * field.vectors + np.sin(angle) * perpendicular,
        source_directions=None,
    )


def diffuse_field(surface: Surface, field: RosyField, time: float) -> RosyField:
    """Smooth a field by diffusion of its representation.

    This is one implicit Euler step, ``(M + t L) z = M z_0``, with the mass matrix M and the
    connection Laplacian L. Opposite values cancel, so magnitudes decrease where the field varies,
    and singularities of opposite index merge.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A RoSy.
    time : float
        Diffusion time t in square Blender units. Details smaller than about its square root are
        removed.

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If the directions are not a RoSy, or the time is not positive and finite.
    """
    field.check_rosy(surface.name)
    if not time > 0 or not np.isfinite(time):
        raise RosyError(f"{surface.name}: the diffusion time must be above 0, not {time}")
    x, y = face_frames(surface)
    degree = field.degree
    z = to_representation(field.vectors, x, y, degree)
    connection = build_connection(surface)
    averages = SurfaceAverages(surface, connection, x, y)
    report(0.1, "smoothing the field")
    rhs = averages.node_sums(z, degree)
    matrix = laplacian(connection, degree)
    mass = connection.positive_mass
    nodes = np.arange(connection.node_count)
    matrix = from_coo(
        np.concatenate([matrix.row_indices, nodes]),
        np.concatenate([matrix.indices, nodes]),
        np.concatenate([matrix.data * time, mass.astype(np.complex128)]),
        connection.node_count,
        connection.node_count,
    )
    with progress(0.2, 0.95):
        solution = conjugate_gradient(matrix, rhs)
    report(0.95, "smoothing the field")
    area = np.bincount(surface.triangle_face, connection.area, surface.face_count)
    mean = averages.face_sums(solution, degree) / np.where(area > 0, area, 1) / 3
    return RosyField(degree, from_representation(mean, x, y, degree))


def with_magnitude(field: RosyField, magnitude: np.ndarray | float) -> RosyField:
    """Replace the magnitudes of a field; faces where it is undefined stay undefined.

    Parameters
    ----------
    field : RosyField
    magnitude : (F,) ndarray or float
        The new magnitudes, not negative.
    """
    magnitude = np.broadcast_to(magnitude, (len(field.vectors),))[:, None]
    return replace(field, vectors=normalize(field.vectors) * magnitude, source_directions=None)

"""Convert a field: change its degree, rotate or smooth it, cancel singularities or replace magnitudes."""

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
from .representation import from_representation, to_representation
from .rosy_field import RosyField, check_degree
from .singularity_changes import cancel_pairs
from .surface import Surface
from .surface_averages import SurfaceAverages


@dataclass(frozen=True, eq=False)
class Conversion:
    """The steps of the conversion of a field, applied in the order of the attributes.

    Attributes
    ----------
    degree : int or None
        The new degree, a multiple or a divisor of the old one; None to keep it.
    rotation : float
        Counter-clockwise rotation about the normals, in radians.
    smoothing_length : float
        Distance over which the field is smoothed by diffusion, as a fraction of the longest side of the
        bounding box (`Surface.extent`); 0 for no smoothing.
    pair_distance : float
        Pairs of singularities with opposite indices are removed if they are at most this far apart, as a
        fraction of the same length; 0 to keep all pairs.
    magnitude : str, (F,) ndarray or None
        Name of a new magnitude, one of `curvature.MAGNITUDES`, or its values on the faces. None to keep the
        magnitudes.
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
    """Return the field with its degree N changed to a multiple or a divisor of N.

    For a multiple, members are added between the existing ones. For a divisor, a subset of the
    members is selected on each face so that the subsets match from face to face. If the subsets do
    not match after a loop around a singularity, a seam remains.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A field whose directions are rotationally symmetric.
    degree : int
        The new degree.

    Raises
    ------
    RosyError
        If the new degree is neither a multiple nor a divisor of N, or the directions are not a RoSy.
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
    """Choose a member vector on each face so that the members of neighboring faces match (combing).

    Parameters
    ----------
    surface : Surface
    field : RosyField
    period : int
        A divisor of N. Members k and l of a face are equivalent if k - l is a multiple of it. The chosen
        members of neighboring faces match up to equivalence, except across seams (see `change_degree`).

    Returns
    -------
    (F, 3) float64 ndarray
        The chosen members.
    """
    faces, matching = field_matching(surface, field)
    defined = field.vectors.any(axis=1)[faces].all(axis=1)
    # Member k of the first face of an edge matches member k + matching of the second face.
    tree = spanning_forest(surface.face_count, *faces[defined].T)
    angle = 2 * np.pi * (tree.sums_from_root(matching[defined]) % period) / field.degree
    return rotate_field(surface, field, angle).vectors


def rotate_field(surface: Surface, field: RosyField, angle: np.ndarray | float) -> RosyField:
    """Return the field rotated counter-clockwise about the face normals.

    Parameters
    ----------
    surface : Surface
    field : RosyField
    angle : (F,) ndarray or float
        Angle in radians, for each face or the same for all faces.
    """
    angle = np.broadcast_to(angle, (len(field.vectors),))[:, None]
    perpendicular = np.cross(surface.face_normal, field.vectors)
    vectors = np.cos(angle) * field.vectors + np.sin(angle) * perpendicular
    return replace(field, vectors=vectors, source_directions=None)


def diffuse_field(surface: Surface, field: RosyField, time: float) -> RosyField:
    """Smooth a field by diffusion of its representation.

    This is one implicit Euler step, ``(M + t L) z = M z_0``, with the mass matrix M and the
    connection Laplacian L. Opposite values cancel, so magnitudes decrease where the field varies,
    and singularities of opposite index cancel.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A field whose directions are rotationally symmetric.
    time : float
        Diffusion time t, the square of a length in object space. Details smaller than about this length
        are removed.

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
    x, y = surface.face_frames
    degree = field.degree
    z = to_representation(field.vectors, x, y, degree)
    connection = build_connection(surface)
    averages = SurfaceAverages(surface, connection, x, y)
    report(0.1, "smoothing the field")
    rhs = averages.node_sums(z, degree)
    matrix = laplacian(connection, degree)
    matrix = replace(matrix, data=time * matrix.data).plus_diagonal(connection.positive_mass)
    with progress(0.2, 0.95):
        solution = conjugate_gradient(matrix, rhs)
    report(0.95, "smoothing the field")
    area = np.bincount(surface.triangle_face, connection.area, surface.face_count)
    mean = averages.face_sums(solution, degree) / np.where(area > 0, area, 1) / 3
    return RosyField(degree, from_representation(mean, x, y, degree))


def with_magnitude(field: RosyField, magnitude: np.ndarray | float) -> RosyField:
    """Return the field with other magnitudes. Faces where it is undefined stay undefined.

    Parameters
    ----------
    field : RosyField
    magnitude : (F,) ndarray or float
        The new magnitudes, at least 0.
    """
    magnitude = np.broadcast_to(magnitude, (len(field.vectors),))[:, None]
    return replace(field, vectors=normalize(field.vectors) * magnitude, source_directions=None)

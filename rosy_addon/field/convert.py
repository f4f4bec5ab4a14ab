"""Convert a field: change its degree, rotate or smooth it, cancel singularities, or replace its magnitudes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import RosyError
from ..progress import Progress, Task, run_to_completion, subtask
from .conjugate_gradient import conjugate_gradient_task
from .connection import connection_task, laplacian_task
from .curvature import magnitude_task
from .directional_field import field_matching
from .frames import normalize
from .generate import MIN_SMOOTHING_LENGTH
from .prescribed import TurningError, change_singularities_task
from .representation import complex_bincount, face_frames, from_representation, to_representation
from .rosy_field import RosyField, check_degree
from .singularities import singularities_task
from .singularity_pairs import opposite_pairs_task
from .smoothest import corner_frame_angles, node_sum_per_face
from .sparse_multigrid import from_coo
from .surface import Surface, connected_components


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
        One of `generate.MAGNITUDES`, or values; None to keep the magnitudes.
    """

    degree: int | None = None
    rotation: float = 0.0
    smoothing_length: float = 0.0
    pair_distance: float = 0.0
    magnitude: str | np.ndarray | None = None


def convert(surface: Surface, field: RosyField, conversion: Conversion) -> RosyField:
    """Convert a field; see `convert_task`."""
    return run_to_completion(convert_task(surface, field, conversion))


def convert_task(surface: Surface, field: RosyField, conversion: Conversion) -> Task[RosyField]:
    """Apply the steps of a conversion to a field.

    Yields
    ------
    Progress

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If a step is not possible; see `change_degree`, `diffuse_task` and `cancel_pairs_task`.
    """
    yield Progress(0.0, "converting the field")
    if conversion.degree is not None:
        field = change_degree(surface, field, conversion.degree)
        yield Progress(0.0, "converting the field")
    if conversion.rotation:
        field = rotate_field(surface, field, conversion.rotation)
    if conversion.smoothing_length >= MIN_SMOOTHING_LENGTH:
        time = (conversion.smoothing_length * surface.extent) ** 2
        field = yield from diffuse_task(surface, field, max(time, np.finfo(np.float64).tiny))
    if conversion.pair_distance > 0:
        field = yield from cancel_pairs_task(
            surface, field, conversion.pair_distance * surface.extent
        )
    magnitude = conversion.magnitude
    if isinstance(magnitude, str):
        magnitude = yield from magnitude_task(surface, magnitude)
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
    check_rosy(surface, field)
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
    face_a, face_b = faces[defined].T
    matching = matching[defined]
    source = np.concatenate([face_a, face_b])
    target = np.concatenate([face_b, face_a])
    # Member k of `source` matches member k + shift of `target`.
    shift = np.concatenate([matching, -matching])
    order = np.argsort(source, kind="stable")
    source, target, shift = source[order], target[order], shift[order]
    start = np.searchsorted(source, np.arange(surface.face_count + 1))
    # Breadth-first search from one face of each connected component.
    member_index = np.full(surface.face_count, -1)
    component = connected_components(surface.face_count, np.stack([face_a, face_b], axis=1))
    front = np.unique(component, return_index=True)[1]
    member_index[front] = 0
    while len(front):
        count = start[front + 1] - start[front]
        link = np.repeat(start[front] - np.cumsum(count) + count, count)
        link += np.arange(count.sum())
        link = link[member_index[target[link]] < 0]
        front, first = np.unique(target[link], return_index=True)
        link = link[first]
        member_index[front] = (member_index[source[link]] + shift[link]) % period
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
    """Smooth a field by diffusion; see `diffuse_task`."""
    return run_to_completion(diffuse_task(surface, field, time))


def diffuse_task(surface: Surface, field: RosyField, time: float) -> Task[RosyField]:
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

    Yields
    ------
    Progress

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If the directions are not a RoSy, or the time is not positive and finite.
    """
    check_rosy(surface, field)
    if not time > 0 or not np.isfinite(time):
        raise RosyError(f"{surface.name}: the diffusion time must be above 0, not {time}")
    x, y = face_frames(surface)
    degree = field.degree
    z = to_representation(field.vectors, x, y, degree)
    connection = yield from subtask(connection_task(surface), 0.0, 0.1)
    frame_angle = corner_frame_angles(surface, connection, x, y)
    yield Progress(0.1, "smoothing the field")
    corner_area = np.repeat(connection.area / 3, 3)
    corner_face = np.repeat(surface.triangle_face, 3)
    to_node = np.exp(-1j * degree * frame_angle)
    rhs = complex_bincount(
        connection.corner_node, corner_area * z[corner_face] * to_node, connection.node_count
    )
    yield Progress(0.15, "smoothing the field")
    matrix = yield from subtask(laplacian_task(connection, degree), 0.15, 0.2)
    yield Progress(0.2, "smoothing the field")
    mass = connection.positive_mass
    nodes = np.arange(connection.node_count)
    matrix = from_coo(
        np.concatenate([matrix.row_indices, nodes]),
        np.concatenate([matrix.indices, nodes]),
        np.concatenate([matrix.data * time, mass.astype(np.complex128)]),
        connection.node_count,
        connection.node_count,
    )
    solution = yield from subtask(conjugate_gradient_task(matrix, rhs), 0.2, 0.95)
    yield Progress(0.95, "smoothing the field")
    area = np.bincount(surface.triangle_face, connection.area, surface.face_count)
    mean = (
        node_sum_per_face(surface, connection, solution, frame_angle, degree)
        / np.where(area > 0, area, 1)
        / 3
    )
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


def cancel_pairs_task(surface: Surface, field: RosyField, max_distance: float) -> Task[RosyField]:
    """Remove pairs of singularities with opposite indices.

    Far from them, the field turns by an angle that falls with the distance. All other singularities stay, and
    so do pairs without which the field would turn too fast for the size of the faces.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A RoSy.
    max_distance : float
        Largest length of a path along edges between the two of a pair, in object space.

    Yields
    ------
    Progress

    Returns
    -------
    RosyField
        The field itself if it has no such pairs.

    Raises
    ------
    RosyError
        If the directions are not a RoSy.
    """
    check_rosy(surface, field)
    vertex, index = yield from subtask(singularities_task(surface, field), 0.0, 0.2)
    task = opposite_pairs_task(surface, vertex, index, max_distance)
    pairs = yield from subtask(task, 0.2, 0.4)
    start = 0.4
    while len(pairs):
        chosen = pairs.ravel()
        task = change_singularities_task(
            surface, field, vertex[chosen], -index[chosen], max_distance
        )
        try:
            return (yield from subtask(task, start, 1.0))
        except TurningError as error:
            pairs = pairs[~_are_near(surface, vertex[pairs], error.vertices)]
        start = 0.5 * (start + 1.0)
    return field


def _are_near(surface: Surface, pairs: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(P,) bool: which (P, 2) pairs of vertices are the nearest to others, by the number of faces between."""
    is_near = np.zeros(len(surface.vertices), dtype=bool)
    is_near[vertices] = True
    corner_vertex, corner_face = surface.corner_vertex, surface.corner_face
    while not is_near[pairs].any():
        touches = np.zeros(surface.face_count, dtype=bool)
        touches[corner_face[is_near[corner_vertex]]] = True
        before = int(is_near.sum())
        is_near[corner_vertex[touches[corner_face]]] = True
        if int(is_near.sum()) == before:
            return np.ones(len(pairs), dtype=bool)
    return is_near[pairs].any(axis=1)


def check_rosy(surface: Surface, field: RosyField) -> None:
    """Raise an error if the directions of a field are not a RoSy."""
    if field.direction_ratios is not None:
        raise RosyError(
            f"{surface.name}: only RoSy fields can be changed, but the directions of this field are not a RoSy"
        )

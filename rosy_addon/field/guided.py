"""Fields that follow directions where these are given, and are smooth between them.

The Dirichlet energy of the connection Laplacian plus a penalty for leaving the guides: Knöppel,
Crane, Pinkall and Schröder, SIGGRAPH 2013, section 4, with a weight that may differ from face to
face, and without one where a guide must be followed.
"""

from __future__ import annotations

import numpy as np

from ..errors import RosyError
from ..memory import keep_freed_memory
from ..progress import Progress, Work, drain, part
from .connection import connect, laplacian
from .representation import complex_sums, face_frames, from_representation, to_representation
from .rosy_field import RosyField, check_degree
from .smoothest import corner_turns, sum_on_faces
from .sparse import Rows, cycle, from_entries, hierarchy
from .surface import Surface

#: Residual, as a share of the right side, at which the solution counts as found.
FOUND = 1e-9
MOST_ROUNDS = 400


def guided_field(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float,
    hard: np.ndarray | None = None,
) -> RosyField:
    """A guided field; see `finding_guided`."""
    return drain(finding_guided(surface, degree, guides, weight, hard))


def finding_guided(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float,
    hard: np.ndarray | None = None,
) -> Work[RosyField]:
    """Find the field that is smooth and near to guides.

    Parameters
    ----------
    surface : Surface
    degree : int
    guides : (F, 3) ndarray
        One member each, in object space; zero where there is no guide. Their lengths count: a guide
        of length 1/2 is a field of magnitude 1/2 to be near to.
    weight : (F,) ndarray or float
        How much each face's guide counts, in 1 / area: away from a single guide of weight w the
        field is free again over a distance of about 1 / sqrt(w).
    hard : (F,) bool ndarray, optional
        Where the guide is followed exactly.

    Yields
    ------
    Progress

    Returns
    -------
    RosyField
        Of magnitude 1 but where nothing is known: on pieces of the mesh without a guide, and on
        faces without area, it is 0.

    Raises
    ------
    RosyError
        If there is no guide on any face with an area.
    """
    degree = check_degree(degree)
    keep_freed_memory()
    yield Progress(0.0, "connecting the vertices")
    x, y = face_frames(surface)
    wish = to_representation(np.asarray(guides, dtype=np.float64), x, y, degree)
    hard = np.zeros(surface.face_count, dtype=bool) if hard is None else hard & (wish != 0)
    if not wish.any():
        raise RosyError(f"{surface.name}: there is no guide on any face with an area")
    weight = np.where(wish != 0, np.broadcast_to(weight, wish.shape), 0.0)
    connection = connect(surface)
    yield Progress(0.04, "carrying the guides to the vertices")
    turn = corner_turns(surface, connection, x, y)
    toward_node = np.exp(-1j * degree * turn)
    owner = np.repeat(surface.triangle_face, 3)
    share = np.repeat(connection.area / 3, 3)
    node, count = connection.node, connection.count
    pull = np.bincount(node, share * weight[owner], count)
    right = complex_sums(node, share * (weight * wish)[owner] * toward_node, count)
    # Nodes between faces that must be followed take the mean, and none where these contradict.
    given = complex_sums(node, share * (hard * wish)[owner] * toward_node, count)
    most = np.bincount(node, share * (hard * np.abs(wish))[owner], count)
    firm = np.abs(given) > 1e-6 * most
    given[~firm] = 0
    given[firm] /= np.abs(given[firm])
    yield Progress(0.06, "connecting the vertices")
    z = given.copy()
    free = np.flatnonzero(~firm)
    if len(free):
        matrix = laplacian(connection, degree)
        yield Progress(0.08, "connecting the vertices")
        matrix, moved = _reduced(matrix, pull, firm, given)
        solving = solve(matrix, (right - moved)[free])
        z[free] = yield from part(solving, 0.1, 0.95)
    yield Progress(0.95, "carrying the field to the faces")
    found = sum_on_faces(surface, connection, z, turn, degree)
    size = np.abs(found)
    known = size > 1e-9 * max(float(size.max()), 1e-300)
    found = np.divide(found, size, out=np.zeros_like(found), where=known)
    found[hard] = wish[hard] / np.abs(wish[hard])
    return RosyField(degree, from_representation(found, x, y, degree))


def _reduced(
    matrix: Rows, pull: np.ndarray, firm: np.ndarray, given: np.ndarray
) -> tuple[Rows, np.ndarray]:
    """The matrix of the nodes that are free, and (n,) what the others add on the left side."""
    moved = matrix @ given
    row, column = matrix.row, matrix.column
    inner = ~firm[row] & ~firm[column]
    number = np.cumsum(~firm) - 1
    row, column, value = number[row[inner]], number[column[inner]], matrix.value[inner]
    own = pull[~firm] + 1e-12 * matrix.diagonal[~firm]
    every = np.arange(len(own))
    return from_entries(
        np.concatenate([row, every]),
        np.concatenate([column, every]),
        np.concatenate([value, own]),
        len(own),
        len(own),
    ), moved


def solve(matrix: Rows, right: np.ndarray) -> Work[np.ndarray]:
    """Conjugate gradients, preconditioned by cycles of multigrid."""
    levels = yield from part(hierarchy(matrix), 0.0, 0.5)
    found, rest = np.zeros_like(right), right.copy()
    goal = FOUND * np.sqrt(_inner(right, right))
    way, before = None, 1.0
    for number in range(MOST_ROUNDS):
        yield Progress(0.5 + 0.5 * (1 - 0.9**number), "smoothing between the guides")
        if np.sqrt(_inner(rest, rest)) <= goal:
            break
        better = cycle(levels, rest)
        now = _inner(rest, better)
        way = better if way is None else better + now / before * way
        image = matrix @ way
        length = now / _inner(way, image)
        found += length * way
        rest -= length * image
        before = now
    return found


def _inner(a: np.ndarray, b: np.ndarray) -> float:
    """The real part of a* b."""
    return float(np.sum(a.real * b.real) + np.sum(a.imag * b.imag))

"""Move singularities of a field: one to another vertex, onto another one, apart, or over a border."""

from __future__ import annotations

import numpy as np

from ..errors import RosyError
from ..progress import progress, report
from .convert import check_rosy
from .prescribed import change_singularities
from .rosy_field import RosyField
from .singularities import find_singularities
from .surface import Surface

#: Stands for no vertex: what is moved there leaves the surface over a border.
OUTSIDE = -1

#: Least distance over which the change falls off, relative to `Surface.extent`.
MIN_REACH = 0.01


def move_index(
    surface: Surface, field: RosyField, source: int, target: int, index: int = 0, reach: float = 0.0
) -> RosyField:
    """Move a singularity index from one vertex to another.

    All ways to edit singularities by hand are such moves. The index of a singularity that is moved onto
    another one is added to it, so that opposite ones vanish. An index that is moved from a vertex without
    one leaves its opposite there: a new pair. A part of an index splits a singularity.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A RoSy.
    source, target : int
        Vertices. `OUTSIDE` stands for none, on a surface with a border.
    index : int
        What is moved, in units of 1 / N. 0 is all that `source` has.
    reach : float
        Distance over which the change of direction falls off, in object space. The distance between the
        vertices is used if that is larger.

    Returns
    -------
    RosyField
        All its other singularities are those of `field`.

    Raises
    ------
    RosyError
        If the directions are not a RoSy, both vertices are the same, a vertex can have no index or has
        none to move, or nothing can leave the surface because it is closed.
    TurningError
        If the field would turn too fast for the size of the faces.
    """
    check_rosy(surface, field)
    if source == target:
        raise RosyError(
            f"{surface.name}: vertex {source} is both source and target: choose another target"
        )
    if index == 0:
        with progress(0.0, 0.2):
            vertex, indices = find_singularities(surface, field)
        index = int(indices[vertex == source].sum())
        if index == 0:
            raise RosyError(
                f"{surface.name}: vertex {source} is not singular: choose a singular vertex, or give the index "
                "to move"
            )
    ends = np.array([source, target])
    is_vertex = ends != OUTSIDE
    change = np.array([-index, index])[is_vertex]
    report(0.2, "moving a singularity")
    reach = max(reach, _distance(surface, ends), MIN_REACH * surface.extent)
    with progress(0.2, 1.0):
        return change_singularities(surface, field, ends[is_vertex], change, reach)


def _distance(surface: Surface, ends: np.ndarray) -> float:
    """Distance between two vertices; 0 if one is `OUTSIDE`, or not in the mesh."""
    if (ends < 0).any() or (ends >= len(surface.vertices)).any():
        return 0.0
    return float(np.linalg.norm(np.diff(surface.vertices[ends].astype(np.float64), axis=0)))

"""Which of the lines through a point a stroke is on: a layer each, for pens and for eyes.

Where the field allows it a line keeps its number all over the surface: the lines of all triangles
are matched across the edges, and if no way round a singularity or a handle takes one line into
another, each is a family. Otherwise families are cut: by the angle to a guiding direction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..field.frames import dot, unit
from ..field.surface import connected
from .ground import Ground, nearest_member
from .strokes import Strokes

#: What guides families that run into each other, if no camera does.
GUIDES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


def label_families(strokes: Strokes, ground: Ground, right: np.ndarray | None = None) -> Strokes:
    """Number the families of strokes that were traced on a ground.

    Parameters
    ----------
    strokes : Strokes
    ground : Ground
    right : (3,) array_like, optional
        A direction in world space, as a camera's x axis, that the first family is to be along
        where families cannot be told apart all over.

    Returns
    -------
    Strokes
        `ground.lines` families; family 1 is nearest to the guiding direction, the others follow
        counter-clockwise.
    """
    lines = ground.lines
    names = tuple(f"family {number + 1}" for number in range(lines))
    if lines == 1 or not len(strokes):
        return replace(strokes, names=names)
    labels = global_labels(ground)
    reference = first_members(ground)
    if labels is None:
        reference = _guided(ground, reference, right)
        labels = np.broadcast_to(np.arange(lines), (len(reference), lines))
    middle = (strokes.start[:-1] + strokes.start[1:]) // 2
    triangle = strokes.triangle[middle]
    member = dot(strokes.member[middle], ground.x[triangle]) + 1j * dot(
        strokes.member[middle], ground.y[triangle]
    )
    which = line_number(member, reference[triangle], ground.degree) % lines
    family = labels[triangle, which].astype(np.int32)
    return replace(strokes, family=family, names=names)


def first_members(ground: Ground) -> np.ndarray:
    """(T,) complex: a member at the middle of each triangle, the one nearest to the frame's x."""
    z = ground.z.sum(axis=1)
    one = np.ones(len(z), dtype=np.complex128)
    if ground.stored is not None and (ground.stored != 0).any():
        # The stored member is on one line all over: begin with that one.
        own = np.exp(1j * np.angle(ground.stored) * ground.lines / ground.degree)
        return nearest_member(own, np.where(z != 0, z, 1), ground.degree)
    return nearest_member(one, np.where(z != 0, z, 1), ground.degree)


def line_number(member: np.ndarray, first: np.ndarray, degree: int) -> np.ndarray:
    """(n,) int64: how many members it is counter-clockwise from the first one to another."""
    turn = np.angle(member * first.conj())
    return np.rint(turn * degree / (2 * np.pi)).astype(np.int64) % degree


def global_labels(ground: Ground) -> np.ndarray | None:
    """(T, M) int: the family of each line of each triangle, if there is one all over.

    Lines are counted from that of `first_members`. None if some line runs into another.
    """
    lines, count = ground.lines, len(ground.z)
    if ground.stored is not None and (ground.stored != 0).any():
        return np.broadcast_to(np.arange(lines), (count, lines))
    first = first_members(ground)
    triangle, edge = np.nonzero(ground.across >= 0)
    other = ground.across[triangle, edge]
    once = triangle < other
    triangle, edge, other = triangle[once], edge[once], other[once]
    carried = first[triangle] * ground.unfold[triangle, edge]
    shift = line_number(
        nearest_member(carried, ground.z[other].sum(axis=1), ground.degree),
        first[other],
        ground.degree,
    )
    every = np.arange(lines)
    here = triangle[:, None] * lines + every
    there = other[:, None] * lines + (every + shift[:, None]) % lines
    piece = connected(count * lines, np.stack([here.ravel(), there.ravel()], axis=1))
    piece = piece.reshape(count, lines)
    for one in range(lines):
        for two in range(one):
            if (piece[:, one] == piece[:, two]).any():
                return None
    return _in_order(ground, piece, first)


def _in_order(ground: Ground, piece: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Pieces of the covering as numbers from 0, by how they lie at the first triangle of each."""
    lines = piece.shape[1]
    family = np.full(int(piece.max()) + 1, -1, dtype=np.int64)
    order = np.argsort(piece[:, 0], kind="stable")
    _, begins = np.unique(piece[order].min(axis=1), return_index=True)
    guided = _guided(ground, first, None)
    shift = line_number(guided, first, ground.degree) % lines
    for triangle in order[begins]:
        own = piece[triangle]
        if (family[own] >= 0).any():
            continue
        family[np.roll(own, -shift[triangle])] = np.arange(lines)
    return np.maximum(family, 0)[piece]


def _guided(ground: Ground, first: np.ndarray, right: np.ndarray | None) -> np.ndarray:
    """(T,) complex: the members nearest to a direction projected to the triangles."""
    guides = GUIDES if right is None else np.concatenate([[np.asarray(right, float)], GUIDES])
    guide = np.zeros_like(ground.normal)
    for axis in guides[::-1]:
        flat = axis - dot(ground.normal, axis)[:, None] * ground.normal
        steep = dot(flat, flat) > 0.1
        guide[steep] = unit(flat[steep])
    near = dot(guide, ground.x) + 1j * dot(guide, ground.y)
    near = np.where(near != 0, near, 1)
    z = ground.z.sum(axis=1)
    return nearest_member(near / np.abs(near), np.where(z != 0, z, 1), ground.degree)

"""The first strokes: around each singularity one in each of its sectors, all equally far from it.

Near a singularity of index i lines of the field are as parallel lines on a cone, unrolled by
z^(1 - i). Where a member is at right angles to the way from the apex, a line passes nearest to it.
Lines at one distance on all sides continue each other's spacing, however one goes around; those of
a front that comes from elsewhere do not, and graze the singularity on one side.
"""

from __future__ import annotations

import numpy as np

from ..field.frames import dot
from .ground import Ground
from .nearby import Nearby
from .walk import Walkers, go_straight

#: Directions that are looked in from a singularity.
ROUND = 72

#: Spacings from a singularity at which strokes on two sides of a separatrix are a spacing apart: of
#: positive index, away from which strokes diverge, and of negative index.
DIVERGING, CONVERGING = 0.8, 1.0

#: Spacings from a singularity to the next one: nearer ones are left to chance.
ALONE = 6.0

#: A triangle of which z has less than this share of its square is one where it does not turn.
FLAT = 1e-6


def singularities(ground: Ground) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the field is zero.

    Returns
    -------
    triangle : (n,) int32 ndarray
    weights : (n, 3) float64 ndarray
    index : (n,) float64 ndarray
        How many turns a member makes around it.
    """
    z = ground.z
    # 0 divides the triangle of the three z into parts with these areas.
    part = (z[:, [1, 2, 0]].conj() * z[:, [2, 0, 1]]).imag
    whole = part.sum(axis=1)
    turns = np.abs(whole) > FLAT * (z.real**2 + z.imag**2).sum(axis=1)
    triangle = np.flatnonzero(turns & (part * np.sign(whole)[:, None] >= 0).all(axis=1))
    weights = part[triangle] / whole[triangle, None]
    return triangle.astype(np.int32), weights, np.sign(whole[triangle]) / ground.degree


def around_singularities(ground: Ground, spacing: np.ndarray) -> Walkers:
    """Seeds around singularities that are far from others.

    Parameters
    ----------
    ground : Ground
    spacing : (T, 3) ndarray
        At the corners of the triangles.
    """
    triangle, weights, index = singularities(ground)
    unit = np.einsum("nk,nk->n", weights, spacing[triangle])
    alone = np.flatnonzero(_alone(ground.place(triangle, weights), ALONE * unit) & (index < 1))
    far = (nearest_pass(index[alone]) * unit[alone]).repeat(ROUND)
    way = np.tile(np.exp(2j * np.pi * np.arange(ROUND) / ROUND), len(alone))
    triangle, weights = triangle[alone].repeat(ROUND), weights[alone].repeat(ROUND, axis=0)
    start = Walkers(triangle, weights, 1j * way, np.ones(len(way)))
    there, walked = go_straight(ground, start, way, far)
    out = ground.place(there.triangle, there.weights) - ground.place(triangle, weights)
    aside = 1j * dot(out, ground.x[there.triangle]) - dot(out, ground.y[there.triangle])
    aside /= np.maximum(np.abs(aside), 1e-300)
    there.member = ground.members(there.triangle, there.weights, aside)
    off = np.angle(there.member * aside.conj())
    off[(walked < 0.999 * far) | (there.member == 0)] = np.nan
    off = off.reshape(-1, ROUND)
    # Going around, members fall behind what is aside of the way from the middle.
    following = np.roll(off, -1, axis=1)
    passes = (off > 0) & (following <= 0) & (off - following < np.pi / ground.degree)
    return there.take(np.flatnonzero(passes))


def nearest_pass(index: np.ndarray) -> np.ndarray:
    """(n,) spacings from a singularity to the first strokes around it.

    On the cone they are half of a distance from the apex, or, where there is but one separatrix, a
    whole one with a stroke on that.
    """
    share = np.where(index < 0.5, 0.5, 1.0)
    apart = np.where(index > 0, DIVERGING, CONVERGING)
    return ((1 - index) * share * apart**-index) ** (1 / (1 - index))


def _alone(place: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """(n,) bool: whether no other place is within a radius."""
    if not len(place):
        return np.zeros(0, dtype=bool)
    grid = Nearby(float(np.median(radius)), len(place))
    grid.add(place)
    query, found = grid.around(place, radius)
    alone = np.ones(len(place), dtype=bool)
    alone[query[query != found]] = False
    return alone

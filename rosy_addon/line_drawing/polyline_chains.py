"""Join segments that share end points into polylines."""

from __future__ import annotations

import numpy as np

from ..field.frames import normalize

#: End points are the same if they differ by less than about this fraction of the extent of all.
SAME_POINT_RATIO = 1e-7

#: Where more than two segments meet, two are joined if they turn by less than this, in radians.
MAX_JUNCTION_TURN = np.radians(50)


def point_keys(ends: np.ndarray) -> np.ndarray:
    """Return (k, 2) int64 keys of the (k, 2, 3) end points: the same for the same points."""
    if not len(ends):
        return np.empty((0, 2), dtype=np.int64)
    points = ends.reshape(-1, 3)
    low = points.min(axis=0)
    cell = SAME_POINT_RATIO * max(float((points.max(axis=0) - low).max()), 1e-300)
    # Columns of whole numbers up to 1e7 fit into one key of 64 bits in two steps.
    x, y, z = np.rint((points - low) / cell).astype(np.int64).T
    _, keys = np.unique(x * (1 << 25) + y, return_inverse=True)
    _, keys = np.unique(keys.astype(np.int64) * (1 << 25) + z, return_inverse=True)
    return keys.reshape(-1, 2).astype(np.int64)


def chain_segments(keys: np.ndarray, ends: np.ndarray) -> list[tuple[np.ndarray, bool]]:
    """Join segments into chains.

    Two segments are joined where no others meet. Where others do, the straightest pairs are joined.

    Parameters
    ----------
    keys : (k, 2) int64 ndarray
        From `point_keys`.
    ends : (k, 2, 3) ndarray
        End points of the segments.

    Returns
    -------
    list of (chain, closed)
        The chain is an array of ends (2 * segment + side) in the order in which they are passed, two
        for each segment. Closed chains end where they start.
    """
    count = len(keys)
    flat = keys.ravel()
    order = np.argsort(flat, kind="stable")
    _, first, uses = np.unique(flat[order], return_index=True, return_counts=True)
    mate = np.full(2 * count, -1, dtype=np.int64)
    pairs = first[uses == 2]
    mate[order[pairs]], mate[order[pairs + 1]] = order[pairs + 1], order[pairs]
    outward = normalize(ends[:, ::-1] - ends).reshape(-1, 3)
    for begin, use in zip(first[uses > 2].tolist(), uses[uses > 2].tolist(), strict=True):
        _join_at_junction(order[begin : begin + use], outward, mate)
    mate_of, unused = mate.tolist(), np.ones(count, dtype=bool).tolist()
    starts = np.flatnonzero(mate < 0).tolist() + list(range(0, 2 * count, 2))
    chains = []
    for start in starts:
        if not unused[start // 2]:
            continue
        chain, end = [], start
        while end >= 0 and unused[end // 2]:
            unused[end // 2] = False
            chain += [end, end ^ 1]
            end = mate_of[end ^ 1]
        chains.append((np.array(chain), end >= 0))
    return chains


def _join_at_junction(junction: np.ndarray, outward: np.ndarray, mate: np.ndarray) -> None:
    """Set the mates of the ends at a point where three or more segments meet."""
    turn = np.arccos(np.clip(-outward[junction] @ outward[junction].T, -1, 1))
    row, column = np.triu_indices(len(junction), 1)
    for pair in np.argsort(turn[row, column], kind="stable").tolist():
        a, b = junction[row[pair]], junction[column[pair]]
        if turn[row[pair], column[pair]] < MAX_JUNCTION_TURN and mate[a] < 0 and mate[b] < 0:
            mate[a], mate[b] = b, a

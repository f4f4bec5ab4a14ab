"""Find ends of strokes that meet the ends of other strokes head on.

Strokes that grow toward each other are rarely aligned, so both end where they meet. If these ends
were tapered like others, a light band would appear along the front.
"""

from __future__ import annotations

import numpy as np

from ..core.progress import report
from ..field.blocks import row_blocks
from ..field.frames import dot, normalize
from .point_grid import PointGrid
from .stroke_set import Strokes

#: Region around an end in which the end of another stroke meets it: largest distances ahead, to the
#: side and behind, in spacings.
MAX_FORWARD, MAX_LATERAL, MAX_BACKWARD = 1.2, 0.8, 0.6

#: Largest cosine between the outward directions of two ends that meet, and smallest cosine between
#: their normals.
MAX_DIRECTION_COSINE, MIN_NORMAL_COSINE = -0.8, 0.5

#: Ends that are compared with others at once.
BLOCK_ENDS = 1 << 12


def head_on_ends(strokes: Strokes) -> np.ndarray:
    """Return which ends of strokes meet the end of another stroke head on.

    Parameters
    ----------
    strokes : Strokes

    Returns
    -------
    (S, 2) bool ndarray
        For the first and the last point of each stroke.
    """
    ends = np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1).ravel()
    next_to_end = np.stack([strokes.start[:-1] + 1, strokes.start[1:] - 2], axis=1).ravel()
    position, normal, spacing = strokes.points[ends], strokes.normal[ends], strokes.spacing[ends]
    outward = normalize(position - strokes.points[next_to_end])
    result = np.zeros(len(ends), dtype=bool)
    if not len(ends):
        return result.reshape(-1, 2)
    grid = PointGrid(MAX_FORWARD * float(np.median(spacing)), len(ends))
    grid.add(position, MAX_FORWARD * spacing)
    radius = float(np.hypot(MAX_FORWARD, MAX_LATERAL)) * spacing
    for block in row_blocks(len(ends), BLOCK_ENDS):
        report(block.start / len(ends), "shaping ends")
        query, other = grid.pairs_within(position[block], radius[block])
        query = query + block.start
        delta = position[other] - position[query]
        forward = dot(delta, outward[query])
        lateral = np.sqrt(np.maximum(dot(delta, delta) - forward**2, 0))
        meets = (query != other) & (dot(outward[query], outward[other]) < MAX_DIRECTION_COSINE)
        meets &= dot(normal[query], normal[other]) > MIN_NORMAL_COSINE
        meets &= forward < MAX_FORWARD * spacing[query]
        meets &= forward > -MAX_BACKWARD * spacing[query]
        meets &= lateral < MAX_LATERAL * spacing[query]
        result[query[meets]] = True
    return result.reshape(-1, 2)

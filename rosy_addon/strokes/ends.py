"""Ends of strokes that meet those of others, head on.

Where two fronts of strokes meet they are seldom in line, and end. Were these ends thinned out like
others, a light band would show where they meet.
"""

from __future__ import annotations

import numpy as np

from ..field.frames import dot, unit
from .nearby import Nearby
from .strokes import Strokes

#: Spacings ahead, aside and back of an end within which that of another is met.
AHEAD, ASIDE, BACK = 1.2, 0.8, 0.6

#: Cosine between their directions, at most, and between their normals, at least.
OPPOSITE, FACING = -0.8, 0.5


def meeting(strokes: Strokes) -> np.ndarray:
    """Which ends have the end of another stroke before them that comes the other way.

    Parameters
    ----------
    strokes : Strokes

    Returns
    -------
    (S, 2) bool ndarray
        Of the first and the last points.
    """
    ends = np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1).ravel()
    inner = np.stack([strokes.start[:-1] + 1, strokes.start[1:] - 2], axis=1).ravel()
    place, normal, spacing = strokes.points[ends], strokes.normal[ends], strokes.spacing[ends]
    out = unit(place - strokes.points[inner])
    found = np.zeros(len(ends), dtype=bool)
    if not len(ends):
        return found.reshape(-1, 2)
    grid = Nearby(AHEAD * float(np.median(spacing)), len(ends))
    grid.add(place)
    own, other = grid.around(place, float(np.hypot(AHEAD, ASIDE)) * spacing)
    away = place[other] - place[own]
    along = dot(away, out[own])
    aside = np.sqrt(np.maximum(dot(away, away) - along**2, 0))
    meets = (own != other) & (dot(out[own], out[other]) < OPPOSITE)
    meets &= dot(normal[own], normal[other]) > FACING
    meets &= (along < AHEAD * spacing[own]) & (along > -BACK * spacing[own])
    meets &= aside < ASIDE * spacing[own]
    found[own[meets]] = True
    return found.reshape(-1, 2)

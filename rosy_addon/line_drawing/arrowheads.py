"""Arrowheads along strokes, for fields in which directions have no opposite direction."""

from dataclasses import replace

import numpy as np

from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import dot, normalize, quotient
from .stroke_set import Strokes

#: Length of the barbs of an arrowhead in spacings, and their angle to the stroke in radians.
BARB_LENGTH, BARB_ANGLE = 0.55, np.radians(27.0)

#: Strokes get arrowheads only if they are longer than this many barbs.
MIN_LENGTH = 3.0


def arrowheads(strokes: Strokes, distance: float, has_direction: np.ndarray) -> Strokes:
    """Return arrowheads along strokes, as additional strokes.

    They point from the first point of a stroke to its last, which is the direction of the field. Each is a
    stroke of three points, from barb to tip to barb, in the tangent plane of the surface. The length of its
    barbs is `BARB_LENGTH` times the spacing at the arrowhead.

    Parameters
    ----------
    strokes : Strokes
    distance : float
        Distance between the arrowheads of a stroke, as a multiple of the spacing at the middle of the stroke.
        Every stroke that is long enough gets at least one arrowhead.
    has_direction : (S,) bool ndarray
        Whether a stroke gets arrowheads: its field contains no direction together with the opposite one.

    Returns
    -------
    Strokes
        The arrowheads alone. Each has the family of its stroke.
    """
    arc, length = strokes.arc, strokes.length
    spacing = strokes.spacing[(strokes.start[:-1] + strokes.start[1:]) // 2]
    is_long = has_direction & (length > MIN_LENGTH * BARB_LENGTH * spacing)
    count = np.zeros(len(strokes), dtype=np.int64)
    count[is_long] = np.maximum(np.rint((length / distance)[is_long] / spacing[is_long]), 1)
    stroke = np.repeat(np.arange(len(strokes)), count)
    rank = np.arange(len(stroke)) - np.repeat(offsets_from_sizes(count)[:-1], count)
    # Put all strokes one after another on one axis of arc length, for a single search.
    offset = np.concatenate([[0.0], np.cumsum(length + 1.0)[:-1]])
    place = offset[stroke] + (rank + 0.5) / count[stroke] * length[stroke]
    key = offset[strokes.stroke] + arc
    first, last = strokes.start[stroke], strokes.start[stroke + 1] - 1
    after = np.clip(np.searchsorted(key, place), first + 1, last)
    before = after - 1
    share = quotient(place - key[before], key[after] - key[before])
    center = strokes.between(after, share)
    normal = normalize(center.normal)
    along = strokes.points[after] - strokes.points[before]
    along = normalize(along - dot(along, normal)[:, None] * normal)
    across = np.cross(normal, along)
    barb = (BARB_LENGTH * strokes.spacing[after])[:, None]
    tip = center.points + 0.5 * np.cos(BARB_ANGLE) * barb * along
    back = tip - np.cos(BARB_ANGLE) * barb * along
    side = np.sin(BARB_ANGLE) * barb * across
    point = np.repeat(after, 3)
    return replace(
        strokes.take_points(point),
        points=np.stack([back + side, tip, back - side], axis=1).reshape(-1, 3),
        start=np.arange(len(stroke) + 1) * 3,
        family=strokes.family[stroke],
        normal=np.repeat(normal, 3, axis=0),
        weights=np.full((len(point), 3), np.nan),
        width=np.ones(len(point)),
        closed=np.zeros(len(stroke), dtype=bool),
        free_ends=None,
    )

"""A field taken from one mesh to another of the same shape, by position."""

from __future__ import annotations

import numpy as np

from ..errors import RosyError
from .frames import carry, dot, unit
from .nearest import nearest_triangles
from .rosy_field import RosyField
from .surface import Surface

#: How far the meshes may be apart, as a share of their size, and by how much normals may differ.
APART, TILT = 0.02, np.radians(60)

#: So large a part of the faces may be farther: what is on one mesh alone stays undefined.
FEW = 0.05


def follow(source: Surface, field: RosyField, target: Surface, name: str) -> RosyField:
    """The field of one mesh on another: each face takes that of the nearest face.

    Parameters
    ----------
    source : Surface
    field : RosyField
        On its faces.
    target : Surface
        The same shape in the same space, with other faces: triangulated, cut, in another order.
    name : str
        What to call the field in messages.

    Returns
    -------
    RosyField
        On the faces of `target`; zero on those that are away from `source`.

    Raises
    ------
    RosyError
        If more than a few faces are away from `source`.
    """
    centre = _centres(target)
    triangle, distance = nearest_triangles(source, centre)
    face = source.triangle_face[triangle]
    size = max(source.size, 1e-300)
    normal = target.face_normal
    facing = dot(normal, source.face_normal[face])
    away = (distance > APART * size) | (facing < np.cos(TILT))
    away |= ~normal.any(axis=1)
    lost = away & normal.any(axis=1)
    if lost.sum() > FEW * len(away):
        raise RosyError(
            f"{name}: {lost.sum()} of {len(away)} faces of {target.name} are away from "
            f"{source.name} by up to {distance.max():.3g}: it is another shape, or in another place"
        )
    vectors = field.vectors[face]
    length = np.sqrt(dot(vectors, vectors))[:, None]
    vectors = unit(carry(vectors, source.face_normal[face], normal)) * length
    vectors[away] = 0
    deviations = None if field.deviations is None else field.deviations[face]
    return RosyField(field.degree, vectors, deviations, field.families)


def _centres(surface: Surface) -> np.ndarray:
    """(F, 3) a point on each face: the middle of its largest triangle."""
    corners = surface.vertices[surface.triangle_vertex]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    order = np.lexsort((dot(cross, cross), surface.triangle_face))
    last = np.searchsorted(surface.triangle_face[order], np.arange(surface.face_count), "right") - 1
    return corners[order[last]].mean(axis=1)

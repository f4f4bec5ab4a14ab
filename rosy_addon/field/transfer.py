"""Transfer a field between two meshes of the same shape, by position."""

from __future__ import annotations

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from .blocks import row_blocks
from .closest_point import closest_triangles
from .frames import dot, normalize, transport
from .rosy_field import RosyField
from .surface import Surface

#: Limits for a target face to get the field of the closest source face: the distance relative to
#: `Surface.extent` of the source, and the angle between the normals in radians.
MAX_DISTANCE, MAX_NORMAL_ANGLE = 0.02, np.radians(60)

#: Largest fraction of the target faces that may exceed these limits. The field is undefined on
#: them.
MAX_UNMATCHED_FRACTION = 0.05


def transfer_field(
    source: Surface, field: RosyField, target: Surface, field_name: str
) -> RosyField:
    """Transfer a field to another mesh: each face takes the value of the closest source face.

    Parameters
    ----------
    source : Surface
    field : RosyField
        The field on the faces of `source`.
    target : Surface
        The same shape in the same space with different faces, for example triangulated or
        reordered.
    field_name : str
        Name of the field in messages.

    Returns
    -------
    RosyField
        On the faces of `target`; zero on faces beyond `MAX_DISTANCE` or `MAX_NORMAL_ANGLE`, and on
        faces without area.

    Raises
    ------
    RosyError
        If more than `MAX_UNMATCHED_FRACTION` of the faces exceed these limits.
    """
    points = _face_points(target)
    with progress(0.1, 0.9):
        triangle, distance = closest_triangles(source, points)
    report(0.9, "transferring the field")
    face = source.triangle_face[triangle]
    extent = max(source.extent, 1e-300)
    normal = target.face_normal
    normal_cosine = dot(normal, source.face_normal[face])
    undefined = (distance > MAX_DISTANCE * extent) | (normal_cosine < np.cos(MAX_NORMAL_ANGLE))
    undefined |= ~normal.any(axis=1)
    unmatched = undefined & normal.any(axis=1)
    if unmatched.sum() > MAX_UNMATCHED_FRACTION * len(undefined):
        raise RosyError(
            f"{field_name}: {unmatched.sum()} of {len(undefined)} faces of {target.name} do not lie on "
            f"{source.name} (distances up to {distance.max():.3g}): the two meshes must have the same "
            "shape and position"
        )
    vectors = field.vectors[face]
    length = np.sqrt(dot(vectors, vectors))[:, None]
    vectors = normalize(transport(vectors, source.face_normal[face], normal)) * length
    vectors[undefined] = 0
    direction_ratios = None if field.direction_ratios is None else field.direction_ratios[face]
    return RosyField(field.degree, vectors, direction_ratios, field.family_count)


def _face_points(surface: Surface) -> np.ndarray:
    """Return (F, 3) a point on each face: the centroid of its largest triangle."""
    points = np.empty((surface.face_count, 3))
    for faces in row_blocks(surface.face_count):
        limits = np.searchsorted(surface.triangle_face, [faces.start, faces.stop])
        triangles = slice(*limits)
        face = surface.triangle_face[triangles]
        corners = surface.vertices[surface.triangle_vertex[triangles]]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        order = np.lexsort((dot(cross, cross), face))
        last = np.searchsorted(face[order], np.arange(faces.start, faces.stop), "right") - 1
        points[faces] = corners[order[last]].mean(axis=1)
    return points

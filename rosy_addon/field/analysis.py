"""How smooth a field is, and how far it is from another one."""

from __future__ import annotations

import numpy as np

from ..errors import RosyError
from .frames import dot, unit
from .representation import (
    face_frames,
    face_representation,
    matching_angles,
    to_representation,
)
from .rosy_field import RosyField
from .surface import Surface, surface_edges


def field_energy(surface: Surface, field: RosyField) -> float:
    """The Dirichlet energy of the field's direction, of its representation with modulus 1.

    The sum over the edges between faces of ``w |z_f - r z_g|^2``, where r unfolds one face into the
    plane of the other and w is the length of the edge over the distance of the faces' centres from
    it: the integral of |grad z|^2 by two-point fluxes. It has no unit, so that scaling the mesh
    changes nothing; a smoothest field on a sphere has about 4 pi N, and a little more around each
    singularity the finer the mesh.

    Faces on which the field is undefined do not count.
    """
    x, y = face_frames(surface)
    z = to_representation(field.vectors, x, y, field.degree)
    size = np.abs(z)
    z = np.divide(z, size, out=np.zeros_like(z), where=size > 0)
    edges = surface_edges(surface.corner_vertex, surface.face_start)
    a, b = edges.sides[:, 0], edges.sides[:, 1]
    one, other = surface.corner_face[a], surface.corner_face[b]
    turn = field.degree * matching_angles(surface, x, y, z, field.degree, a, b)
    start = surface.vertices[surface.corner_vertex[a]]
    edge = surface.vertices[surface.corner_vertex[b]] - start
    length = np.sqrt(dot(edge, edge))
    along = unit(edge)
    across = np.zeros(len(a))
    for face in (one, other):
        off = surface.face_centre[face] - start
        off -= dot(off, along)[:, None] * along
        across += np.sqrt(dot(off, off))
    known = (size[one] > 0) & (size[other] > 0) & (across > 0)
    weight = np.divide(length, across, out=np.zeros_like(length), where=known)
    return float((weight * 2 * (1 - np.cos(turn)))[known].sum())


def angle_errors(surface: Surface, field: RosyField, other: RosyField) -> np.ndarray:
    """How far one field is turned against another of the same degree.

    Parameters
    ----------
    surface : Surface
    field, other : RosyField

    Returns
    -------
    (F,) float64 ndarray
        Radians from a member to the nearest of the other field, 0 to pi / N; NaN on faces on which
        either is undefined.

    Raises
    ------
    RosyError
        If their degrees differ.
    """
    if field.degree != other.degree:
        raise RosyError(
            f"{surface.name}: a field of degree {field.degree} cannot be compared with one of "
            f"{other.degree}"
        )
    z, wanted = face_representation(surface, field), face_representation(surface, other)
    error = np.abs(np.angle(z * wanted.conj())) / field.degree
    error[(z == 0) | (wanted == 0)] = np.nan
    return error


def error_facts(surface: Surface, error: np.ndarray) -> dict[str, float]:
    """Mean, root mean square and largest of (F,) errors, in degrees, by area; and the share known.

    All are 0 if nothing is known.
    """
    area = np.bincount(surface.triangle_face, _triangle_areas(surface), surface.face_count)
    known = np.isfinite(error)
    weight = area[known] / max(float(area[known].sum()), 1e-300)
    degrees = np.degrees(error[known])
    return {
        "mean": float(weight @ degrees),
        "rms": float(np.sqrt(weight @ degrees**2)),
        "max": float(degrees.max(initial=0.0)),
        "compared": float(known.mean()),
    }


def _triangle_areas(surface: Surface) -> np.ndarray:
    corner = surface.vertices[surface.triangle_vertex]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.sqrt(dot(cross, cross)) / 2

"""Measure a field: its Dirichlet energy, and its angular difference from another field."""

from __future__ import annotations

import numpy as np

from ..errors import RosyError
from .frames import dot, normalize
from .representation import (
    face_frames,
    face_representation,
    matching_angles,
    to_representation,
)
from .rosy_field import RosyField
from .surface import Surface, build_edges


def dirichlet_energy(surface: Surface, field: RosyField) -> float:
    """Compute the Dirichlet energy of the representation of a field, normalized to modulus 1.

    The energy is the integral of ``|grad z|^2``, discretized by two-point fluxes. It is the sum
    over the interior edges of ``w |z_f - r z_g|^2``, where r is the rotation that unfolds face g
    into the plane of face f. The weight w is the length of the edge divided by the summed distances
    of the two face centers from it.

    The energy has no unit, so it does not depend on the scale of the mesh. A smoothest field on a
    sphere has about 4 pi N. The part around each singularity grows slowly with the resolution of
    the mesh. Faces where the field is undefined are ignored.
    """
    x, y = face_frames(surface)
    z = to_representation(field.vectors, x, y, field.degree)
    modulus = np.abs(z)
    z = np.divide(z, modulus, out=np.zeros_like(z), where=modulus > 0)
    edges = build_edges(surface.corner_vertex, surface.face_start)
    a, b = edges.halfedges[:, 0], edges.halfedges[:, 1]
    face_a, face_b = surface.corner_face[a], surface.corner_face[b]
    angle = field.degree * matching_angles(surface, x, y, z, field.degree, a, b)
    length, center_distance = edge_lengths(surface, a, b)
    defined = (modulus[face_a] > 0) & (modulus[face_b] > 0) & (center_distance > 0)
    weight = np.divide(length, center_distance, out=np.zeros_like(length), where=defined)
    return float((weight * 2 * (1 - np.cos(angle)))[defined].sum())


def edge_lengths(surface: Surface, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Measure interior edges, for two-point fluxes across them.

    Parameters
    ----------
    surface : Surface
    a, b : (I,) int ndarray
        The columns of `Edges.halfedges`.

    Returns
    -------
    length : (I,) float64 ndarray
    center_distance : (I,) float64 ndarray
        The summed distances of the centers of both faces from the edge.
    """
    start = surface.vertices[surface.corner_vertex[a]]
    edge = surface.vertices[surface.corner_vertex[b]] - start
    direction = normalize(edge)
    center_distance = np.zeros(len(a))
    for corner in (a, b):
        offset = surface.face_center[surface.corner_face[corner]] - start
        offset -= dot(offset, direction)[:, None] * direction
        center_distance += np.sqrt(dot(offset, offset))
    return np.sqrt(dot(edge, edge)), center_distance


def angle_errors(surface: Surface, field: RosyField, other: RosyField) -> np.ndarray:
    """Compute the angle between two fields of the same degree on each face.

    Parameters
    ----------
    surface : Surface
    field, other : RosyField

    Returns
    -------
    (F,) float64 ndarray
        Angle in radians from a member to the nearest member of the other field, 0 to pi / N. NaN on
        faces where either field is undefined.

    Raises
    ------
    RosyError
        If the degrees differ.
    """
    if field.degree != other.degree:
        raise RosyError(
            f"{surface.name}: a field of degree {field.degree} cannot be compared with one of "
            f"{other.degree}"
        )
    z, other_z = face_representation(surface, field), face_representation(surface, other)
    error = np.abs(np.angle(z * other_z.conj())) / field.degree
    error[(z == 0) | (other_z == 0)] = np.nan
    return error


def error_statistics(surface: Surface, error: np.ndarray) -> dict[str, float]:
    """Summarize angular errors over the surface.

    Parameters
    ----------
    surface : Surface
    error : (F,) float ndarray
        Radians, as from `angle_errors`; NaN is ignored.

    Returns
    -------
    dict of str to float
        "mean" and "rms", weighted by face area, and "max", in degrees; and "compared", the fraction
        of the faces whose error is not NaN. All are 0 if there are none.
    """
    area = np.bincount(surface.triangle_face, _triangle_areas(surface), surface.face_count)
    defined = np.isfinite(error)
    weight = area[defined] / max(float(area[defined].sum()), 1e-300)
    degrees = np.degrees(error[defined])
    return {
        "mean": float(weight @ degrees),
        "rms": float(np.sqrt(weight @ degrees**2)),
        "max": float(degrees.max(initial=0.0)),
        "compared": float(defined.mean()),
    }


def _triangle_areas(surface: Surface) -> np.ndarray:
    """(T,) float64 areas of the triangles, in square Blender units."""
    corner = surface.vertices[surface.triangle_vertex]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.sqrt(dot(cross, cross)) / 2

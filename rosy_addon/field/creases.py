"""Creases of a mesh: chains of sharp edges, told from the noise of scans.

Edges are judged with hysteresis and as chains, like the edges of an image by Canny, "A Computational
Approach to Edge Detection", PAMI 1986. The result does not depend on the view, so creases do not
flicker when something moves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..progress import progress, report
from .frames import angle_between, dot
from .salient_edges import (
    MIN_RATIO,
    NOISE_MULTIPLE,
    SHARP_ANGLE,
    filtered_normals,
    largest_of_others,
)
from .surface import Edges, Surface, build_edges, connected_components

#: A chain may contain edges with this share of the crease angle.
WEAK_SHARE = 0.5

#: At least this share of the length of a chain has the full crease angle.
MIN_STRONG_SHARE = 0.25

#: Smallest angle between filtered normals, relative to the angle between the normals.
MIN_FILTERED_SHARE = 0.1

#: Shortest chain on a noisy mesh: its number of mean edges, for each radian of noise.
MIN_EDGES_PER_NOISE = 100.0

#: Mean edge, relative to `Surface.extent`, above which the filtered normals count less: the edges of a
#: coarse mesh are meant.
NOISY_EDGE_LENGTH = 0.02

#: Rings of faces around sharp edges in which normals are filtered.
FILTER_RINGS = 4

#: Smallest crease angle in radians, below which normals differ by rounding only.
MIN_ANGLE = 1e-3

#: Label of the progress.
LABEL = "finding creases"


class Creases(NamedTuple):
    """The edges of a mesh that are creases.

    Attributes
    ----------
    ends : (n, 2) int32 ndarray
        Pairs of vertices, the smaller first.
    chain : (n,) int32 ndarray
        Chain of each edge, numbered from 0 without gaps. The edges of a chain are connected.
    """

    ends: np.ndarray
    chain: np.ndarray


def find_creases(surface: Surface, crease_angle: float) -> Creases:
    """Find the creases of a mesh.

    An edge is strong if the angle between the normals of its faces is at least the crease angle, and
    weak if it is at least half of that. The angle between the filtered normals must exceed the noise.
    Where normals are interpolated across an edge, the edge must also bend more than those around it,
    or by `SHARP_ANGLE`. A chain of connected edges is kept if enough of it is strong, and if it is
    long enough for the noise of the mesh.

    Parameters
    ----------
    surface : Surface
    crease_angle : float
        Radians.

    Returns
    -------
    Creases
        Borders and edges with more than two faces are not creases.
    """
    none = Creases(np.empty((0, 2), np.int32), np.empty(0, np.int32))
    report(0.0, LABEL)
    edges = build_edges(surface.corner_vertex, surface.face_start)
    sides = surface.corner_face[edges.halfedges].T
    # Smaller angles have no effect.
    crease_angle = max(crease_angle, MIN_ANGLE)
    angle = _large_angles(surface.face_normal, sides, WEAK_SHARE / MIN_RATIO * crease_angle)
    if angle.max(initial=0.0) < crease_angle:
        return none
    region = _faces_near(surface, edges.ends[edges.interior[angle >= crease_angle]])
    with progress(0.4, 0.8, LABEL):
        normals, noise_angle = filtered_normals(surface, edges, region)
    ends = edges.ends[edges.interior]
    vector = surface.vertices[ends[:, 0]] - surface.vertices[ends[:, 1]]
    length = np.sqrt(dot(vector, vector))
    mean_length = max(float(length.mean()), 1e-300)
    density = min(1.0, NOISY_EDGE_LENGTH * surface.extent / mean_length) ** 2
    noise_angle *= density
    report(0.8, LABEL)
    bent = np.flatnonzero(angle >= WEAK_SHARE * crease_angle)
    least = np.maximum(density * MIN_FILTERED_SHARE * angle[bent], NOISE_MULTIPLE * noise_angle)
    bent = bent[angle_between(*normals[sides[:, bent]]) >= least]
    is_candidate = angle[bent] >= SHARP_ANGLE
    is_candidate |= _is_between_fans(surface, edges.halfedges[bent])
    if not is_candidate.all():
        is_candidate |= angle[bent] >= MIN_RATIO * _largest_around(surface, edges, angle)[bent]
    bent = bent[is_candidate]
    if not len(bent):
        return none
    report(0.9, LABEL)
    ends, length, is_strong = ends[bent], length[bent], angle[bent] >= crease_angle
    chain = connected_components(len(surface.vertices), ends)[ends[:, 0]]
    total = np.bincount(chain, length)[chain]
    is_kept = np.bincount(chain, length * is_strong)[chain] >= MIN_STRONG_SHARE * total
    is_kept &= total >= MIN_EDGES_PER_NOISE * noise_angle * mean_length
    _, chain = np.unique(chain[is_kept], return_inverse=True)
    return Creases(ends[is_kept], chain.ravel().astype(np.int32))


def _large_angles(normals: np.ndarray, sides: np.ndarray, least: float) -> np.ndarray:
    """(I,) angles in radians between the normals of pairs (2, I) of faces; 0 below the least."""
    angle = np.zeros(sides.shape[1])
    a, b = sides
    is_large = sum(x[a] * x[b] for x in np.ascontiguousarray(normals.T)) < np.cos(least)
    angle[is_large] = angle_between(normals[a[is_large]], normals[b[is_large]])
    return angle


def _faces_near(surface: Surface, ends: np.ndarray) -> np.ndarray:
    """(F,) bool: the faces within `FILTER_RINGS` rings of edges, given as pairs of vertices."""
    is_near = np.zeros(len(surface.vertices), dtype=bool)
    is_near[ends] = True
    for _ in range(FILTER_RINGS):
        faces = np.logical_or.reduceat(is_near[surface.corner_vertex], surface.face_start[:-1])
        is_near[surface.corner_vertex[faces[surface.corner_face]]] = True
    return faces


def _is_between_fans(surface: Surface, halfedges: np.ndarray) -> np.ndarray:
    """(n,) bool: whether normals are not interpolated across edges, given as of `Edges.halfedges`."""
    fan, following = surface.corner_fan, surface.next_corner
    a, b = halfedges.T
    return (fan[a] != fan[following[b]]) | (fan[following[a]] != fan[b])


def _largest_around(surface: Surface, edges: Edges, angle: np.ndarray) -> np.ndarray:
    """(I,) largest angle of the other edges of the two faces at each interior edge."""
    all_angles = np.zeros(len(edges.ends))
    all_angles[edges.interior] = angle
    return np.maximum(*largest_of_others(surface, all_angles[edges.corner_edge], edges.halfedges))

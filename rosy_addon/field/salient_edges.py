"""Edges at which the form of a surface breaks, told from the noise of scans and coarse meshes."""

from __future__ import annotations

import numpy as np

from ..progress import report
from .frames import angle_between, dot, normalize
from .surface import Edges, Surface, connected_components, face_area_vectors

#: Rounds of the bilateral filter of the normals, and its width: a difference of unit normals.
FILTER_ROUNDS, FILTER_WIDTH = 8, 0.35

#: Edges with a larger angle than the second are salient, in radians. Between the two angles, an edge is
#: salient if its angle is at least `MIN_RATIO` times those of the other edges of its two faces.
MIN_ANGLE, SHARP_ANGLE = np.pi / 6, np.pi / 3
MIN_RATIO = 2.0

#: Both angles are at least this multiple of the angle by which noise turns the normals.
NOISE_MULTIPLE = 5.0

#: Shortest line of salient edges, relative to `Surface.extent`.
MIN_LINE_LENGTH = 0.05


def weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    """Return the value at which half of the total weight is reached; 0 without any weight."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    if not len(total) or not total[-1] > 0:
        return 0.0
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def filtered_normals(
    surface: Surface, edges: Edges, region: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Smooth the face normals over edges, but not across large angles.

    Parameters
    ----------
    surface : Surface
    edges : Edges
    region : (F,) bool ndarray, optional
        The faces to smooth, without regard to the others. All by default.

    Returns
    -------
    normals : (F, 3) float64 ndarray
        Unit, or zero.
    noise_angle : float
        The median angle, by area, between the normals before and after, in radians; of the region.

    References
    ----------
    Zheng, Fu, Au and Tai, "Bilateral Normal Filtering for Mesh Denoising", TVCG 2011.
    """
    label = "filtering normals"
    face_a, face_b = (surface.corner_face[side] for side in edges.halfedges.T)
    corner_vertex, face_start = surface.corner_vertex, surface.face_start
    unfiltered = normals = surface.face_normal
    if region is not None:
        inside = region[face_a] & region[face_b]
        rank = np.cumsum(region) - 1
        face_a, face_b = rank[face_a[inside]], rank[face_b[inside]]
        unfiltered = normals = normals[region]
        corner_vertex = corner_vertex[region[surface.corner_face]]
        face_start = np.concatenate([[0], np.cumsum(np.diff(face_start)[region])])
    vectors = face_area_vectors(surface.vertices, corner_vertex, face_start)
    area = np.sqrt(dot(vectors, vectors))
    area /= max(float(area.max(initial=0.0)), 1e-300)
    for index in range(FILTER_ROUNDS):
        report(index / FILTER_ROUNDS, label)
        normal_a, normal_b = normals[face_a], normals[face_b]
        difference = normal_a - normal_b
        weight = np.exp(dot(difference, difference) * (-0.5 / FILTER_WIDTH**2))
        weight_a, weight_b = weight * area[face_b], weight * area[face_a]
        report((index + 0.5) / FILTER_ROUNDS, label)
        total = normals * area[:, None]
        for axis in range(3):
            total[:, axis] += np.bincount(face_a, weight_a * normal_b[:, axis], len(area))
            total[:, axis] += np.bincount(face_b, weight_b * normal_a[:, axis], len(area))
        normals = normalize(total)
    noise_angle = weighted_median(angle_between(unfiltered, normals), area)
    if region is not None:
        filtered = normals
        normals = surface.face_normal.copy()
        normals[region] = filtered
    return normals, noise_angle


def salient_edges(
    surface: Surface, edges: Edges, normals: np.ndarray, noise_angle: float
) -> np.ndarray:
    """Find the borders and the edges at which the surface bends more sharply than around them.

    On a coarse mesh of a smooth surface, neighboring edges have similar angles, and none of them is
    salient unless it is very sharp.

    Parameters
    ----------
    surface : Surface
    edges : Edges
    normals, noise_angle
        From `filtered_normals`.

    Returns
    -------
    (E, 2) int32 ndarray
        Pairs of vertices.
    """
    face_a, face_b = (surface.corner_face[side] for side in edges.halfedges.T)
    angle = np.zeros(len(edges.ends))
    # Faces without area have no normal, so their edges have no angle.
    angle[edges.interior] = angle_between(normals[face_a], normals[face_b])
    interior = angle[edges.interior]
    others = np.maximum(*largest_of_others(surface, angle[edges.corner_edge], edges.halfedges))
    noise = NOISE_MULTIPLE * noise_angle
    is_sharp = interior >= max(SHARP_ANGLE, noise)
    is_sharp |= (interior >= max(MIN_ANGLE, noise)) & (interior >= MIN_RATIO * others)
    is_salient = np.ones(len(edges.ends), dtype=bool)
    is_salient[edges.interior] = is_sharp
    ends = edges.ends[is_salient]
    if not len(ends):
        return ends
    line = connected_components(len(surface.vertices), ends)
    line = line[ends[:, 0]]
    edge = surface.vertices[ends[:, 0]] - surface.vertices[ends[:, 1]]
    length = np.bincount(line, np.sqrt(dot(edge, edge)))[line]
    return ends[length >= MIN_LINE_LENGTH * surface.extent]


def largest_of_others(
    surface: Surface, corner_angle: np.ndarray, halfedges: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest angle of the other edges of the two faces at each interior edge.

    Parameters
    ----------
    surface : Surface
    corner_angle : (C,) float64 ndarray
        Angle of the edge from each corner to the next.
    halfedges : (I, 2) int32 ndarray
        `Edges.halfedges`.
    """
    first = surface.face_start[:-1]
    largest = np.maximum.reduceat(corner_angle, first)
    is_largest = corner_angle == largest[surface.corner_face]
    second = np.maximum.reduceat(np.where(is_largest, 0.0, corner_angle), first)
    is_tied = np.add.reduceat(is_largest.astype(np.int32), first) > 1
    second = np.where(is_tied, largest, second)
    a, b = (
        np.where(is_largest[side], second[face], largest[face])
        for side, face in ((side, surface.corner_face[side]) for side in halfedges.T)
    )
    return a, b

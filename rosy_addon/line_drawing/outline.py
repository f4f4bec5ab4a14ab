"""Outlines of meshes as strokes: silhouettes, creases and borders."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.progress import progress, report
from ..field.connectivity import build_edges
from ..field.creases import find_creases
from ..field.frames import angle_between, dot, normalize
from ..field.surface import Surface
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.vector_components import cofactor_matrix
from .stroke_set import Strokes
from .tangent_mesh import CREASE_ANGLE, is_sharp_edge
from .visibility import pixel_size

#: `Strokes.names` of an outline: the kind of line of each family.
OUTLINE_KINDS = ("silhouettes", "creases", "borders")

#: Shortest crease in pixels if it is as sharp as the angle, in radians. Sharper ones may be shorter, but
#: count as at most a right angle; blunter ones have to be longer.
MIN_CREASE_PX, REFERENCE_ANGLE = 12.0, np.radians(60)

#: End points are the same if they differ by less than about this fraction of the extent of all.
SAME_POINT_RATIO = 1e-7

#: Where more than two segments meet, two are joined if they turn by less than this, in radians.
MAX_JUNCTION_TURN = np.radians(50)


class Segments(NamedTuple):
    """k straight segments of lines on triangles, in world space.

    Attributes
    ----------
    ends : (k, 2, 3) float64 ndarray
    normals : (k, 2, 3) float64 ndarray
        Unit shading normals at the ends.
    triangle : (k,) int64 ndarray
    """

    ends: np.ndarray
    normals: np.ndarray
    triangle: np.ndarray


class _Corners(NamedTuple):
    """The (T, 3, 3) corners of triangles, the shading normals there and the normals of triangles."""

    points: np.ndarray
    normals: np.ndarray
    flat: np.ndarray


def outline(instance: MeshInstance, camera: Camera) -> Strokes:
    """Extract the silhouettes, creases and borders of a mesh instance.

    Silhouettes are the curves on which the interpolated normal is perpendicular to the direction to
    the camera. They pass smoothly through the triangles (Hertzmann and Zorin, "Illustrating Smooth
    Surfaces", SIGGRAPH 2000). At sharp edges that are no creases, they follow the edges.

    Parameters
    ----------
    instance : MeshInstance
    camera : Camera
        Camera of the silhouettes. Creases are left out that are too short and blunt in its pixels.

    Returns
    -------
    Strokes
        World space; families as in `OUTLINE_KINDS`. Members and spacings are 0, weights are NaN.
    """
    label = "finding outlines"
    surface = instance.surface
    matrix = np.asarray(instance.matrix, dtype=np.float64)
    points = instance.world_points()[surface.triangle_vertex]
    normals = normalize(surface.corner_normal @ cofactor_matrix(matrix[:3, :3]).T)
    flat = normalize(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]))
    corners = _Corners(points, normals[surface.triangles], flat)
    vertex = surface.triangle_vertex.ravel()
    with progress(0.0, 0.3, label):
        edges = build_edges(vertex, np.arange(0, len(vertex) + 1, 3, dtype=np.int32))
    a, b = edges.halfedges[:, 0], edges.halfedges[:, 1]
    with progress(0.3, 0.7, label):
        is_crease = _are_pairs(vertex, a, find_creases(surface, CREASE_ANGLE).ends)
    is_border = np.ones(len(edges.face_count), dtype=bool)
    is_border[edges.interior] = False
    borders = np.flatnonzero(is_border[edges.corner_edge])
    report(0.8, label)
    starts = a[is_crease]
    creases = _edge_segments(corners, starts)
    is_blunt = is_sharp_edge(surface, a, b) & ~is_crease
    smooth = _smooth_silhouettes(corners, camera)
    sharp = _sharp_silhouettes(corners, a[is_blunt], b[is_blunt], camera)
    silhouettes = Segments(*(np.concatenate(pair) for pair in zip(smooth, sharp, strict=True)))
    angle = angle_between(flat[starts // 3], flat[b[is_crease] // 3])
    salience = _pixel_salience(creases, angle, camera)
    families = [
        _strokes(silhouettes, 0, surface),
        _strokes(creases, 1, surface, salience),
    ]
    report(0.9, label)
    return Strokes.join([*families, _strokes(_edge_segments(corners, borders), 2, surface)])


def _smooth_silhouettes(corners: _Corners, camera: Camera) -> Segments:
    """Return the zero set of n . w, where w is the direction to the camera.

    It has a straight segment in each triangle in which n . w changes its sign.
    """
    facing = dot(corners.normals, camera.view_directions(corners.points))
    front = facing > 0
    triangle = np.flatnonzero(front.any(axis=1) & ~front.all(axis=1))
    front, facing = front[triangle], facing[triangle]
    lone_corner = np.argmax(front == (front.sum(axis=1) == 1)[:, None], axis=1)
    row = np.arange(len(triangle))
    ends, normals = [], []
    for step in (1, 2):
        other = (lone_corner + step) % 3
        fraction = facing[row, lone_corner] / (facing[row, lone_corner] - facing[row, other])
        for target, values in ((ends, corners.points), (normals, corners.normals)):
            a, b = values[triangle, lone_corner], values[triangle, other]
            target.append(a + fraction[:, None] * (b - a))
    return Segments(np.stack(ends, 1), normalize(np.stack(normals, 1)), triangle)


def _sharp_silhouettes(corners: _Corners, a: np.ndarray, b: np.ndarray, camera: Camera) -> Segments:
    """Return the parts of sharp edges on which one side faces the camera and the other does not.

    Parameters
    ----------
    corners : _Corners
    a, b : (n,) ndarray of int
        The corners (3 t + k) at which the edges start in the triangles on both sides.
    camera : Camera
    """
    segments = _edge_segments(corners, a)
    to_eye = camera.view_directions(segments.ends)
    # The other triangle runs along the edge in the opposite direction.
    facing = np.stack(
        [
            dot(segments.normals, to_eye),
            dot(_edge_segments(corners, b).normals[:, ::-1], to_eye),
        ],
        axis=1,
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = np.clip(np.nan_to_num(facing[..., 0] / (facing[..., 0] - facing[..., 1])), 0, 1)
    cuts = np.sort(np.concatenate([zero, np.zeros((len(a), 1)), np.ones((len(a), 1))], axis=1))
    middle = (cuts[:, :-1] + cuts[:, 1:]) / 2
    at_middle = (
        facing[:, None, :, 0] + middle[..., None] * (facing[..., 1] - facing[..., 0])[:, None]
    )
    is_contour = ((at_middle > 0).sum(axis=2) == 1) & (np.diff(cuts) > 1e-9)
    edge, part = np.nonzero(is_contour)
    fraction = np.stack([cuts[edge, part], cuts[edge, part + 1]], axis=1)[..., None]
    first, last = segments.ends[edge, :1], segments.ends[edge, 1:]
    return Segments(
        first + fraction * (last - first), segments.normals[edge], segments.triangle[edge]
    )


def _edge_segments(corners: _Corners, starts: np.ndarray) -> Segments:
    """Return the edges of triangles that start at the given corners (3 t + k)."""
    triangle, k = starts // 3, starts % 3
    following = (k + 1) % 3
    return Segments(
        np.stack([corners.points[triangle, k], corners.points[triangle, following]], axis=1),
        np.stack([corners.normals[triangle, k], corners.normals[triangle, following]], axis=1),
        triangle.astype(np.int64),
    )


def _are_pairs(vertex: np.ndarray, starts: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return (n,) bool: whether edges of triangles are among pairs of vertices, the smaller first.

    Parameters
    ----------
    vertex : (3 T,) ndarray of int
        Vertex of each corner.
    starts : (n,) ndarray of int
        Corners at which the edges start.
    pairs : (m, 2) ndarray of int
    """
    stride = int(vertex.max()) + 1
    following = starts - starts % 3 + (starts + 1) % 3
    low, high = np.sort(np.stack([vertex[starts], vertex[following]]).astype(np.int64), axis=0)
    return np.isin(low * stride + high, pairs[:, 0].astype(np.int64) * stride + pairs[:, 1])


def _pixel_salience(segments: Segments, angle: np.ndarray, camera: Camera) -> np.ndarray:
    """Return (k,) float64: the lengths of creases in pixels, times their sharpness.

    Pixels are measured at the depth of the segment, so that the result does not change when the mesh
    turns.
    """
    length = np.linalg.norm(segments.ends[:, 1] - segments.ends[:, 0], axis=1)
    length = length / pixel_size(segments.ends.mean(axis=1), camera)
    return length * np.minimum(angle, np.pi / 2) / REFERENCE_ANGLE


# --- strokes -----------------------------------------------------------------------------------------


def _strokes(
    segments: Segments, family: int, surface: Surface, salience: np.ndarray | None = None
) -> Strokes:
    """Return the polylines that segments form, as strokes of a family.

    With (k,) saliences, polylines with a sum of less than `MIN_CREASE_PX` are left out.
    """
    keys = _point_keys(segments.ends)
    # Where a silhouette passes through a vertex, it has segments without a length in some triangles.
    has_length = keys[:, 0] != keys[:, 1]
    segments = Segments(*(column[has_length] for column in segments))
    chains = _chain_segments(keys[has_length], segments.ends)
    if salience is not None:
        salience = salience[has_length]
        chains = [
            (chain, closed)
            for chain, closed in chains
            if salience[chain[::2] >> 1].sum() >= MIN_CREASE_PX
        ]
    # Each end of a segment, but the second of two that meet; and the segment that ends there.
    none = np.empty(0, dtype=np.int64)
    point = np.concatenate([none, *(np.append(chain[::2], chain[-1]) for chain, _ in chains)])
    segment = np.concatenate([none, *(np.append(chain[0], chain[::2]) for chain, _ in chains)]) >> 1
    triangle = segments.triangle[segment]
    return Strokes(
        points=segments.ends.reshape(-1, 3)[point],
        start=np.cumsum([0, *(len(chain) // 2 + 1 for chain, _ in chains)]),
        family=np.full(len(chains), family, dtype=np.int32),
        names=OUTLINE_KINDS,
        face=surface.triangle_face[triangle],
        triangle=triangle.astype(np.int32),
        weights=np.full((len(point), 3), np.nan),
        normal=segments.normals.reshape(-1, 3)[point],
        member=np.zeros((len(point), 3)),
        spacing=np.zeros(len(point)),
        width=np.ones(len(point)),
        closed=np.array([closed for _, closed in chains], dtype=bool),
    )


def _point_keys(ends: np.ndarray) -> np.ndarray:
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


def _chain_segments(keys: np.ndarray, ends: np.ndarray) -> list[tuple[np.ndarray, bool]]:
    """Join segments into chains.

    Two segments are joined where no others meet. Where others do, the straightest pairs are joined.

    Parameters
    ----------
    keys : (k, 2) int64 ndarray
        From `_point_keys`.
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

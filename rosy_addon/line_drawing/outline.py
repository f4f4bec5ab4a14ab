"""Outlines of meshes as strokes: silhouettes, creases and borders, and their visible parts.

Silhouettes lie where the surface turns away from the camera, so the surface itself nearly hides them. For
this reason, outlines have a depth test of their own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.progress import progress
from ..field.blocks import mask
from ..field.connectivity import are_pairs, build_edges
from ..field.creases import find_creases
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import angle_between, dot, normalize
from ..field.surface import Surface
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.vector_components import cofactor_matrix
from .stroke_set import Strokes
from .tangent_mesh import CREASE_ANGLE, is_sharp_edge
from .visibility import DepthBuffer, pixel_size, planes_around, project_to_pixels, visible_runs

#: Names of the families in outlines; see `Strokes.names`.
OUTLINE_KINDS = ("silhouettes", "creases", "borders")
SILHOUETTES, CREASES, BORDERS = range(3)

#: Creases shorter than `MIN_CREASE_PX` pixels are left out if their angle is `REFERENCE_ANGLE` radians. For
#: other angles, the limit is inversely proportional to the angle. Angles above a right angle count as right
#: angles.
MIN_CREASE_PX, REFERENCE_ANGLE = 12.0, np.radians(60)

#: End points count as the same if they differ by less than about this fraction of the extent of all points.
SAME_POINT_RATIO = 1e-7

#: Where more than two segments meet, two are joined only if the angle by which the line turns from one to the
#: other is less than this, in radians.
MAX_JUNCTION_TURN = np.radians(50)

#: A point of a silhouette is also visible if it is visible after a move outward by one of these distances, in
#: pixels. Otherwise, edges of triangles that are outside of the smooth silhouette would hide it.
OUTWARD_STEPS_PX = (1.0, 2.0)

#: A point of a silhouette in a triangle is not hidden by triangles that share a vertex with this triangle, if
#: they are in front of it by less than this fraction of the longest edge of the triangle.
MAX_RING_DEPTH = 1.0

#: Gaps in outlines that are shorter than `MAX_GAP_PX` pixels are closed. Visible parts that are shorter than
#: `MIN_MARK_PX` pixels are left out.
MAX_GAP_PX, MIN_MARK_PX = 4.0, 6.0


class Segments(NamedTuple):
    """k straight segments on triangles, in world space.

    Attributes
    ----------
    ends : (k, 2, 3) float64 ndarray
        End points.
    normals : (k, 2, 3) float64 ndarray
        Unit shading normals at the ends.
    triangle : (k,) int64 ndarray
        Triangle on which each segment lies.
    """

    ends: np.ndarray
    normals: np.ndarray
    triangle: np.ndarray


class _Corners(NamedTuple):
    """Corners of triangles, (T, 3, 3), shading normals there, (T, 3, 3), and flat normals, (T, 3)."""

    points: np.ndarray
    normals: np.ndarray
    flat: np.ndarray

    @classmethod
    def of(cls, instance: MeshInstance) -> _Corners:
        """Return the corners of an instance in world space. Normals are unit vectors."""
        surface = instance.surface
        linear = np.asarray(instance.matrix, dtype=np.float64)[:3, :3]
        points = instance.world_points()[surface.triangle_vertex]
        normals = normalize(surface.corner_normal @ cofactor_matrix(linear).T)
        flat = normalize(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]))
        return cls(points, normals[surface.triangles], flat)


def outline_strokes(instance: MeshInstance, camera: Camera) -> Strokes:
    """Extract the silhouettes, creases and borders of a mesh instance.

    Silhouettes are the curves on which the interpolated normal is perpendicular to the direction to
    the camera. They pass smoothly through the triangles (Hertzmann and Zorin, "Illustrating Smooth
    Surfaces", SIGGRAPH 2000). At sharp edges that are no creases, they follow the edges.

    Parameters
    ----------
    instance : MeshInstance
    camera : Camera
        Camera for which the silhouettes are found. Creases whose length in its pixels is too small for their
        angle are left out; see `MIN_CREASE_PX`.

    Returns
    -------
    Strokes
        Strokes in world space, with the families `OUTLINE_KINDS`. Members and spacings are 0, weights are
        NaN.
    """
    surface, corners = instance.surface, _Corners.of(instance)
    vertex = surface.triangle_vertex.ravel()
    with progress(0.0, 0.3, "finding outlines"):
        edges = build_edges(vertex, np.arange(0, len(vertex) + 1, 3, dtype=np.int32))
    a, b = edges.halfedges[:, 0], edges.halfedges[:, 1]
    with progress(0.3, 0.7, "finding outlines"):
        is_crease = are_pairs(edges.ends[edges.interior], find_creases(surface, CREASE_ANGLE))
    borders = np.flatnonzero(~mask(len(edges.face_count), edges.interior)[edges.corner_edge])
    starts = a[is_crease]
    creases = _edge_segments(corners, starts)
    is_blunt = is_sharp_edge(surface, a, b) & ~is_crease
    smooth = _smooth_silhouettes(corners, camera)
    sharp = _sharp_silhouettes(corners, a[is_blunt], b[is_blunt], camera)
    silhouettes = Segments(*(np.concatenate(pair) for pair in zip(smooth, sharp, strict=True)))
    angle = angle_between(corners.flat[starts // 3], corners.flat[b[is_crease] // 3])
    salience = _pixel_salience(creases, angle, camera)
    silhouettes = _strokes(silhouettes, SILHOUETTES, surface)
    creases = _strokes(creases, CREASES, surface, salience)
    borders = _strokes(_edge_segments(corners, borders), BORDERS, surface)
    return Strokes.join([silhouettes, creases, borders])


def _smooth_silhouettes(corners: _Corners, camera: Camera) -> Segments:
    """Return the silhouettes of the smooth surface: the zero set of n . w.

    Here n is the interpolated normal, and w the direction to the camera. There is a straight segment in each
    triangle in which n . w changes its sign.
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
    """Return the parts of sharp edges on which one side faces the camera and the other side faces away.

    Parameters
    ----------
    corners : _Corners
    a, b : (n,) ndarray of int
        Corners at which the edges start, as 3 t + k: `a` in the triangles t on one side, `b` on the other
        side.
    camera : Camera
    """
    segments = _edge_segments(corners, a)
    to_eye = camera.view_directions(segments.ends)
    # The other triangle runs along the edge in the opposite direction.
    other_normals = _edge_segments(corners, b).normals[:, ::-1]
    facing = np.stack([dot(segments.normals, to_eye), dot(other_normals, to_eye)], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = np.clip(np.nan_to_num(facing[..., 0] / (facing[..., 0] - facing[..., 1])), 0, 1)
    cuts = np.sort(np.concatenate([zero, np.zeros((len(a), 1)), np.ones((len(a), 1))], axis=1))
    middle = (cuts[:, :-1] + cuts[:, 1:])[..., None] / 2
    at_middle = facing[:, None, :, 0] + middle * (facing[..., 1] - facing[..., 0])[:, None]
    is_contour = ((at_middle > 0).sum(axis=2) == 1) & (np.diff(cuts) > 1e-9)
    edge, part = np.nonzero(is_contour)
    fraction = np.stack([cuts[edge, part], cuts[edge, part + 1]], axis=1)[..., None]
    first, last = segments.ends[edge, :1], segments.ends[edge, 1:]
    ends = first + fraction * (last - first)
    return Segments(ends, segments.normals[edge], segments.triangle[edge])


def _edge_segments(corners: _Corners, starts: np.ndarray) -> Segments:
    """Return the edges of triangles that start at the given corners (3 t + k)."""
    triangle, k = starts // 3, starts % 3
    row, ends = triangle[:, None], np.stack([k, (k + 1) % 3], axis=1)
    triangle = triangle.astype(np.int64)
    return Segments(corners.points[row, ends], corners.normals[row, ends], triangle)


def _pixel_salience(segments: Segments, angle: np.ndarray, camera: Camera) -> np.ndarray:
    """Return (k,) float64: the lengths of creases in pixels, times their angle over `REFERENCE_ANGLE`.

    `angle`, (k,), is the angle between the normals at both sides of each segment, in radians. The length is
    not foreshortened: it is divided by the size of a pixel at the depth of the segment. So the result hardly
    changes when the mesh rotates.
    """
    length = np.linalg.norm(segments.ends[:, 1] - segments.ends[:, 0], axis=1)
    length = length / pixel_size(segments.ends.mean(axis=1), camera)
    return length * np.minimum(angle, np.pi / 2) / REFERENCE_ANGLE


# --- strokes -----------------------------------------------------------------------------------------


def _strokes(
    segments: Segments, family: int, surface: Surface, salience: np.ndarray | None = None
) -> Strokes:
    """Join segments to polylines, and return them as strokes of the given family.

    `surface` is the surface on which the segments lie; the faces of its triangles become `Strokes.face`. If
    `salience`, (k,), is given, a polyline is left out if the sum of the saliences of its segments is below
    `MIN_CREASE_PX`.
    """
    keys = _point_keys(segments.ends)
    # Where a silhouette passes through a vertex, it has segments without a length in some triangles.
    has_length = keys[:, 0] != keys[:, 1]
    segments = Segments(*(column[has_length] for column in segments))
    chains = _chain_segments(keys[has_length], segments.ends)
    if salience is not None:
        salience = salience[has_length]
        chains = [pair for pair in chains if salience[pair[0][::2] >> 1].sum() >= MIN_CREASE_PX]
    # The points of chains: one end of each segment, and the last end of the chain. Then the segment at each.
    none = np.empty(0, dtype=np.int64)
    point = np.concatenate([none, *(np.append(chain[::2], chain[-1]) for chain, _ in chains)])
    segment = np.concatenate([none, *(np.append(chain[0], chain[::2]) for chain, _ in chains)]) >> 1
    triangle = segments.triangle[segment]
    return Strokes(
        points=segments.ends.reshape(-1, 3)[point],
        start=offsets_from_sizes([len(chain) // 2 + 1 for chain, _ in chains]),
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
    """Return (k, 2) int64 keys of the (k, 2, 3) end points. Points at the same position have the same key."""
    if not len(ends):
        return np.empty((0, 2), dtype=np.int64)
    points = ends.reshape(-1, 3)
    cell = SAME_POINT_RATIO * max(float(np.ptp(points, axis=0).max()), 1e-300)
    cells = np.rint((points - points.min(axis=0)) / cell).astype(np.int64)
    _, keys = np.unique(cells, axis=0, return_inverse=True)
    return keys.reshape(-1, 2).astype(np.int64)


def _chain_segments(keys: np.ndarray, ends: np.ndarray) -> list[tuple[np.ndarray, bool]]:
    """Join segments into chains.

    Where exactly two segments meet, they are joined. Where more segments meet, the straightest pairs are
    joined.

    Parameters
    ----------
    keys : (k, 2) int64 ndarray
        Keys of the end points, which are equal for points at the same position.
    ends : (k, 2, 3) ndarray
        End points of the segments.

    Returns
    -------
    list of (chain, closed)
        The chain is an array of ends of segments, 2 * segment + (0 or 1), in their order along the chain.
        Each segment has two ends. A closed chain ends where it starts.
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
    """Join the straightest pairs of ends at a point where three or more segments meet.

    Parameters
    ----------
    junction : (m,) ndarray of int
        Ends at the point, as 2 * segment + (0 or 1).
    outward : (2 k, 3) ndarray
        For each end, the unit direction of its segment toward the end.
    mate : (2 k,) ndarray of int
        The end that is joined to each end, or -1. Changed in place.
    """
    turn = np.arccos(np.clip(-outward[junction] @ outward[junction].T, -1, 1))
    row, column = np.triu_indices(len(junction), 1)
    for pair in np.argsort(turn[row, column], kind="stable").tolist():
        a, b = junction[row[pair]], junction[column[pair]]
        if turn[row[pair], column[pair]] < MAX_JUNCTION_TURN and mate[a] < 0 and mate[b] < 0:
            mate[a], mate[b] = b, a


# --- visibility --------------------------------------------------------------------------------------


def visible_outline(
    instance: MeshInstance, index: int, camera: Camera, depth_buffer: DepthBuffer | None
) -> Strokes:
    """Return the parts of the `outline_strokes` of an instance that are in the frame and not hidden.

    Outlines need another depth test than strokes, because silhouettes lie on triangles that may face away
    from the camera where the smooth surface does not.

    Parameters
    ----------
    instance : MeshInstance
    index : int
        Index of the instance in the depth buffer.
    camera : Camera
    depth_buffer : DepthBuffer or None
        If None, lines are only clipped to the frame.

    Returns
    -------
    Strokes
        With a depth buffer, visible parts that are shorter than `MIN_MARK_PX` are left out.
    """
    lines = outline_strokes(instance, camera)
    test = None if depth_buffer is None else _OutlineTest(instance, index, depth_buffer).is_visible
    return visible_runs(lines, camera, test, MAX_GAP_PX, MIN_MARK_PX)


class _OutlineTest:
    """The depth test of the outline of an instance.

    Attributes
    ----------
    depth_buffer : DepthBuffer
    first_triangle : int
        Index of the first triangle of the instance in the depth buffer.
    triangle_vertex : (T, 3) int32 ndarray
        Vertices of the triangles of the instance.
    corners : _Corners
        Corners and normals of these triangles, in world space.
    """

    def __init__(self, instance: MeshInstance, index: int, depth_buffer: DepthBuffer) -> None:
        self.depth_buffer = depth_buffer
        self.first_triangle = depth_buffer.start[index]
        self.triangle_vertex = instance.surface.triangle_vertex
        self.corners = _Corners.of(instance)

    def is_visible(self, block: Strokes, point: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """Return (m,) bool: whether points of outlines are visible.

        `block` holds outlines, `point` the (m,) indices of the points to test, and `pixels` the (m, 2) pixel
        coordinates of these points.
        """
        camera, triangle = self.depth_buffer.camera, block.triangle[point]
        ring_depth = np.full(len(point), -1.0)
        contour = np.flatnonzero(block.family[block.stroke[point]] == SILHOUETTES)
        crossed, inverse = np.unique(triangle[contour], return_inverse=True)
        ring_depth[contour] = self._ring_depth(crossed)[inverse]
        visible = ~self._is_hidden(block.points[point], pixels, triangle, ring_depth)
        for step in OUTWARD_STEPS_PX:
            pending = np.flatnonzero(~visible & (ring_depth > 0))
            points, normal = block.points[point[pending]], block.normal[point[pending]]
            to_eye = camera.view_directions(points)
            outward = normalize(normal - dot(normal, to_eye)[:, None] * to_eye)
            moved = points + step * pixel_size(points, camera)[:, None] * outward
            pixels = np.nan_to_num(project_to_pixels(moved, camera)[0])
            around = triangle[pending], ring_depth[pending]
            visible[pending] = ~self._is_hidden(moved, pixels, *around)
        return visible

    def _ring_depth(self, triangle: np.ndarray) -> np.ndarray:
        """Return (n,) float64: tolerances of the depth test for the silhouettes in n triangles.

        Adjacent triangles do not hide a point of a silhouette that is behind them by less than the tolerance,
        a distance along the view ray in world space. It is `MAX_RING_DEPTH` times the longest edge of the
        triangle if the radial curvature of the surface is positive: n . w (normal times the direction to the
        camera) grows toward the camera. There the surface itself does not hide its silhouette. Elsewhere, and
        in triangles that no silhouette crosses, the tolerance is -1, so that all triangles are tested.
        """
        a, b, c = self.corners.points[triangle].transpose(1, 0, 2)
        to_eye = self.depth_buffer.camera.view_directions((a + b + c) / 3)
        normals = self.corners.normals[triangle]
        fa, fb, fc = facing = np.stack([dot(normals[:, k], to_eye) for k in range(3)])
        u, v = b - a, c - a
        uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
        along_u, along_v = dot(u, to_eye), dot(v, to_eye)
        # The derivative along the projection of the direction to the eye, times a positive factor.
        slope = (vv * along_u - uv * along_v) * (fb - fa)
        slope += (uu * along_v - uv * along_u) * (fc - fa)
        longest = np.sqrt(np.maximum(np.maximum(uu, vv), dot(c - b, c - b)))
        crossed = (facing.min(axis=0) < 0) & (facing.max(axis=0) > 0)
        return np.where((slope > 0) & crossed, MAX_RING_DEPTH * longest, -1.0)

    def _is_hidden(
        self, points: np.ndarray, pixels: np.ndarray, triangle: np.ndarray, ring_depth: np.ndarray
    ) -> np.ndarray:
        """Return (n,) bool: whether each point is hidden by the triangles at all four pixels around it.

        `points` are in world space, `pixels` are their (n, 2) pixel coordinates, and `triangle` is the own
        triangle of each point, on which it lies. Another triangle that shares a vertex with the own triangle
        does not hide the point if the point is less than `ring_depth`, (n,), behind it along the view ray, in
        world space.
        """
        hidden = np.ones(len(points), dtype=bool)
        for plane in planes_around(points, pixels, self.depth_buffer):
            behind = plane.hides.copy()
            near = np.flatnonzero(behind & (plane.distance < ring_depth))
            behind[near] = ~self._shares_vertex(triangle[near], plane.triangle[near])
            hidden &= behind
        return hidden

    def _shares_vertex(self, triangle: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return (n,) bool: whether pairs of triangles share a vertex.

        `triangle` holds triangles of this instance, and `other` triangles of the depth buffer. The result is
        false if `other` belongs to another instance.
        """
        local = other - self.first_triangle
        is_own = (local >= 0) & (local < len(self.triangle_vertex))
        vertex = self.triangle_vertex[np.where(is_own, local, 0)]
        own_vertex = self.triangle_vertex[triangle]
        return is_own & (vertex[:, :, None] == own_vertex[:, None, :]).any(axis=(1, 2))

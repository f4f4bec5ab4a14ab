"""Triangulate polygons, as fans where possible and by ear clipping otherwise."""

import heapq

import numpy as np

from .blocks import mask, row_blocks
from .connectivity import build_edges
from .frames import dot, quotient

#: Largest sine of the turning angle at a flat corner. Reflex corners have negative sines.
COLLINEAR_SINE = 1e-6

#: Number of corners that are compared with a triangle at once.
CHUNK_SIZE = 512

#: Number of faces whose corners are processed at once.
FACES_PER_BLOCK = 1 << 14

#: Faces with more corners are not divided into fans. In a Laplacian, the apex of a fan is a neighbor of all corners,
#: and on coarser grids of `sparse_multigrid` most pairs of its k neighbors become neighbors: k^2 / 4 of them.
MAX_FAN = 256

#: A diagonal is flipped if this makes the sum of the cotangents opposite it larger by more than this. If all corners of
#: a face lie on a circle, these sums are 0 for all diagonals, up to rounding errors.
EQUAL_COTANGENTS = 1e-6


def triangulate(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Split each face with k corners into k - 2 triangles, in the order of the faces.

    The triangles of a concave face lie inside the face, and collinear corners do not cause triangles without
    area. Faces are projected along their Newell normal. Self-intersecting faces are also split, but
    their triangles may overlap.

    Parameters
    ----------
    vertices : (V, 3) float64 ndarray
        Positions of the vertices.
    corner_vertex : (C,) int32 ndarray
        Vertex of each corner.
    face_start : (F + 1,) int32 ndarray
        First corner of each face, and C.

    Returns
    -------
    triangles : (T, 3) int32 ndarray
        Indices of the three corners of each triangle.
    triangle_face : (T,) int32 ndarray
        Face of each triangle, in ascending order.

    Notes
    -----
    A convex face becomes a fan around its first corner. A face with a single flat or reflex corner becomes
    a fan around that corner. All other corners are visible from it, because shortest paths inside a polygon
    bend only at reflex corners. A convex face with more than `MAX_FAN` corners becomes a strip. The remaining faces,
    usually few, are ear-clipped in a Python loop.
    """
    size = np.diff(face_start)
    apex = np.zeros(len(size), dtype=np.int32)
    faces = np.flatnonzero(size > 3)
    apex[faces], needs_ears = _fan_apexes(vertices, corner_vertex, face_start, faces)
    triangles, triangle_face = _triangle_fans(face_start, apex)
    first_triangle = np.cumsum(size - 2) - (size - 2)
    for face in faces[needs_ears]:
        corners = np.arange(face_start[face], face_start[face + 1])
        ears = _ear_clip(_project_to_plane(vertices[corner_vertex[corners]]))
        first = first_triangle[face]
        triangles[first : first + len(ears)] = corners[ears]
    return triangles, triangle_face


def delaunay_triangles(
    points: np.ndarray, triangles: np.ndarray, triangle_face: np.ndarray
) -> np.ndarray:
    """Return Delaunay triangulations of the faces (Lawson 1977). They do not depend on the first corners of faces.

    Diagonals are flipped until the two angles opposite each of them add up to at most 180 degrees. Where all
    corners of a face lie on a circle, as in a rectangle, several divisions are as good. Then the cotangent
    weights of the diagonals are 0, so that a Laplacian does not depend on the choice.

    Parameters
    ----------
    points : (C, 3) float64 ndarray
        Position of each corner.
    triangles : (T, 3) int32 ndarray
        Indices of the three corners of each triangle, as `triangulate` returns them.
    triangle_face : (T,) int32 ndarray
        Face of each triangle.

    Returns
    -------
    (T, 3) int32 ndarray
        Corners of the new triangles; row t belongs to the same face as before.
    """
    triangles, size = triangles.copy(), np.bincount(triangle_face)
    active = np.flatnonzero(size[triangle_face] > 1)
    # Each round flips the best diagonal of each face, at least. Faces that are not planar may never settle.
    for _ in range(int(size.max(initial=0)) ** 2):
        pairs, quads = _diagonals(triangles[active])
        gain = _gain_of_flips(points[quads])
        rank = np.argsort(np.argsort(-gain, kind="stable"))
        best = np.full(len(active), len(gain))
        np.minimum.at(best, pairs.ravel(), np.repeat(rank, 2))
        chosen = (gain > EQUAL_COTANGENTS) & (best[pairs] == rank[:, None]).all(axis=1)
        if not chosen.any():
            break
        first, second = active[pairs[chosen].T]
        triangles[first], triangles[second] = quads[chosen][:, [0, 1, 3]], quads[chosen][:, 1:]
        active = active[mask(len(size), triangle_face[first])[triangle_face[active]]]
    return triangles


def _diagonals(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the n pairs of triangles that share two corners.

    Returns
    -------
    pairs : (n, 2) intp ndarray
        Indices of both triangles.
    quads : (n, 4) int32 ndarray
        The four corners of both triangles, counter-clockwise. The first and the third corner are shared.
    """
    corner = triangles.ravel()
    halfedges = build_edges(corner, np.arange(0, len(corner) + 1, 3)).halfedges
    opposite = corner[halfedges - halfedges % 3 + (halfedges + 2) % 3]
    tail = corner[halfedges]
    quads = np.stack([tail[:, 0], opposite[:, 1], tail[:, 1], opposite[:, 0]], axis=1)
    return halfedges // 3, quads


def _gain_of_flips(corners: np.ndarray) -> np.ndarray:
    """Return (n,) gains of flipping diagonals; a flip to a Delaunay diagonal has a positive gain.

    The gain is the sum of the cotangents of the two angles opposite to the other diagonal, minus this sum for
    the present diagonal. It is 0 where the other diagonal lies outside. `corners` holds the (n, 4, 3)
    positions of the corners of both triangles, counter-clockwise. The present diagonal is from the first to
    the third.
    """
    following = np.roll(corners, -1, axis=1) - corners
    previous = -np.roll(following, 1, axis=1)
    cross = np.cross(following, previous)
    double_area = np.sqrt(dot(cross, cross))
    cotangent = dot(following, previous) / np.maximum(double_area, 1e-300)
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    is_convex = (dot(cross[:, [0, 2]], normal[:, None]) > 0).all(axis=1)
    gain = cotangent[:, 0] + cotangent[:, 2] - cotangent[:, 1] - cotangent[:, 3]
    return np.where(is_convex, gain, 0)


def _triangle_fans(face_start: np.ndarray, apex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split faces into fans or strips (see `chain_corners`). Return `triangles` and `triangle_face` of `triangulate`.

    `apex` holds, for each of F faces, the apex of the fan or the first corner of the strip, counted from 0 within the
    face.
    """
    size = np.diff(face_start)
    count = size - 2
    triangle_face = np.repeat(np.arange(len(size), dtype=np.int32), count)
    first_triangle = (np.cumsum(count) - count)[triangle_face]
    step = np.arange(len(triangle_face), dtype=np.int32) - first_triangle
    first, size, apex = face_start[triangle_face], size[triangle_face], apex[triangle_face]
    local = (chain_corners(step, size) + apex[:, None]) % size[:, None]
    return (first[:, None] + local).astype(np.int32), triangle_face


def chain_corners(rank: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the corners of the triangles that divide faces. Each triangle shares a side with the next in its face.

    The triangles of a face form a fan around its first corner or, if it has more than `MAX_FAN` corners, a strip that
    zigzags between its two sides.

    Parameters
    ----------
    rank, size : (T,) int ndarray
        Position of each triangle among the triangles of its face, from 0, and number of corners of the face.

    Returns
    -------
    (T, 3) int ndarray
        Corners, counted from 0 in the face, counter-clockwise. The last one is not in the previous triangle.
    """
    half, odd = np.divmod(np.where(size > MAX_FAN, rank, 0), 2)
    is_fan = size <= MAX_FAN
    second = np.where(is_fan, rank + 1, half + odd + 1)
    third = np.where(is_fan, rank + 2, np.where(odd, -half - 1, half + 2))
    return np.stack([-half, second, third], axis=1) % size[:, None]


def _fan_apexes(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Choose the apex of the fan of each face, and find the faces that need ear clipping.

    Parameters
    ----------
    vertices, corner_vertex, face_start : ndarray
        The polygon mesh, as in `triangulate`.
    faces : (n,) int ndarray
        Faces with more than three corners.

    Returns
    -------
    apex : (n,) int32 ndarray
        Corner around which the fan is, counted from 0 within each face.
    needs_ears : (n,) bool ndarray
        Whether the face cannot be split into a fan and needs ear clipping.
    """
    size = np.diff(face_start)[faces]
    apex = np.zeros(len(faces), dtype=np.int32)
    needs_ears = np.zeros(len(faces), dtype=bool)
    for count in np.unique(size):
        same_size = np.flatnonzero(size == count)
        for block in row_blocks(len(same_size), max(FACES_PER_BLOCK * 4 // int(count), 1)):
            group = same_size[block]
            corners = face_start[faces[group]][:, None] + np.arange(count)
            sine = _corner_sines(vertices[corner_vertex[corners]])
            sharpest = np.argmin(sine, axis=1)
            not_convex = sine.min(axis=1) <= COLLINEAR_SINE
            apex[group] = np.where(not_convex, sharpest, 0)
            if count > 4:
                needs_ears[group] = (sine <= COLLINEAR_SINE).sum(axis=1) > (count <= MAX_FAN)
    return apex, needs_ears


def _corner_sines(points: np.ndarray) -> np.ndarray:
    """Return the (F, k) sines of the exterior angles at the corners of (F, k, 3) polygons.

    They are negative at reflex corners.
    """
    edge = np.roll(points, -1, axis=1) - points
    previous_edge = np.roll(edge, 1, axis=1)
    relative = points - points[:, :1]
    normal = np.cross(relative, np.roll(relative, -1, axis=1)).sum(axis=1)
    length = np.linalg.norm(edge, axis=2)
    scale = np.roll(length, 1, axis=1) * length * np.linalg.norm(normal, axis=1)[:, None]
    return quotient(np.einsum("fki,fi->fk", np.cross(previous_edge, edge), normal), scale)


def _project_to_plane(points: np.ndarray) -> np.ndarray:
    """Return the (k, 2) corners of a polygon, projected along its normal. They run counter-clockwise."""
    relative = points - points[0]
    normal = np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0)
    axis = np.zeros(3)
    axis[np.argmin(np.abs(normal))] = 1.0
    x = np.cross(axis, normal)
    y = np.cross(normal, x)
    return np.stack([relative @ x, relative @ y / (np.linalg.norm(normal) or 1.0)], axis=1)


def _ear_clip(points: np.ndarray) -> np.ndarray:
    """Triangulate a simple counter-clockwise polygon by ear clipping.

    Each step cuts off the ear whose smallest angle is the largest. An ear is a corner whose
    triangle contains no other corner.

    Parameters
    ----------
    points : (k, 2) ndarray

    Returns
    -------
    (k - 2, 3) int ndarray
        Indices of the three points of each triangle.

    Notes
    -----
    Candidates for ears are kept in a heap, sorted by the smallest angle of their triangle. If the triangle
    of a candidate contains a corner, it cannot be an ear before that corner is cut off, so it waits until
    then. The time is nearly linear in k unless many corners are near each other along both axes.
    """
    count = len(points)
    previous = [count - 1, *range(count - 1)]
    following = [*range(1, count), 0]
    remaining = _RemainingCorners(points)
    quality = _smallest_sine(points[previous], points, points[following])
    # An entry of the heap is valid if its version is the current version of its corner.
    version = [0] * count
    candidates = [(-value, corner, 0) for corner, value in enumerate(quality.tolist())]
    heapq.heapify(candidates)
    blocked: list[tuple[float, int, int]] = []
    waiting: dict[int, list[tuple[float, int, int]]] = {}
    triangles = []
    while len(triangles) < count - 3:
        # A self-intersecting polygon may have no ear. Then cut off the triangle of best quality.
        is_candidate = bool(candidates)
        entry = heapq.heappop(candidates if is_candidate else blocked)
        _, corner, entry_version = entry
        if entry_version != version[corner]:
            continue
        before, after = previous[corner], following[corner]
        if is_candidate:
            contained = remaining.first_inside(before, corner, after)
            if contained is not None:
                waiting.setdefault(contained, []).append(entry)
                heapq.heappush(blocked, entry)
                continue
        triangles.append((before, corner, after))
        version[corner] = -1
        remaining.remove(corner)
        following[before], previous[after] = after, before
        for released in waiting.pop(corner, ()):
            heapq.heappush(candidates, released)
        left, right = [previous[before], before], [after, following[after]]
        quality = _smallest_sine(points[left], points[[before, after]], points[right])
        for end, value in zip((before, after), quality.tolist(), strict=True):
            version[end] += 1
            heapq.heappush(candidates, (-value, end, version[end]))
    last = next(corner for corner in range(count) if version[corner] >= 0)
    return np.array([*triangles, sorted((previous[last], last, following[last]))])


class _RemainingCorners:
    """The corners of a polygon in the plane that are not cut off yet, sorted by x and sorted by y."""

    def __init__(self, points: np.ndarray) -> None:
        self._points = points
        self._alive = np.ones(len(points), dtype=bool)
        self._alive_count = len(points)
        self._sort()

    def _sort(self) -> None:
        """Sort the remaining corners by x, and in a second list by y."""
        corners = np.flatnonzero(self._alive)
        self._order = [corners[np.argsort(self._points[corners, axis])] for axis in (0, 1)]
        self._coordinate = [self._points[self._order[axis], axis] for axis in (0, 1)]

    def remove(self, corner: int) -> None:
        """Remove a corner that has been cut off."""
        self._alive[corner] = False
        self._alive_count -= 1
        if 2 * self._alive_count < len(self._order[0]):
            self._sort()

    def first_inside(self, a: int, b: int, c: int) -> int | None:
        """Return a remaining corner in or on the triangle of the corners a, b and c; None if there is none.

        Corners at the same position as a, b or c do not count.
        """
        triangle = self._points[[a, b, c]]
        low, high = triangle.min(axis=0), triangle.max(axis=0)
        slices = []
        for axis in (0, 1):
            start = np.searchsorted(self._coordinate[axis], low[axis], "left")
            stop = np.searchsorted(self._coordinate[axis], high[axis], "right")
            slices.append(self._order[axis][start:stop])
        nearby = min(slices, key=len)
        # Test in chunks: most triangles that contain a corner contain one of the first chunk.
        for first in range(0, len(nearby), CHUNK_SIZE):
            corners = nearby[first : first + CHUNK_SIZE]
            corners = corners[self._alive[corners]]
            points = self._points[corners]
            inside = np.ones(len(corners), dtype=bool)
            for start, stop in ((0, 1), (1, 2), (2, 0)):
                offset = points - triangle[start]
                inside &= _cross(triangle[stop] - triangle[start], offset) >= 0
                inside &= (offset != 0).any(axis=1)
            found = np.flatnonzero(inside)
            if len(found):
                return int(corners[found[0]])
        return None


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the (...) z components of the cross products of (..., 2) vectors."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _smallest_sine(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return the (n,) smallest sines of the angles of triangles with (n, 2) corners a, b and c.

    The sine is negative for clockwise triangles.
    """
    ab, bc, ca = (np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c))
    scale = ab * bc * ca / np.maximum(np.minimum(np.minimum(ab, bc), ca), 1e-300)
    return quotient(_cross(b - a, c - a), scale)

"""Reduce a tangent mesh to the part on which strokes are traced: the part in the frame that is visible.

Without this cut, there would be no limit to the number of strokes outside the frame: toward the plane through
the eye, the size of a pixel in world space falls to zero, and the spacing of strokes falls with it.

Strokes on hidden triangles are not traced either. On most models, these are half of all strokes. A stroke
keeps its distance only from the strokes beside it. So visible strokes are the same as on the whole mesh if
tracing continues a little beyond the visible triangles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.progress import report
from ..field.frames import dot, normalize
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.pixel_blocks import part_of, reported_blocks
from .stroke_set import Strokes
from .tangent_mesh import TangentMesh, take_triangles, with_corners
from .visibility import BLOCK_POINTS, DepthBuffer, in_frame, planes_around, project_to_pixels

#: Distance from the frame up to which strokes are traced: the smaller one of a number of pixels and a
#: fraction of the frame. With this margin, strokes reach the frame as on the whole mesh.
MARGIN_PIXELS, MARGIN_RATIO = 64.0, 0.125

#: If the depths in a triangle differ by more than the factor `MAX_DEPTH_RATIO`, triangles are cut at planes
#: of constant depth, each `DEPTH_STEP` times as far away as the one before. The reason is that spacings are
#: proportional to the depth in perspective, but interpolated linearly in triangles.
DEPTH_STEP, MAX_DEPTH_RATIO = 2.0, 4.0

#: Distance from visible triangles up to which strokes are traced, in spacings.
HIDDEN_MARGIN = 6.0


@dataclass(frozen=True, eq=False)
class Parts:
    """T' triangles, each of which is a part of one of T whole triangles.

    Attributes
    ----------
    triangle : (T',) int32 ndarray
        Index of the whole triangle that contains each part.
    weights : (T', 3, 3) float64 ndarray
        Barycentric coordinates of the three corners of each part in its whole triangle.
    """

    triangle: np.ndarray
    weights: np.ndarray

    def corner_values(self, values: np.ndarray) -> np.ndarray:
        """Return (T', 3, ...) values at the corners of the parts.

        They are interpolated from the (T, 3, ...) values at the corners of the whole triangles.
        """
        return np.einsum("tkj,tj...->tk...", self.weights, values[self.triangle])


@dataclass(frozen=True, eq=False)
class MeshInView(Parts):
    """A part of a tangent mesh, with the position of its T' triangles in the T triangles of the whole mesh.

    Attributes
    ----------
    mesh : TangentMesh
        The part as a mesh. Its `triangle_vertex` holds the vertices of the whole triangles.
    """

    mesh: TangentMesh

    def take(self, kept: np.ndarray) -> MeshInView:
        """Return the mesh of the triangles for which `kept`, (T',) bool, is true."""
        return MeshInView(self.triangle[kept], self.weights[kept], take_triangles(self.mesh, kept))

    def on_whole_mesh(self, strokes: Strokes) -> Strokes:
        """Return strokes that were traced on this part, with triangles and weights of the whole mesh."""
        weights = np.einsum("nk,nkj->nj", strokes.weights, self.weights[strokes.triangle])
        return replace(strokes, triangle=self.triangle[strokes.triangle], weights=weights)


def mesh_in_view(mesh: TangentMesh, camera: Camera) -> MeshInView:
    """Cut off what is outside the frame and its margin, or nearer to the camera than the near plane.

    The margin is `MARGIN_PIXELS` wide, but at most `MARGIN_RATIO` times the side of the frame.

    Parameters
    ----------
    mesh : TangentMesh
    camera : Camera

    Returns
    -------
    MeshInView
        The remaining part of the mesh. Edges at the cut have no neighbors. There may be no triangles.
    """
    report(0.0, "finding the part in view")
    matrix = camera.projection @ camera.view
    # Unlike the result of `@`, clip coordinates are equal for equal points.
    x, y, z, w = np.einsum("ij,tkj->itk", matrix[:, :3], mesh.points) + matrix[:, 3, None, None]
    margins = (min(MARGIN_PIXELS / side, MARGIN_RATIO) for side in (camera.width, camera.height))
    right, top = (w * (1 + 2 * margin) for margin in margins)
    whole = whole_mesh(mesh)
    adjacency = mesh.neighbor, mesh.neighbor_edge, mesh.edge_transport
    pieces = _Pieces(whole.triangle, whole.weights, *adjacency)
    for distance in (z + w, right - x, right + x, top - y, top + y):
        pieces = pieces.cut(distance, keeps_both=False)
    if camera.is_perspective:
        for depth in _depths_of_cuts(pieces.corner_values(w)):
            report(0.5, "finding the part in view")
            pieces = pieces.cut(w - depth, keeps_both=True)
    if pieces.neighbor is mesh.neighbor:
        return whole
    return pieces.apply(mesh)


def whole_mesh(mesh: TangentMesh) -> MeshInView:
    """Return a `MeshInView` that contains a mesh without any cut."""
    count = len(mesh.points)
    weights = np.broadcast_to(np.eye(3), (count, 3, 3))
    return MeshInView(np.arange(count, dtype=np.int32), weights, mesh)


def _depths_of_cuts(depth: np.ndarray) -> np.ndarray:
    """Return the depths of the planes at which triangles are cut, given the (T, 3) depths of their corners.

    The planes are parallel to the image plane, and depths are in Blender units. After the cuts, the depth
    changes so little in each triangle that the spacing can be interpolated; see `DEPTH_STEP`. The result has
    one dimension. It is empty if no triangle has depths that differ by more than the factor
    `MAX_DEPTH_RATIO`.
    """
    low, high = np.maximum(depth.min(axis=1), 1e-300), depth.max(axis=1)
    is_deep = high > MAX_DEPTH_RATIO * low
    if not is_deep.any():
        return np.zeros(0)
    low, high = low[is_deep].min(), high[is_deep].max()
    return low * DEPTH_STEP ** np.arange(1.0, np.ceil(np.log2(high / low) / np.log2(DEPTH_STEP)))


@dataclass(frozen=True, eq=False)
class _Pieces(Parts):
    """Parts of triangles and their adjacency.

    `neighbor`, `neighbor_edge` and `edge_transport` are as in `TangentMesh`, for the edges of the parts.
    """

    neighbor: np.ndarray
    neighbor_edge: np.ndarray
    edge_transport: np.ndarray

    def cut(self, distance: np.ndarray, keeps_both: bool) -> _Pieces:
        """Return the pieces after a cut along a plane.

        Parameters
        ----------
        distance : (T, 3) ndarray
            Signed distances of the corners of the whole triangles from the plane, in any unit.
        keeps_both : bool
            Whether the pieces with negative distances are kept as well as the others.
        """
        value = self.corner_values(distance)
        inside = value >= 0
        inside_count = inside.sum(axis=1)
        is_cut = (inside_count > 0) & (inside_count < 3)
        if not is_cut.any() and (keeps_both or inside_count.all()):
            return self
        uncut = np.flatnonzero(~is_cut if keeps_both else inside_count == 3)
        crossed = np.flatnonzero(is_cut)
        # Corner a is alone on its side of the plane, b and c follow it.
        is_alone_inside = inside_count[crossed] == 1
        a = np.argmax(inside[crossed] == is_alone_inside[:, None], axis=1)
        b, c = (a + 1) % 3, (a + 2) % 3
        on_ab = self._crossing(value, crossed, a, b)
        on_ac = self._crossing(value, crossed, a, c)
        at_a, at_b, at_c = (self.weights[crossed, corner] for corner in (a, b, c))
        # Edges keep their numbers 3 t + k from before the cut. New edges in a triangle that is cut have
        # negative numbers. The cut is an edge of the tip and of the rest, which is a quadrilateral. The
        # diagonal is an edge of the two triangles into which the rest is divided.
        edge_a, edge_b, edge_c = (3 * crossed + corner for corner in (a, b, c))
        first = -4 * np.arange(len(crossed)) - 1
        cut_of_tip, cut_of_rest, diagonal, diagonal_back = first, first - 1, first - 2, first - 3
        tip = np.stack([at_a, on_ab, on_ac], axis=1), (cut_of_tip, edge_b, edge_c)
        rest = np.stack([on_ab, at_b, at_c], axis=1), (edge_a, diagonal, edge_c)
        other_rest = np.stack([on_ab, at_c, on_ac], axis=1), (edge_b, cut_of_rest, diagonal_back)
        edges = 3 * uncut[:, None] + np.arange(3)
        parts = [(uncut, self.weights[uncut], edges, inside_count[uncut] > 0)]
        for (weights, edges), is_tip in ((tip, True), (rest, False), (other_rest, False)):
            side = is_alone_inside == is_tip
            kept = slice(None) if keeps_both else side
            edges = np.stack(edges, axis=1)[kept]
            parts.append((crossed[kept], weights[kept], edges, side[kept]))
        columns = zip(*parts, strict=True)
        source, weights, edge, side = (np.concatenate(column) for column in columns)
        neighbor, neighbor_edge = self._neighbors(edge, side, len(crossed))
        transport = np.where(edge < 0, 1, self.edge_transport.ravel()[np.maximum(edge, 0)])
        return _Pieces(self.triangle[source], weights, neighbor, neighbor_edge, transport)

    def _crossing(
        self, value: np.ndarray, piece: np.ndarray, first: np.ndarray, second: np.ndarray
    ) -> np.ndarray:
        """Return (n, 3) barycentric coordinates, in whole triangles, of the zeros of a function on edges.

        Parameters
        ----------
        value : (T', 3) ndarray
            Values at the corners of all pieces. They are interpolated linearly.
        piece : (n,) ndarray of int
            Piece to which each edge belongs.
        first, second : (n,) ndarray of int
            Corners, 0 to 2, of the pieces at the ends of the edges.
        """
        start, end = value[piece, first], value[piece, second]
        fraction = (start / (start - end))[:, None]
        return (1 - fraction) * self.weights[piece, first] + fraction * self.weights[piece, second]

    def _neighbors(
        self, edge: np.ndarray, side: np.ndarray, cut_count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the attributes `neighbor` and `neighbor_edge` of m new pieces, as in `TangentMesh`.

        Each new piece is a part of one of the pieces of this object, the old pieces.

        Parameters
        ----------
        edge : (m, 3) ndarray of int
            For each edge of a new piece, the number 3 t + k of the edge of an old piece that contains it.
            Edges inside old pieces have negative numbers. Two of them are the same edge if their values of
            ``-edge - 1`` differ only in the last bit.
        side : (m,) bool ndarray
            Whether the new piece is on the positive side of the plane.
        cut_count : int
            Number of old pieces that were cut.
        """
        is_inner, old = edge < 0, np.maximum(edge, 0)
        # Two parts of the same old edge are neighbors if they are on the same side of the plane.
        offset = 3 * len(self.triangle) * side[:, None]
        new_edge_at = np.full(6 * len(self.triangle), -1)
        new_edge = np.arange(edge.size).reshape(edge.shape)
        new_edge_at[(old + offset)[~is_inner]] = new_edge[~is_inner]
        inner_edge_at = np.full(4 * cut_count, -1)
        inner_edge_at[-edge[is_inner] - 1] = new_edge[is_inner]
        old_neighbor = self.neighbor.ravel()[old].astype(np.int64)
        beside = 3 * old_neighbor + self.neighbor_edge.ravel()[old] + offset
        has_neighbor = ~is_inner & (old_neighbor >= 0)
        other = np.full(edge.shape, -1)
        other[has_neighbor] = new_edge_at[beside[has_neighbor]]
        # The numbers of the two sides of an inner edge differ in the last bit.
        other[is_inner] = inner_edge_at[(-edge[is_inner] - 1) ^ 1]
        return (other // 3).astype(np.int32), (np.maximum(other, 0) % 3).astype(np.int8)

    def apply(self, mesh: TangentMesh) -> MeshInView:
        """Return the pieces as a mesh, with the values of `mesh` interpolated at their corners."""
        part = replace(
            part_of(mesh, self.triangle),
            corner_normal=normalize(self.corner_values(mesh.corner_normal)),
            z=self.corner_values(mesh.z),
            magnitude=self.corner_values(mesh.magnitude),
            harmonics=tuple((j, self.corner_values(values)) for j, values in mesh.harmonics),
            neighbor=self.neighbor,
            neighbor_edge=self.neighbor_edge,
            edge_transport=self.edge_transport,
        )
        part = with_corners(part, self.corner_values(mesh.points))
        return MeshInView(self.triangle, self.weights, part)


# --- triangles that are seen -------------------------------------------------------------------------


def seen_triangles(instance: MeshInstance, index: int, depth_buffer: DepthBuffer) -> np.ndarray:
    """Return which triangles of an instance the camera sees.

    Parameters
    ----------
    instance : MeshInstance
    index : int
        Index of the instance in the depth buffer.
    depth_buffer : DepthBuffer

    Returns
    -------
    (T,) bool ndarray
        True for triangles that are nearest to the camera at a pixel, or have a corner that is not hidden. A
        corner outside the frame counts as not hidden.
    """
    triangle_vertex = instance.surface.triangle_vertex
    owner = depth_buffer.triangle[depth_buffer.triangle >= 0]
    pixel_counts = np.bincount(owner, minlength=len(depth_buffer.normal))
    seen = pixel_counts[depth_buffer.start[index] : depth_buffer.start[index + 1]] > 0
    points = instance.world_points()
    hidden = np.zeros(len(points), dtype=bool)
    pending = np.unique(triangle_vertex[~seen])
    for part in reported_blocks(len(pending), "finding the part in view", size=BLOCK_POINTS):
        hidden[pending[part]] = _is_hidden(points[pending[part]], depth_buffer)
    return seen | ~hidden[triangle_vertex].all(axis=1)


def _is_hidden(points: np.ndarray, depth_buffer: DepthBuffer) -> np.ndarray:
    """Return (n,) bool: whether (n, 3) points in world space are in the frame and hidden.

    A point is hidden if the triangles that are visible at all four pixels around it hide it.
    """
    pixels, _ = project_to_pixels(points, depth_buffer.camera)
    hidden = in_frame(pixels, depth_buffer.camera)
    chosen = np.flatnonzero(hidden)
    for plane in planes_around(points[chosen], pixels[chosen], depth_buffer):
        hidden[chosen] &= plane.hides
    return hidden


def triangles_near(mesh: TangentMesh, seen: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Return which triangles are visible or within `HIDDEN_MARGIN` spacings of a visible triangle.

    Hidden triangles are reached from visible ones by paths across edges. The distance of a triangle is the
    straight distance between two edges: where the path leaves a visible triangle, and where it enters the
    triangle.

    Parameters
    ----------
    mesh : TangentMesh
    seen : (T,) bool ndarray
        Visible triangles.
    spacing : (T, 3) float64 ndarray
        Spacing at the corners, in world space.

    Returns
    -------
    (T,) bool ndarray
    """
    spacing = spacing.mean(axis=1)
    distance = np.where(seen, 0.0, np.inf)
    # The edge at which the path to each triangle leaves a visible triangle.
    origin = np.zeros((len(seen), 2, 3))
    front = np.flatnonzero(seen)
    while len(front):
        source, edge = np.nonzero(mesh.neighbor[front] >= 0)
        source = front[source]
        target = mesh.neighbor[source, edge]
        beyond = ~seen[target]
        source, edge, target = source[beyond], edge[beyond], target[beyond]
        entered = mesh.points[source[:, None], np.stack([edge + 1, edge + 2], axis=1) % 3]
        start = np.where(seen[source, None, None], entered, origin[source])
        reached = _edge_distance(start, entered) / spacing[target]
        nearer = np.flatnonzero((reached < distance[target]) & (reached <= HIDDEN_MARGIN))
        # If several paths reach a triangle, the shortest one is written last.
        nearer = nearer[np.argsort(-reached[nearer], kind="stable")]
        distance[target[nearer]], origin[target[nearer]] = reached[nearer], start[nearer]
        front = np.unique(target[nearer])
    return np.isfinite(distance)


def _edge_distance(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the (n,) distances between the two edges of each pair, which do not cross.

    `first` and `second`, (n, 2, 3), hold the ends of the two edges, row by row. Distances are measured from
    the ends of each edge to the other edge.
    """
    # The shortest connection starts at an end of one of the two edges.
    point = np.stack([first, second]).transpose(2, 0, 1, 3)
    edge = np.stack([second, first])
    along, offset = edge[:, :, 1] - edge[:, :, 0], point - edge[:, :, 0]
    fraction = np.clip(dot(offset, along) / np.maximum(dot(along, along), 1e-300), 0, 1)
    return np.linalg.norm(offset - fraction[..., None] * along, axis=-1).min(axis=(0, 1))

"""The part of a tangent mesh that can be in the picture.

Strokes are traced only there. Beyond the frame and behind the camera, the size of a pixel has no lower
limit, so strokes there could be without number.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..field.frames import normalize
from ..progress import report
from ..projection.camera import Camera
from .stroke_set import Strokes
from .tangent_mesh import TangentMesh, take_triangles, with_corners

#: Distance from the frame up to which strokes are traced, in pixels and as a fraction of the frame; the
#: lesser of both counts. Strokes then reach the frame as if the mesh went on.
MARGIN_PIXELS, MARGIN_RATIO = 64.0, 0.125

#: Triangles are cut at planes of constant depth, each this many times as far away as the one before, if
#: one of them has a larger ratio of depths than `MAX_DEPTH_RATIO`: spacings are interpolated in triangles.
DEPTH_STEP, MAX_DEPTH_RATIO = 2.0, 4.0


@dataclass(frozen=True, eq=False)
class MeshInView:
    """A part of a tangent mesh, of T' triangles that are parts of its T triangles.

    Attributes
    ----------
    mesh : TangentMesh
        The part. `triangle_vertex` is that of the whole triangles.
    triangle : (T',) int32 ndarray
        The whole triangle of each part.
    weights : (T', 3, 3) float64 ndarray
        Barycentric coordinates of each corner in that triangle.
    """

    mesh: TangentMesh
    triangle: np.ndarray
    weights: np.ndarray

    def corner_values(self, values: np.ndarray) -> np.ndarray:
        """Return (T', 3) values at the corners, interpolated from those of the (T, 3) whole ones."""
        return np.einsum("tkj,tj->tk", self.weights, values[self.triangle])

    def take(self, kept: np.ndarray) -> MeshInView:
        """Return some of the parts; `kept` is (T',) bool."""
        return MeshInView(take_triangles(self.mesh, kept), self.triangle[kept], self.weights[kept])

    def on_whole_mesh(self, strokes: Strokes) -> Strokes:
        """Return strokes that were traced on the part as strokes on the whole mesh."""
        return replace(
            strokes,
            triangle=self.triangle[strokes.triangle],
            weights=np.einsum("nk,nkj->nj", strokes.weights, self.weights[strokes.triangle]),
        )


def mesh_in_view(mesh: TangentMesh, camera: Camera) -> MeshInView:
    """Cut off what is beyond the frame, by more than a margin, or in front of the near plane.

    Parameters
    ----------
    mesh : TangentMesh
    camera : Camera

    Returns
    -------
    MeshInView
        Has no neighbors across the cut. It may have no triangles.
    """
    label = "finding the part in view"
    report(0.0, label)
    x, y, z, w = _clip_coordinates(mesh.points, camera)
    right, top = (
        w * (1 + 2 * min(MARGIN_PIXELS / side, MARGIN_RATIO))
        for side in (camera.width, camera.height)
    )
    whole = whole_mesh(mesh)
    pieces = _Pieces(
        whole.triangle, whole.weights, mesh.neighbor, mesh.neighbor_edge, mesh.edge_transport
    )
    for index, distance in enumerate((z + w, right - x, right + x, top - y, top + y)):
        report(0.1 * index, label)
        pieces = pieces.cut(distance, keeps_both=False)
    if camera.is_perspective:
        for depth in _depths_of_cuts(pieces.corner_values(w)):
            report(0.5, label)
            pieces = pieces.cut(w - depth, keeps_both=True)
    if pieces.neighbor is mesh.neighbor:
        return whole
    report(0.9, label)
    return pieces.apply(mesh)


def whole_mesh(mesh: TangentMesh) -> MeshInView:
    """Return all of a mesh as a `MeshInView`."""
    count = len(mesh.points)
    return MeshInView(
        mesh, np.arange(count, dtype=np.int32), np.broadcast_to(np.eye(3), (count, 3, 3))
    )


def _clip_coordinates(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Return (4, T, 3) clip coordinates. Equal points have equal ones."""
    matrix = camera.projection @ camera.view
    return np.einsum("ij,tkj->itk", matrix[:, :3], points) + matrix[:, 3, None, None]


def _depths_of_cuts(depth: np.ndarray) -> np.ndarray:
    """Return the depths at which triangles with (T, 3) depths above 0 are cut."""
    low, high = np.maximum(depth.min(axis=1), 1e-300), depth.max(axis=1)
    is_deep = high > MAX_DEPTH_RATIO * low
    if not is_deep.any():
        return np.zeros(0)
    low, high = low[is_deep].min(), high[is_deep].max()
    return low * DEPTH_STEP ** np.arange(1.0, np.ceil(np.log2(high / low) / np.log2(DEPTH_STEP)))


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Parts of triangles, and the parts that are beside them.

    The attributes are those of `MeshInView` and `TangentMesh` with the same names.
    """

    triangle: np.ndarray
    weights: np.ndarray
    neighbor: np.ndarray
    neighbor_edge: np.ndarray
    edge_transport: np.ndarray

    def corner_values(self, values: np.ndarray) -> np.ndarray:
        """As `MeshInView.corner_values`."""
        return np.einsum("tkj,tj->tk", self.weights, values[self.triangle])

    def cut(self, distance: np.ndarray, keeps_both: bool) -> _Pieces:
        """Cut along a plane.

        Parameters
        ----------
        distance : (T, 3) ndarray
            Signed distances of the corners of the whole triangles from the plane, in any unit.
        keeps_both : bool
            Whether the side with negative distances is kept.
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
        # Edges are those of before, by triangle and number; or, if negative, the inner edges of a
        # triangle that is cut: the cut, seen from the tip, from the rest, and the diagonal of the rest.
        edge_a, edge_b, edge_c = (3 * crossed + corner for corner in (a, b, c))
        cut_of_tip, cut_of_rest, diagonal, diagonal_back = (
            -(4 * np.arange(len(crossed)) + number) - 1 for number in range(4)
        )
        tip = np.stack([at_a, on_ab, on_ac], axis=1), (cut_of_tip, edge_b, edge_c)
        rest = np.stack([on_ab, at_b, at_c], axis=1), (edge_a, diagonal, edge_c)
        other_rest = np.stack([on_ab, at_c, on_ac], axis=1), (edge_b, cut_of_rest, diagonal_back)
        parts = [
            (uncut, self.weights[uncut], 3 * uncut[:, None] + np.arange(3), inside_count[uncut] > 0)
        ]
        for (weights, edges), is_tip in ((tip, True), (rest, False), (other_rest, False)):
            side = is_alone_inside == is_tip
            kept = slice(None) if keeps_both else side
            edges = np.stack(edges, axis=1)[kept]
            parts.append((crossed[kept], weights[kept], edges, side[kept]))
        source, weights, edge, side = (
            np.concatenate(column) for column in zip(*parts, strict=True)
        )
        return self._with_parts(source, weights, edge, side, len(crossed))

    def _crossing(
        self, value: np.ndarray, piece: np.ndarray, first: np.ndarray, second: np.ndarray
    ) -> np.ndarray:
        """Return (n, 3) weights of the points on the edges from one corner to another at value 0."""
        start, end = value[piece, first], value[piece, second]
        fraction = (start / (start - end))[:, None]
        return (1 - fraction) * self.weights[piece, first] + fraction * self.weights[piece, second]

    def _with_parts(
        self,
        source: np.ndarray,
        weights: np.ndarray,
        edge: np.ndarray,
        side: np.ndarray,
        cut_count: int,
    ) -> _Pieces:
        """Return the pieces after a cut, and find the neighbors of each.

        Parameters
        ----------
        source : (m,) ndarray of int
            The piece that each new piece is a part of.
        weights : (m, 3, 3) ndarray
        edge : (m, 3) ndarray of int
            The edges as in `cut`.
        side : (m,) bool ndarray
            The side of the plane.
        cut_count : int
            The number of pieces that were cut.
        """
        is_inner = edge < 0
        # Parts of an edge are beside each other if they are on the same side.
        slot = np.where(is_inner, 0, edge) + 3 * len(self.triangle) * side[:, None]
        new_edge_at = np.full(6 * len(self.triangle), -1)
        new_edge = np.arange(edge.size).reshape(edge.shape)
        new_edge_at[slot[~is_inner]] = new_edge[~is_inner]
        inner_edge_at = np.full(4 * cut_count, -1)
        inner_edge_at[-edge[is_inner] - 1] = new_edge[is_inner]
        old = np.where(is_inner, 0, edge)
        old_neighbor = self.neighbor.ravel()[old].astype(np.int64)
        beside = 3 * old_neighbor + self.neighbor_edge.ravel()[old]
        has_neighbor = ~is_inner & (old_neighbor >= 0)
        other = np.full(edge.shape, -1)
        row = np.broadcast_to(side[:, None], edge.shape)[has_neighbor]
        other[has_neighbor] = new_edge_at[beside[has_neighbor] + 3 * len(self.triangle) * row]
        # The other inner edge of a pair differs in the last bit.
        other[is_inner] = inner_edge_at[(-edge[is_inner] - 1) ^ 1]
        transport = np.where(is_inner, 1, self.edge_transport.ravel()[old])
        return _Pieces(
            self.triangle[source],
            weights,
            np.where(other >= 0, other // 3, -1).astype(np.int32),
            np.where(other >= 0, other % 3, 0).astype(np.int8),
            transport,
        )

    def apply(self, mesh: TangentMesh) -> MeshInView:
        """Return the pieces as a mesh."""

        def at_corners(values: np.ndarray) -> np.ndarray:
            return np.einsum("tkj,tj...->tk...", self.weights, values[self.triangle])

        per_triangle = {
            name: getattr(mesh, name)[self.triangle]
            for name in ("x", "y", "normal", "face", "triangle_vertex")
        }
        part = replace(
            mesh,
            corner_normal=normalize(at_corners(mesh.corner_normal)),
            z=at_corners(mesh.z),
            harmonics=tuple((j, at_corners(values)) for j, values in mesh.harmonics),
            family_z=None if mesh.family_z is None else mesh.family_z[self.triangle],
            neighbor=self.neighbor,
            neighbor_edge=self.neighbor_edge,
            edge_transport=self.edge_transport,
            **per_triangle,
        )
        return MeshInView(with_corners(part, at_corners(mesh.points)), self.triangle, self.weights)

"""The order of the lines of a field on a surface: which line comes first in light tones.

In a picture, the line nearest to the guiding angle comes first. Where the field turns, another line
becomes the nearest, and the hatching changes its direction there. On a surface the first line can
continue instead, as far as the field allows. Around singularities it cannot: somewhere, two lines
have to swap.

The order is found by threshold dynamics: each point takes the line nearest to the guide, the lines are
averaged over a length, and so again with shorter lengths. The curves where lines swap then shrink. The
last average is over a few widths of lines, and blends the lines where they swap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.progress import progress, report
from ..field.bisection import BisectionTree, bisect
from ..field.connection import build_connection
from ..field.connectivity import connected_components
from ..field.representation import power
from ..field.surface import build_surface
from ..field.surface_averages import SurfaceAverages
from ..line_drawing.tangent_mesh import TangentMesh, nearest_member, shared_edges

#: Longest edge of the triangles on which the order is computed, as a fraction of the side of a square
#: as large as the surface; and the most triangles, unless the mesh has more.
MAX_EDGE, MAX_TRIANGLES = 1 / 100, 200_000

#: Lengths of the averages, as fractions of that side.
AVERAGE_LENGTHS = (0.4, 0.2, 0.1, 0.05, 0.025)

#: Weight of the x axis as a guide on triangles that are nearly horizontal.
X_AXIS_WEIGHT = 0.01

#: Sharpness of the choice between lines. Those whose weight is below `MIN_WEIGHT` are not drawn.
SHARPNESS, MIN_WEIGHT = 6.0, 0.02

#: Label of the progress.
LABEL = "ordering lines"


@dataclass(frozen=True, eq=False)
class LineOrder:
    """The first line at the points of a surface.

    Attributes
    ----------
    degree : int
        Of the representation of a line: 1 if opposite directions are on different lines, else 2.
    tree : BisectionTree
        The triangles of the tangent mesh, and the L smaller ones in them.
    first : (L, 3) complex64 ndarray
        Representation of the first line at their corners, in the frame of the triangle of the mesh. The
        modulus is 1, and less where lines swap.
    """

    degree: int
    tree: BisectionTree
    first: np.ndarray

    def first_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return (n,) complex64 representations of the first line.

        Parameters
        ----------
        triangle : (n,) ndarray of int
        weights : (n, 3) float32 ndarray
            Barycentric coordinates.
        """
        leaf, weights = self.tree.locate(triangle, weights)
        return sum(
            weight * corner.take(leaf) for weight, corner in zip(weights, self.first.T, strict=True)
        )


@dataclass(frozen=True, eq=False)
class CombedDirections:
    """One direction of the first line at the points of a surface.

    Attributes
    ----------
    line : LineOrder
    sense : LineOrder
        Of degree 1: which of the two opposite directions of a line is chosen. Where it turns over, the line
        goes on.
    """

    line: LineOrder
    sense: LineOrder

    def directions_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return (n,) unit tangents near to the directions of the field.

        Parameters
        ----------
        triangle, weights
            As for `LineOrder.first_at`.
        """
        direction = _unit_root(self.line.first_at(triangle, weights), self.line.degree)
        is_opposite = (direction * self.sense.first_at(triangle, weights).conj()).real < 0
        return np.where(is_opposite, -direction, direction)


def first_line_weights(first: np.ndarray, members: np.ndarray, degree: int) -> np.ndarray:
    """Return (M, n) float32: how much each line comes first; the sum is 1.

    Parameters
    ----------
    first : (n,) complex ndarray
        From `LineOrder.first_at`.
    members : (M, n) complex ndarray
        Unit directions of the lines, in the same frames.
    degree : int
        Of `first`.
    """
    count = len(members)
    if count == 1:
        return np.ones(members.shape, dtype=np.float32)
    scale = SHARPNESS / (1 - np.cos(2 * np.pi / count))
    weights = np.stack([(first * power(member, degree).conj()).real for member in members])
    weights = np.exp(np.float32(scale) * (weights - weights.max(axis=0)))
    weights /= weights.sum(axis=0)
    np.maximum(weights - np.float32(MIN_WEIGHT), 0, out=weights)
    weights /= weights.sum(axis=0)
    return weights.astype(np.float32, copy=False)


def line_order(mesh: TangentMesh, guiding_angle: float, blend: float) -> LineOrder:
    """Find the order of the lines of a field.

    Parameters
    ----------
    mesh : TangentMesh
    guiding_angle : float
        Direction that the first line is near to: the angle from the horizontal direction, in radians,
        counter-clockwise as seen from outside.
    blend : float
        Width of the strip in which two lines swap, in Blender units.

    Returns
    -------
    LineOrder

    References
    ----------
    Threshold dynamics: Merriman, Bence and Osher, "Diffusion Generated Motion by Mean Curvature", 1992.
    On fields of directions: Viertel and Osting, "An Approach to Quad Meshing Based on Harmonic
    Cross-Valued Maps and the Ginzburg-Landau Theory", SIAM J. Sci. Comput. 41(1), 2019.
    """
    with progress(0.0, 0.4):
        refined = _refined(mesh)
    with progress(0.4, 1.0, LABEL):
        return _first_lines(mesh, refined, guiding_angle, blend)


def combed_directions(mesh: TangentMesh, guiding_angle: float) -> CombedDirections:
    """Choose one direction of a field at each point: a direction of the first line.

    Opposite directions of that line meet only where they must.

    Parameters
    ----------
    mesh, guiding_angle
        As for `line_order`.

    Returns
    -------
    CombedDirections
    """
    with progress(0.0, 0.3):
        refined = _refined(mesh)
    with progress(0.3, 0.6, LABEL):
        lines = _first_lines(mesh, refined, guiding_angle, 0.0)
    if lines.degree == 1:
        return CombedDirections(lines, lines)
    root = refined.tree.leaf_root
    line = power(_unit_root(lines.first.sum(axis=1), 2), 2)
    guide = _guide(mesh, guiding_angle, 1)[root]
    with progress(0.6, 1.0, LABEL):
        sense = _aligned(refined, line, 2, guide, 1, AVERAGE_LENGTHS)
    return CombedDirections(lines, sense)


class _RefinedMesh(NamedTuple):
    """A mesh of small triangles, on which representations are averaged.

    Lengths are fractions of the side of a square as large as the surface.
    """

    tree: BisectionTree
    averages: SurfaceAverages
    side: float


def _refined(mesh: TangentMesh) -> _RefinedMesh:
    """Refine a mesh."""
    report(0.0, LABEL)
    side = float(np.sqrt(mesh.area.sum()))
    with progress(0.0, 0.2):
        points, triangle_vertex = _welded(mesh)
    # No number is very large or small.
    points = (points - points.mean(axis=0)) / side
    max_triangles = max(MAX_TRIANGLES, len(triangle_vertex))
    report(0.2, LABEL)
    tree = bisect(points, triangle_vertex, MAX_EDGE, max_triangles)
    root = tree.leaf_root
    start = np.arange(0, 3 * len(root) + 1, 3, dtype=np.int32)
    with progress(0.3, 0.6):
        leaves = build_surface(tree.vertices, tree.leaf_vertex.ravel(), start)
    with progress(0.6, 0.9):
        connection = build_connection(leaves)
    report(0.9, LABEL)
    return _RefinedMesh(tree, SurfaceAverages(leaves, connection, mesh.x[root], mesh.y[root]), side)


def _first_lines(
    mesh: TangentMesh, refined: _RefinedMesh, guiding_angle: float, blend: float
) -> LineOrder:
    """Find the first line; see `line_order`."""
    degree = mesh.degree // mesh.family_count
    tree = refined.tree
    z = np.einsum(
        "lck,lk->l", tree.leaf_weights / np.float32(3), mesh.z.take(tree.leaf_root, axis=0)
    )
    if mesh.family_z is None:
        first, lengths = _guide(mesh, guiding_angle, degree)[tree.leaf_root], AVERAGE_LENGTHS
    else:  # the field distinguishes its lines
        first, lengths = mesh.family_z[tree.leaf_root], ()
    lengths = (*lengths, blend / refined.side)
    return _aligned(refined, z, mesh.degree, first, degree, lengths)


def _aligned(
    refined: _RefinedMesh,
    z: np.ndarray,
    z_degree: int,
    first: np.ndarray,
    degree: int,
    lengths: Sequence[float],
) -> LineOrder:
    """Align a guide with a field by threshold dynamics.

    Parameters
    ----------
    refined : _RefinedMesh
    z : (L,) complex ndarray
        Representation of the field, of the degree `z_degree`.
    first : (L,) complex ndarray
        Representation of the guide, of the degree `degree`.
    lengths : sequence of float
        Lengths of the averages.
    """
    averages = refined.averages
    connection = averages.connection
    matrix = averages.laplacian(degree)
    nodes = None
    for number, length in enumerate(lengths):
        snapped = power(nearest_member(_unit_root(first, degree), z, z_degree), degree)
        sums = averages.node_sums(snapped, degree)
        with progress(number / len(lengths), (number + 1) / len(lengths), LABEL):
            nodes = averages.smooth(matrix, length**2, sums, nodes)
        first = averages.face_means(nodes, degree)
    angle = averages.frame_angle.reshape(-1, 3)
    corners = nodes[connection.corner_node].reshape(-1, 3) * np.exp(1j * degree * angle)
    return LineOrder(degree, refined.tree, corners.astype(np.complex64))


def _unit_root(values: np.ndarray, degree: int) -> np.ndarray:
    """Return (n,) unit directions of representations."""
    return np.exp(1j * np.angle(values) / degree)


def _guide(mesh: TangentMesh, guiding_angle: float, degree: int) -> np.ndarray:
    """(T,) representations of the direction at an angle to the horizontal one.

    Its modulus decreases toward horizontal triangles, where the x axis takes its place.
    """
    x, _, z = (mesh.x + 1j * mesh.y).T
    turn = np.exp(1j * guiding_angle)
    # Seen from outside, the direction to the right is a quarter turn clockwise from the z axis.
    return power(-1j * turn * z, degree) + X_AXIS_WEIGHT * power(turn * x, degree)


def _welded(mesh: TangentMesh) -> tuple[np.ndarray, np.ndarray]:
    """Join the corners of triangles between which streamlines can cross.

    Returns
    -------
    points : (n, 3) float64 ndarray
    triangle_vertex : (T, 3) int32 ndarray
        Indices of the corners into the points.
    """
    pairs = np.concatenate(shared_edges(mesh).ends())
    with progress(0.0, 1.0):
        group = connected_components(3 * len(mesh.neighbor), pairs)
    points = np.empty((int(group.max()) + 1, 3))
    points[group] = mesh.points.reshape(-1, 3)
    return points, group.reshape(-1, 3).astype(np.int32)

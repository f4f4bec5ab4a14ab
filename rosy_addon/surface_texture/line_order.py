"""The order of the line directions of a field on a surface, and maps of its first line direction.

A line direction is a pair of opposite directions of a field, or a single direction if the field has no
opposite ones. In hatching, the first line direction is drawn in light tones, and the others are added in
darker tones. In a picture, the line direction nearest to the guiding angle comes first. Where the field
rotates, another direction becomes the nearest, and the hatching changes its direction there. On a surface the
first line direction can be continuous instead, as far as the field allows. Around singularities it cannot:
somewhere, two line directions have to swap.

The order is found by threshold dynamics. At each point, the line direction nearest to the guide is chosen;
the chosen directions are averaged over a neighborhood, and the average is the next guide. This is repeated
with smaller and smaller neighborhoods, and the curves where directions swap shrink. The last neighborhood is
a few line widths large. Its average blends the directions where they swap.

Renderers read the first line direction from an anisotropy map of glTF or from a flow map. An anisotropy map
stores the components of a direction along the tangent (the direction of u) and the bitangent. Opposite
directions have the same meaning, but texture filters must not average them to zero. So the directions are
combed: neighboring ones point the same way. A flow map stores the components along u and v, along which a
shader moves a texture.

References
----------
The Khronos Group, "KHR_materials_anisotropy", 2023. Flow maps: Vlachos, "Water Flow in Portal 2", SIGGRAPH
2010 course "Advances in Real-Time Rendering".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.progress import progress, report
from ..field.bisection import BisectionTree, bisect
from ..field.connection import build_connection
from ..field.connectivity import connected_components
from ..field.representation import power
from ..field.rosy_field import RosyField
from ..field.surface import Surface, build_surface
from ..field.surface_averages import SurfaceAverages
from ..line_drawing.tangent_mesh import (
    TangentMesh,
    build_tangent_mesh,
    nearest_member,
    shared_edges,
)
from ..projection.gbuffer import MeshInstance
from ..projection.pixel_blocks import reported_blocks
from .charts import uv_tangents
from .texels import TexelSurface

#: The mesh is refined until no edge is longer than `MAX_EDGE` or there are `MAX_TRIANGLES` triangles. Edges
#: are measured in sides of a square that has the area of the surface. Larger meshes are not refined.
MAX_EDGE, MAX_TRIANGLES = 1 / 100, 200_000

#: Lengths over which directions are averaged, one after the other, in sides of the same square.
AVERAGE_LENGTHS = (0.4, 0.2, 0.1, 0.05, 0.025)

#: Weight of the direction relative to the x axis, which is the guide on nearly horizontal triangles.
X_AXIS_WEIGHT = 0.01

#: Sharpness of the choice between line directions. Those whose weight is below `MIN_WEIGHT` are not drawn.
SHARPNESS, MIN_WEIGHT = 6.0, 0.02

#: Labels of the progress.
LABEL, MAP_LABEL = "ordering lines", "drawing directions"


@dataclass(frozen=True, eq=False)
class LineOrder:
    """Which line direction of a field comes first, as a function on a surface.

    Attributes
    ----------
    degree : int
        Degree of the representation of a line direction: 2 if opposite directions are the same, else 1.
    tree : BisectionTree
        The triangles of the tangent mesh, refined into L smaller triangles.
    first : (L, 3) complex64 ndarray
        Representation of the first line direction (its power `degree`) at the corners of the smaller
        triangles, in the frame of the triangle of the tangent mesh. The modulus is 1, and less where
        directions swap.
    """

    degree: int
    tree: BisectionTree
    first: np.ndarray

    def first_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return (n,) complex64: representations of the first line direction at points of the tangent mesh.

        Parameters
        ----------
        triangle : (n,) ndarray of int
            Indices of triangles of the tangent mesh, in whose frames the results are.
        weights : (n, 3) float32 ndarray
            Barycentric coordinates of the points in their triangles.
        """
        leaf, weights = self.tree.locate(triangle, weights)
        corners = zip(weights, self.first.T, strict=True)
        return sum(weight * corner.take(leaf) for weight, corner in corners)


@dataclass(frozen=True, eq=False)
class CombedDirections:
    """The first line direction on a surface, as a direction that is continuous where possible.

    Attributes
    ----------
    line : LineOrder
        Which line direction comes first.
    sense : LineOrder
        A smooth direction, of degree 1. Of the two opposite directions of `line`, the one nearer to it is
        chosen.
    """

    line: LineOrder
    sense: LineOrder

    def directions_at(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return (n,) complex unit tangents along the first line direction, at points of the tangent mesh.

        Of both opposite directions along the lines, the one nearer to `sense` is returned.

        Parameters
        ----------
        triangle : (n,) ndarray of int
            Indices of triangles of the tangent mesh, in whose frames the results are.
        weights : (n, 3) float32 ndarray
            Barycentric coordinates of the points in their triangles.
        """
        direction = _unit_root(self.line.first_at(triangle, weights), self.line.degree)
        is_opposite = (direction * self.sense.first_at(triangle, weights).conj()).real < 0
        return np.where(is_opposite, -direction, direction)


def first_line_weights(first: np.ndarray, members: np.ndarray, degree: int) -> np.ndarray:
    """Return (M, n) float32: the weight with which each line direction is the first; weights sum to 1.

    The weight of the first direction is nearly 1. Where directions swap, weights change smoothly.

    Parameters
    ----------
    first : (n,) complex ndarray
        Representation of the first line direction, from `LineOrder.first_at`.
    members : (M, n) complex ndarray
        The M line directions as unit tangents, in the same frames.
    degree : int
        Degree of `first`.
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
    """Choose at each point of a mesh which line direction of the field comes first.

    Parameters
    ----------
    mesh : TangentMesh
    guiding_angle : float
        Angle, in radians, that the first line direction is near to. It is measured from the horizontal
        direction, counter-clockwise as seen from outside.
    blend : float
        Width of the strip in which two line directions swap, in Blender units.

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
    """Choose one of the N directions of a field at each point of a mesh, as continuous as possible.

    It points one way or the other along the line direction that `line_order` puts first. The choice jumps
    between these two only where the topology of the field requires it.

    Parameters
    ----------
    mesh : TangentMesh
        Tangent mesh with the field.
    guiding_angle : float
        Angle on the surface, in radians from the horizontal direction and counter-clockwise as seen from
        outside, near which the chosen line lies.

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
    """A mesh of L small triangles, on which representations of directions are averaged.

    Attributes
    ----------
    tree : BisectionTree
        The triangles of the tangent mesh, refined into the L triangles. Coordinates are in units of `side`.
    averages : SurfaceAverages
        The operators that average on the refined mesh, with lengths in units of `side`.
    side : float
        Side, in Blender units of world space, of a square that has the area of the surface.
    """

    tree: BisectionTree
    averages: SurfaceAverages
    side: float


def _refined(mesh: TangentMesh) -> _RefinedMesh:
    """Divide the triangles of a mesh into smaller ones, and prepare averages on them."""
    report(0.0, LABEL)
    side = float(np.sqrt(mesh.area.sum()))
    with progress(0.0, 0.2):
        points, triangle_vertex = _welded(mesh)
    # Scale coordinates so that none is very large or small.
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
    """Choose for each refined triangle which line direction comes first.

    If the field itself marks one of its line directions (`TangentMesh.family_z`), the marked one comes first,
    otherwise one near to the guiding angle. The angle is in radians from the horizontal direction. `blend` is
    the width of the strip in which two line directions swap, in Blender units.
    """
    degree = mesh.degree // mesh.family_count
    tree = refined.tree
    weights = tree.leaf_weights / np.float32(3)
    z = np.einsum("lck,lk->l", weights, mesh.z.take(tree.leaf_root, axis=0))
    if mesh.family_z is None:
        first, lengths = _guide(mesh, guiding_angle, degree)[tree.leaf_root], AVERAGE_LENGTHS
    else:  # the field marks its first line direction
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
    """Align a guiding direction with a field: replace it by the nearest member, average, and repeat.

    This is threshold dynamics (diffusion-generated motion): the averages remove short boundaries between
    parts in which another member is the nearest one.

    Parameters
    ----------
    refined : _RefinedMesh
        Mesh of L triangles.
    z : (L,) complex ndarray
        Representation of the field at each triangle, of the degree `z_degree`, in the frame of the triangle
        of the tangent mesh.
    first : (L,) complex ndarray
        Representation of the guiding direction at each triangle, of the degree `degree`, in the same frame.
    lengths : sequence of float
        Lengths over which directions are averaged, one after the other, in units of `refined.side`.
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
    """Return (n,) complex: a unit tangent of each representation, its root of the given degree."""
    return np.exp(1j * np.angle(values) / degree)


def _guide(mesh: TangentMesh, guiding_angle: float, degree: int) -> np.ndarray:
    """Return (T,) complex: representations of the guiding direction on the triangles of a mesh.

    They are of the degree `degree`, in the frames of the triangles. The guiding direction is at
    `guiding_angle`, in radians, to the horizontal direction of the triangle. The modulus decreases toward
    horizontal triangles. On these, the angle is measured from the x axis instead.
    """
    x, _, z = (mesh.x + 1j * mesh.y).T
    turn = np.exp(1j * guiding_angle)
    # Seen from outside, the horizontal direction to the right is 90 degrees clockwise from the z axis.
    return power(-1j * turn * z, degree) + X_AXIS_WEIGHT * power(turn * x, degree)


def _welded(mesh: TangentMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles as an indexed mesh that is connected where streamlines can cross.

    Returns
    -------
    points : (n, 3) float64 ndarray
        Vertices in world space.
    triangle_vertex : (T, 3) int32 ndarray
        Indices of the corners of triangles into `points`.
    """
    pairs = np.concatenate(shared_edges(mesh).ends())
    group = connected_components(3 * len(mesh.neighbor), pairs)
    points = np.empty((int(group.max()) + 1, 3))
    points[group] = mesh.points.reshape(-1, 3)
    return points, group.reshape(-1, 3).astype(np.int32)


# --- maps of directions ------------------------------------------------------------------------------


def direction_map(on: TexelSurface, content: str, guiding_angle: float) -> np.ndarray:
    """Compute the anisotropy map or the flow map of a field.

    Parameters
    ----------
    on : TexelSurface
    content : {"anisotropy", "flow"}
    guiding_angle : float
        Angle, in radians from the horizontal direction on the surface, that the directions in the map are
        near to. See `line_order`.

    Returns
    -------
    (P, 4) float32 ndarray
        RGBA of the P texels as stored in the file, 0 to 1. Red and green are the components of a unit vector,
        scaled from [-1, 1] to [0, 1]. Blue is 0 where the field is undefined, and 1 elsewhere. Alpha is 1.
    """
    mesh, charts, texels = on.mesh, on.charts, on.texels
    with progress(0.0, 0.7):
        combed = combed_directions(mesh, guiding_angle)
    is_flow = content == "flow"
    tangents = None
    if not is_flow:
        with progress(0.7, 0.8):
            tangents = uv_tangents(on.instance.surface, mesh, charts)
    is_mirrored = charts.density < 0
    values = np.ones((len(texels), 4), dtype=np.float32)
    for block in reported_blocks(len(texels), MAP_LABEL, 0.8, 1.0):
        triangle, weights = texels.triangle[block], texels.barycentric[block]
        direction, is_defined = _directions_at(mesh, combed, triangle, weights)
        if is_flow:
            relative = charts.to_uv(triangle, direction)
            relative /= np.maximum(np.abs(relative), np.finfo(float).tiny)
        else:
            tangent = np.einsum("nk,nk->n", weights, tangents[triangle])
            relative = direction * np.exp(-1j * np.angle(tangent))
            relative[is_mirrored[triangle]] = relative[is_mirrored[triangle]].conj()
        values[block, 0], values[block, 1] = relative.real, relative.imag
        values[block, 2] = is_defined
    values[:, :2] = 0.5 + 0.5 * values[:, :2]
    return values


def corner_tangents(surface: Surface, field: RosyField, guiding_angle: float) -> np.ndarray:
    """Compute one direction of a field at each face corner of a surface, as continuous as possible.

    Parameters
    ----------
    surface : Surface
    field : RosyField
    guiding_angle : float
        Angle, in radians from the horizontal direction on the surface, that the directions are near to. See
        `line_order`.

    Returns
    -------
    (C, 3) float32 ndarray
        Unit vectors in object space; 0 where the field is undefined.
    """
    with progress(0.0, 0.3):
        mesh = build_tangent_mesh(MeshInstance(surface, np.eye(4), field))
    with progress(0.3, 0.9):
        combed = combed_directions(mesh, guiding_angle)
    report(0.9, MAP_LABEL)
    triangle = np.repeat(np.arange(len(mesh.x)), 3)
    weights = np.tile(np.eye(3, dtype=np.float32), (len(mesh.x), 1))
    direction, is_defined = _directions_at(mesh, combed, triangle, weights)
    vectors = mesh.to_world(triangle, direction) * is_defined[:, None]
    tangents = np.zeros((len(surface.corner_vertex), 3), dtype=np.float32)
    tangents[surface.triangles] = vectors.reshape(-1, 3, 3)
    return tangents


def _directions_at(
    mesh: TangentMesh, combed: CombedDirections, triangle: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (n,) unit tangents at points, and (n,) bool: whether the field is defined there.

    A tangent, complex in the frame of its triangle, is the direction of the field that is nearest to the
    combed direction. The points are given by (n,) triangles and (n, 3) barycentric coordinates.
    """
    member = mesh.members_at(triangle, weights, combed.directions_at(triangle, weights))
    return mesh.directions_at(triangle, weights, member), member != 0

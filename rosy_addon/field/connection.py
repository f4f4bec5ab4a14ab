"""The connection Laplacian of a triangulated surface, for fields of degree N at its vertices.

An *umbrella* is a set of triangles around a vertex that are connected by shared manifold edges. A
*node* is a vertex together with one of its umbrellas. A vertex with several umbrellas (a
nonmanifold vertex, or one on a nonmanifold edge) becomes several nodes.

Tangent vectors at a node are complex numbers in polar coordinates of its umbrella (its *polar map*): a
direction is the sum of the corner angles up to it, counter-clockwise from the first edge. At interior
vertices these angles are scaled so that a full turn is 2 pi. Transport along an edge keeps the angle between
the vector and the edge.

Reference: Knöppel, Crane, Pinkall and Schröder, "Globally Optimal Direction Fields", SIGGRAPH 2013,
section 6. Here, weights are cotangents and masses are lumped.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..core.progress import report
from .blocks import row_blocks
from .connectivity import build_edges, connected_components, sums_from_roots
from .frames import dot
from .polygon_arrays import next_corners
from .sparse_matrix import CSRMatrix, from_edges
from .surface import Surface

#: Largest absolute value of a cotangent. Without a limit, slivers would dominate the energy.
MAX_COTANGENT = 1e3

#: Number of triangles that are processed at once, to bound memory and to fit in the CPU caches.
BLOCK_TRIANGLES = 1 << 14


@dataclass(frozen=True, eq=False)
class Connection:
    """The nodes of a triangulated surface, and the transport and weights along its edges.

    A node is a vertex with a set of triangles around it that are connected by edges; see the module
    docstring. T is the number of triangles, n the number of nodes and E the number of edges.

    Attributes
    ----------
    corner_node : (3 T,) int32 ndarray
        Node of each corner of the triangles.
    node_count : int
        n.
    edge_direction : (3 T,) float64 ndarray
        Direction of the edge from each corner to the next corner of its triangle, as an angle in radians
        in the polar map of the corner's node.
    bisector_direction : (3 T,) float64 ndarray
        Direction of the angle bisector of each corner, as an angle in radians in the polar map of its node.
    corner_angle : (3 T,) float64 ndarray
        Interior angle of the triangle at each corner, in radians.
    area : (T,) float64 ndarray
        Areas of the triangles.
    corner_area : (3 T,) float64 ndarray
        Shares of the areas of the faces. A face divides its area equally among its corners. If several
        triangles of a face have a corner in common, they divide the share of this corner equally.
    mass : (n,) float64 ndarray
        Lumped masses: the sum of the shares (`corner_area`) around each node.
    tail, head : (E,) int32 ndarray
        Nodes at the two ends of each edge.
    transport_angle : (E,) float64 ndarray
        Angle in radians to add to the direction of a tangent at `head` to transport it to `tail`.
    weight : (E,) float64 ndarray
        Half the sum of the cotangents of the angles opposite the edge.
    """

    corner_node: np.ndarray
    node_count: int
    edge_direction: np.ndarray
    bisector_direction: np.ndarray
    corner_angle: np.ndarray
    area: np.ndarray
    corner_area: np.ndarray
    mass: np.ndarray
    tail: np.ndarray
    head: np.ndarray
    transport_angle: np.ndarray
    weight: np.ndarray

    @cached_property
    def component(self) -> np.ndarray:
        """(n,) int32: the index of the connected component of each node."""
        return connected_components(self.node_count, np.stack([self.tail, self.head], axis=1))

    @cached_property
    def positive_mass(self) -> np.ndarray:
        """(n,) float64: `mass`, but a small positive value at nodes where the mass is 0."""
        return np.maximum(self.mass, 1e-12 * max(float(self.mass.mean()), 1e-300))


def build_connection(surface: Surface) -> Connection:
    """Build the connection of the triangles of a surface, with the positions in `Surface.vertices`."""
    report(0.0, "building the connection Laplacian")
    vertex = surface.triangle_vertex.ravel()
    start = np.arange(0, len(vertex) + 1, 3, dtype=np.int32)
    edges = build_edges(vertex, start)
    corner = np.arange(len(vertex), dtype=np.int32)
    next_corner = next_corners(start)
    previous_corner = next_corner[next_corner]
    twin = np.full(len(vertex), -1, dtype=np.int32)
    a, b = edges.halfedges.T
    twin[a], twin[b] = b, a

    corner_angle, cotangent, area = _corner_geometry(surface.vertices, surface.triangle_vertex)
    previous, is_closed = umbrella_order(vertex, twin, next_corner)
    is_first = previous == corner
    first_corner, offset = sums_from_roots(previous, corner_angle[previous])
    node_of_corner = np.cumsum(is_first) - 1
    corner_node = node_of_corner[first_corner].astype(np.int32)
    node_count = int(node_of_corner[-1]) + 1
    angle_sum = np.bincount(corner_node, corner_angle, node_count)
    angle_scale = np.ones(node_count)
    is_interior = is_closed[is_first] & (angle_sum > 0)
    angle_scale[is_interior] = 2 * np.pi / angle_sum[is_interior]
    edge_direction = offset * angle_scale[corner_node]
    bisector_direction = (offset + 0.5 * corner_angle) * angle_scale[corner_node]

    # Take each edge once, from the tail corner to the next corner of its triangle.
    is_edge = (twin < 0) | (corner < twin)
    tail_corner, head_corner = corner[is_edge], next_corner[corner[is_edge]]
    # The direction of the reversed edge at its head is the direction of the twin halfedge or, at a
    # boundary, of the second side of the corner at the head.
    twin_of_tail = twin[tail_corner]
    scaled_angle = corner_angle[head_corner] * angle_scale[corner_node[head_corner]]
    has_twin, border_direction = twin_of_tail >= 0, edge_direction[head_corner] + scaled_angle
    reverse_direction = np.where(has_twin, edge_direction[twin_of_tail], border_direction)
    opposite = np.where(has_twin, cotangent[previous_corner[twin_of_tail]], 0)
    weight = 0.5 * (cotangent[previous_corner[tail_corner]] + opposite)
    corner_area = _corner_areas(surface, area)
    return Connection(
        corner_node=corner_node,
        node_count=node_count,
        edge_direction=edge_direction,
        bisector_direction=bisector_direction,
        corner_angle=corner_angle,
        area=area,
        corner_area=corner_area,
        mass=np.bincount(corner_node, corner_area, node_count),
        tail=corner_node[tail_corner],
        head=corner_node[head_corner],
        transport_angle=edge_direction[tail_corner] - reverse_direction - np.pi,
        weight=weight,
    )


def laplacian(connection: Connection, degree: int, shift: float = 0.0) -> CSRMatrix:
    """Return the connection Laplacian L for RoSy representations z, plus `shift` times the mass matrix.

    Parameters
    ----------
    connection : Connection
    degree : int
        N.
    shift : float
        Factor by which the diagonal mass matrix is multiplied before it is added.

    Returns
    -------
    (n, n) CSRMatrix
        The Hermitian matrix. Without a shift, z* L z is the Dirichlet energy of z: the sum over all edges
        (i, j) of w |z_i - r^N z_j|^2. Here w is the weight of the edge, and r, of modulus 1, transports
        tangent vectors from node j to node i.
    """
    c = connection
    # Negative weights (of obtuse triangles) would make the matrix indefinite.
    weight = np.maximum(c.weight, 0)
    ends = np.concatenate([c.tail, c.head])
    # Nodes without weight get a nonzero diagonal, so that the matrix stays regular.
    diagonal = np.bincount(ends, np.tile(weight, 2), c.node_count) + shift * c.mass
    diagonal[diagonal <= 0] = max(float(diagonal.mean()), 1.0)
    off_diagonal = -weight * np.exp(1j * degree * c.transport_angle)
    return from_edges(c.tail, c.head, off_diagonal, diagonal)


def _corner_areas(surface: Surface, area: np.ndarray) -> np.ndarray:
    """Return the (3 T,) shares of the areas of faces at the corners of triangles (`Connection.corner_area`).

    `area` holds the (T,) areas of the triangles.
    """
    face = surface.triangle_face
    if len(face) == surface.face_count:
        return np.repeat(area / 3, 3)
    share = np.bincount(face, area, surface.face_count) / np.diff(surface.face_start)
    corner = surface.triangles.ravel()
    return np.repeat(share[face], 3) / np.bincount(corner)[corner]


def _corner_geometry(
    vertices: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (3 T,) angles (radians) and cotangents at the corners of triangles, and (T,) areas."""
    corner_angle, cotangent = np.empty(triangles.shape), np.empty(triangles.shape)
    area = np.empty(len(triangles))
    for block in row_blocks(len(triangles), BLOCK_TRIANGLES):
        points = [vertices.take(column, axis=0) for column in triangles[block].T]
        edges = [points[(k + 1) % 3] - points[k] for k in range(3)]
        cross = np.cross(edges[0], edges[1])
        double_area = np.sqrt(dot(cross, cross))
        area[block] = double_area / 2
        for k in range(3):
            cosine_term = -dot(edges[k], edges[k - 1])
            corner_angle[block, k] = np.arctan2(double_area, cosine_term)
            exceeds_limit = np.abs(cosine_term) >= MAX_COTANGENT * double_area
            limit = np.where(double_area > 0, np.sign(cosine_term) * MAX_COTANGENT, 0)
            ratio = cosine_term / np.where(exceeds_limit, 1, double_area)
            cotangent[block, k] = np.where(exceeds_limit, limit, ratio)
    return corner_angle.ravel(), cotangent.ravel(), area


def umbrella_order(
    corner_vertex: np.ndarray, twin: np.ndarray, next_corner: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the order of the corners around each umbrella (the connected triangles around a vertex).

    A closed umbrella, which surrounds its vertex, begins with its corner of smallest index.

    Parameters
    ----------
    corner_vertex : (C,) int ndarray
        Vertex of each corner.
    twin : (C,) int ndarray
        For the halfedge that starts at each corner, the corner at which the opposite halfedge starts, in the
        neighboring triangle; -1 if there is no neighbor.
    next_corner : (C,) int ndarray
        The following corner of the same triangle.

    Returns
    -------
    previous : (C,) int ndarray
        The previous corner around the vertex, in counter-clockwise order. The first corner of an umbrella
        has its own index.
    is_closed : (C,) bool ndarray
        Whether the umbrella that contains the corner is closed.
    """
    corner = np.arange(len(twin), dtype=twin.dtype)
    # The previous corner lies across the edge that leaves from this corner.
    previous = np.where(twin >= 0, next_corner[twin], corner)
    smallest, pointer = corner, previous
    for _ in range(int(np.bincount(corner_vertex).max()).bit_length()):
        smallest, pointer = np.minimum(smallest, smallest[pointer]), pointer[pointer]
    is_closed = twin[pointer] >= 0
    return np.where(is_closed & (smallest == corner), corner, previous), is_closed

"""The connection Laplacian of a triangulated surface, for fields of degree N at its vertices.

A *node* is a vertex as seen by one umbrella of triangles around it: a vertex at which several meet,
or that lies on an edge that is not manifold, is cut into as many. Tangents at a node are complex
numbers in a polar map of its umbrella, in which interior angles add up to 2 pi; along an edge they
are carried by keeping their angle with it.

Knöppel, Crane, Pinkall and Schröder, "Globally Optimal Direction Fields", SIGGRAPH 2013, section 6,
with cotangents as weights and masses lumped.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .frames import dot
from .sparse import Rows, from_entries
from .surface import Surface, connected, next_corners, surface_edges

#: Cotangents of the sharpest angles are held to this, or slivers would outweigh everything.
STEEPEST = 1e3

#: Triangles that are worked on at once: bounds memory, and fits the caches.
BLOCK = 1 << 14


@dataclass(frozen=True, eq=False)
class Connection:
    """How tangents at the nodes of a surface compare.

    Attributes
    ----------
    node : (3 T,) int32 ndarray
        Of each corner of the triangles.
    count : int
        Of the nodes.
    along : (3 T,) float64 ndarray
        The direction of the edge from each corner to the next, in the map of the node, radians.
    middle : (3 T,) float64 ndarray
        That of the middle of the corner.
    opening : (3 T,) float64 ndarray
        The angle at the corner, on the triangle.
    area : (T,) float64 ndarray
    mass : (n,) float64 ndarray
        A third of the areas around each node.
    here, there : (E,) int32 ndarray
        Nodes at the ends of edges.
    turn : (E,) float64 ndarray
        Radians from a tangent at `there` to the same one, carried, at `here`.
    weight : (E,) float64 ndarray
        Half the sum of the cotangents opposite.
    """

    node: np.ndarray
    count: int
    along: np.ndarray
    middle: np.ndarray
    opening: np.ndarray
    area: np.ndarray
    mass: np.ndarray
    here: np.ndarray
    there: np.ndarray
    turn: np.ndarray
    weight: np.ndarray

    @cached_property
    def piece(self) -> np.ndarray:
        """(n,) int32: the connected piece of each node."""
        return connected(self.count, np.stack([self.here, self.there], axis=1))


def connect(surface: Surface) -> Connection:
    """The connection of a surface as it is, triangulated."""
    vertex = surface.triangle_vertex.ravel()
    start = np.arange(0, len(vertex) + 1, 3, dtype=np.int32)
    edges = surface_edges(vertex, start)
    corner = np.arange(len(vertex), dtype=np.int32)
    following = next_corners(start)
    preceding = following[following]
    twin = np.full(len(vertex), -1, dtype=np.int32)
    a, b = edges.sides[:, 0], edges.sides[:, 1]
    twin[a], twin[b] = b, a

    opening, cotangent, area = _shapes(surface.vertices, surface.triangle_vertex)
    # Around a vertex, counter-clockwise: the corner before lies across the edge that leaves here.
    before = np.where(twin >= 0, following[np.maximum(twin, 0)], -1)
    first, closed = _first_corners(before, int(np.bincount(vertex).max()))
    root, offset = _back_to_first(before, first, opening)
    number = np.cumsum(first) - 1
    node = number[root].astype(np.int32)
    count = int(number[-1]) + 1
    around = np.bincount(node, opening, count)
    stretch = np.ones(count)
    full = closed & (around > 0)
    stretch[full] = 2 * np.pi / around[full]
    along = offset * stretch[node]
    middle = (offset + 0.5 * opening) * stretch[node]

    # The edge of each corner, once: from there to the next corner of the triangle.
    once = (twin < 0) | (corner < twin)
    tail, head = corner[once], following[corner[once]]
    # Where it arrives, it runs along the edge that leaves backward: that of the twin, or the end
    # of the corner there.
    other = twin[tail]
    backward = np.where(
        other >= 0, along[np.maximum(other, 0)], along[head] + opening[head] * stretch[node[head]]
    )
    weight = 0.5 * (
        cotangent[preceding[tail]] + np.where(other >= 0, cotangent[preceding[other]], 0)
    )
    return Connection(
        node=node,
        count=count,
        along=along,
        middle=middle,
        opening=opening,
        area=area,
        mass=np.bincount(node, np.repeat(area / 3, 3), count),
        here=node[tail],
        there=node[head],
        turn=along[tail] - backward - np.pi,
        weight=weight,
    )


def laplacian(connection: Connection, degree: int, shift: float = 0.0) -> Rows:
    """The (n, n) matrix of the Dirichlet energy of representations z, plus `shift` masses.

    z* L z is the sum over edges of w |z_i - r^N z_j|^2.
    """
    c = connection
    # Slivers' cotangents, negative and large, would make it indefinite.
    weight = np.maximum(c.weight, 0)
    ends = np.concatenate([c.here, c.there])
    # A node without any weight keeps its row regular.
    own = np.bincount(ends, np.tile(weight, 2), c.count) + shift * c.mass
    own[own <= 0] = max(float(own.mean()), 1.0)
    off = -weight * np.exp(1j * degree * c.turn)
    every = np.arange(c.count)
    return from_entries(
        np.concatenate([c.here, c.there, every]).astype(np.intp),
        np.concatenate([c.there, c.here, every]).astype(np.intp),
        np.concatenate([off, off.conj(), own]),
        c.count,
        c.count,
    )


def _shapes(
    vertices: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(3 T,) angles and cotangents at the corners of triangles, and (T,) areas."""
    opening, cotangent = np.empty(triangles.shape), np.empty(triangles.shape)
    area = np.empty(len(triangles))
    for first in range(0, len(triangles), BLOCK):
        part = slice(first, first + BLOCK)
        points = [vertices.take(column, axis=0) for column in triangles[part].T]
        edges = [points[(k + 1) % 3] - points[k] for k in range(3)]
        cross = np.cross(edges[0], edges[1])
        twice = np.sqrt(dot(cross, cross))
        area[part] = twice / 2
        for k in range(3):
            along = -dot(edges[k], edges[k - 1])
            opening[part, k] = np.arctan2(twice, along)
            steep = np.abs(along) >= STEEPEST * twice
            steepest = np.where(twice > 0, np.sign(along) * STEEPEST, 0)
            cotangent[part, k] = np.where(steep, steepest, along / np.where(steep, 1, twice))
    return opening.ravel(), cotangent.ravel(), area


def _first_corners(before: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """(C,) bool: where each umbrella begins; (umbrellas,) bool: whether it is closed.

    `before` is the corner before each, -1 at the start of an open umbrella; none has more than
    `most` corners. A closed one begins with its smallest.
    """
    own = np.arange(len(before))
    least, way = own, np.where(before >= 0, before, own)
    for _ in range(most.bit_length()):
        least, way = np.minimum(least, least[way]), way[way]
    closed = before[way] >= 0
    first = (before < 0) | (closed & (least == own))
    return first, closed[first]


def _back_to_first(
    before: np.ndarray, first: np.ndarray, angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(C,) the corner that the umbrella of each begins with, and the angles from there on to it."""
    way = np.where(first, np.arange(len(before)), before)
    total = np.where(first, 0.0, angle[way])
    while True:
        further = way[way]
        if np.array_equal(further, way):
            return way, total
        total, way = total + total[way], further

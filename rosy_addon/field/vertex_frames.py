"""Convert vectors with two components to object space, as in geometry-central's tangent frames at vertices."""

import numpy as np

from ..core.errors import RosyError
from .blocks import mask
from .corner_fans import corner_angles
from .frames import dot, normalize
from .surface import Surface
from .validate import checked_domain, vertex_normals

#: Notes about rows of two numbers.
FLAT_NOTE = "rows have two numbers; they are read as x and y, because the mesh is flat"
FRAME_NOTE = "rows have two numbers; they are read as vectors at the vertices, in the frames of geometry-central"


def in_space(surface: Surface, rows: np.ndarray, source: str) -> tuple[np.ndarray, str | None, str]:
    """Convert vectors with two components each to object space.

    Parameters
    ----------
    surface : Surface
    rows : (n, 2) float64 ndarray
        The components x and y, if all vertices have the same z. Otherwise the components of a vector at each
        vertex in its frame; see `vertex_frames`.
    source : str
        Name of the file or array, for messages.

    Returns
    -------
    vectors : (n, 3) float64 ndarray
        The vectors in object space.
    domain : {"vertex"} or None
        The mesh elements to which the vectors belong; None to infer it from the number of rows.
    note : str
        Text for the user that says how the two numbers were interpreted.

    Raises
    ------
    RosyError
        If the vertices differ in z, and the number of rows is not the number of vertices or a vertex has no frame.
    """
    if not np.ptp(surface.vertices[:, 2]):
        return np.pad(rows, ((0, 0), (0, 1))), None, FLAT_NOTE
    checked_domain(surface, len(rows), "vertex", source)
    x, y = vertex_frames(surface.in_rest_shape())
    return rows[:, :1] * x + rows[:, 1:] * y, "vertex", FRAME_NOTE


def vertex_frames(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Return the x and y axes of geometry-central's tangent plane at each vertex.

    The angles between the edges around a vertex are scaled so that their sum is 2 pi, or pi on the border. They are
    counted from the first edge. At an interior vertex, this is the edge to the next corner in the face with the
    largest index. At a border vertex, it is the border edge that has a face to its left. The x axis is the mean of the
    projected edges, each rotated back by its angle (Sharp, Soliman and Crane, *The Vector Heat Method*, 2019;
    ``vertexTangentBasis``).

    Parameters
    ----------
    surface : Surface
        The shape whose vertex normals the axes are perpendicular to.

    Returns
    -------
    x, y : (V, 3) float64 ndarray
        Unit vectors; zero at vertices without a face.

    Raises
    ------
    RosyError
        If the faces at a vertex are not one fan, so that its edges have no order.
    """
    vertex, following = surface.corner_vertex, surface.next_corner
    normal, angle = vertex_normals(surface), corner_angles(surface)
    count, corners = len(surface.vertices), np.arange(len(vertex))
    previous = np.empty_like(following)
    previous[following] = corners
    twin = np.full(len(vertex), -1)
    twin[surface.edges.halfedges] = surface.edges.halfedges[:, ::-1]
    to_left = twin[previous]  # the corner of the same vertex in the next face, counter-clockwise
    corner = np.full(count, -1)
    corner[vertex] = corners
    is_first = ~mask(len(vertex), to_left[to_left >= 0])
    corner[vertex[is_first]] = corners[is_first]
    is_border = mask(count, vertex[is_first])
    total = np.bincount(vertex, angle, count)
    scale = np.where(is_border, np.pi, 2 * np.pi) / np.where(total > 0, total, 1.0)
    start, at = corner.copy(), np.flatnonzero(corner >= 0)
    turned, x, seen = np.zeros(count), np.zeros((count, 3)), 0

    def add_edge(v: np.ndarray, end: np.ndarray) -> None:
        edge = surface.vertices[vertex[end]] - surface.vertices[v]
        edge -= dot(edge, normal[v])[:, None] * normal[v]
        cosine, sine = np.cos(turned[v]), np.sin(turned[v])
        x[v] += cosine[:, None] * edge - sine[:, None] * np.cross(normal[v], edge)

    while len(at):
        at_corner = corner[at]
        add_edge(at, following[at_corner])
        seen += len(at)
        turned[at] += scale[at] * angle[at_corner]
        corner[at] = to_left[at_corner]
        ends = corner[at] < 0
        add_edge(at[ends], previous[at_corner[ends]])
        at = at[(corner[at] >= 0) & (corner[at] != start[at])]
    if seen != len(vertex):
        raise RosyError(
            f"{surface.name}: the faces at some vertices are not one fan, so they have no frames"
        )
    x = normalize(x)
    return x, np.cross(normal, x)

"""Make guides along salient edges, but not along edges in steps, which voxel remeshing makes."""

from functools import partial

import numpy as np

from .analysis import edge_lengths
from .blocks import mask
from .conjugate_gradient import conjugate_gradient
from .guides import guides_from_edges
from .representation import edge_unfolding, power, to_representation
from .sparse_matrix import from_edges
from .surface import Surface

#: Distance along edges over which their directions are averaged, relative to the size of the surface. With half of this
#: distance, fields follow the steps of voxels of 1 % (572 singularities on a tee). With twice the distance, they do not
#: follow some edges of a part that is remeshed with quads, whose edges are at 45 degrees.
JAG_LENGTH = 0.01

#: A guide is removed if N times its angle from the average has a smaller cosine than `MIN_COSINE`, or if the length
#: of the average is below `MIN_LENGTH` (1 for a straight line). On a circle of radius r, the length is
#: 1 / (1 + (N JAG_LENGTH / r)^2), so cross fields follow rims of holes down to r = 0.026. A tee that is remeshed with
#: voxels has 576 singularities without these limits, and 36 with them.
MIN_COSINE, MIN_LENGTH = 0.7, 0.3

#: Largest ratio of the length of an edge to the distance of the face centers at it. Slivers have larger ones.
MAX_EDGE_RATIO = 1e3

#: Residual norm at which the averages stop, relative to the right-hand side, and their largest number of
#: iterations. Meshes without slivers needed 8 to 30.
TOLERANCE, MAX_ITERATIONS = 1e-2, 100


def coherent_edge_guides(surface: Surface, ends: np.ndarray, degree: int) -> np.ndarray:
    """Make guides along edges, on their faces. Remove guides whose directions differ from the edges around them.

    Voxel remeshing, for example, turns a sharp edge into steps. The directions of the steps are not the direction of
    the edge, and a field along them has a pair of singularities at each step.

    The guides are averaged over the distance `JAG_LENGTH`, along the faces that touch the edges. A guide is removed
    if the average is short or has another direction. Faces are unfolded at their common edges, so that
    the corner of a box does not count as a contradiction for degree 4. Guides on faces larger than the
    distance are kept.

    Parameters
    ----------
    surface : Surface
        A surface of size 1, a result of `feature_curvature.of_unit_extent`.
    ends : (E, 2) int ndarray
        The edges, as pairs of vertices.
    degree : int
        N of the field.

    Returns
    -------
    (F, 3) float64 ndarray
        Unit vectors along the edges of a face (`guides.guides_from_edges`); zero on faces without a guide.
    """
    guides = guides_from_edges(surface, ends, degree)
    z = to_representation(guides, *surface.face_frames, degree)
    is_end = mask(len(surface.vertices), ends)[surface.corner_vertex]
    touches = np.logical_or.reduceat(is_end, surface.face_start[:-1])
    halfedges = surface.edges.halfedges
    a, b = halfedges[touches[surface.corner_face[halfedges]].all(axis=1)].T
    length, distance = edge_lengths(surface, a, b)
    least = np.maximum(length / MAX_EDGE_RATIO, np.finfo(float).tiny)
    weight = JAG_LENGTH**2 * length / np.maximum(distance, least)
    number = np.cumsum(touches) - 1
    source, target = number[surface.corner_face[a]], number[surface.corner_face[b]]
    mass = np.where(z != 0, surface.face_area, 0.0)[touches]
    # A tiny term keeps the diagonal positive at faces without an edge to another of these faces.
    stiffness = np.bincount(np.concatenate([source, target]), np.tile(weight, 2), len(mass))
    diagonal = mass + stiffness + np.finfo(float).eps
    transport = power(edge_unfolding(surface, a, b), degree)
    matrix = from_edges(target, source, -weight * transport, diagonal)
    scale, label = partial(np.multiply, 1 / diagonal), "averaging sharp edges"
    average = conjugate_gradient(
        matrix, mass * z[touches], TOLERANCE, scale, label, max_iterations=MAX_ITERATIONS
    )
    is_kept = surface.face_area >= JAG_LENGTH**2
    modulus = np.abs(average)
    agrees = (average * z[touches].conj()).real >= MIN_COSINE * modulus
    is_kept[touches] |= agrees & (modulus >= MIN_LENGTH)
    return np.where(is_kept[:, None], guides, 0.0)

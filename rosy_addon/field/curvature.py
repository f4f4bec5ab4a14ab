"""Compute principal directions and curvatures on the faces of a surface."""

import numpy as np

from ..core.errors import RosyError
from ..core.progress import report
from .connectivity import connected_components, smooth_fans
from .corner_fans import corner_angles, corner_rotations, smooth_face_values
from .frames import dot
from .polygon_arrays import fan_normals, sum_per_face
from .representation import from_representation
from .rosy_field import RosyField, check_degree
from .surface import Surface

#: The smallest normal floating-point number. Its inverse is finite.
TINY = float(np.finfo(np.float64).tiny)

#: Names of the magnitudes that can be computed for a field, with the descriptions shown in the interface.
MAGNITUDES = {
    "unit": "1 on all faces",
    "confidence": "How well the principal directions are defined, from 0 to 1",
    "curvature": "The larger principal curvature, in 1 / unit of the mesh: 2 on a ball of radius 0.5",
}

#: Confidence below which a principal direction is a rounding error: of `face_curvature`, and of coordinates in single
#: precision.
LEAST_CONFIDENCE = 1e-6

#: Number of rounds of averaging over vertices, which reduces the effect of mesh noise on curvature fields.
CURVATURE_SMOOTHING_ROUNDS = 2


def face_magnitude(surface: Surface, kind: str) -> np.ndarray:
    """Compute the magnitude for a field on each face; `kind` is a name in `MAGNITUDES`.

    "unit" is 1. "confidence" says how well the principal directions are defined, from 0 to 1: the magnitude
    of `curvature_field`. "curvature" is the larger absolute principal curvature, in 1 / unit of length in
    object space.

    Returns
    -------
    (F,) float64 ndarray

    Raises
    ------
    RosyError
        If the kind is unknown.
    """
    if kind == "unit":
        return np.ones(surface.face_count)
    if kind == "confidence":
        return curvature_field(surface, 4).magnitude
    if kind != "curvature":
        raise RosyError(f"unknown magnitude '{kind}': choose {', '.join(MAGNITUDES)}")
    report(0.0, "computing curvature")
    smooth_surface = with_smooth_normals(surface)
    mean, deviator = face_curvature(smooth_surface, *smooth_surface.face_frames)
    return np.abs(mean) + np.abs(deviator)


def with_smooth_normals(surface: Surface, corner_fan: np.ndarray | None = None) -> Surface:
    """Return the surface with shading normals that are averaged over smooth fans, and without a rest shape.

    `corner_fan` holds the (C,) index of the fan of each corner. By default, normals are smooth everywhere.
    """
    mesh = surface.vertices, surface.corner_vertex, surface.face_start
    fan = smooth_fans(*mesh) if corner_fan is None else corner_fan
    normal = fan_normals(*mesh, fan)
    return surface.with_parts(corner_fan=fan, corner_normal=normal, rest_vertices=None)


def curvature_field(surface: Surface, degree: int) -> RosyField:
    """Compute a field along the principal directions of curvature.

    Degree 2 follows the direction of the greater signed curvature, which is positive where the surface is
    convex. The side on which most of a connected component is convex counts as the outside, so that reversed
    faces have the same field. Degree 4 follows both principal directions. In fields of other even degrees,
    one member follows the direction of degree 2. Principal directions have no sign, so odd degrees are not
    possible.

    The magnitude is a confidence from 0 to 1, ``|k1 - k2| / (|k1| + |k2| + k0)``, where k1 and k2 are the
    principal curvatures. It is 0 at umbilics and in planes, which have no principal directions, and about 1
    on cylinders and saddles. The constant k0 is 0.02 divided by the root mean square radius of the mesh. It
    suppresses rounding errors in nearly flat regions.

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If the degree is odd.

    References
    ----------
    The second fundamental form of a face is fitted to the differences of its corner normals, as in
    Rusinkiewicz, "Estimating Curvatures and Their Derivatives on Triangle Meshes", 3DPVT 2004, but
    for polygons. Representations are then averaged over the vertices.
    """
    degree = check_degree(degree)
    if degree % 2:
        raise RosyError(f"a curvature field needs an even degree, not {degree}")
    label = "computing principal directions"
    report(0.0, label)
    smooth_surface = with_smooth_normals(surface)
    x, y = smooth_surface.face_frames
    mean, deviator = face_curvature(smooth_surface, x, y)
    if degree % 4:
        deviator = deviator * outer_sides(surface, mean)
    report(0.6, label)
    deviator_norm = np.abs(deviator)
    offset = smooth_surface.face_center - smooth_surface.face_center.mean(axis=0)
    radius = np.sqrt(np.mean(dot(offset, offset)))
    # |k1 - k2| = 2 |d|; |k1| + |k2| is the larger of 2 |H| and 2 |d|.
    larger = np.maximum(np.abs(mean), deviator_norm)
    confidence = deviator_norm / (larger + 0.01 / max(radius, 1e-30))
    is_curved = confidence > LEAST_CONFIDENCE
    phase = np.divide(deviator, deviator_norm, out=np.zeros_like(deviator), where=is_curved)
    z = confidence * phase ** (degree // 2)
    rotation = corner_rotations(smooth_surface, smooth_surface.corner_normal)
    weights = corner_angles(smooth_surface)
    for index in range(CURVATURE_SMOOTHING_ROUNDS):
        report(0.7 + 0.1 * index, label)
        z = smooth_face_values(smooth_surface, z, rotation, degree, weights)
    z[np.abs(z) < LEAST_CONFIDENCE] = 0
    report(0.95, label)
    return RosyField(degree, from_representation(z, x, y, degree))


def outer_sides(surface: Surface, mean: np.ndarray) -> np.ndarray:
    """Return (F,) float64: 1 on components that are mostly convex, -1 on those that are mostly concave.

    Curvature changes its sign if all faces are reversed; curvature times this sign does not. `mean` holds the
    (F,) mean curvatures. The sign is 1 if both parts are equal, as on a saddle or a wave.
    """
    faces = surface.corner_face[surface.edges.halfedges]
    component = connected_components(surface.face_count, faces)
    total = np.bincount(component, surface.face_area * mean)
    least = LEAST_CONFIDENCE * np.bincount(component, surface.face_area * np.abs(mean))
    return np.where(total < -least, -1.0, 1.0)[component]


def face_curvature(surface: Surface, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the curvature of each face, by a least-squares fit of its second fundamental form.

    The second fundamental form is the symmetric matrix [[a, b], [b, c]] in the frame of the face. It maps
    each edge (u, v) of the face to the difference (p, q) of the normals at the ends of the edge. So
    curvatures are positive where the surface is convex.

    Parameters
    ----------
    surface : Surface
    x, y : (F, 3) float64 ndarray
        Tangent frames of the faces.

    Returns
    -------
    mean : (F,) float64 ndarray
        Mean curvature (k1 + k2) / 2, in 1 / unit of length in object space.
    deviator : (F,) complex128 ndarray
        (a - c) / 2 + i b. Its modulus is (k1 - k2) / 2, its phase twice the angle from x to the direction of
        the greater curvature k1.
    """
    face, next_corner = surface.corner_face, surface.next_corner
    points = surface.vertices[surface.corner_vertex]
    edge = points[next_corner] - points
    normal_difference = surface.corner_normal[next_corner] - surface.corner_normal
    u, v = dot(edge, x[face]), dot(edge, y[face])
    p, q = dot(normal_difference, x[face]), dot(normal_difference, y[face])
    products = u * u, u * v, v * v, u * p, v * p + u * q, v * q
    uu, uv, vv, up, mixed, vq = (sum_per_face(product, surface.face_start) for product in products)
    trace = uu + vv
    trace[trace == 0] = 1.0
    regularization = 1e-9 * trace  # faces without area get curvature 0 instead of a singular system
    uu, vv = uu + regularization, vv + regularization
    # uu a + uv b = up,  uv a + (uu + vv) b + uv c = mixed,  uv b + vv c = vq
    b = uu * vv * mixed - uv * (vv * up + uu * vq)
    b /= (uu + vv) * (uu * vv - uv * uv)
    a, c = (up - uv * b) / uu, (vq - uv * b) / vv
    return (a + c) / 2, (a - c) / 2 + 1j * b

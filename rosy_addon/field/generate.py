"""Field generators: make a field on a surface by the name of its kind.

Two of the generators, along an axis and along the curvature, are implemented here. Fields are cut
along edges whose faces disagree on orientation; see `surface.count_inconsistent_edges`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import NoFeaturesError, RosyError
from ..memory import check_memory
from ..progress import Progress, Task, run_to_completion, subtask
from .corner_fans import corner_angles_task, corner_rotations_task, smooth_face_values
from .frames import dot, normalize
from .guided import guided_task
from .guides import (
    average_guides,
    feature_edges_task,
    guides_from_axes,
    guides_from_edges,
    guides_from_strokes,
    uv_guides_task,
)
from .representation import face_frames, from_representation
from .rosy_field import RosyField, check_degree
from .smoothest import smoothest_task
from .surface import Surface, sum_per_face, surface_task

#: The smallest number whose inverse is finite.
TINY = float(np.finfo(np.float64).tiny)

#: Smallest distance of smoothing, relative to `Surface.extent`. Shorter ones change nothing.
MIN_SMOOTHING_LENGTH = 1e-6

#: Kinds of generated fields, with the descriptions shown in the interface.
GENERATORS = {
    "smoothest": "The smoothest field, with few singularities",
    "curvature": "Along the principal directions of curvature (even degrees)",
    "features": "Along borders and sharp edges, and smooth between them",
    "guided": "Along guides (strokes, edges, a UV map, vectors or empties), and smooth between them",
    "axis": "Along a direction, projected to the surface",
    "uv": "Along the axes of a UV map",
}

#: Kinds of magnitudes of a field, with the descriptions shown in the interface.
MAGNITUDES = {
    "unit": "1 on all faces",
    "confidence": "How well the principal directions are defined, from 0 to 1",
    "curvature": "The larger principal curvature, multiplied by the size of the mesh",
}

#: Shorter projections of a unit axis are rounding errors: the face is perpendicular to the axis.
MIN_PROJECTION = 1e-12

#: Rounds of averaging over vertices, which reduce noise of the mesh in curvature fields.
CURVATURE_SMOOTHING_ROUNDS = 2

#: Bytes of memory that a face takes at the peak, by kind. The other kinds take little.
BYTES_PER_FACE = {"smoothest": 750, "curvature": 720, "features": 1000, "guided": 1000}


@dataclass(frozen=True)
class GeneratorSettings:
    """The settings of `generate`.

    Attributes
    ----------
    kind : str
        One of `GENERATORS`.
    axis : 3 floats
        For "axis": the direction to follow, in object space.
    smoothing_length : float
        Relative to `Surface.extent`. For "curvature": the distance over which directions of high
        confidence spread to regions of low confidence; 0 for none. For "guided": the distance over
        which guides are smoothed; at 0 they are followed exactly.
    sharp_angle : float
        For "features": the smallest angle between face normals at a sharp edge, in radians.
    edges : (E, 2) int ndarray or None
        For "features" and "guided": pairs of vertices, the edges to follow. For "features", they
        replace the border and sharp edges.
    strokes : sequence of (n, 3) float ndarray
        For "guided": polylines drawn on the surface, in object space.
    axis_guides : sequence of (point, axis, radius)
        For "guided": see `guides.guides_from_axes`; object space.
    uv : (C, 2) float ndarray or None
        For "guided" and "uv": texture coordinates of the corners.
    vectors : (F, 3) float ndarray or None
        For "guided": a member vector for each face, zero where there is no guide.
    """

    kind: str
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    smoothing_length: float = 0.0
    sharp_angle: float = np.pi / 6
    edges: np.ndarray | None = None
    strokes: Sequence[np.ndarray] = ()
    axis_guides: Sequence[tuple[Sequence[float], Sequence[float], float]] = ()
    uv: np.ndarray | None = None
    vectors: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.smoothing_length < MIN_SMOOTHING_LENGTH:
            object.__setattr__(self, "smoothing_length", 0.0)


def generate(surface: Surface, settings: GeneratorSettings | str, degree: int) -> RosyField:
    """Generate a field; see `generate_task`."""
    return run_to_completion(generate_task(surface, settings, degree))


def generate_task(
    surface: Surface, settings: GeneratorSettings | str, degree: int
) -> Task[RosyField]:
    """Generate a field of one of the kinds in `GENERATORS`.

    Parameters
    ----------
    surface : Surface
    settings : GeneratorSettings or str
        A string is a kind, with the default settings.
    degree : int
        N.

    Yields
    ------
    Progress

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If the kind is unknown, cannot make a field of this degree on this surface, or needs more
        memory than there is.
    """
    settings = GeneratorSettings(settings) if isinstance(settings, str) else settings
    check_memory(
        BYTES_PER_FACE.get(settings.kind, 0) * surface.face_count,
        f"{surface.name}: a field on {surface.face_count:,} faces",
        "choose a smaller mesh, or another kind of field",
    )
    yield Progress(0.0, "generating the field")
    if settings.kind == "smoothest":
        return (yield from smoothest_task(surface, degree))
    if settings.kind == "axis":
        return axis_field(surface, degree, settings.axis)
    if settings.kind == "curvature":
        split = 0.4 if settings.smoothing_length else 1.0
        field = yield from subtask(curvature_task(surface, degree), 0.0, split)
        if not settings.smoothing_length:
            return field
        # The extent is zero if all faces are points; then so is the magnitude.
        length = max(settings.smoothing_length * surface.extent, TINY)
        weight = (field.magnitude / length) ** 2
        task = _guided_or_smoothest_task(surface, degree, normalize(field.vectors), weight)
        return (yield from subtask(task, split, 1.0))
    if settings.kind == "features":
        return (yield from _features_task(surface, settings, degree))
    if settings.kind == "guided":
        return (yield from _guides_task(surface, settings, degree))
    if settings.kind == "uv":
        if settings.uv is None:
            raise RosyError(f"{surface.name}: has no UV map: add one, or choose another generator")
        task = uv_guides_task(surface, settings.uv, check_degree(degree))
        return RosyField(degree, (yield from task))
    raise RosyError(f"unknown generator '{settings.kind}': choose {', '.join(GENERATORS)}")


def _features_task(surface: Surface, settings: GeneratorSettings, degree: int) -> Task[RosyField]:
    """A field along the given edges or, without any, along border and sharp edges."""
    degree = check_degree(degree)
    ends = settings.edges
    if ends is None:
        task = feature_edges_task(surface, settings.sharp_angle)
        ends = yield from subtask(task, 0.0, 0.0, "finding guides")
        yield Progress(0.0, "finding guides")
    if not len(ends):
        raise NoFeaturesError(
            f"{surface.name}: has no border or sharp edge: reduce the sharp angle, or mark edges"
        )
    guides = guides_from_edges(surface, ends, degree)
    if not guides.any():
        raise NoFeaturesError(
            f"{surface.name}: on each face, the edges cancel each other in a field of degree "
            f"{degree}: choose another degree"
        )
    return (yield from _guided_or_smoothest_task(surface, degree, guides))


def _guided_or_smoothest_task(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float | None = None,
) -> Task[RosyField]:
    """A guided field, with the smoothest field on connected components without a guide.

    Guides are followed exactly if `weight` is None.
    """
    hard = guides.any(axis=1) if weight is None else None
    task = guided_task(surface, degree, guides, 0.0 if weight is None else weight, hard)
    field = yield from subtask(task, 0.0, 0.6)
    unguided = ~field.vectors.any(axis=1) & surface.face_normal.any(axis=1)
    if not unguided.any():
        return field
    smoothest = yield from subtask(smoothest_task(surface, degree), 0.6, 1.0)
    return RosyField(degree, np.where(unguided[:, None], smoothest.vectors, field.vectors))


def _guides_task(surface: Surface, settings: GeneratorSettings, degree: int) -> Task[RosyField]:
    """A field along the mean of all guides in the settings."""
    degree = check_degree(degree)
    guide_sets, label = [], "finding guides"
    if settings.edges is not None:
        guide_sets.append(guides_from_edges(surface, settings.edges, degree))
        yield Progress(0.0, label)
    if settings.strokes:
        guide_sets.append(guides_from_strokes(surface, settings.strokes, degree))
        yield Progress(0.0, label)
    if settings.axis_guides:
        position, axis, radius = (
            np.array(column, dtype=np.float64) for column in zip(*settings.axis_guides, strict=True)
        )
        guide_sets.append(guides_from_axes(surface, position, axis, radius, degree))
        yield Progress(0.0, label)
    if settings.uv is not None:
        task = uv_guides_task(surface, settings.uv, degree)
        guide_sets.append((yield from subtask(task, 0.0, 0.0)))
    if settings.vectors is not None:
        guide_sets.append(normalize(settings.vectors))
    if not guide_sets:
        raise RosyError(
            f"{surface.name}: no guides are given: give strokes, edges, a UV map, vectors or axes"
        )
    faces = np.tile(np.arange(surface.face_count), len(guide_sets))
    yield Progress(0.0, label)
    guides = average_guides(surface, faces, np.concatenate(guide_sets), degree)
    weight = (
        (settings.smoothing_length * surface.extent) ** -2 if settings.smoothing_length else None
    )
    return (yield from _guided_or_smoothest_task(surface, degree, guides, weight))


def axis_field(
    surface: Surface, degree: int, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
) -> RosyField:
    """Make a field whose stored member is an axis projected to each face.

    The magnitude is the length of the projection of the unit axis: 1 where the surface is parallel
    to the axis and 0 where it is perpendicular to it. There the field is undefined.

    Parameters
    ----------
    surface : Surface
    degree : int
    axis : 3 floats
        Object space, of any nonzero length.

    Raises
    ------
    RosyError
        If the axis is zero, not finite, or not a vector of 3 numbers.
    """
    direction = np.asarray(axis, dtype=np.float64).reshape(-1)
    largest = np.abs(direction).max(initial=0.0)
    if direction.shape != (3,) or not np.isfinite(largest) or largest == 0:
        raise RosyError(
            f"axis {tuple(axis)} is not a direction: give three finite numbers that are not all zero"
        )
    # Scaled exactly to about 1, so that its square neither overflows nor vanishes.
    direction = np.ldexp(direction, -np.frexp(largest)[1])
    direction = direction / np.linalg.norm(direction)
    normal = surface.face_normal
    vectors = direction - (normal @ direction)[:, None] * normal
    vectors[~normal.any(axis=1) | (np.linalg.norm(vectors, axis=1) < MIN_PROJECTION)] = 0.0
    return RosyField(degree, vectors)


def magnitude_task(surface: Surface, kind: str) -> Task[np.ndarray]:
    """Compute magnitudes of one of the kinds in `MAGNITUDES`.

    "curvature" is the larger absolute principal curvature times `Surface.extent`, so it has no
    unit.

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
        field = yield from curvature_task(surface, 4)
        return field.magnitude
    if kind != "curvature":
        raise RosyError(f"unknown magnitude '{kind}': choose {', '.join(MAGNITUDES)}")
    smooth_surface = yield from _smooth_normals_task(surface)
    x, y = face_frames(smooth_surface)
    yield Progress(0.5, "computing the curvature")
    mean, deviator = yield from subtask(_face_curvature_task(smooth_surface, x, y), 0.5, 1.0)
    return (np.abs(mean) + np.abs(deviator)) * surface.extent


def _smooth_normals_task(surface: Surface) -> Task[Surface]:
    """The surface with smooth normals everywhere, without flat faces and sharp edges."""
    task = surface_task(
        surface.vertices,
        surface.corner_vertex,
        surface.face_start,
        name=surface.name,
        triangles=surface.triangles,
        triangle_face=surface.triangle_face,
    )
    return (yield from subtask(task, 0.0, 0.3, "averaging normals"))


def curvature_field(surface: Surface, degree: int) -> RosyField:
    """Compute a curvature field; see `curvature_task`."""
    return run_to_completion(curvature_task(surface, degree))


def curvature_task(surface: Surface, degree: int) -> Task[RosyField]:
    """Compute a field along the principal directions of curvature.

    Degree 2 follows the direction of the greater signed curvature (positive where the surface is
    convex). Degree 4 follows both principal directions. In fields of other even degrees, one member
    follows the direction of degree 2. Principal directions have no sign, so odd degrees are not
    possible.

    The magnitude is a confidence from 0 to 1, ``|k1 - k2| / (|k1| + |k2| + k0)``. It is 0 at
    umbilics and in planes, which have no principal directions, and about 1 on cylinders and
    saddles. k0 is 0.02 divided by the root mean square radius of the mesh. It suppresses rounding
    errors in nearly flat regions.

    Yields
    ------
    Progress

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
    yield Progress(0.0, label)
    smooth_surface = yield from _smooth_normals_task(surface)
    yield Progress(0.3, label)
    x, y = face_frames(smooth_surface)
    yield Progress(0.4, label)
    mean, deviator = yield from subtask(_face_curvature_task(smooth_surface, x, y), 0.4, 0.6)
    yield Progress(0.6, label)
    deviator_norm = np.abs(deviator)
    center = smooth_surface.face_center.mean(axis=0)
    offset = smooth_surface.face_center - center
    radius = np.sqrt(np.mean(dot(offset, offset)))
    # |k1 - k2| = 2 |d|; |k1| + |k2| is the larger of 2 |H| and 2 |d|.
    confidence = deviator_norm / (
        np.maximum(np.abs(mean), deviator_norm) + 0.01 / max(radius, 1e-30)
    )
    is_curved = deviator_norm > TINY
    phase = np.divide(deviator, deviator_norm, out=np.zeros_like(deviator), where=is_curved)
    z = confidence * phase ** (degree // 2)
    yield Progress(0.65, label)
    task = corner_rotations_task(
        smooth_surface.face_normal,
        x,
        smooth_surface.corner_face,
        smooth_surface.corner_normal,
        label,
    )
    rotation = yield from subtask(task, 0.65, 0.68)
    weights = yield from subtask(corner_angles_task(smooth_surface), 0.68, 0.7, label)
    for index in range(CURVATURE_SMOOTHING_ROUNDS):
        yield Progress(0.7 + 0.1 * index, label)
        z = smooth_face_values(smooth_surface, z, rotation, degree, weights)
    yield Progress(0.95, label)
    return RosyField(degree, from_representation(z, x, y, degree))


def _face_curvature_task(
    surface: Surface, x: np.ndarray, y: np.ndarray
) -> Task[tuple[np.ndarray, np.ndarray]]:
    """Fit the second fundamental form of each face.

    The symmetric matrix [[a, b], [b, c]] maps each edge (u, v) of the face to the difference (p, q)
    of the normals at its ends, in the least squares sense.

    Returns
    -------
    mean : (F,) float64 ndarray
        Mean curvature (k1 + k2) / 2, in 1 / Blender unit.
    deviator : (F,) complex128 ndarray
        (a - c) / 2 + i b. Its modulus is (k1 - k2) / 2, its phase twice the angle of the direction
        of k1 in the frame x, y.
    """
    face, next_corner = surface.corner_face, surface.next_corner
    points = surface.vertices[surface.corner_vertex]
    edge = points[next_corner] - points
    normal_difference = surface.corner_normal[next_corner] - surface.corner_normal
    yield Progress(0.3, "computing principal directions")
    u, v = dot(edge, x[face]), dot(edge, y[face])
    p, q = dot(normal_difference, x[face]), dot(normal_difference, y[face])
    yield Progress(0.6, "computing principal directions")
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

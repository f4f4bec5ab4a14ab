"""Where a field can come from: the kinds of fields that are made, by name, and two plain ones.

Surfaces that cannot be oriented are cut where their sides meet; `surface.cut_edges` counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import RosyError
from ..progress import Progress, Work, drain, part
from .corners import corner_angles, corner_rotations, smooth_faces
from .frames import dot, unit
from .guided import finding_guided
from .guides import (
    along_edges,
    along_handles,
    along_strokes,
    along_uv,
    feature_edges,
    mean_guides,
)
from .representation import face_frames, from_representation
from .rosy_field import RosyField, check_degree
from .smoothest import finding_smoothest
from .surface import Surface, build_surface, sum_over_faces

#: What can be generated, in the words a user meets.
KINDS = {
    "smoothest": "As smooth as can be, with as few singularities as the shape allows",
    "curvature": "Along the principal directions of curvature (even degrees)",
    "features": "Along borders and sharp edges, and smooth between them",
    "guided": "Along what you give: strokes, edges, a UV map, vectors, empties; smooth between",
    "axis": "Along a direction, projected to the surface",
    "uv": "Along the axes of a UV map",
}

#: What the magnitude of a field can be made of, in the words a user meets.
MAGNITUDES = {
    "unit": "1 everywhere",
    "confidence": "How clear the direction of curvature is, from 0 to 1",
    "curvature": "How much the surface bends where it bends most, by the size of the mesh",
}

#: Rounds of averaging that take the jitter of the triangulation out of a curvature field.
SMOOTHING = 2


@dataclass(frozen=True)
class Recipe:
    """How a field is made.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    axis : 3 floats
        Of the kind "axis": object space.
    reach : float
        As a share of the surface's size. Of the kind "curvature": how far clearly curved parts
        reach into those that are not; 0 leaves every face what its own curvature says. Of
        "guided": over what distance guides are smoothed; at 0 they are met exactly.
    sharp_angle : float
        Of the kind "features": radians by which the surface bends at a sharp edge, at least.
    edges : (E, 2) int ndarray or None
        Of the kinds "features" and "guided": which edges to follow; of the former, instead of
        borders and sharp ones.
    strokes : sequence of (n, 3) float ndarray
        Of "guided": points of lines drawn on the surface, object space.
    handles : sequence of (place, axis, radius)
        Of "guided": points, what they guide along, and how far from them; object space.
    uv : (C, 2) float ndarray or None
        Of "guided" and "uv": of the corners.
    vectors : (F, 3) float ndarray or None
        Of "guided": a member each, zero where there is none.
    """

    kind: str
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    reach: float = 0.0
    sharp_angle: float = np.pi / 6
    edges: np.ndarray | None = None
    strokes: Sequence[np.ndarray] = ()
    handles: Sequence[tuple[Sequence[float], Sequence[float], float]] = ()
    uv: np.ndarray | None = None
    vectors: np.ndarray | None = None


def generate(surface: Surface, recipe: Recipe | str, degree: int) -> RosyField:
    """Make a field; see `generating`."""
    return drain(generating(surface, recipe, degree))


def generating(surface: Surface, recipe: Recipe | str, degree: int) -> Work[RosyField]:
    """Make a field.

    Parameters
    ----------
    surface : Surface
    recipe : Recipe or str
        A kind alone is a recipe with nothing else changed.
    degree : int

    Raises
    ------
    RosyError
        If there is no such kind, it does not make fields of this degree, or not on this surface.
    """
    recipe = Recipe(recipe) if isinstance(recipe, str) else recipe
    yield Progress(0.0, "making a field")
    if recipe.kind == "smoothest":
        return (yield from finding_smoothest(surface, degree))
    if recipe.kind == "axis":
        return axis_field(surface, degree, recipe.axis)
    if recipe.kind == "curvature":
        end = 0.4 if recipe.reach else 1.0
        field = yield from part(finding_curvature(surface, degree), 0.0, end)
        if not recipe.reach:
            return field
        weight = (field.magnitude / (recipe.reach * surface.size)) ** 2
        following = _following(surface, degree, unit(field.vectors), weight)
        return (yield from part(following, end, 1.0))
    if recipe.kind == "features":
        return (yield from _following_features(surface, recipe, degree))
    if recipe.kind == "guided":
        return (yield from _following_guides(surface, recipe, degree))
    if recipe.kind == "uv":
        if recipe.uv is None:
            raise RosyError(f"{surface.name}: it has no UV map to follow")
        return RosyField(degree, along_uv(surface, recipe.uv, check_degree(degree)))
    raise RosyError(f"no generator is named '{recipe.kind}'; there are {', '.join(KINDS)}")


def _following_features(surface: Surface, recipe: Recipe, degree: int) -> Work[RosyField]:
    degree = check_degree(degree)
    ends = recipe.edges
    if ends is None:
        ends = feature_edges(surface, recipe.sharp_angle)
    if not len(ends):
        raise RosyError(f"{surface.name}: there is no border or sharp edge to follow")
    guides = along_edges(surface, ends, degree)
    if not guides.any():
        raise RosyError(
            f"{surface.name}: the edges of each face contradict each other in a field of degree "
            f"{degree}"
        )
    return (yield from _following(surface, degree, guides))


def _following(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float | None = None,
) -> Work[RosyField]:
    """A guided field; pieces of the mesh without a guide have their smoothest one.

    Without a weight guides are met exactly.
    """
    hard = guides.any(axis=1) if weight is None else None
    guided = finding_guided(surface, degree, guides, 0.0 if weight is None else weight, hard)
    field = yield from part(guided, 0.0, 0.6)
    left = ~field.vectors.any(axis=1) & surface.face_normal.any(axis=1)
    if not left.any():
        return field
    smoothest = yield from part(finding_smoothest(surface, degree), 0.6, 1.0)
    return RosyField(degree, np.where(left[:, None], smoothest.vectors, field.vectors))


def _following_guides(surface: Surface, recipe: Recipe, degree: int) -> Work[RosyField]:
    degree = check_degree(degree)
    found = []
    if recipe.edges is not None:
        found.append(along_edges(surface, recipe.edges, degree))
    if recipe.strokes:
        found.append(along_strokes(surface, recipe.strokes, degree))
    if recipe.handles:
        place, axis, radius = (
            np.array(part, dtype=np.float64) for part in zip(*recipe.handles, strict=True)
        )
        found.append(along_handles(surface, place, axis, radius, degree))
    if recipe.uv is not None:
        found.append(along_uv(surface, recipe.uv, degree))
    if recipe.vectors is not None:
        found.append(unit(recipe.vectors))
    if not found:
        raise RosyError(f"{surface.name}: there is nothing to follow")
    every = np.tile(np.arange(surface.face_count), len(found))
    guides = mean_guides(surface, every, np.concatenate(found), degree)
    weight = (recipe.reach * surface.size) ** -2 if recipe.reach else None
    return (yield from _following(surface, degree, guides, weight))


def axis_field(
    surface: Surface, degree: int, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
) -> RosyField:
    """One member along a direction, projected to each face.

    The magnitude is the length of the projection of the unit axis: 1 where the surface runs along
    it, 0 where it stands across, which is where the field is singular.

    Parameters
    ----------
    surface : Surface
    degree : int
    axis : 3 floats
        Object space, of any length but 0.

    Raises
    ------
    RosyError
        If the axis has no direction.
    """
    direction = np.asarray(axis, dtype=np.float64).reshape(-1)
    length = np.linalg.norm(direction)
    if direction.shape != (3,) or not np.isfinite(length) or length == 0:
        raise RosyError(f"axis {tuple(axis)} is not a direction")
    direction = direction / length
    normal = surface.face_normal
    vectors = direction - (normal @ direction)[:, None] * normal
    vectors[~normal.any(axis=1)] = 0.0
    return RosyField(degree, vectors)


def curvature_magnitude(surface: Surface, kind: str) -> np.ndarray:
    """(F,) float64 magnitudes of one of `MAGNITUDES`.

    The curvature is the larger one of the two principal ones, times the largest side of the box of
    the mesh, so that it has no unit.
    """
    if kind == "unit":
        return np.ones(surface.face_count)
    if kind == "confidence":
        return curvature_field(surface, 4).magnitude
    if kind != "curvature":
        raise RosyError(f"no magnitude is named '{kind}'; there are {', '.join(MAGNITUDES)}")
    whole = _shaded_smoothly(surface)
    mean, deviator = _curvature_of_faces(whole, *face_frames(whole))
    return (np.abs(mean) + np.abs(deviator)) * surface.size


def _shaded_smoothly(surface: Surface) -> Surface:
    """A mesh shown flat or with sharp edges bends all the same."""
    return build_surface(
        surface.vertices, surface.corner_vertex, surface.face_start, name=surface.name
    )


def curvature_field(surface: Surface, degree: int) -> RosyField:
    """The field of `finding_curvature`."""
    return drain(finding_curvature(surface, degree))


def finding_curvature(surface: Surface, degree: int) -> Work[RosyField]:
    """Members along the principal directions of curvature.

    Degree 2 follows the direction in which the surface bends most toward its inside (the greater
    signed curvature), degree 4 both principal directions. Of other even degrees one member follows
    the former: of degree 6 it is one of three lines. A principal direction has no head, so there is
    none of an odd degree.

    The magnitude is a confidence from 0 to 1, ``|k1 - k2| / (|k1| + |k2| + k0)``: 0 at umbilics
    and in planes, where there is no principal direction, 1 on cylinders and saddles. k0, a
    curvature of a fiftieth over the mean radius of the mesh, keeps rounding errors in nearly flat
    parts from passing for directions.

    Raises
    ------
    RosyError
        If the degree is odd.

    References
    ----------
    The second fundamental form of a face is fitted to the differences of its corner normals, as
    by Rusinkiewicz, "Estimating Curvatures and Their Derivatives on Triangle Meshes", 3DPVT 2004,
    here for polygons; representations are then averaged over the vertices.
    """
    degree = check_degree(degree)
    if degree % 2:
        raise RosyError(f"a curvature field has an even degree, not {degree}")
    label = "finding the directions of curvature"
    yield Progress(0.0, label)
    whole = _shaded_smoothly(surface)
    yield Progress(0.3, label)
    x, y = face_frames(whole)
    mean, deviator = _curvature_of_faces(whole, x, y)
    yield Progress(0.6, label)
    amount = np.abs(deviator)
    centre = whole.face_centre.mean(axis=0)
    offset = whole.face_centre - centre
    radius = np.sqrt(np.mean(dot(offset, offset)))
    # |k1 - k2| = 2 |d|; |k1| + |k2| is the larger of 2 |H| and 2 |d|.
    confidence = amount / (np.maximum(np.abs(mean), amount) + 0.01 / max(radius, 1e-30))
    phase = np.divide(deviator, amount, out=np.zeros_like(deviator), where=amount > 0)
    z = confidence * phase ** (degree // 2)
    turn = corner_rotations(whole.face_normal, x, whole.corner_face, whole.corner_normal)
    weights = corner_angles(whole)
    for number in range(SMOOTHING):
        yield Progress(0.7 + 0.1 * number, label)
        z = smooth_faces(whole, z, turn, degree, weights)
    return RosyField(degree, from_representation(z, x, y, degree))


def _curvature_of_faces(
    surface: Surface, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean curvature (F,) float, and deviator (F,) complex, of the form fitted to each face.

    The symmetric form [[a, b], [b, c]] should take each edge (u, v) of the face to the difference
    (p, q) of the normals at its ends; least squares over the edges. The deviator
    (a - c) / 2 + i b has the modulus (k1 - k2) / 2 and twice the angle of the direction of k1.
    """
    face, ahead = surface.corner_face, surface.next_corner
    points = surface.vertices[surface.corner_vertex]
    edge = points[ahead] - points
    bend = surface.corner_normal[ahead] - surface.corner_normal
    u, v = dot(edge, x[face]), dot(edge, y[face])
    p, q = dot(bend, x[face]), dot(bend, y[face])
    products = u * u, u * v, v * v, u * p, v * p + u * q, v * q
    uu, uv, vv, up, mixed, vq = (sum_over_faces(each, surface.face_start) for each in products)
    size = uu + vv
    size[size == 0] = 1.0
    ridge = 1e-9 * size  # faces without area get no curvature instead of no solution
    uu, vv = uu + ridge, vv + ridge
    # uu a + uv b = up,  uv a + (uu + vv) b + uv c = mixed,  uv b + vv c = vq
    b = uu * vv * mixed - uv * (vv * up + uu * vq)
    b /= (uu + vv) * (uu * vv - uv * uv)
    a, c = (up - uv * b) / uu, (vq - uv * b) / vv
    return (a + c) / 2, (a - c) / 2 + 1j * b

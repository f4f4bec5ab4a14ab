"""Generate a field on a surface, by the name of a method.

`GeneratorSettings` describes the options of all methods. A field is not continuous across edges whose faces
have opposite orientations; see `mesh_checks.count_inconsistent_edges`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.errors import NoFeaturesError, RosyError
from ..core.memory import check_memory
from ..core.progress import progress, report
from ..core.settings import check_settings, choice, number, numbers, settings_of, switch
from .cheapest_singularities import cheapest_singularities
from .creases import principal_extent
from .curvature import TINY, curvature_field
from .form import form
from .frames import normalize, unit_direction
from .guided_system import firmness_weights, guided_field
from .guides import (
    average_guides,
    feature_edges,
    guides_from_axes,
    guides_from_edges,
    guides_from_strokes,
    guides_from_uv,
)
from .prescribed import prescribed_field
from .rosy_field import RosyField, check_degree
from .smoothest import smoothest_field
from .surface import Surface, with_delaunay_triangles

#: Smallest smoothing distance, relative to `principal_extent`. Shorter distances have no effect.
MIN_SMOOTHING_LENGTH = 1e-6

#: Names of the methods that generate fields (the *kind* of a field), with the descriptions in the interface.
GENERATORS = {
    "form": "Along the form: clear curvature and sharp edges, and smooth between them",
    "smoothest": "The smoothest field, with few singularities",
    "curvature": "Along the principal directions of each face's own curvature (even degrees)",
    "features": "Along borders and sharp edges, and smooth between them",
    "guided": "Along guides (strokes, edges, a UV map, vectors or empties), and smooth between them",
    "prescribed": "The smoothest field with the singularities that you place, and no other ones",
    "axis": "Along a direction, projected to the surface",
    "uv": "Along the axes of a UV map",
}

#: A projection of a unit axis that is shorter than this is a rounding error: the face is perpendicular to the
#: axis.
MIN_PROJECTION = 1e-12

#: Peak memory in bytes per triangle, measured with the most expensive options of each kind of field. Kinds
#: that are not listed need little memory.
BYTES_PER_TRIANGLE = dict(
    form=1200, smoothest=950, curvature=950, features=1000, guided=950, prescribed=1600
)


def _only_for(*kinds: str) -> Callable[[Any], bool]:
    """Return a function for `Setting.applies`: whether the kind of field in the settings is one of `kinds`."""
    return lambda settings: settings.kind in kinds


@dataclass(frozen=True)
class GeneratorSettings:
    """The method that generates a field, its options and its inputs.

    The first dataclass fields are options with descriptions (`core.settings`). The properties of the
    operator, its panel, the options of the command line and the checks of values are derived from these
    descriptions. The other dataclass fields, listed below, are inputs: they are read from the scene, from
    files or from the arguments of a script.

    Attributes
    ----------
    edges : (E, 2) int ndarray or None
        For "features" and "guided": the edges to follow, as pairs of vertices. For "features", they replace
        the border edges and sharp edges, which are used by default.
    strokes : sequence of (n, 3) float ndarray
        For "guided": polylines drawn on the surface, in object space.
    axis_guides : sequence of (point, axis, radius)
        For "guided": axes that guide the field within a radius around points, all in object space; see
        `guides.guides_from_axes`.
    uv : (C, 2) float ndarray or None
        For "guided" and "uv": texture coordinates of the corners.
    vectors : (F, 3) float ndarray or None
        For "guided" and "prescribed": a member vector for each face, zero where there is no guide.
    vectors_have_firmness : bool
        For "guided": whether the lengths of `vectors` are the firmness of the guides, from 0 to 1 (how
        strictly the field follows them); see `guided_system.firmness_weights`.
    singularities : ((K,) int ndarray, (K,) int ndarray) or None
        For "prescribed": the singular vertices, and their indices in units of 1 / N.

    Raises
    ------
    RosyError
        If the value of an option is not allowed.
    """

    kind: str = choice(
        "form",
        "Method that generates the field",
        GENERATORS,
        label="From",
        option_labels={"uv": "UV Map"},
    )
    axis: tuple[float, float, float] = numbers(
        (0.0, 0.0, 1.0),
        "Direction in object space that is projected to the surface",
        dict.fromkeys("XYZ", (-1e30, 1e30)),
        applies=_only_for("axis"),
    )
    reach: float = number(
        0.0,
        0.0,
        10.0,
        "Distance, as a fraction of the size of the mesh, by which curvature extends into flat parts, "
        "over which guides are smoothed, or over which a field with prescribed singularities bends to "
        "guides. 0: guides are met exactly",
        soft_high=0.2,
        unit="size",
        applies=_only_for("curvature", "guided", "prescribed"),
    )
    sharp_angle: float = number(
        np.pi / 6,
        0.0,
        np.pi,
        "Smallest angle between the faces of a sharp edge",
        unit="angle",
        applies=_only_for("features"),
    )
    add_missing: bool = switch(
        False,
        "Add the further singularities that the field needs, where it is smoothest",
        applies=_only_for("prescribed"),
    )
    edges: np.ndarray | None = None
    strokes: Sequence[np.ndarray] = ()
    axis_guides: Sequence[tuple[Sequence[float], Sequence[float], float]] = ()
    uv: np.ndarray | None = None
    vectors: np.ndarray | None = None
    vectors_have_firmness: bool = False
    singularities: tuple[np.ndarray, np.ndarray] | None = None

    def __post_init__(self) -> None:
        check_settings(self)
        if self.reach < MIN_SMOOTHING_LENGTH:
            object.__setattr__(self, "reach", 0.0)


def options_of(kind: str) -> list[str]:
    """Return the names of the options that apply to a kind of field, such as "curvature"."""
    settings = GeneratorSettings(kind)
    described = settings_of(GeneratorSettings)
    return [name for name in described if name != "kind" and described[name].applies(settings)]


def generate(surface: Surface, settings: GeneratorSettings | str, degree: int) -> RosyField:
    """Generate a field of one of the kinds in `GENERATORS`.

    Parameters
    ----------
    surface : Surface
    settings : GeneratorSettings or str
        A string is the name of a kind in `GENERATORS`; its options then have their default values.
    degree : int
        N.

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If the kind is unknown, if its method cannot make a field of this degree on this surface, or if it
        needs more memory than the computer has.
    """
    settings = GeneratorSettings(settings) if isinstance(settings, str) else settings
    needed = BYTES_PER_TRIANGLE.get(settings.kind, 0) * len(surface.triangles)
    subject = f"{surface.name}: a field on {surface.face_count:,} faces"
    check_memory(needed, subject, "choose a smaller mesh, or another kind of field")
    report(0.0, "generating the field")
    surface = with_delaunay_triangles(surface)
    match settings.kind:
        case "form":
            return form(surface, degree)
        case "smoothest":
            return smoothest_field(surface, degree)
        case "curvature":
            return _curvature(surface, settings, degree)
        case "features":
            return _features(surface, settings, degree)
        case "guided":
            return _guided(surface, settings, degree)
        case "prescribed":
            return _prescribed(surface, settings, degree)
        case "axis":
            return axis_field(surface, degree, settings.axis)
    if settings.uv is None:
        raise RosyError(f"{surface.name}: has no UV map: add one, or choose another generator")
    return RosyField(degree, guides_from_uv(surface, settings.uv, check_degree(degree)))


def _curvature(surface: Surface, settings: GeneratorSettings, degree: int) -> RosyField:
    """Return a field along principal curvature directions.

    Where the two principal curvatures are nearly equal, as on flat parts, these directions are arbitrary. If
    `settings.reach` is above 0, the field there is a smooth continuation of the field around these parts.
    """
    split = 0.4 if settings.reach else 1.0
    with progress(0.0, split):
        field = curvature_field(surface, degree)
    if not settings.reach or not field.vectors.any():
        return field
    # The size is zero if all faces are points. The magnitude is then zero as well.
    weight = (field.magnitude / max(settings.reach * principal_extent(surface), TINY)) ** 2
    with progress(split, 1.0):
        return guided_field(surface, degree, normalize(field.vectors), weight)


def _prescribed(surface: Surface, settings: GeneratorSettings, degree: int) -> RosyField:
    """Return the smoothest field with the singularities in the settings."""
    if settings.singularities is None:
        raise RosyError(
            f"{surface.name}: no singularities are given: give their vertices and indices"
        )
    singularities, start = settings.singularities, 0.0
    reach = settings.reach * principal_extent(surface)
    if settings.add_missing:
        with progress(0.0, 0.5):
            singularities, start = cheapest_singularities(surface, degree, *singularities), 0.5
    with progress(start, 1.0):
        return prescribed_field(surface, degree, *singularities, settings.vectors, reach)


def _features(surface: Surface, settings: GeneratorSettings, degree: int) -> RosyField:
    """Return a field along the edges in the settings or, if there are none, along border and sharp edges."""
    degree = check_degree(degree)
    angle, ends = settings.sharp_angle, settings.edges
    ends = feature_edges(surface, angle) if ends is None else ends
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
    with progress(0.1, 1.0):
        return guided_field(surface, degree, guides)


def _guided(surface: Surface, settings: GeneratorSettings, degree: int) -> RosyField:
    """Return a field that follows all guides in the settings (edges, strokes, axes, UV map and vectors).

    On a face with several guides, it follows their mean.
    """
    degree = check_degree(degree)
    report(0.0, "finding guides")
    guide_sets = []
    if settings.edges is not None:
        guide_sets.append(guides_from_edges(surface, settings.edges, degree))
    if settings.strokes:
        guide_sets.append(guides_from_strokes(surface, settings.strokes, degree))
    if settings.axis_guides:
        columns = zip(*settings.axis_guides, strict=True)
        given = (np.array(column, dtype=np.float64) for column in columns)
        guide_sets.append(guides_from_axes(surface, *given, degree))
    if settings.uv is not None:
        guide_sets.append(guides_from_uv(surface, settings.uv, degree))
    if settings.vectors is not None:
        guide_sets.append(normalize(settings.vectors))
    if not guide_sets:
        raise RosyError(
            f"{surface.name}: no guides are given: give strokes, edges, a UV map, vectors or axes"
        )
    faces = np.tile(np.arange(surface.face_count), len(guide_sets))
    guides = average_guides(surface, faces, np.concatenate(guide_sets), degree)
    firmness = np.ones(surface.face_count)
    if settings.vectors is not None and settings.vectors_have_firmness:
        firmness = np.linalg.norm(settings.vectors, axis=1)
        for guide in guide_sets[:-1]:
            firmness[guide.any(axis=1)] = 1.0
    reach = settings.reach * principal_extent(surface)
    weight, is_exact = firmness_weights(firmness, surface.mean_edge_length, reach)
    return guided_field(surface, degree, guides, weight, is_exact)


def axis_field(
    surface: Surface, degree: int, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
) -> RosyField:
    """Make a field along an axis: its stored member vectors are the projections of the axis to the faces.

    The magnitude is the length of the projection of the unit axis: 1 where the surface is parallel
    to the axis. Where it is perpendicular to the axis, the magnitude is 0 and the field is undefined.

    Parameters
    ----------
    surface : Surface
    degree : int
        N.
    axis : 3 floats
        Vector in object space, of any nonzero length.

    Raises
    ------
    RosyError
        If the axis is zero, not finite, or not a vector of 3 numbers.
    """
    direction = unit_direction(axis)
    if direction is None:
        raise RosyError(
            f"axis {tuple(axis)} is not a direction: give three finite numbers that are not all zero"
        )
    normal = surface.face_normal
    vectors = direction - (normal @ direction)[:, None] * normal
    vectors[~normal.any(axis=1) | (np.linalg.norm(vectors, axis=1) < MIN_PROJECTION)] = 0.0
    return RosyField(degree, vectors)

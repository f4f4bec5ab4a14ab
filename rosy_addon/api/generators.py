"""Compute fields from a surface, or from guides on it."""

import os
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import RosyError, counted
from ..field.field import Field, check_same_surface
from ..field.formats.feature_edges import read_edges
from ..field.formats.sings import read_sings
from ..field.generate import GeneratorSettings, generate
from ..field.mesh_checks import orientation_warning
from ..field.surface import Surface
from .field import warn


def form(surface: Surface, degree: int = 4) -> Field:
    """Make a field that follows the form of the surface. It is the default of RoSy.

    It follows sharp edges and clear directions of curvature, and is smooth between them.
    Curvature is averaged over a distance that depends on the noise of the mesh.

    Parameters
    ----------
    surface : Surface
    degree : int
        N, from 1 to 12.

    Raises
    ------
    RosyError
        If the degree is not supported, or there is not enough memory.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> rf.form(torus)
    <Field: 4-RoSy field on <Surface 'torus.obj': 288 faces, 288 vertices>>
    """
    return generated(surface, GeneratorSettings("form"), degree)


def smoothest(surface: Surface, degree: int = 4) -> Field:
    """Make the field of the lowest Dirichlet energy, which has few singularities.

    Method: Knöppel, Crane, Pinkall and Schröder, "Globally Optimal Direction Fields"
    (SIGGRAPH 2013).

    Parameters
    ----------
    surface : Surface
    degree : int
        N, from 1 to 12.

    Raises
    ------
    RosyError
        If the degree is not supported, or there is not enough memory.

    Examples
    --------
    >>> import rosyfields as rf
    >>> cube = rf.Surface(
    ...     [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    ...     [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
    ... )
    >>> field = rf.smoothest(cube)
    >>> int(field.singularities.index.sum()) == field.degree * cube.euler_characteristic
    True
    """
    return generated(surface, GeneratorSettings("smoothest"), degree)


def curvature(surface: Surface, degree: int = 4, *, reach: float = 0.0) -> Field:
    """Make a field along the principal directions of curvature.

    The magnitude of the field says how well the directions are defined, from 0 to 1.

    Parameters
    ----------
    surface : Surface
    degree : int
        N, an even number.
    reach : float
        Distance over which clear directions extend into parts of the surface without clear directions, as a
        fraction of the size of the mesh (the diameter of a ball). At 0, each face has its own directions.

    Raises
    ------
    RosyError
        If the degree is odd or not supported, or there is not enough memory.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> field = rf.curvature(torus, degree=2, reach=0.02)
    >>> field.degree
    2
    """
    return generated(surface, GeneratorSettings("curvature", reach=float(reach)), degree)


def features(
    surface: Surface,
    degree: int = 4,
    *,
    sharp_angle: float = np.pi / 6,
    edges: ArrayLike | str | os.PathLike[str] | None = None,
) -> Field:
    """Make a field along borders and sharp edges that is smooth between them.

    Parameters
    ----------
    surface : Surface
    degree : int
        N, from 1 to 12.
    sharp_angle : float
        Smallest angle in radians between the normals of the two faces of a sharp edge.
    edges : (E, 2) array_like of int, or path-like, optional
        Pairs of vertices: edges that the field follows instead of borders and sharp edges. Or a file of
        edges: ``.sharp`` of QuadWild, or ``.feature`` of TriCrossField.

    Raises
    ------
    RosyError
        If the mesh has neither borders nor sharp edges, or no pair in `edges` is an edge of the mesh. Pairs
        that are not an edge are ignored as long as there are others.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> rf.features(torus, edges=[[0, 1], [1, 2], [2, 3]]).degree
    4
    """
    followed = _edge_ends(surface, edges)
    settings = GeneratorSettings("features", sharp_angle=float(sharp_angle), edges=followed)
    return generated(surface, settings, degree)


def guided(
    surface: Surface,
    degree: int = 4,
    *,
    strokes: Sequence[ArrayLike] = (),
    vectors: ArrayLike | Field | None = None,
    edges: ArrayLike | str | os.PathLike[str] | None = None,
    uv: bool = False,
    reach: float = 0.0,
    vectors_have_firmness: bool = False,
) -> Field:
    """Make a field that follows guides and is smooth between them.

    A face with several guides gets the mean of their directions, each taken as N equivalent directions.

    Parameters
    ----------
    surface : Surface
    degree : int
        N, from 1 to 12.
    strokes : sequence of (n, 3) array_like
        Polylines on the surface.
    vectors : (F, 3) array_like or Field, optional
        One vector (a member of the field) for each face, zero where there is no guide.
    edges : (E, 2) array_like of int, or path-like, optional
        Pairs of vertices: edges of the mesh to follow. Or a file of edges, as for `features`.
    uv : bool
        Whether the field also follows the axes of the UV map of the surface.
    reach : float
        Distance over which guides are smoothed, as a fraction of the size of the mesh. At 0,
        the field meets them exactly.
    vectors_have_firmness : bool
        If true, the lengths of `vectors`, from 0 to 1, say how firmly the field follows them, as for guides
        that are combed in Blender. If false, the field follows all of them exactly.

    Raises
    ------
    RosyError
        If there is no guide, or the surface has no UV map.

    Examples
    --------
    >>> import rosyfields as rf
    >>> square = rf.Surface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> field = rf.guided(square, 2, strokes=[[[0.1, 0.2, 0], [0.9, 0.2, 0]]])
    >>> abs(field.vectors).round(6)
    array([[1., 0., 0.],
           [1., 0., 0.]])
    """
    settings = GeneratorSettings(
        "guided",
        reach=float(reach),
        edges=_edge_ends(surface, edges),
        strokes=[np.asarray(stroke, dtype=np.float64) for stroke in strokes],
        uv=uv_map(surface) if uv else None,
        vectors=_guide_vectors(surface, vectors, degree),
        vectors_have_firmness=vectors_have_firmness,
    )
    return generated(surface, settings, degree)


def _edge_ends(surface: Surface, edges: Any) -> np.ndarray | None:
    """Return the argument `edges` of `guided` as (E, 2) vertices at the ends of edges, or None if it is None.

    `edges` holds such pairs, or it is the path of a file of edges, which is read.
    """
    if isinstance(edges, (str, os.PathLike)):
        return read_edges(edges, surface)
    return None if edges is None else np.asarray(edges)


def _guide_vectors(surface: Surface, vectors: Any, degree: int) -> np.ndarray | None:
    """Return the argument `vectors` of `guided` as (F, 3) vectors, or None if it is None.

    Raises
    ------
    RosyError
        If they are a field of another surface or degree.
    """
    if isinstance(vectors, Field):
        check_same_surface(surface, vectors)
        if vectors.degree != degree:
            raise RosyError(
                f"{surface.name}: guides of degree {vectors.degree} cannot guide a field of degree "
                f"{degree}: convert them with to_degree"
            )
        vectors = vectors.vectors
    return None if vectors is None else np.asarray(vectors, dtype=np.float64)


def prescribed(
    surface: Surface,
    singularities: Mapping[int, float] | str | os.PathLike[str],
    degree: int | None = None,
    *,
    vectors: ArrayLike | Field | None = None,
    reach: float = 0.0,
    add_missing: bool = False,
) -> Field:
    """Make the smoothest field that has given singularities, and no other ones.

    Method: Crane, Desbrun and Schröder, "Trivial Connections on Discrete Surfaces" (SGP
    2010). On a closed surface, the sum of the indices, in units of 1/N, must be N times the Euler
    characteristic.

    Parameters
    ----------
    surface : Surface
    singularities : mapping of int to int or float, or path-like
        The indices of singularities by their vertices: whole numbers (int) are in units of 1/N, others
        (float or `Fraction`) are the index itself, such as 0.25. Or the path of a file of singularities
        (``.sings``).
    degree : int, optional
        N, from 1 to 12. By default the degree of the file, or 4.
    vectors : (F, 3) array_like or Field, optional
        Guides: one vector for each face, zero where there is no guide. On each connected part of the mesh,
        the whole field is rotated by one angle, which aligns it with the guides as well as possible. Without
        guides, it is aligned with the edges of the faces, or rotated as the smoothest field if N is odd.
    reach : float
        If it is above 0, the field also bends toward the guides. Their influence falls off over this
        distance, which is a fraction of the size of the mesh.
    add_missing : bool
        Whether to add singularities until the sum of the indices is N times the Euler characteristic, at
        vertices where the field stays smoothest.

    Raises
    ------
    RosyError
        If an index is no multiple of 1/N, the surface cannot have these singularities, the file cannot be
        read or is of another degree, or there is not enough memory.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> field = rf.prescribed(torus, {10: 0.25, 200: -0.25})
    >>> field.singularities.vertex.tolist(), field.singularities.index.tolist()
    ([10, 200], [1, -1])
    """
    if isinstance(singularities, Mapping):
        degree = 4 if degree is None else degree
        vertex, index = _whole_indices(surface, singularities, degree)
    else:
        path = os.fspath(singularities)
        own, vertex, index = read_sings(Path(path))
        if degree not in (None, own):
            raise RosyError(f"{path}: is of degree {own}, not {degree}: leave the degree out")
        degree = own
    settings = GeneratorSettings(
        "prescribed",
        singularities=(vertex, index),
        vectors=_guide_vectors(surface, vectors, degree),
        reach=float(reach),
        add_missing=add_missing,
    )
    return generated(surface, settings, degree)


def _whole_indices(
    surface: Surface, singularities: Mapping[int, float], degree: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the (K,) int64 vertices and indices of singularities, indices in units of 1 / `degree`.

    `singularities` has the index of each singularity by its vertex: an int is in units of 1 / `degree`,
    another number is the index itself.

    Raises
    ------
    RosyError
        If a vertex is not an integer, an index is not a multiple of 1 / `degree`, or one of them has more
        than 31 bits.
    """
    rows: list[tuple[int, int]] = []
    for vertex, index in singularities.items():
        if not (isinstance(vertex, Integral) and abs(vertex) < 2**31):
            raise RosyError(
                f"{surface.name}: has no vertex {vertex}: vertices are whole numbers below "
                f"{len(surface.vertices)}"
            )
        units = index if isinstance(index, Integral) else float(index) * degree
        if not (abs(units) < 2**31 and abs(units - round(units)) <= 1e-6 * degree):
            raise RosyError(
                f"{surface.name}: the index {index} at vertex {vertex} is not a multiple of 1/{degree}, or too "
                f"large: give 1 (int) or {1 / degree:g} (float) for 1/{degree}"
            )
        rows.append((int(vertex), round(units)))
    pairs = np.array(rows, dtype=np.int64).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def along_axis(surface: Surface, axis: Sequence[float] = (0.0, 0.0, 1.0), degree: int = 4) -> Field:
    """Make a field along a direction that is projected to the surface.

    The magnitude is the length of the projection. Where it is zero, the field is undefined.

    Parameters
    ----------
    surface : Surface
    axis : sequence of 3 floats
        The direction, of any length above 0.
    degree : int
        N, from 1 to 12.

    Raises
    ------
    RosyError
        If the axis is not three finite numbers, or all of them are 0.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> field = rf.along_axis(torus, (0, 1, 0), degree=1)
    >>> float(field.magnitude.max()) <= 1
    True
    """
    x, y, z = (float(component) for component in axis)
    return generated(surface, GeneratorSettings("axis", axis=(x, y, z)), degree)


def along_uv(surface: Surface, degree: int = 4) -> Field:
    """Make a field along the axes of the UV map of the surface.

    Members follow the direction in which u increases. If the degree N is a multiple of 4, the field is the
    one that is nearest to both axes of the map: where the angle between them is not a multiple of 360/N
    degrees, it deviates equally from both, by at most 90/N degrees. `from_directions` keeps axes that are not
    perpendicular.

    Raises
    ------
    RosyError
        If the surface has no UV map.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> rf.along_uv(torus).degree
    4
    """
    return generated(surface, GeneratorSettings("uv", uv=uv_map(surface)), degree)


#: Functions that generate fields, by the kind of the field.
GENERATOR_FUNCTIONS: dict[str, Callable[..., Field]] = {
    **{f.__name__: f for f in (form, smoothest, curvature, features, guided, prescribed)},
    "axis": along_axis,
    "uv": along_uv,
}


def uv_map(surface: Surface) -> np.ndarray:
    """Return (C, 2) texture coordinates of the corners.

    Raises
    ------
    RosyError
        If the surface has no UV map.
    """
    if surface.uv is None:
        raise RosyError(
            f"{surface.name}: has no UV map: give uv, or choose an .obj file that has one"
        )
    return surface.uv


def generated(surface: Surface, settings: GeneratorSettings, degree: int) -> Field:
    """Generate a field. Warn if it is undefined on faces, or if the faces are not consistently oriented."""
    warn(orientation_warning(surface), stacklevel=4)
    field = Field.of(surface, generate(surface, settings, degree))
    # On faces without area, the field is always undefined.
    has_area = surface.face_normal.any(axis=1)
    count = int((has_area & ~field.vectors.any(axis=1)).sum())
    if count:
        total = int(has_area.sum())
        where = "any face" if count == total else f"{count:,} of {counted(total, 'face')}"
        warn(
            f"{surface.name}: {settings.kind} gives no direction on {where}: choose another kind of "
            "field, such as form",
            stacklevel=4,
        )
    return field

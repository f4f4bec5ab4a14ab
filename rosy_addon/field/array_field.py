"""Make fields from named arrays at the vertices or faces of a surface, such as the results of simulations."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import RosyError, RosyWarning
from ..core.progress import progress, report
from .blocks import as_float64
from .field_io import field_from_raw
from .formats.mesh_with_field import DIRECTION
from .formats.polygons import RawField
from .frames import dot
from .polygon_arrays import mean_per_face
from .representation import from_representation, to_representation
from .rosy_field import MAX_DEGREE, RosyField, check_degree
from .surface import Surface
from .validate import (
    MAX_OUTLIER_FRACTION,
    STRICT,
    TOLERANCE_DEG,
    VectorPolicy,
    apply_nonfinite_policy,
    tangent_normals,
)

#: Degree of the field made from an array of vectors, if the caller gives none.
VECTOR_DEGREE = 1

#: Names of arrays that hold the normals of the surface, in lower case.
_NORMAL_NAMES = ("normal", "normals")

#: For the 9 elements of a symmetric 3 x 3 matrix, in row order: which of VTK's six components (XX YY ZZ XY YZ
#: XZ) each is.
_SYMMETRIC_ENTRIES = [0, 3, 5, 3, 1, 4, 5, 4, 2]

#: Largest difference between a tensor and its transpose, relative to the largest entry of the array.
_ASYMMETRY_TOLERANCE = 1e-3

#: The tangential part of a vector is only a rounding error if it is shorter than this fraction of the vector.
_NORMAL_VECTOR_SINE = 1e-6

_LABEL = "reading the field"


@dataclass(frozen=True, eq=False)
class SurfaceArrays:
    """A surface of V vertices and F faces, with named arrays of values at the vertices and at the faces.

    Attributes
    ----------
    name : str
        Name of the data in error messages, such as the path of the file.
    surface : Surface
    vertex_data, face_data : mapping of str to array_like
        Arrays with V rows (`vertex_data`) and with F rows (`face_data`), by their names. Arrays with another
        number of rows, and arrays that do not hold real numbers, are ignored.
    """

    name: str
    surface: Surface
    vertex_data: Mapping[str, Any]
    face_data: Mapping[str, Any]


class FieldArray(NamedTuple):
    """A named array of values at the vertices or at the faces of a surface (points or cells in VTK's words).

    Attributes
    ----------
    name : str
    domain : {"vertex", "face"}
    values : (n, ...) ndarray
        One row for each vertex or face.
    """

    name: str
    domain: str
    values: np.ndarray

    @property
    def columns(self) -> int:
        """Number of values at each vertex or face, such as 3 for vectors."""
        return int(np.prod(self.values.shape[1:]))

    def __str__(self) -> str:
        where = "points" if self.domain == "vertex" else "cells"
        return f"'{self.name}' ({len(self.values):,} {where} x {self.columns})"


def find_array(arrays: SurfaceArrays, name: str | None = None) -> FieldArray:
    """Return the array that a field is made from.

    Parameters
    ----------
    arrays : SurfaceArrays
    name : str, optional
        Name of the array. If an array at the vertices and one at the faces have the same name, it is
        "point:NAME" (vertices) or "cell:NAME" (faces). If no name is given, there must be exactly one
        array from which a field can be made (see `array_field`). Arrays of integers are then ignored,
        because they are usually labels or colors, and so are arrays of normals.

    Raises
    ------
    RosyError
        If there is no such array, or more than one. The message lists the arrays of the surface.
    """
    found = _all_arrays(arrays)
    if name is not None:
        return _array_of_name(arrays, found, name)
    candidates = [
        array
        for array in found
        if array.values.dtype.kind == "f"
        and array.name.lower() not in _NORMAL_NAMES
        and _can_be_field(arrays, array.columns)
    ]
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        raise RosyError(
            f"{arrays.name}: {len(candidates)} arrays can be a field: choose one by its name, with "
            f"--array on the command line: {_listed(candidates)}"
        )
    raise RosyError(
        f"{arrays.name}: has no array of vectors or tensors, only {_listed(found)}: read a field from "
        "a file, or generate one"
    )


def _all_arrays(arrays: SurfaceArrays) -> list[FieldArray]:
    """Return the arrays at the vertices, followed by the arrays at the faces."""
    found = []
    for domain, data, count in (
        ("vertex", arrays.vertex_data, len(arrays.surface.vertices)),
        ("face", arrays.face_data, arrays.surface.face_count),
    ):
        for name, given in data.items():
            values = np.asarray(given)
            if values.dtype.kind in "fiu" and values.shape[:1] == (count,):
                found.append(FieldArray(name, domain, values))
    return found


def _array_of_name(arrays: SurfaceArrays, listed: list[FieldArray], name: str) -> FieldArray:
    """Return the array with this name, out of the arrays `listed`.

    The name may have the prefix "point:" (vertices) or "cell:" (faces).
    """
    found = [array for array in listed if array.name == name]
    prefix, _, rest = name.partition(":")
    if not found and prefix in ("point", "cell"):
        domain = "vertex" if prefix == "point" else "face"
        found = [array for array in listed if (array.name, array.domain) == (rest, domain)]
    if len(found) > 1:
        raise RosyError(
            f"{arrays.name}: both points and cells have an array '{name}': choose 'point:{name}' or "
            f"'cell:{name}'"
        )
    if not found:
        raise RosyError(f"{arrays.name}: there is no array '{name}', only {_listed(listed)}")
    return found[0]


def _listed(arrays: list[FieldArray]) -> str:
    """Return a text that lists the names and shapes of arrays, for error messages."""
    return ", ".join(map(str, arrays)) or "the mesh"


def _can_be_field(arrays: SurfaceArrays, columns: int) -> bool:
    """Return whether a field can be made from an array with this number of values per vertex or face."""
    if columns == 2:
        return not np.ptp(arrays.surface.vertices[:, 2])
    return columns % 3 == 0 and 3 <= columns <= 3 * MAX_DEGREE


def array_field(
    arrays: SurfaceArrays,
    name: str | None = None,
    degree: int | None = None,
    policy: VectorPolicy = STRICT,
) -> RosyField:
    """Make a field from one of the arrays of a surface, or from the directions in a file that RoSy wrote.

    The number of values at each vertex or face determines what they mean:

    =======  ====================================================================================
    2        on a mesh with constant z: a member vector, z is 0
    3        a member vector
    6        a symmetric tensor, in VTK's order XX, YY, ZZ, XY, YZ, XZ; a `RosyWarning` says so
    9        a symmetric tensor, 3 x 3
    12 ...   3 N numbers: all N directions
    =======  ====================================================================================

    If nearly all vectors are tangent to the surface, they are treated like vectors of a field file; see
    `field.validate.validated_field`. Otherwise (velocities at the boundary of a volume, for example) all
    vectors are replaced by their tangential components. A vector at a vertex is projected to the plane of
    each face at that vertex. The projections at the corners of a face are then averaged in the RoSy
    representation. Tensors are restricted to the tangent planes of the faces; tensors at vertices are first
    averaged over the corners of each face.

    Parameters
    ----------
    arrays : SurfaceArrays
    name : str, optional
        Name of the array, with the prefix "point:" (vertices) or "cell:" (faces) if it occurs at both. If not
        given, the arrays direction_1 to direction_N at the faces are the N directions. Without these arrays,
        the only array from which a field can be made is taken (see `find_array`).
    degree : int, optional
        The degree N. If not given, it is `VECTOR_DEGREE` for member vectors. Tensors have degree 4.
    policy : VectorPolicy
        What to do about values that are not finite, and about vectors off the surface. With "error", member
        vectors are replaced by their tangential components.

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If there is no such array, or if the array holds scalars, tensors that are not symmetric, values
        that are not finite, or data for another degree. A velocity gradient or deformation gradient is not
        symmetric: use a symmetric tensor made from it, such as the rate of strain.
    """
    surface = arrays.surface
    if name is None and (rows := _stored_directions(arrays)) is not None:
        raw = RawField(rows, rows.shape[1], domain="face")
        return field_from_raw(raw, surface, degree, arrays.name, policy)
    found = find_array(arrays, name)
    array = f"array '{found.name}'"  # without the file, so that warnings are the same for all steps
    source = f"{arrays.name}: {array}"
    if not _can_be_field(arrays, found.columns):
        kind = "scalars" if found.columns == 1 else f"{found.columns} numbers for each element"
        raise RosyError(
            f"{source} has {kind}, a field needs vectors or tensors; the arrays are "
            f"{_listed(_all_arrays(arrays))}"
        )
    raw = _raw_field(found, source)
    degree = check_degree(raw.degree or VECTOR_DEGREE if degree is None else degree)
    if found.columns == 6:
        text = f"{array}: its components have no names; they are read in VTK's order XX, YY, ZZ, XY, YZ, XZ"
        warnings.warn(text, RosyWarning, stacklevel=3)
    report(0.0, _LABEL)
    if raw.tensors and raw.domain == "vertex":
        apply_nonfinite_policy(raw.values, source, "vertex", policy.nonfinite)
        means = mean_per_face(raw.values.reshape(-1, 9)[surface.corner_vertex], surface.face_start)
        raw = replace(raw, values=means.reshape(-1, 3, 3), domain="face")
    elif not raw.tensors and raw.values.shape[1] == 1:
        vectors = raw.values[:, 0]
        apply_nonfinite_policy(vectors, source, raw.domain, policy.nonfinite)
        tangential = None
        if policy.off_surface == "error":
            tangential = _tangential_on_faces(surface, vectors, raw.domain, degree)
        if tangential is not None:
            text = f"{array}: its vectors are off the surface; their tangential parts are read"
            warnings.warn(text, RosyWarning, stacklevel=3)
            raw = replace(raw, values=tangential[:, None], domain="face")
    with progress(0.5, 1.0):
        return field_from_raw(raw, surface, degree, source, policy)


def _stored_directions(arrays: SurfaceArrays) -> np.ndarray | None:
    """Return the (F, N, 3) directions of a file that RoSy wrote, whose arrays are called direction_1 ... N.

    The result is None if there are no such arrays.
    """
    rows: list[np.ndarray] = []
    while (values := arrays.face_data.get(f"{DIRECTION}{len(rows) + 1}")) is not None:
        rows.append(as_float64(np.asarray(values)))
        if rows[-1].shape != (arrays.surface.face_count, 3):
            return None
    return np.stack(rows, axis=1) if 0 < len(rows) <= MAX_DEGREE else None


def _raw_field(array: FieldArray, source: str) -> RawField:
    """Return the rows of an array as a `RawField` of vectors, directions or tensors.

    `source` is the name of the array in error messages.
    """
    count, columns = len(array.values), array.columns
    values = as_float64(array.values.reshape(count, columns))
    if columns == 2:
        values = np.pad(values, ((0, 0), (0, 1)))
    if columns == 6:
        values = values[:, _SYMMETRIC_ENTRIES]
    matrices = np.ascontiguousarray(values.reshape(count, -1, 3))
    if columns not in (6, 9):
        degree = None if matrices.shape[1] == 1 else matrices.shape[1]
        return RawField(matrices, degree, domain=array.domain)
    finite = matrices[np.isfinite(matrices).all(axis=(1, 2))]
    transposed = finite.swapaxes(1, 2)
    asymmetry, size = np.abs(finite - transposed).max(initial=0.0), np.abs(finite).max(initial=0.0)
    if asymmetry > _ASYMMETRY_TOLERANCE * size:
        raise RosyError(
            f"{source} has tensors that are not symmetric, by up to {asymmetry:.3g} of {size:.3g}: store "
            "the symmetric tensors or the vectors to draw"
        )
    matrices = (matrices + matrices.swapaxes(1, 2)) / 2
    return RawField(matrices, 4, domain=array.domain, tensors=True)


def _tangential_on_faces(
    surface: Surface, vectors: np.ndarray, domain: str, degree: int
) -> np.ndarray | None:
    """Return (F, 3) tangential components of vectors on the faces, or None if the vectors are tangent.

    `vectors` holds (V, 3) or (F, 3) member vectors of a field of degree `degree`, as `domain` is "vertex" or
    "face". They count as tangent if at most `MAX_OUTLIER_FRACTION` of them are off the tangent plane.
    Vectors at vertices are projected to the plane of each face and averaged as representations.
    """
    normal = tangent_normals(surface, domain)
    length = np.sqrt(dot(vectors, vectors))
    is_off = np.abs(dot(vectors, normal)) > np.sin(np.radians(TOLERANCE_DEG[domain])) * length
    if is_off.sum() <= MAX_OUTLIER_FRACTION * np.count_nonzero(length):
        return None
    if domain == "face":
        return _tangential(vectors, surface.face_normal)
    vectors = vectors[surface.corner_vertex]
    tangential = _tangential(vectors, surface.face_normal[surface.corner_face])
    x, y = surface.face_frames
    frames = x[surface.corner_face], y[surface.corner_face]
    mean = mean_per_face(to_representation(tangential, *frames, degree), surface.face_start)
    return from_representation(mean, x, y, degree)


def _tangential(vectors: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the (n, 3) projections of vectors to the planes with these unit normals.

    They are 0 for vectors that are parallel to the normal, and where the normal is zero.
    """
    tangential = vectors - dot(vectors, normal)[:, None] * normal
    is_parallel = dot(tangential, tangential) <= _NORMAL_VECTOR_SINE**2 * dot(vectors, vectors)
    return np.where(is_parallel[:, None] | ~normal.any(axis=1)[:, None], 0.0, tangential)

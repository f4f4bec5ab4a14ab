"""Read and write fields as plain tables of numbers: text, `.npy` and `.npz` files.

A row holds one of the N member vectors (3 numbers, or 2; see `vertex_frames.in_space`), all N directions (3 N
numbers), one direction of each line of a cross (6 numbers; see `directional_field.with_opposites`) or a
symmetric tensor (9 numbers).
"""

import io
import math
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import RosyError, counted
from ...core.file_io import read_bytes
from ...core.memory import check_memory
from ..blocks import as_float64
from ..directional_field import stored_directions
from ..rosy_field import MAX_DEGREE, RosyField, check_degree
from ..surface import Surface
from .polygons import Polygons, RawField
from .text_rows import is_number, read_rows

#: Largest difference between a symmetric matrix and its transpose, relative to its largest entry.
SYMMETRY_TOLERANCE = 1e-5

#: The functions of numpy that read the header of an `.npy` file, by the version of the format.
_NPY_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}

#: Names of the arrays of an `.npz` file that are the field, and of vertices and faces: those that RoSy writes,
#: and those of other programs.
_FIELD_NAMES, _MESH_NAMES = ("directions", "Q"), (("vertices", "faces"), ("V", "F"))


def read_text(path: Path) -> RawField:
    """Read a text file with rows of 2, 3, 3 N or 9 numbers.

    Numbers are separated by commas or white space. ``#`` starts a comment. The first line may have words or
    the number of rows, and each row may begin with its number, from 0 or 1. Rows of a center, two
    directions and their opposites, as in files of seamless parametrizations, are read without the center.

    Raises
    ------
    RosyError
        If the file cannot be read or holds no numbers, or if its rows differ in length.
    """
    rows = read_rows(path, data=read_bytes(path, reject_binary=True).replace(b",", b" "))
    if len(rows) and not any(map(is_number, rows.words[0])):
        rows = rows[1:]
    header_count = None
    if len(rows) > 1 and len(rows.words[0]) == 1 and rows.words[0][0].isdigit():
        header_count, rows = int(rows.words[0][0]), rows[1:]
    if not len(rows):
        raise RosyError(f"{path}: contains no numbers")
    columns = len(rows.words[0])
    _check_columns(str(path), columns - (columns % 3 == 1))
    for row, words in enumerate(rows.words):
        if len(words) != columns:
            found = counted(len(words), "number")
            raise rows.error(row, f"the row has {found}, the rows above have {columns}")
    values = rows.floats("part of a vector").reshape(-1, columns)
    if columns == 15 and not (values[:, 3:9] + values[:, 9:]).any():
        values = values[:, 3:]
    return replace(raw_field(values, str(path)), header_count=header_count)


def read_npy(path: Path) -> RawField:
    """Read an `.npy` array of shape (n, 2), (n, 3), (n, 3 N), (n, N, 3) or, for tensors, (n, 3, 3).

    Raises
    ------
    RosyError
        If the file cannot be read, or does not contain an array of real numbers with such a shape.
    """
    return _array_field(_load_npy(read_bytes(path), str(path)), str(path))


def _load_npy(data: bytes, source: str) -> Any:
    """Return the array of an `.npy` file, given its contents; `source` is its name in messages."""
    try:
        file = io.BytesIO(data)
        version = np.lib.format.read_magic(file)
        if version in _NPY_HEADERS:
            # numpy allocates what the header declares, even if the file contains less.
            shape, _, dtype = _NPY_HEADERS[version](file)
            if math.prod(shape) * dtype.itemsize > len(data):
                raise ValueError(f"it declares the shape {shape}, which is more than it contains")
        return np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as reason:  # numpy evaluates the header as Python, which can raise any error
        line = (str(reason).splitlines() or [type(reason).__name__])[0]
        raise RosyError(f"{source}: is not a valid .npy file of numbers: {line}") from None


def _array_field(values: Any, source: str) -> RawField:
    """Return an array of shape (n, 2), (n, 3 N), (n, N, 3) or (n, 3, 3) as a `RawField`.

    `source` is the name of the array in messages.
    """
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        raise RosyError(f"{source}: does not contain an array of real numbers")
    if values.ndim not in (2, 3) or not len(values) or (values.ndim == 3 and values.shape[2] != 3):
        raise RosyError(
            f"{source}: expected an array of shape (n, 3 N) or (n, N, 3), found {values.shape}"
        )
    return raw_field(as_float64(values.reshape(len(values), -1)), source)


def read_npz(path: Path) -> RawField:
    """Read an `.npz` archive of arrays: rows for a field, and the mesh if it has one.

    The field is the array "directions" or "Q", or else the only one of shape (n, 3 N) or (n, N, 3) of
    floating-point numbers. The arrays of the mesh are "vertices" and "faces", or "V" and "F". If the field is
    an array of members, the number "degree" is N.

    Raises
    ------
    RosyError
        If the file cannot be read, has no array for a field, or several.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(read_bytes(path))) as archive:
            names = [name for name in archive.namelist() if name.endswith(".npy")]
            size = sum(archive.getinfo(name).file_size for name in names)
            check_memory(size, f"{path}", "choose a smaller file")
            files = {name.removesuffix(".npy"): archive.read(name) for name in names}
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as reason:
        raise RosyError(f"{path}: is not a valid .npz file: {reason}") from None
    arrays = {name: _load_npy(data, f"{path}, {name}") for name, data in files.items()}
    mesh = next((pair for pair in _MESH_NAMES if all(name in arrays for name in pair)), ())
    rows = {
        name: values
        for name, values in arrays.items()
        if name not in mesh and values.dtype.kind == "f" and _has_vectors(values.shape)
    }
    name = next((name for name in _FIELD_NAMES if name in rows), None)
    if name is None:
        if len(rows) != 1:
            found = ", ".join(f"'{name}' {each.shape}" for name, each in (rows or arrays).items())
            fault = "several arrays can be the field" if rows else "no array can be the field"
            advice = f"call it '{_FIELD_NAMES[0]}'"
            raise RosyError(f"{path}: {fault}; {advice}: {found or 'it is empty'}")
        (name,) = rows
    raw = _array_field(rows[name], f"{path}, {name}")
    degree = arrays.get("degree", np.empty(0))
    if degree.shape == () and degree.dtype.kind in "iu" and raw.values.shape[1] in (1, int(degree)):
        raw = replace(raw, degree=check_degree(int(degree)))
    polygons = _polygons(*(arrays[name] for name in mesh)) if mesh else None
    # RoSy itself writes directions of faces, also if there are as many vertices.
    return replace(raw, polygons=polygons, domain="face" if name == _FIELD_NAMES[0] else None)


def _has_vectors(shape: tuple[int, ...]) -> bool:
    """Return whether an array has rows of vectors: (n, 3 N) or (n, N, 3)."""
    is_table = len(shape) == 2 and shape[1] % 3 == 0 and shape[1] > 0
    return is_table or (len(shape) == 3 and shape[2] == 3 and shape[1] > 0)


def _polygons(vertices: np.ndarray, faces: np.ndarray) -> Polygons | None:
    """Return the mesh of two arrays; None if they are not (V, 3) points and (F, k) indices of vertices."""
    if vertices.shape[1:] != (3,) or faces.ndim != 2 or faces.dtype.kind not in "iu":
        return None
    if faces.shape[1] < 3 or not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        return None
    face_start = np.arange(len(faces) + 1) * faces.shape[1]
    return Polygons(as_float64(vertices), faces.ravel().astype(np.int64), face_start)


def read_guide_strokes(path: Path) -> list[np.ndarray]:
    """Read guide strokes from a text file: rows x y z, with an empty line between two strokes.

    Returns
    -------
    list of (n, 3) float64 ndarray
        The points of each stroke (a polyline), in the space of the mesh (object space). Strokes with a
        single point are left out.

    Raises
    ------
    RosyError
        If the file is missing, is malformed, or has no stroke of at least two points.
    """
    path = Path(path)
    rows = read_rows(path)
    points = rows.points("point")
    # `TextRows` has no empty lines, so a gap in the line numbers separates two strokes.
    ends = np.flatnonzero(np.diff(rows.line_numbers) > 1) + 1
    strokes = [stroke for stroke in np.split(points, ends) if len(stroke) > 1]
    if not strokes:
        raise RosyError(
            f"{path}: contains no stroke: a stroke is two or more consecutive rows x y z"
        )
    return strokes


def npy_bytes(surface: Surface, field: RosyField) -> bytes:
    """Return the contents of an `.npy` file that stores all directions of a field as an array (F, 3 N)."""
    file = io.BytesIO()
    np.save(file, stored_directions(surface, field).reshape(surface.face_count, -1))
    return file.getvalue()


def _check_columns(source: str, columns: int) -> None:
    """Raise a `RosyError` unless `columns` is 2, or 3 N for a degree N from 1 to `MAX_DEGREE`.

    It is the count of numbers in each row. `source` is the name of the file in the message.
    """
    if columns != 2 and (columns % 3 or not 3 <= columns <= 3 * MAX_DEGREE):
        raise RosyError(
            f"{source}: has {counted(columns, 'number')} per row, expected 3 for each of up to {MAX_DEGREE} directions"
        )


def raw_field(values: np.ndarray, source: str, flags: bool = False) -> RawField:
    """Return the rows of a file as member vectors, directions or tensors.

    Rows of 9 values are tensors if all of them are symmetric 3 x 3 matrices, and 3 directions otherwise. A first
    column that numbers the rows from 0 or 1 is left out.

    Parameters
    ----------
    values : (n, k) float64 ndarray
        At least one row.
    source : str
        Name of the file, for messages.
    flags : bool
        Whether a first column of the numbers 0 and 1 is left out as well.

    Raises
    ------
    RosyError
        If the other columns are not 2 numbers, or 3 N for a degree N from 1 to `MAX_DEGREE`.
    """
    if values.shape[1] % 3 == 1:
        first = values[:, 0]
        is_number = first[0] in (0, 1) and (first - first[0] == np.arange(len(first))).all()
        if is_number or (flags and np.isin(first, (0, 1)).all()):
            values = values[:, 1:]
    _check_columns(source, values.shape[1])
    matrices = values.reshape(len(values), -1, 2 if values.shape[1] == 2 else 3)
    if values.shape[1] == 9 and _are_symmetric(matrices):
        return RawField(matrices, 4, tensors=True)
    return RawField(matrices)


def _are_symmetric(matrices: np.ndarray) -> bool:
    """Return whether all (n, 3, 3) matrices are symmetric; matrices that are not finite are ignored."""
    matrices = matrices[np.isfinite(matrices).all(axis=(1, 2))]
    scale = np.abs(matrices).max(axis=(1, 2), keepdims=True, initial=0.0)
    matrices = matrices / np.where(scale > 0, scale, 1.0)
    asymmetry = np.abs(matrices - matrices.swapaxes(1, 2))
    return len(matrices) > 0 and bool((asymmetry <= SYMMETRY_TOLERANCE).all())

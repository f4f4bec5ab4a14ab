"""Read and write fields as plain tables of numbers: text and `.npy` files.

A row holds one of the N member vectors (3 numbers), all N directions (3 N numbers) or a symmetric tensor (9
numbers).
"""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np

from ...core.errors import RosyError, counted
from ...core.file_io import read_bytes
from ..blocks import as_float64
from ..rosy_field import MAX_DEGREE
from .polygons import RawField
from .text_rows import read_rows

#: Largest difference between a symmetric matrix and its transpose, relative to its largest entry.
SYMMETRY_TOLERANCE = 1e-5

#: The functions of numpy that read the header of an `.npy` file, by the version of the format.
_NPY_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def read_text(path: Path) -> RawField:
    """Read a text file with rows of 3, 3 N or 9 numbers.

    Numbers are separated by commas or white space. ``#`` starts a comment.

    Raises
    ------
    RosyError
        If the file cannot be read or holds no numbers, or if its rows differ in length.
    """
    rows = read_rows(path, data=read_bytes(path, reject_binary=True).replace(b",", b" "))
    if not len(rows):
        raise RosyError(f"{path}: contains no numbers")
    columns = len(rows.words[0])
    _check_columns(str(path), columns)
    for row, words in enumerate(rows.words):
        if len(words) != columns:
            raise rows.error(
                row, f"the row has {counted(len(words), 'number')}, the rows above have {columns}"
            )
    return _raw_field(rows.floats("part of a vector").reshape(-1, columns))


def _check_npy_size(data: bytes) -> None:
    """Raise `ValueError` if the header of an `.npy` file declares more data than the file contains."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version in _NPY_HEADERS:
        shape, _, dtype = _NPY_HEADERS[version](file)
        if math.prod(shape) * dtype.itemsize > len(data):
            raise ValueError(f"it declares the shape {shape}, which is more than it contains")


def read_npy(path: Path) -> RawField:
    """Read an `.npy` array of shape (n, 3), (n, 3 N), (n, N, 3) or, for tensors, (n, 3, 3).

    Raises
    ------
    RosyError
        If the file cannot be read, or does not contain an array of real numbers with such a shape.
    """
    data = read_bytes(path)
    try:
        _check_npy_size(data)
        values = np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as reason:  # numpy evaluates the header as Python, which can raise any error
        message_lines = str(reason).splitlines() or [type(reason).__name__]
        raise RosyError(
            f"{path}: is not a valid .npy file of numbers: {message_lines[0]}"
        ) from None
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        raise RosyError(f"{path}: does not contain an array of real numbers")
    if values.ndim not in (2, 3) or not len(values) or (values.ndim == 3 and values.shape[2] != 3):
        raise RosyError(
            f"{path}: expected an array of shape (n, 3 N) or (n, N, 3), found {values.shape}"
        )
    values = as_float64(values.reshape(len(values), -1))
    _check_columns(str(path), values.shape[1])
    return _raw_field(values)


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


def npy_bytes(directions: np.ndarray) -> bytes:
    """Return the contents of an `.npy` file that stores (F, N, 3) directions as an array (F, 3 N)."""
    file = io.BytesIO()
    np.save(file, directions.reshape(len(directions), -1))
    return file.getvalue()


def _check_columns(source: str, columns: int) -> None:
    """Raise a `RosyError` unless a row has 3 N numbers for a degree N from 1 to `MAX_DEGREE`."""
    if columns % 3 or not 3 <= columns <= 3 * MAX_DEGREE:
        raise RosyError(
            f"{source}: has {counted(columns, 'number')} per row, expected 3 for each of up to {MAX_DEGREE} "
            "directions"
        )


def _raw_field(values: np.ndarray) -> RawField:
    """Return (n, k) values as a `RawField` of member vectors, directions or tensors.

    Rows of 9 values are tensors if all of them are symmetric 3 x 3 matrices, and 3 directions otherwise.
    """
    matrices = values.reshape(len(values), -1, 3)
    if values.shape[1] == 9 and _are_symmetric(matrices):
        return RawField(matrices, 4, tensors=True)
    return RawField(matrices, None if values.shape[1] == 3 else values.shape[1] // 3)


def _are_symmetric(matrices: np.ndarray) -> bool:
    """Return whether all (n, 3, 3) matrices are symmetric; matrices that are not finite are ignored."""
    matrices = matrices[np.isfinite(matrices).all(axis=(1, 2))]
    scale = np.abs(matrices).max(axis=(1, 2), keepdims=True, initial=0.0)
    matrices = matrices / np.where(scale > 0, scale, 1.0)
    asymmetry = np.abs(matrices - matrices.swapaxes(1, 2))
    return len(matrices) > 0 and bool((asymmetry <= SYMMETRY_TOLERANCE).all())

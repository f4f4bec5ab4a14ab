"""Plain numbers: text, and numpy's `.npy`, of one member, all directions or a tensor a row."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from ...errors import RosyError
from ...files import read_bytes
from ..rosy_field import MAX_DEGREE
from .given import Given
from .rows import lines, read_rows

#: How far, of its largest entry, a matrix may be from its transpose and be called symmetric.
SYMMETRIC = 1e-5


def read_text(path: Path) -> Given:
    """Rows of 3, 3 N or 9 numbers, with commas or white space between; # begins a comment."""
    data = read_bytes(path, text=True).replace(b",", b" ")
    rows = read_rows(path, data=data)
    if not len(rows):
        raise RosyError(f"{path}: holds no numbers")
    columns = len(rows.words[0])
    _check_columns(str(path), columns)
    for row, words in enumerate(rows.words):
        if len(words) != columns:
            raise rows.error(row, f"has {len(words)} numbers, the rows above have {columns}")
    return _given(rows.floats("part of a vector").reshape(-1, columns))


def read_npy(path: Path) -> Given:
    """An array (n, 3), (n, 3 N), (n, N, 3) or, of symmetric tensors, (n, 3, 3)."""
    data = read_bytes(path)
    try:
        values = np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as reason:  # its header is read as Python, and may fail in any way
        what = str(reason).splitlines() or [type(reason).__name__]
        raise RosyError(f"{path}: is no .npy file of numbers: {what[0]}") from None
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        raise RosyError(f"{path}: holds no array of real numbers")
    if values.ndim not in (2, 3) or not len(values) or (values.ndim == 3 and values.shape[2] != 3):
        raise RosyError(f"{path}: holds an array {values.shape}; (n, 3 N) or (n, N, 3) is wanted")
    values = values.reshape(len(values), -1).astype(np.float64)
    _check_columns(str(path), values.shape[1])
    return _given(values)


def text_of(directions: np.ndarray) -> str:
    """A text file of (F, N, 3) directions."""
    return "\n".join([*lines(directions.reshape(len(directions), -1)), ""])


def npy_bytes(directions: np.ndarray) -> bytes:
    """An `.npy` file of (F, N, 3) directions, as (F, 3 N)."""
    file = io.BytesIO()
    np.save(file, np.ascontiguousarray(directions.reshape(len(directions), -1)))
    return file.getvalue()


def _check_columns(source: str, columns: int) -> None:
    if columns % 3 or not 3 <= columns <= 3 * MAX_DEGREE:
        raise RosyError(
            f"{source}: has {columns} numbers a row; wanted 3 for each of up to {MAX_DEGREE} "
            "directions"
        )


def _given(values: np.ndarray) -> Given:
    matrices = values.reshape(len(values), -1, 3)
    if values.shape[1] == 9:
        uneven = np.abs(matrices - matrices.swapaxes(1, 2)).max(axis=(1, 2))
        if (uneven <= SYMMETRIC * np.abs(matrices).max(axis=(1, 2))).all():
            return Given(matrices, 4, tensors=True)
    return Given(matrices, None if values.shape[1] == 3 else values.shape[1] // 3)

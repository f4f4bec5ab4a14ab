"""Read `.dmat` files, the matrices of libigl, as text or binary."""

from pathlib import Path

import numpy as np

from ...core.errors import RosyError
from ...core.file_io import read_bytes
from ..blocks import as_float64
from .plain import raw_field
from .polygons import RawField
from .text_rows import read_rows


def read_dmat(path: Path) -> RawField:
    """Read a matrix of libigl with a row of 3, 3 N or 9 numbers for each face or vertex.

    The numbers are one member vector, all N directions or a symmetric tensor, as in `plain.read_text`. A
    first column that holds row numbers, or flags 0 and 1, is ignored.

    Raises
    ------
    RosyError
        If the file cannot be read or is malformed, or if its rows are no vectors.
    """
    header, _, rest = read_bytes(path).partition(b"\n")
    is_binary = header.split() == [b"0", b"0"]
    if is_binary:
        header, _, rest = rest.partition(b"\n")
    words = header.split()
    if len(words) != 2 or not all(word.isdigit() for word in words):
        raise RosyError(f"{path}: expected the numbers of columns and of rows at its beginning")
    columns, count = map(int, words)
    if is_binary:
        values = np.frombuffer(rest, "<f8", min(columns * count, len(rest) // 8))
    else:
        values = read_rows(path, comment=None, data=b"\n" + rest).floats("entry of the matrix")
    if len(values) != columns * count:
        raise RosyError(f"{path}: declares {columns * count} numbers, but contains {len(values)}")
    if not count:
        raise RosyError(f"{path}: contains no numbers")
    return raw_field(as_float64(values.reshape(columns, count).T), str(path), flags=True)

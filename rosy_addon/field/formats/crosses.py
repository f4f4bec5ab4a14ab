"""Read crosses that are stored as two directions, one per line: `.crossfield`, `.ffield`, `.vfield`."""

from pathlib import Path

import numpy as np

from ...core.errors import RosyError, counted
from .polygons import RawField
from .text_rows import TextRows, is_number, read_rows


def read_crossfield(path: Path) -> RawField:
    """Read a `.crossfield` file of libigl: 2 and the number of rows, then rows of a flag and two directions.

    The flag says which directions were constraints. It is not read.

    Raises
    ------
    RosyError
        If the file cannot be read, or is malformed.
    """
    rows = read_rows(path)
    header = rows.words[0] if len(rows) else ()
    if len(header) != 2 or header[0] != b"2" or not header[1].isdigit():
        raise rows.error(0, "expected '2' and the number of rows")
    return _crosses(rows[1:], 7, int(header[1]), None)


def read_vcg_frames(path: Path) -> RawField:
    """Read an `.ffield` (faces) or `.vfield` (vertices) file of VCG: rows of two scales and two directions.

    The rows follow a line with their number and a line of column names. The scales are not read, as in VCG.

    Raises
    ------
    RosyError
        If the file cannot be read, or is malformed.
    """
    rows = read_rows(path)
    counts = [index for index, words in enumerate(rows.words[:3]) if len(words) == 1]
    if not counts or not rows.words[counts[0]][0].isdigit():
        raise rows.error(0, "expected the header of a frame field of VCG")
    first = counts[0] + 1
    if len(rows) > first and not any(map(is_number, rows.words[first])):
        first += 1
    count = int(rows.words[counts[0]][0])
    domain = "vertex" if path.suffix.lower() == ".vfield" else "face"
    return _crosses(rows[first:], 8, count, domain)


def _crosses(rows: TextRows, columns: int, count: int, domain: str | None) -> RawField:
    """Return the crosses whose two directions are the last six of `columns` numbers in each row.

    `count` is the number of rows that the header declares. `domain` says whether the rows belong to faces or
    vertices: "face", "vertex", or None to infer it from the number of rows.
    """
    if not len(rows):
        raise RosyError(f"{rows.path}: contains no rows of {columns} numbers")
    for row, words in enumerate(rows.words):
        if len(words) != columns:
            found = counted(len(words), "word")
            raise rows.error(row, f"expected {columns} numbers, found {found}")
    values = rows.floats("part of a vector").reshape(-1, columns)[:, -6:].reshape(-1, 2, 3)
    return RawField(np.concatenate([values, -values], axis=1), 4, count, domain)

"""Read and write `.rosy` files (one of the N vectors per row) and `.rawfield` files (N directions per row).

`.rawfield` is a format of the library Directional.
"""

from pathlib import Path

import numpy as np

from ...core.errors import RosyError, counted
from ..directional_field import stored_directions
from ..rosy_field import RosyField, check_degree
from ..surface import Surface
from .polygons import RawField
from .text_rows import TextRows, abbreviate, format_lines, read_rows


def read_rosy(path: Path) -> RawField:
    """Read a `.rosy` file: the number of rows, the degree N, and rows x y z.

    The first two numbers may be on one line or on two lines. Some programs write no degree.

    Raises
    ------
    RosyError
        If the file cannot be read, or is malformed.
    """
    rows = read_rows(path, comment=None)
    if len(rows) > 1 and len(rows.words[0]) == 1 and len(rows.words[1]) == 3:
        (count,) = _read_header(rows, "count")
        return RawField(_vector_table(rows, 3, count, 1).reshape(-1, 1, 3), None, count)
    count, degree = _read_header(rows, "count", "degree")
    return RawField(_vector_table(rows, 3, count).reshape(-1, 1, 3), degree, count)


def read_rawfield(path: Path) -> RawField:
    """Read a `.rawfield` file: the degree N, the number of rows, and rows of N vectors.

    Raises
    ------
    RosyError
        If the file cannot be read, or is malformed.
    """
    rows = read_rows(path, comment=None)
    degree, count = _read_header(rows, "degree", "count")
    return RawField(_vector_table(rows, 3 * degree, count).reshape(-1, degree, 3), degree, count)


def rosy_text(_: Surface, field: RosyField) -> str:
    """Return the text of a `.rosy` file with the member vectors of a field."""
    return f"{len(field.vectors)}\n{field.degree}\n{format_lines(field.vectors)}"


def rawfield_text(surface: Surface, field: RosyField) -> str:
    """Return the text of a `.rawfield` file with all directions of a field."""
    return f"{field.degree} {surface.face_count}\n{rows_text(surface, field)}"


def rows_text(surface: Surface, field: RosyField) -> str:
    """Return all directions of a field as text, with a row of 3 N numbers for each face."""
    return format_lines(stored_directions(surface, field).reshape(surface.face_count, -1))


def _read_header(rows: TextRows, *names: str) -> list[int]:
    """Return the integers at the beginning of a file, one for each of `names`. Two may be on one line or on two.

    `names`, one or two, are used in messages. The integer with the name "degree" must be a valid degree.
    """
    words = [word for line in rows.words[:2] for word in line]
    values = []
    for index, name in enumerate(names):
        try:
            number = int(words[index])
            values.append(check_degree(number) if name == "degree" else number)
        except IndexError:
            raise RosyError(f"{rows.path}: ends before the {name}") from None
        except ValueError as reason:  # also a `RosyError`
            text = f"expected the {name}, a whole number, found {abbreviate(words[index])}"
            text = str(reason) if isinstance(reason, RosyError) else text
            raise rows.error(rows.row_of_word(index), text) from None
    return values


def _vector_table(rows: TextRows, columns: int, count: int, header: int = 2) -> np.ndarray:
    """Return the numbers after the header as (n, columns) float64. Line breaks in the file are ignored.

    `count` is the number of rows that the header declares, for the error message. The header has `header`
    numbers.
    """
    row_count, remainder = divmod(sum(map(len, rows.words)) - header, columns)
    if remainder:
        raise RosyError(
            f"{rows.path}: declares {counted(count, 'row')} of {columns} numbers, but contains {row_count} and "
            "part of another"
        )
    return rows.floats("part of a vector")[header:].reshape(row_count, columns)

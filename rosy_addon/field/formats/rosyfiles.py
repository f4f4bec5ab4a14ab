"""`.rosy`, one member vector a row, and Directional's `.rawfield`, all N of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import RosyError
from ..rosy_field import RosyField, check_degree
from .given import Given
from .rows import Rows, lines, read_rows, shown


def read_rosy(path: Path) -> Given:
    """A count, N, and rows x y z; count and N on one line or on two."""
    rows = read_rows(path, comment=None)
    count, degree = _header(rows, "count", "degree")
    return Given(_table(rows, 3, count).reshape(-1, 1, 3), _degree(rows, 1, degree), count)


def read_rawfield(path: Path) -> Given:
    """N, a count, and rows of N vectors."""
    rows = read_rows(path, comment=None)
    degree, count = _header(rows, "degree", "count")
    degree = _degree(rows, 0, degree)
    return Given(_table(rows, 3 * degree, count).reshape(-1, degree, 3), degree, count)


def rosy_text(field: RosyField) -> str:
    """A `.rosy` file."""
    return "\n".join([str(len(field.vectors)), str(field.degree), *lines(field.vectors), ""])


def rawfield_text(directions: np.ndarray) -> str:
    """A `.rawfield` file of (F, N, 3) directions."""
    count, degree = directions.shape[:2]
    return "\n".join([f"{degree} {count}", *lines(directions.reshape(count, -1)), ""])


def _header(rows: Rows, *names: str) -> tuple[int, int]:
    """The first two numbers, on one line or on two."""
    words = [word for line in rows.words[:2] for word in line][:2]
    values = []
    for number, name in enumerate(names):
        try:
            values.append(int(words[number]))
        except IndexError:
            raise RosyError(f"{rows.path}: ends before the {name}") from None
        except ValueError:
            row = rows.row_of_word(number)
            found = shown(words[number])
            raise rows.error(row, f"found {found}, wanted the {name}, a whole number") from None
    return values[0], values[1]


def _degree(rows: Rows, word: int, degree: int) -> int:
    try:
        return check_degree(degree)
    except RosyError as reason:
        raise rows.error(rows.row_of_word(word), str(reason)) from None


def _table(rows: Rows, columns: int, count: int) -> np.ndarray:
    """(n, columns) the numbers after the header; lines may be broken anywhere."""
    found, rest = divmod(sum(map(len, rows.words)) - 2, columns)
    if rest:
        raise RosyError(
            f"{rows.path}: says {count} rows of {columns} numbers, but holds {found} and a part of "
            "one"
        )
    return rows.floats("part of a vector")[2:].reshape(found, columns)

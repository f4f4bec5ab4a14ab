"""Directional's `.sings` (also `.sing`): a degree, a count, and rows of an element and an index."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .rows import read_rows

#: How their names end.
SINGULARITIES = (".sings", ".sing")


def read_sings(path: Path) -> tuple[int, np.ndarray, np.ndarray]:
    """Read the singularities of a field.

    Returns
    -------
    degree : int
        N.
    element : (K,) int64 ndarray
        Vertices, of fields on faces.
    index : (K,) int64 ndarray
        In units of 1 / N.

    Raises
    ------
    RosyError
        If the file is missing, or holds anything else.
    """
    rows = read_rows(Path(path), comment=None)
    numbers = rows.ints("degree, count, elements and indices")
    if len(numbers) < 2 or len(numbers) != 2 + 2 * numbers[1]:
        said = numbers[1] if len(numbers) > 1 else "no"
        raise rows.error(
            len(rows), f"says {said} singularities, but holds {max(len(numbers) - 2, 0) / 2:g}"
        )
    return int(numbers[0]), numbers[2::2], numbers[3::2]


def sings_text(degree: int, element: np.ndarray, index: np.ndarray) -> str:
    """A `.sings` file."""
    rows = [f"{a} {b}" for a, b in zip(element.tolist(), index.tolist(), strict=True)]
    return "\n".join([f"{degree} {len(rows)}", *rows, ""])

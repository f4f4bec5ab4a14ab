"""Read and write the singularities of a field (`.sings` and `.sing` files of Directional).

A file holds the degree, the number of singularities, and for each a row with the mesh element (a vertex or a
face) and its singularity index.
"""

from pathlib import Path

import numpy as np

from ..rosy_field import RosyField
from ..singularities import find_singularities
from ..surface import Surface
from .text_rows import format_lines, read_rows

#: File name extensions of the format.
SINGULARITY_SUFFIXES = (".sings", ".sing")


def read_sings(path: Path) -> tuple[int, np.ndarray, np.ndarray]:
    """Read the singularities of a field.

    Returns
    -------
    degree : int
        N, the degree of the field.
    element : (K,) int64 ndarray
        Singular mesh elements, counted from 0: vertices if the field is on faces, faces if it is on vertices.
    index : (K,) int64 ndarray
        Singularity indices in units of 1 / N.

    Raises
    ------
    RosyError
        If the file is missing, or is not such a file.
    """
    rows = read_rows(Path(path), comment=None)
    numbers = rows.ints("degree, count, elements and indices")
    if len(numbers) < 2 or len(numbers) != 2 + 2 * int(numbers[1]):
        declared = numbers[1] if len(numbers) > 1 else "no"
        found = max(len(numbers) - 2, 0) / 2
        raise rows.error(len(rows), f"declares {declared} singularities, but contains {found:g}")
    return int(numbers[0]), numbers[2::2], numbers[3::2]


def sings_text(surface: Surface, field: RosyField) -> str:
    """Return the text of a `.sings` file with the singularities of a field."""
    rows = np.stack(find_singularities(surface, field), axis=1)
    return f"{field.degree} {len(rows)}\n{format_lines(rows)}"

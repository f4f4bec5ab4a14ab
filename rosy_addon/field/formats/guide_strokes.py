"""Read guide strokes from text: one point x y z per row, with an empty line between strokes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...core.errors import RosyError
from .text_rows import read_rows


def read_guide_strokes(path: Path) -> list[np.ndarray]:
    """Read the polylines of a guide stroke file.

    Returns
    -------
    list of (n, 3) float64 ndarray
        The points of each stroke, in the space of the mesh (object space). Strokes of a single
        point are left out.

    Raises
    ------
    RosyError
        If the file is missing, is not such a file, or has no stroke of at least two points.
    """
    path = Path(path)
    rows = read_rows(path)
    points = rows.points("point")
    # Rows leave out empty lines, so a gap in the line numbers separates two strokes.
    ends = np.flatnonzero(np.diff(rows.line_numbers) > 1) + 1
    strokes = [stroke for stroke in np.split(points, ends) if len(stroke) > 1]
    if not strokes:
        raise RosyError(
            f"{path}: contains no stroke: a stroke is two or more consecutive rows x y z"
        )
    return strokes

"""Lines drawn on a mesh, as text: rows x y z, with an empty line between one and the next."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import RosyError
from .rows import read_rows


def read_strokes(path: Path) -> list[np.ndarray]:
    """Read strokes.

    Returns
    -------
    list of (n, 3) float64 ndarray
        In the space of the mesh.

    Raises
    ------
    RosyError
        If the file is missing, holds anything else, or no stroke of two points.
    """
    path = Path(path)
    rows = read_rows(path)
    points = rows.points("point")
    # A line that is left out comes between.
    ends = np.flatnonzero(np.diff(rows.line) > 1) + 1
    strokes = [stroke for stroke in np.split(points, ends) if len(stroke) > 1]
    if not strokes:
        raise RosyError(f"{path}: holds no stroke: two rows x y z below each other are one")
    return strokes

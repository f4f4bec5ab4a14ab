"""Stereolithography .stl, text and binary: triangles whose equal corners become one vertex."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import RosyError
from ...files import read_bytes
from .polygons import Polygons
from .rows import Rows, read_rows

_HEADER = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path) -> Polygons:
    """Read an .stl file. Corners at exactly the same position share a vertex."""
    data = read_bytes(path)
    count = int.from_bytes(data[80:_HEADER], "little")
    # Some binary files begin with "solid" too: only their length tells.
    is_binary = len(data) == _HEADER + count * _TRIANGLE.itemsize
    if not is_binary and data.lstrip()[:5].lower() == b"solid" and b"\0" not in data[:_HEADER]:
        points = _text_points(path, data)
    else:
        points = _binary_points(path, data, count)
    with np.errstate(invalid="ignore"):  # signalling NaN; refused with the other ones
        points = points.astype(np.float64)
    vertices, corner_vertex = weld(points)
    return Polygons(vertices, corner_vertex, np.arange(0, len(points) + 1, 3))


def weld(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Make points at exactly the same place one.

    Returns
    -------
    vertices : (V, 3) ndarray
        In the order in which they first occur.
    index : (P,) int64 ndarray
        The vertex of each point.
    """
    points = points + 0.0  # -0 and 0 are one place
    order = np.lexsort(points.T)
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    # The sort is stable, so the first of each run of equals occurs first.
    first = order[is_new]
    rank = np.empty(len(first), dtype=np.int64)
    by_occurrence = np.argsort(first)
    rank[by_occurrence] = np.arange(len(first))
    index = np.empty(len(points), dtype=np.int64)
    index[order] = rank[np.cumsum(is_new) - 1]
    return points[first[by_occurrence]], index


def _binary_points(path: Path, data: bytes, count: int) -> np.ndarray:
    found = (len(data) - _HEADER) // _TRIANGLE.itemsize
    if len(data) < _HEADER or found < count:
        said = f"says {count} triangles" if len(data) >= _HEADER else "is no .stl file"
        raise RosyError(f"{path}: {said}, but ends after {max(found, 0)}")
    return np.frombuffer(data, _TRIANGLE, count, _HEADER)["points"].reshape(-1, 3)


def _text_points(path: Path, data: bytes) -> np.ndarray:
    rows = read_rows(path, comment=None, data=data)
    corners = [row for row, words in enumerate(rows.words) if words[0].lower() == b"vertex"]
    loops = sum(words[0].lower() == b"endloop" for words in rows.words)
    if len(corners) != 3 * loops:
        raise rows.error(
            corners[-1] if corners else len(rows),
            f"the file has {len(corners)} corners in {loops} whole triangles; is it truncated?",
        )
    chosen = Rows(
        path, [rows.words[row][1:] for row in corners], [rows.line[row] for row in corners]
    )
    return chosen.points("corner") if corners else np.zeros((0, 3))

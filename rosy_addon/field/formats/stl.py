"""Read stereolithography .stl files, text and binary, and merge corners at equal positions into vertices."""

from pathlib import Path

import numpy as np

from ...core.errors import RosyError, counted
from ...core.file_io import read_bytes
from ..blocks import as_float64
from .polygons import Polygons
from .text_rows import read_rows

#: Size of the header of a binary file, with the number of triangles in its last 4 bytes.
_HEADER_BYTES = 84
_TRIANGLE_DTYPE = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path) -> Polygons:
    """Read the triangles of an .stl file. Corners at exactly the same position share a vertex.

    Raises
    ------
    RosyError
        If the file cannot be read, or is malformed or truncated.
    """
    data = read_bytes(path)
    count = int.from_bytes(data[80:_HEADER_BYTES], "little")
    # Some binary files also begin with "solid" like text files. They are recognized by their size.
    is_text = data.lstrip()[:5].lower() == b"solid" and b"\0" not in data[:_HEADER_BYTES]
    if is_text and len(data) != _HEADER_BYTES + count * _TRIANGLE_DTYPE.itemsize:
        points = _text_points(path, data)
    else:
        points = _binary_points(path, data, count)
    vertices, corner_vertex = weld(as_float64(points))
    return Polygons(vertices, corner_vertex, np.arange(0, len(points) + 1, 3))


def weld(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge points that have exactly the same position.

    Parameters
    ----------
    points : (P, 3) float ndarray

    Returns
    -------
    vertices : (V, 3) ndarray
        The distinct points, in the order of their first occurrence.
    index : (P,) int64 ndarray
        For each point, the index of its vertex.
    """
    points = points + 0.0  # turns -0 into 0
    order = np.lexsort(points.T)
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    # The sort is stable, so each run of equal points begins with the first occurrence.
    first = np.empty_like(order)
    first[order] = order[is_new][np.cumsum(is_new) - 1]
    kept, index = np.unique(first, return_inverse=True)
    return points[kept], index


def _binary_points(path: Path, data: bytes, count: int) -> np.ndarray:
    """Return the (3 T, 3) float32 corners of the triangles of a binary file; T is the declared `count`."""
    found = (len(data) - _HEADER_BYTES) // _TRIANGLE_DTYPE.itemsize
    if len(data) < _HEADER_BYTES:
        raise RosyError(f"{path}: is not an .stl file: it is shorter than the header")
    if found < count:
        raise RosyError(f"{path}: declares {counted(count, 'triangle')}, but ends after {found}")
    return np.frombuffer(data, _TRIANGLE_DTYPE, count, _HEADER_BYTES)["points"].reshape(-1, 3)


def _text_points(path: Path, data: bytes) -> np.ndarray:
    """Return (3 T, 3) float64 corners of the triangles of a text file."""
    rows = read_rows(path, comment=None, data=data)
    is_corner = np.array([words[0].lower() == b"vertex" for words in rows.words], dtype=bool)
    corners = rows.select(is_corner, slice(1, None))
    loops = sum(words[0].lower() == b"endloop" for words in rows.words)
    if len(corners) != 3 * loops:
        row = np.flatnonzero(is_corner)[-1] if len(corners) else len(rows)
        found, complete = counted(len(corners), "corner"), counted(loops, "complete triangle")
        raise rows.error(row, f"the file has {found} in {complete}; is it truncated?")
    return corners.points("corner")

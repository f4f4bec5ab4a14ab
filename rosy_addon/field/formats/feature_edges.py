"""Read feature edges: `.sharp` files of QuadWild and `.feature` files of TriCrossField."""

import os
from pathlib import Path

import numpy as np

from ...core.errors import RosyError, counted
from ...core.file_io import read_bytes
from ..surface import Surface
from .text_rows import read_rows

#: The numbers in each row of a format: a face and one of its edges, in `.sharp` files after the type of the edge.
_COLUMNS = {".sharp": 3, ".feature": 2}
EDGE_SUFFIXES = tuple(_COLUMNS)


def read_edges(path: str | os.PathLike[str], surface: Surface) -> np.ndarray:
    """Read the feature edges of a mesh: the number of rows, and rows of a face and an edge, from 0.

    Edge k of a face is from its corner k to the next one.

    Returns
    -------
    (E, 2) int32 ndarray
        The vertices of each edge.

    Raises
    ------
    RosyError
        If the file cannot be read, is malformed, or names a face or an edge that the mesh does not have.
    """
    path = Path(path)
    columns = _COLUMNS.get(path.suffix.lower())
    if columns is None:
        raise RosyError(f"{path}: is not a file of edges: its name must end in .sharp or .feature")
    rows = read_rows(path, data=read_bytes(path, reject_binary=True).replace(b",", b" "))
    if not len(rows) or len(rows.words[0]) != 1:
        raise rows.error(0, "expected the number of edges")
    count, rows = rows[:1].ints("number of edges")[0], rows[1:]
    if count != len(rows):
        raise RosyError(f"{path}: declares {counted(int(count), 'edge')}, but contains {len(rows)}")
    rows.check_lengths(columns, "a row", "number", str(columns))
    words = [words[columns - 2 : columns] for words in rows.words]
    face, edge = rows.with_words(words).ints("face or edge").reshape(-1, 2).T
    is_face = (face >= 0) & (face < surface.face_count)
    sizes = np.diff(surface.face_start)[np.where(is_face, face, 0)]
    wrong = ~is_face | (edge < 0) | (edge >= sizes)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise rows.error(row, f"{surface.name} has no edge {edge[row]} of face {face[row]}")
    first = surface.face_start[face]
    corners = np.stack([first + edge, first + (edge + 1) % sizes], axis=1)
    return surface.corner_vertex[corners]

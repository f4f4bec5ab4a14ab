"""Read Wavefront .obj files: one function for vertices and faces, and one for texture coordinates.

Normals, materials and groups are ignored.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .polygons import Polygons, offsets_from_sizes
from .text_rows import ROWS_PER_BLOCK, TextRows, read_rows


def read_obj(path: Path) -> Polygons:
    """Read the vertices and faces (`v` and `f` lines) of an .obj file.

    Corners may have the forms v, v/vt, v//vn and v/vt/vn. A negative index counts back from the last vertex
    that is defined above the line.

    Raises
    ------
    RosyError
        If the file cannot be read, a line is malformed, or an index is out of range.
    """
    rows = read_rows(path)
    is_vertex, is_face = _is_kind(rows, b"v"), _is_kind(rows, b"f")
    vertices = rows.select(is_vertex, slice(1, 4)).points("vertex")
    corners = rows.select(is_face, slice(1, None))
    corners.check_lengths(3, "a face", "corner", "3 or more")
    rows, defined_above = _position_indices(corners), np.cumsum(is_vertex)[is_face]
    message = "a face refers to vertex {}, but the vertices"
    corner_vertex = _resolved(rows, "vertex of a face", defined_above, len(vertices), message)
    return Polygons(vertices, corner_vertex, offsets_from_sizes(list(map(len, corners.words))))


def _resolved(rows: TextRows, label: str, defined: np.ndarray, count: int, text: str) -> np.ndarray:
    """Return the indices in rows of a file, counted from 0; the file counts vertices (or `vt` lines) from 1.

    Parameters
    ----------
    rows : TextRows
        Rows of indices. A negative index counts back from the last vertex that is defined above the line.
    label : str
        Name of the indices in messages.
    defined : (rows,) int ndarray
        Number of vertices that are defined above each line.
    count : int
        Number of vertices in the whole file.
    text : str
        Beginning of the message about an index out of range, with a format field for the index.
    """
    index = rows.ints(label)
    defined = np.repeat(defined, list(map(len, rows.words)))
    result = np.where(index < 0, index + defined, index - 1)
    out_of_range = (result < 0) | (result >= count)
    if out_of_range.any():
        word = int(np.argmax(out_of_range))
        subject, row = text.format(index[word]), rows.row_of_word(word)
        raise rows.error(row, f"{subject} are numbered 1 to {count}")
    return result


def _is_kind(rows: TextRows, kind: bytes) -> np.ndarray:
    """Return (rows,) bool: whether the first word of each row is `kind`, such as b"v"."""
    return np.array([words[0] == kind for words in rows.words], dtype=bool)


def _position_indices(corners: TextRows) -> TextRows:
    """Return rows with only the position index v of each corner, which is written v, v/vt, v//vn or v/vt/vn."""
    rows: list[Sequence[bytes]] = []
    for start in range(0, len(corners), ROWS_PER_BLOCK):
        words = corners.words[start : start + ROWS_PER_BLOCK]
        joined = b"\n".join(b" ".join(row) for row in words)
        if b"/" in joined:
            lines = re.sub(rb"(?<=\d)/[-\d/]*(?=\s|$)", b"", joined).split(b"\n")
            words = [tuple(line.split()) for line in lines]
        rows += words
    return corners.with_words(rows)


def read_uv(path: Path) -> np.ndarray | None:
    """Read the texture coordinates (`vt` lines) of the corners of an .obj file.

    Returns
    -------
    (C, 2) float64 ndarray or None
        Texture coordinates (u, v) of each corner, in the order of `read_obj`; None if the file has none.

    Raises
    ------
    RosyError
        If only some of the corners have texture coordinates, or an index is out of range.
    """
    rows = read_rows(path)
    is_uv, is_face = _is_kind(rows, b"vt"), _is_kind(rows, b"f")
    if not is_uv.any():
        return None
    table = rows.select(is_uv, slice(1, 3))
    table.check_lengths(2, "a texture coordinate", "number", "2")
    uv = table.floats("texture coordinate").reshape(-1, 2)
    corners = rows.select(is_face, slice(1, None))
    words = [[(word + b"/").split(b"/")[1] for word in line] for line in corners.words]
    for row, line in enumerate(words):
        if not all(line):
            raise corners.error(row, "a corner has no texture coordinate")
    rows, defined_above = corners.with_words(words), np.cumsum(is_uv)[is_face]
    message = "a corner refers to texture coordinate {}, but they"
    return uv[_resolved(rows, "texture coordinate of a corner", defined_above, len(uv), message)]

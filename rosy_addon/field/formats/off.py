"""Read Object File Format (.off) text files: vertices and faces.

Colors, normals and texture coordinates, which variants of the format have, are ignored.
"""

import re
from pathlib import Path

import numpy as np

from ...core.errors import RosyError, counted
from .polygons import Polygons, offsets_from_sizes
from .text_rows import TextRows, abbreviate, read_rows

_KEYWORD = re.compile(rb"(ST)?C?N?OFF$", re.IGNORECASE)


def read_off(path: Path) -> Polygons:
    """Read a text .off file.

    The numbers of vertices and faces may be on the line of the keyword ``OFF`` or on the next line.
    Comments may be anywhere.

    Raises
    ------
    RosyError
        If the file cannot be read, is binary, malformed or truncated, or an index is out of range.
    """
    rows = _after_keyword(read_rows(path))
    if not len(rows):
        raise RosyError(f"{path}: ends before the numbers of vertices and faces")
    counts = rows[:1].ints("number of vertices, faces or edges")
    if len(counts) < 2 or counts.min() < 0:
        raise rows.error(0, "expected the numbers of vertices, faces and edges")
    vertex_count, face_count = counts[:2].tolist()
    body = rows[1:]
    if len(body) < vertex_count + face_count:
        raise RosyError(
            f"{path}: declares {counted(vertex_count, 'vertex', 'vertices')} and "
            f"{counted(face_count, 'face')}, but ends after {counted(len(body), 'row')}"
        )
    vertices = body[:vertex_count].points("vertex")
    return Polygons(vertices, *_faces(body[vertex_count : vertex_count + face_count], vertex_count))


def _after_keyword(rows: TextRows) -> TextRows:
    """Return the rows of an .off file from the row of counts on, without the keyword.

    The keyword is optional. The counts may be on the same line.
    """
    if not len(rows) or rows.words[0][0].isdigit():
        return rows
    keyword, *rest = rows.words[0]
    if not _KEYWORD.match(keyword):
        raise rows.error(0, f"expected OFF, found {abbreviate(keyword)}")
    if rest and rest[0].upper() == b"BINARY":
        raise rows.error(0, "binary .off files are not supported")
    return rows.with_words([rest, *rows.words[1:]]) if rest else rows[1:]


def _faces(rows: TextRows, vertex_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return `corner_vertex` and `face_start` of `Polygons`, given one row of text for each face.

    Raises
    ------
    RosyError
        If a row is malformed, or a vertex is not below `vertex_count`.
    """
    sizes = rows.with_words([words[:1] for words in rows.words]).ints("number of corners of a face")
    corner_words = []
    for row, (size, words) in enumerate(zip(sizes.tolist(), rows.words, strict=True)):
        if size < 3:
            raise rows.error(row, f"face {row} has {size} corners, expected 3 or more")
        if size >= len(words):
            found = len(words) - 1
            raise rows.error(row, f"face {row} declares {size} corners, but lists {found}")
        corner_words.append(words[1 : size + 1])
    corners = rows.with_words(corner_words)
    corner_vertex = corners.ints("vertex of a face")
    out_of_range = (corner_vertex < 0) | (corner_vertex >= vertex_count)
    if out_of_range.any():
        corner = int(np.argmax(out_of_range))
        row, vertex, last = corners.row_of_word(corner), corner_vertex[corner], vertex_count - 1
        text = f"a face refers to vertex {vertex}, but the vertices are numbered 0 to {last}"
        raise rows.error(row, text)
    return corner_vertex, offsets_from_sizes(sizes)

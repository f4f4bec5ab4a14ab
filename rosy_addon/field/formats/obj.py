"""Read Wavefront .obj files: vertices and faces, and texture coordinates separately.

Normals, materials and groups are ignored.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...errors import counted
from ...progress import progress, report
from .polygons import Polygons, offsets_from_sizes
from .text_rows import LABEL, ROWS_PER_BLOCK, TextRows, read_rows


def read_obj(path: Path) -> Polygons:
    """Read the vertices and faces (`v` and `f` lines) of an .obj file.

    Corners may have the forms v, v/vt, v//vn and v/vt/vn. Negative indices are relative to the last
    vertex above the line.

    Raises
    ------
    RosyError
        If the file cannot be read, a line is malformed, or an index is out of range.
    """
    with progress(0.0, 0.4):
        rows = read_rows(path)
    is_vertex, is_face = _is_kind(rows, b"v"), _is_kind(rows, b"f")
    vertex_rows = _select_rows(rows, is_vertex, 3)
    with progress(0.5, 0.6):
        vertices = vertex_rows.points("vertex")
    corners = _select_rows(rows, is_face)
    for row, words in enumerate(corners.words):
        if len(words) < 3:
            raise corners.error(
                row, f"a face has {counted(len(words), 'corner')}, expected 3 or more"
            )
    sizes = [len(words) for words in corners.words]
    with progress(0.6, 0.9):
        positions = _position_indices(corners)
    with progress(0.9, 1.0):
        index = positions.ints("vertex of a face")
    # A negative index is relative to the number of vertices above its line.
    vertices_so_far = np.cumsum(is_vertex)[is_face]
    corner_vertex = np.where(index < 0, index + np.repeat(vertices_so_far, sizes), index - 1)
    out_of_range = (corner_vertex < 0) | (corner_vertex >= len(vertices))
    if out_of_range.any():
        corner = int(np.argmax(out_of_range))
        raise corners.error(
            corners.row_of_word(corner),
            f"a face refers to vertex {index[corner]}, but the vertices are numbered 1 to {len(vertices)}",
        )
    return Polygons(vertices, corner_vertex, offsets_from_sizes(sizes))


def _is_kind(rows: TextRows, kind: bytes) -> np.ndarray:
    """(rows,) bool: whether the first word of each row is that of a kind."""
    return np.array([words[0] == kind for words in rows.words], dtype=bool)


def _select_rows(rows: TextRows, is_selected: np.ndarray, max_words: int | None = None) -> TextRows:
    """The selected rows without their first word, cut to at most `max_words` further words."""
    end = None if max_words is None else max_words + 1
    selected = np.flatnonzero(is_selected).tolist()
    return TextRows(
        rows.path,
        [rows.words[row][1:end] for row in selected],
        [rows.line_numbers[row] for row in selected],
    )


def _position_indices(corners: TextRows) -> TextRows:
    """Reduce corners v, v/vt, v//vn and v/vt/vn to v, the index of the position."""
    rows: list[Sequence[bytes]] = []
    for start in range(0, len(corners), ROWS_PER_BLOCK):
        report(start / len(corners), LABEL)
        words = corners.words[start : start + ROWS_PER_BLOCK]
        joined = b"\n".join(b" ".join(row) for row in words)
        if b"/" in joined:
            lines = re.sub(rb"(?<=\d)/[-\d/]*(?=\s|$)", b"", joined).split(b"\n")
            words = [tuple(line.split()) for line in lines]
        rows += words
    return TextRows(corners.path, rows, corners.line_numbers)


def read_uv(path: Path) -> np.ndarray | None:
    """Read the texture coordinates (`vt` lines) of the corners of an .obj file.

    Returns
    -------
    (C, 2) float64 ndarray or None
        One (u, v) for each corner, in the order of `read_obj`; None if the file has none.

    Raises
    ------
    RosyError
        If only some of the corners have texture coordinates, or an index is out of range.
    """
    rows = read_rows(path)
    is_uv, is_face = _is_kind(rows, b"vt"), _is_kind(rows, b"f")
    if not is_uv.any():
        return None
    table = _select_rows(rows, is_uv, 2)
    for row, words in enumerate(table.words):
        if len(words) < 2:
            raise table.error(row, "a texture coordinate has fewer than 2 numbers")
    uv = table.floats("texture coordinate").reshape(-1, 2)
    corners = _select_rows(rows, is_face)
    words = [[word.split(b"/")[1:2] for word in line] for line in corners.words]
    for row, line in enumerate(words):
        if not all(word and word[0] for word in line):
            raise corners.error(row, "a corner has no texture coordinate")
    uv_rows = TextRows(path, [[word[0] for word in line] for line in words], corners.line_numbers)
    index = uv_rows.ints("texture coordinate of a corner")
    coordinates_so_far = np.repeat(np.cumsum(is_uv)[is_face], [len(line) for line in words])
    uv_index = np.where(index < 0, index + coordinates_so_far, index - 1)
    out_of_range = (uv_index < 0) | (uv_index >= len(uv))
    if out_of_range.any():
        corner = int(np.argmax(out_of_range))
        raise uv_rows.error(
            uv_rows.row_of_word(corner),
            f"a corner refers to texture coordinate {index[corner]}, but they are numbered 1 to {len(uv)}",
        )
    return uv[uv_index]

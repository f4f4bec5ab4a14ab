"""Wavefront .obj: its vertices and faces; normals, textures and groups are left out."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from .polygons import Polygons, starts_of
from .rows import Rows, read_rows


def read_obj(path: Path) -> Polygons:
    """Read an .obj file: `v` and `f` lines, with v/vt/vn corners and negative (relative) indices."""
    rows = read_rows(path)
    kinds = [words[0] for words in rows.words]
    is_vertex = np.array([kind == b"v" for kind in kinds], dtype=bool)
    is_face = np.array([kind == b"f" for kind in kinds], dtype=bool)
    vertices = _chosen(rows, is_vertex, 3).points("vertex")
    corners = _chosen(rows, is_face)
    for row, words in enumerate(corners.words):
        if len(words) < 3:
            raise corners.error(row, f"a face has {len(words)} corners, at least 3 are wanted")
    sizes = [len(words) for words in corners.words]
    index = _without_slashes(corners).ints("vertex of a face")
    # A negative index counts back from the last vertex above its line.
    above = np.cumsum(is_vertex)[is_face]
    corner_vertex = np.where(index < 0, index + np.repeat(above, sizes), index - 1)
    wrong = (corner_vertex < 0) | (corner_vertex >= len(vertices))
    if wrong.any():
        corner = int(np.argmax(wrong))
        raise corners.error(
            corners.row_of_word(corner),
            f"a face refers to vertex {index[corner]}, there are {len(vertices)}, counted from 1",
        )
    return Polygons(vertices, corner_vertex, starts_of(sizes))


def _chosen(rows: Rows, choice: np.ndarray, most: int | None = None) -> Rows:
    """The chosen rows without their first word, and at most so many of the others."""
    end = None if most is None else most + 1
    chosen = np.flatnonzero(choice).tolist()
    return Rows(
        rows.path, [rows.words[row][1:end] for row in chosen], [rows.line[row] for row in chosen]
    )


def _without_slashes(corners: Rows) -> Rows:
    """Corners v, v/vt, v//vn or v/vt/vn as v alone."""
    joined = b"\n".join(b" ".join(words) for words in corners.words)
    if b"/" not in joined:
        return corners
    lines = re.sub(rb"(?<=\d)/[-\d/]*(?=\s|$)", b"", joined).split(b"\n")
    return Rows(corners.path, [line.split() for line in lines], corners.line)


def read_uv(path: Path) -> np.ndarray | None:
    """(C, 2) float64 texture coordinates of the corners of an .obj file; None if it has none.

    Raises
    ------
    RosyError
        If corners refer to coordinates that are not there, or only some have any.
    """
    rows = read_rows(path)
    is_uv = np.array([words[0] == b"vt" for words in rows.words], dtype=bool)
    is_face = np.array([words[0] == b"f" for words in rows.words], dtype=bool)
    if not is_uv.any():
        return None
    table = _chosen(rows, is_uv, 2)
    for row, words in enumerate(table.words):
        if len(words) < 2:
            raise table.error(row, "a texture coordinate has fewer than 2 numbers")
    uv = table.floats("texture coordinate").reshape(-1, 2)
    corners = _chosen(rows, is_face)
    words = [[word.split(b"/")[1:2] for word in line] for line in corners.words]
    for row, line in enumerate(words):
        if not all(word and word[0] for word in line):
            raise corners.error(row, "a corner has no texture coordinate")
    chosen = Rows(path, [[word[0] for word in line] for line in words], corners.line)
    index = chosen.ints("texture coordinate of a corner")
    above = np.repeat(np.cumsum(is_uv)[is_face], [len(line) for line in words])
    place = np.where(index < 0, index + above, index - 1)
    wrong = (place < 0) | (place >= len(uv))
    if wrong.any():
        corner = int(np.argmax(wrong))
        raise chosen.error(
            chosen.row_of_word(corner),
            f"a corner refers to texture coordinate {index[corner]}, there are {len(uv)}",
        )
    return uv[place]

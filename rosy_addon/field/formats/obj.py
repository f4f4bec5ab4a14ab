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

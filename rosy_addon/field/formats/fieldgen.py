"""Read and write the `.obj` files of fieldgen: a mesh with a vertex field in its comments.

The comments are ``# degree N``, a line ``# field i x y z`` with one of the N vectors of each vertex i, and a
line ``# singularity i s`` for each singular triangle i with the singularity index s, in full turns. Vertices
and triangles are counted from 1. Singularities are neither read nor written here.

fieldgen is the program of Knöppel, Crane, Pinkall and Schröder,
https://github.com/GeometryCollective/fieldgen.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np

from ...core.errors import RosyError, counted
from ...core.file_io import read_bytes
from ..corner_fans import corner_angles, corner_rotations
from ..frames import tangent_frame
from ..representation import (
    complex_bincount,
    face_representation,
    from_representation,
    power,
    unit_complex,
)
from ..rosy_field import RosyField, check_degree
from ..surface import Surface
from ..validate import vertex_normals
from .obj import read_obj
from .polygons import RawField
from .text_rows import format_lines, format_rows, read_rows


def read_fieldgen(path: Path) -> RawField:
    """Read the mesh and the field of a fieldgen file.

    Returns
    -------
    RawField
        One member vector for each vertex, and the mesh in `polygons`.

    Raises
    ------
    RosyError
        If the file cannot be read, is not an .obj mesh, has no degree, or does not have exactly one field
        line for each vertex.
    """
    data = read_bytes(path, reject_binary=True)
    polygons = read_obj(path)
    rows = read_rows(path, comment=None, data=data)
    degree, is_vertex_row = None, np.zeros(len(rows), dtype=bool)
    for row, words in enumerate(rows.words):
        if not words[0].startswith(b"#"):
            continue
        words = words[words[0] == b"#" :]
        kind = words[0].lstrip(b"#") if words else b""
        if kind == b"degree" and len(words) == 2 and degree is None:
            try:
                degree = check_degree(int(words[1]))
            except (ValueError, RosyError):
                continue  # a comment at the top of the file explains the format with such a line
        elif kind == b"field" and len(words) == 5 and words[1].isdigit():
            is_vertex_row[row] = True
    if degree is None or not is_vertex_row.any():
        raise RosyError(f"{path}: has no field: there are no lines '# field i x y z'")
    numbers = rows.select(is_vertex_row, slice(-4, None)).floats("part of a vector")
    numbers = numbers.reshape(-1, 4)
    vertex = numbers[:, 0].astype(np.int64) - 1
    count = len(polygons.vertices)
    if vertex.min() < 0 or vertex.max() >= count or len(np.unique(vertex)) != count:
        raise RosyError(
            f"{path}: expected one '# field' line for each of {count} vertices, found "
            f"{counted(len(vertex), 'line')} for vertices {vertex.min() + 1} to {vertex.max() + 1}"
        )
    values = np.zeros((count, 1, 3))
    values[vertex, 0] = numbers[:, 1:]
    return RawField(values, degree, domain="vertex", polygons=polygons)


def vertex_members(surface: Surface, field: RosyField) -> np.ndarray:
    """Return (V, 3) members of a field at the vertices, of length 1, or zero where their mean is zero.

    The vector of a vertex is the mean of the field on the faces around it, in the RoSy representation,
    weighted by corner angle.
    """
    angle, normal = corner_angles(surface), vertex_normals(surface)
    face, vertex = surface.corner_face, surface.corner_vertex
    rotation = power(corner_rotations(surface, normal[vertex]), field.degree)
    values = face_representation(surface, field)[face] * rotation * angle
    mean = unit_complex(complex_bincount(vertex, values, len(surface.vertices)))
    return from_representation(mean, *tangent_frame(normal), field.degree)


def fieldgen_text(surface: Surface, field: RosyField) -> str:
    """Return the text of a fieldgen file with a mesh and a field.

    `vertex_members` computes the vectors.
    """
    vertex, normal = surface.corner_vertex, vertex_normals(surface)
    member = vertex_members(surface, field)
    corners, starts = (vertex + 1).tolist(), surface.face_start.tolist()
    faces = (corners[start:stop] for start, stop in pairwise(starts))
    face_lines = (" ".join(f"{v}//{v}" for v in vertices) for vertices in faces)
    field_lines = enumerate(format_rows(member), 1)
    lines = [format_lines(surface.vertices, "v "), format_lines(normal, "vn ")]
    lines += [*(f"f {line}\n" for line in face_lines), f"# degree {field.degree}\n"]
    lines += (f"# field {number} {line}\n" for number, line in field_lines)
    return "".join(lines)

"""The `.obj` files of fieldgen: a mesh, and in its comments a field on the vertices.

``# degree N``, then ``# field i x y z`` for each vertex, one member of it, and
``# singularity i s`` for triangles, s in turns; all counted from 1. The program is that of Knöppel,
Crane, Pinkall and Schröder, https://github.com/GeometryCollective/fieldgen.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import RosyError
from ...files import read_bytes
from ..check import vertex_normals
from ..corners import corner_angles, corner_rotations
from ..frames import tangent_frame
from ..representation import (
    complex_sums,
    face_frames,
    from_representation,
    power,
    to_representation,
)
from ..rosy_field import RosyField, check_degree
from ..surface import Surface
from .given import Given
from .obj import read_obj
from .rows import Rows, lines, read_rows


def read_fieldgen(path: Path) -> Given:
    """Read mesh and field."""
    data = read_bytes(path, text=True)
    polygons = read_obj(path)
    rows = read_rows(path, comment=None, data=data)
    said = [
        (row, words[words[0] == b"#" :])
        for row, words in enumerate(rows.words)
        if words[0].startswith(b"#")
    ]
    degree, chosen = None, []
    for row, words in said:
        kind = words[0].lstrip(b"#") if words else b""
        if kind == b"degree" and len(words) == 2 and degree is None:
            try:
                degree = check_degree(int(words[1]))
            except (ValueError, RosyError):
                continue  # the explanation at the top has a line of this form
        elif kind == b"field" and len(words) == 5 and words[1].isdigit():
            chosen.append((row, words[1:]))
    if degree is None or not chosen:
        raise RosyError(f"{path}: is a mesh without a field: there are no lines '# field i x y z'")
    part = Rows(path, [words for _, words in chosen], [rows.line[row] for row, _ in chosen])
    numbers = part.floats("part of a vector").reshape(-1, 4)
    vertex = numbers[:, 0].astype(np.int64) - 1
    count = len(polygons.vertices)
    if vertex.min() < 0 or vertex.max() >= count or len(np.unique(vertex)) != count:
        raise RosyError(
            f"{path}: has {len(vertex)} lines '# field', for vertices {vertex.min() + 1} to "
            f"{vertex.max() + 1}; there are {count}, and one of each is wanted"
        )
    values = np.zeros((count, 1, 3))
    values[vertex, 0] = numbers[:, 1:]
    return Given(values, degree, domain="vertex", polygons=polygons)


def fieldgen_text(surface: Surface, field: RosyField) -> str:
    """Mesh and field as such a file: the mean RoSy of the faces around each vertex, unit."""
    count = len(surface.vertices)
    angle = corner_angles(surface)
    face, vertex = surface.corner_face, surface.corner_vertex
    normal = vertex_normals(surface)
    face_x, face_y = face_frames(surface)
    z = to_representation(field.vectors, face_x, face_y, field.degree)
    turn = power(corner_rotations(surface.face_normal, face_x, face, normal[vertex]), field.degree)
    mean = complex_sums(vertex, z[face] * turn * angle, count)
    size = np.abs(mean)
    mean = np.divide(mean, size, out=np.zeros_like(mean), where=size > 0)
    member = from_representation(mean, *tangent_frame(normal), field.degree)
    starts = surface.face_start
    corners = [f"{v}//{v}" for v in (vertex + 1).tolist()]
    return "\n".join(
        [
            *(f"v {line}" for line in lines(surface.vertices)),
            *(f"vn {line}" for line in lines(normal)),
            *(
                f"f {' '.join(corners[start:stop])}"
                for start, stop in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)
            ),
            f"# degree {field.degree}",
            *(f"# field {number} {line}" for number, line in enumerate(lines(member), 1)),
            "",
        ]
    )

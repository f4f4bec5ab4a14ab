"""Fields with given singularities: the files, and whether what was given is what is found."""

import warnings
from collections import Counter
from pathlib import Path

from numpy.random import Generator

from rosy_addon import api
from rosy_addon.core.errors import RosyError
from rosy_addon.field.formats.sings import SINGULARITY_SUFFIXES, read_sings

from .meshes import Polygons

#: Indices that no field can have.
_LARGE = (10**9, -(10**9), 2**31, 2**63 - 1, -(2**63), 10**30)


def singularity_bytes(rng: Generator, mesh: Polygons) -> bytes:
    """Return the contents of a `.sings` file for a mesh: in most cases a field can have these singularities."""
    points, faces = mesh
    degree = int(rng.choice([1, 2, 3, 4, 4, 4, 6, 12]))
    sides = Counter((face[i - 1], face[i]) for face in faces for i in range(len(face)))
    border = [(a, b) for (a, b), count in sides.items() if not count == sides[b, a] == 1]
    at_border = {vertex for side in border for vertex in side}
    free = sorted({vertex for face in faces for vertex in face} - at_border)
    free = rng.permutation(free if free and rng.random() < 0.9 else len(points)).tolist()
    # All that a closed surface needs, spread evenly, and pairs; or any, near their mean on a closed surface.
    total = degree * (len(free) - len(sides) // 2 + len(faces)) if not border else 0
    if not border and rng.random() < 0.5:
        index = [(total + place) // len(free) for place in range(len(free))]
        for _ in range(rng.integers(3)):
            index[rng.integers(len(free))] += 1
            index[rng.integers(len(free))] -= 1
    else:
        index = rng.choice([-2, -1, -1, 0, 1, 1, 2], min(rng.integers(6), len(free)))
        index = (index + round(total / len(free))).tolist()
    rows = [(v, i) for v, i in zip(free, index, strict=False) if i or rng.random() < 0.5]
    if rows and rng.random() < 0.08:
        vertex, value = rows[rng.integers(len(rows))]
        others = ((vertex, -value), (-1, 1), (len(points), 1), (vertex, _LARGE[rng.integers(6)]))
        rows.append(others[rng.integers(4)])
    if rows and rng.random() < 0.04:
        rows[0] = (rows[0][0], _LARGE[rng.integers(6)])
    lines = [f"{degree} {len(rows)}", *(f"{vertex} {value}" for vertex, value in rows)]
    return "\n".join(lines).encode() + b"\n"


def singularities_changed(mesh: Path, given: Path, output: Path, *, add_missing: bool) -> str:
    """Return how the singularities of a field that was written differ from the given ones, or an empty text.

    With `add_missing`, the field may have others, at other vertices.
    """
    degree, vertex, index = read_sings(given)
    wanted = dict(zip(vertex.tolist(), index.tolist(), strict=True))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        surface = api.Surface(mesh)
        try:
            if output.suffix in SINGULARITY_SUFFIXES:
                _, *pair = read_sings(output)
            else:
                pair = list(api.read_field(output, surface, degree).singularities)
        except RosyError as error:
            return f"cannot be read again: {error}"
    found = dict(zip(*(array.tolist() for array in pair), strict=True))
    compared = wanted if add_missing else wanted | found
    wrong = [
        f"{v}: {wanted.get(v, 0)}, {found.get(v, 0)}"
        for v in compared
        if wanted.get(v, 0) != found.get(v, 0)
    ]
    return f"vertex, given and found index of degree {degree}: {'; '.join(wrong)}" if wrong else ""

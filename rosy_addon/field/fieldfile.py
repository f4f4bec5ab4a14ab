"""Fields from files and to files: `.rosy`, one member a row, and `.rawfield`, all of them."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..errors import RosyError
from ..files import write_bytes
from .check import checked_field, field_domain, tangent_normals
from .formats.rows import Rows, read_rows, shown
from .frames import dot, unit
from .rosy_field import RosyField, check_degree
from .surface import Surface

#: How far the vectors of a .rawfield may be from a RoSy: degrees between neighbours, and relative
#: difference in length. Files with six digits are a hundred times as good.
ANGLE_TOLERANCE, LENGTH_TOLERANCE = 1.0, 0.01


def read_field(
    path: str | os.PathLike[str],
    surface: Surface,
    degree: int | None = None,
    undefined: str = "error",
) -> RosyField:
    """Read the field of a mesh from a `.rosy` or `.rawfield` file.

    A `.rosy` file holds a count, N, and that many rows x y z, one member each; a `.rawfield` holds
    N, a count, and rows of all N members. White space may be any, and rows may belong to faces or
    to vertices, which are then averaged onto the faces.

    Parameters
    ----------
    path : path-like
    surface : Surface
    degree : int, optional
        What N has to be; any if not given.
    undefined : {"error", "zero"}
        What to do about NaN and infinite vectors.

    Raises
    ------
    RosyError
        If the file is missing, of another kind, damaged, of another degree or for another mesh, or
        its vectors are not an N-RoSy on the surface.
    """
    path = Path(path)
    reader = _FORMATS.get(path.suffix.lower(), (None,))[0]
    if reader is None:
        raise RosyError(f"{path}: fields are read from {_KINDS}, not from '{path.suffix}' files")
    rows = read_rows(path, comment=None)
    found, vectors = reader(rows, surface)
    if degree is not None and found != degree:
        raise RosyError(f"{path}: holds a field of degree {found}, not {degree}")
    return checked_field(surface, vectors, found, str(path), undefined)


def write_field(path: str | os.PathLike[str], field: RosyField, surface: Surface) -> None:
    """Write a field to a `.rosy` or `.rawfield` file, one row a face.

    The numbers are the shortest that give the same float64 when read, so what is read again is the
    same to the last bit.

    Raises
    ------
    RosyError
        If the name ends in neither, or the file cannot be written.
    """
    path = Path(path)
    writer = _FORMATS.get(path.suffix.lower(), (None, None))[1]
    if writer is None:
        raise RosyError(f"{path}: fields are written to {_KINDS}, not to '{path.suffix}' files")
    write_bytes(path, writer(field, surface).encode("ascii"))


def _read_rosy(rows: Rows, surface: Surface) -> tuple[int, np.ndarray]:
    count, degree, numbers = _header(rows, "count", "degree")
    degree = _degree(rows, 1, degree)
    vectors = _table(rows, numbers, 3, count, surface)
    return degree, vectors


def _read_rawfield(rows: Rows, surface: Surface) -> tuple[int, np.ndarray]:
    degree, count, numbers = _header(rows, "degree", "count")
    degree = _degree(rows, 0, degree)
    members = _table(rows, numbers, 3 * degree, count, surface).reshape(-1, degree, 3)
    check_members(str(rows.path), members, surface)
    vectors = members[:, 0].copy()
    vectors[~np.isfinite(members).all(axis=(1, 2))] = np.nan
    return degree, vectors


def _header(rows: Rows, *names: str) -> tuple[int, int, int]:
    """The first two numbers, on one line or on two, and how many numbers follow."""
    words = [word for line in rows.words[:2] for word in line][:2]
    values = []
    for number, name in enumerate(names):
        try:
            values.append(int(words[number]))
        except IndexError:
            raise RosyError(f"{rows.path}: ends before the {name}") from None
        except ValueError:
            row = rows.row_of_word(number)
            found = shown(words[number])
            raise rows.error(row, f"found {found}, wanted the {name}, a whole number") from None
    return *values, sum(map(len, rows.words)) - 2


def _degree(rows: Rows, word: int, degree: int) -> int:
    try:
        return check_degree(degree)
    except RosyError as reason:
        raise rows.error(rows.row_of_word(word), str(reason)) from None


def _table(rows: Rows, numbers: int, columns: int, count: int, surface: Surface) -> np.ndarray:
    """(n, columns) the numbers after the header. The rows tell how many there are.

    Some writers put the number of vertices over rows for faces; any other disagreement between the
    count and the rows is an error.
    """
    found, rest = divmod(numbers, columns)
    vertices_over_faces = count == len(surface.vertices) and found == surface.face_count
    if rest or (found != count and not vertices_over_faces):
        part = " and a part of one" if rest else ""
        raise RosyError(
            f"{rows.path}: says {count} rows of {columns} numbers, but holds {found}{part}"
        )
    if field_domain(surface, found) is None:
        raise RosyError(
            f"{rows.path}: holds {found} rows, but the mesh {surface.name} has "
            f"{surface.face_count} faces and {len(surface.vertices)} vertices"
        )
    return rows.floats("part of a vector")[2:].reshape(found, columns)


def check_members(source: str, members: np.ndarray, surface: Surface) -> None:
    """Make sure that vectors given together are a RoSy, in whatever order.

    Parameters
    ----------
    source : str
        File or attributes, for messages.
    members : (n, N, 3) ndarray
        N vectors on each face or each vertex. Rows of zeros, and those that hold anything not
        finite, are left out.
    surface : Surface

    Raises
    ------
    RosyError
        If angles between neighbours or lengths differ by more than `ANGLE_TOLERANCE` and
        `LENGTH_TOLERANCE`, with the largest deviations.
    """
    count, degree = members.shape[:2]
    length = np.sqrt(dot(members, members))
    rows = np.flatnonzero(np.isfinite(length).all(axis=1) & length.any(axis=1))
    if degree == 1 or not len(rows):
        return
    members, length = members[rows], length[rows]
    normal = tangent_normals(surface, field_domain(surface, count))[rows]
    x = unit(members[:, 0] - dot(members[:, 0], normal)[:, None] * normal)
    y = np.cross(normal, x)
    angle = np.sort(
        np.arctan2(dot(members, y[:, None]), dot(members, x[:, None])) % (2 * np.pi), axis=1
    )
    gap = np.diff(angle, axis=1, append=angle[:, :1] + 2 * np.pi)
    off = np.degrees(np.abs(gap - 2 * np.pi / degree).max(axis=1))
    spread = length.max(axis=1) / np.maximum(length.min(axis=1), 1e-300) - 1
    usable = x.any(axis=1)
    off, spread = off[usable], spread[usable]
    if off.max(initial=0) > ANGLE_TOLERANCE or spread.max(initial=0) > LENGTH_TOLERANCE:
        shorter, longer = length[usable].min(), length[usable].max()
        worst = rows[usable][np.argmax(off)]
        raise RosyError(
            f"{source}: its vectors are not a RoSy of degree {degree}: the angles between neighbours "
            f"deviate from {360 / degree:.4g} degrees by up to {off.max():.1f} (row {worst}) and "
            f"lengths within a row by up to {100 * spread.max():.0f} % (all are {shorter:.2g} to "
            f"{longer:.2g}); {ANGLE_TOLERANCE:g} degree and {100 * LENGTH_TOLERANCE:g} % are allowed"
        )


def _rosy_text(field: RosyField, surface: Surface) -> str:
    return "\n".join([str(len(field.vectors)), str(field.degree), *_lines(field.vectors), ""])


def _rawfield_text(field: RosyField, surface: Surface) -> str:
    """Members counter-clockwise about the normal, the stored one first and untouched."""
    across = np.cross(tangent_normals(surface, "face"), field.vectors)
    turns = 2 * np.pi * np.arange(1, field.degree) / field.degree
    members = [field.vectors]
    members += [np.cos(turn) * field.vectors + np.sin(turn) * across for turn in turns]
    rows = np.concatenate(members, axis=1)
    return "\n".join([f"{field.degree} {len(rows)}", *_lines(rows), ""])


def _lines(rows: np.ndarray) -> list[str]:
    return [" ".join(map(repr, row)) for row in rows.tolist()]


_FORMATS: dict[str, tuple[Callable, Callable]] = {
    ".rosy": (_read_rosy, _rosy_text),
    ".rawfield": (_read_rawfield, _rawfield_text),
}
_KINDS = " and ".join(_FORMATS)

"""Fields from files and to files, in the formats that other programs use."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ..errors import RosyError
from ..files import write_bytes
from .check import checked_directions, checked_field, field_domain, is_usable
from .directions import directions_of, tensor_field
from .follow import follow
from .formats.fieldgen import fieldgen_text, read_fieldgen
from .formats.given import Given
from .formats.plain import npy_bytes, read_npy, read_text, text_of
from .formats.rosyfiles import rawfield_text, read_rawfield, read_rosy, rosy_text
from .formats.sings import SINGULARITIES, sings_text
from .meshfile import READERS as MESHES
from .meshfile import SHARP_ANGLE, read_mesh
from .rosy_field import RosyField
from .singularities import singularities
from .surface import Surface, build_surface

#: What is read, by the end of the name.
_READERS: dict[str, Callable[[Path], Given]] = {
    ".rosy": read_rosy,
    ".rawfield": read_rawfield,
    ".obj": read_fieldgen,
    ".txt": read_text,
    ".npy": read_npy,
}
READ = tuple(_READERS)
WRITTEN = (".rosy", ".rawfield", ".obj", ".txt", ".npy", *SINGULARITIES)

#: Of files that say nothing of it.
DEFAULT_DEGREE = 4


class Loaded(NamedTuple):
    """A field, and what the user should know of how it was read; empty if nothing."""

    field: RosyField
    note: str


def read_field(
    path: str | os.PathLike[str],
    surface: Surface,
    degree: int | None = None,
    undefined: str = "error",
    mesh: str | os.PathLike[str] | None = None,
) -> RosyField:
    """The field of `load_field`."""
    return load_field(path, surface, degree, undefined, mesh).field


def load_field(
    path: str | os.PathLike[str],
    surface: Surface,
    degree: int | None = None,
    undefined: str = "error",
    mesh: str | os.PathLike[str] | None = None,
) -> Loaded:
    """Read the field of a mesh from a file.

    ============  ==================================================================
    `.rosy`       a count, N, and rows x y z: one member each
    `.rawfield`   N, a count, and rows of all N directions, a RoSy or not
    `.obj`        a mesh with the field in comments, as the program fieldgen writes it
    `.txt`        rows of 3 numbers (a member each), of 3 N (all directions), or of 9
                  that are symmetric 3 x 3 tensors
    `.npy`        the same as an array, (n, 3), (n, 3 N), (n, N, 3) or (n, 3, 3)
    ============  ==================================================================

    White space may be any. Rows belong to faces or to vertices, which are then averaged onto the
    faces; tensors to faces alone.

    Parameters
    ----------
    path : path-like
    surface : Surface
    degree : int, optional
        What N has to be; any if not given. A plain file with one member a row does not say, and is
        of degree `DEFAULT_DEGREE` then.
    undefined : {"error", "zero"}
        What to do about NaN and infinite vectors.
    mesh : path-like, optional
        The mesh file that the rows count by, if its faces are others than those of `surface`:
        triangulated, say, or in another order. The field follows by position. If not given, and
        the counts differ, a mesh file of the same name beside the field is taken.

    Returns
    -------
    Loaded

    Raises
    ------
    RosyError
        If the file is missing, of another kind, damaged, of another degree or for another mesh, or
        its vectors are not tangent to the surface.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if path.suffix.lower() in SINGULARITIES:
        raise RosyError(f"{path}: holds singularities, and no directions")
    if reader is None:
        raise RosyError(
            f"{path}: fields are read from {_listed(READ)}, not from '{path.suffix}' files"
        )
    given = reader(path)
    if degree is not None and given.degree is not None and given.degree != degree:
        raise RosyError(f"{path}: holds a field of degree {given.degree}, not {degree}")
    own = _own_surface(path, given, surface, mesh)
    if own is None:
        return Loaded(_made(given, surface, degree, str(path), undefined), "")
    field = follow(own, _made(given, own, degree, str(path), undefined), surface, str(path))
    return Loaded(
        field,
        f"{path.name}: its {own.face_count:,} faces are not the {surface.face_count:,} of the mesh; "
        f"the field followed by position, from {Path(own.name).name}",
    )


def _made(
    given: Given, surface: Surface, degree: int | None, source: str, undefined: str
) -> RosyField:
    """The field of a file on the surface that its rows count by."""
    _check_count(given, surface, source)
    values = given.values
    if given.tensors:
        if not is_usable(values).all():
            raise RosyError(f"{source}: holds tensors that are not finite")
        if len(values) != surface.face_count:
            raise RosyError(f"{source}: holds tensors on vertices; they are read on faces alone")
        return tensor_field(surface, values)
    if given.degree is None or values.shape[1] == 1:
        found = given.degree or degree or DEFAULT_DEGREE
        return checked_field(surface, values[:, 0], found, source, undefined, given.domain)
    return checked_directions(surface, values, source, undefined, given.domain)


def _check_count(given: Given, surface: Surface, source: str) -> None:
    """Some writers put the number of vertices over rows for faces: the rows tell.

    Any other disagreement between the two is an error.
    """
    found = len(given.values)
    vertices_over_faces = given.says == len(surface.vertices) and found == surface.face_count
    if given.says not in (None, found) and not vertices_over_faces:
        raise RosyError(
            f"{source}: says {given.says} rows of {given.columns} numbers, but holds {found}"
        )
    if given.domain is None and field_domain(surface, found) is None:
        raise RosyError(
            f"{source}: holds {found} rows, but the mesh {surface.name} has "
            f"{surface.face_count} faces and {len(surface.vertices)} vertices"
        )


def _own_surface(
    path: Path, given: Given, surface: Surface, mesh: str | os.PathLike[str] | None
) -> Surface | None:
    """The surface that a file's rows count by; None if it is that which wants the field."""
    if mesh is not None:
        return read_mesh(mesh)
    count = len(given.values)
    if given.polygons is not None:
        own = len(given.polygons.vertices), given.polygons.face_count
        if own == (len(surface.vertices), surface.face_count):
            return None
        return build_surface(*given.polygons, name=str(path), sharp_angle=SHARP_ANGLE)
    if count == surface.face_count:
        return None
    beside = [path.with_suffix(suffix) for suffix in MESHES if suffix != path.suffix.lower()]
    found = next((other for other in beside if other.is_file()), None)
    if found is None:
        return None
    own = read_mesh(found)
    # As many rows as vertices may still be those of the faces of the mesh beside.
    return own if count == own.face_count or field_domain(surface, count) is None else None


def write_field(path: str | os.PathLike[str], field: RosyField, surface: Surface) -> None:
    """Write a field to a file, one row a face (`.obj`: one a vertex, with the mesh).

    Numbers are the shortest that give the same float64 when read, so that what is read again is the
    same to the last bit; but for `.obj`, whose field is on vertices. Directions that came from a
    file or from attributes are written as they came. `.sings` and `.sing` hold the singularities of
    the field.

    Raises
    ------
    RosyError
        If the name ends in none of `WRITTEN`, the format has no room for such a field, or the file
        cannot be written.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in WRITTEN:
        raise RosyError(
            f"{path}: fields are written to {_listed(WRITTEN)}, not to '{path.suffix}' files"
        )
    if kind in (".rosy", ".obj") and field.deviations is not None:
        raise RosyError(
            f"{path}: a {kind} file has room for one member a row, but the directions of this "
            "field are no RoSy: write a .rawfield, .txt or .npy file"
        )
    if kind == ".rosy":
        data = rosy_text(field)
    elif kind == ".obj":
        data = fieldgen_text(surface, field)
    elif kind in SINGULARITIES:
        data = sings_text(field.degree, *singularities(surface, field))
    else:
        rows = field.given if field.given is not None else directions_of(surface, field)
        if kind == ".npy":
            write_bytes(path, npy_bytes(rows))
            return
        data = rawfield_text(rows) if kind == ".rawfield" else text_of(rows)
    write_bytes(path, data.encode("ascii"))


def _listed(kinds: tuple[str, ...]) -> str:
    return f"{', '.join(kinds[:-1])} and {kinds[-1]}"

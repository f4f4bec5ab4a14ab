"""Read and write fields in the file formats of other programs."""

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..core.errors import RosyError, RosyWarning, counted
from ..core.file_io import check_parsing_memory, write_bytes
from ..core.progress import progress, report
from .analysis import angle_errors
from .blocks import row_blocks
from .closest_point import closest_triangles
from .directional_field import ANGLE_TOLERANCE_DEG, tensor_field, with_opposites
from .formats.crosses import read_crossfield, read_vcg_frames
from .formats.dmat import read_dmat
from .formats.fieldgen import fieldgen_text, read_fieldgen, vertex_members
from .formats.mesh_with_field import npz_bytes, ply_bytes, vtk_bytes
from .formats.openmesh import read_om
from .formats.plain import npy_bytes, read_npy, read_npz, read_text
from .formats.polygons import RawField
from .formats.rosy_rawfield import rawfield_text, read_rawfield, read_rosy, rosy_text, rows_text
from .formats.sings import SINGULARITY_SUFFIXES, sings_text
from .frames import dot, normalize, transport
from .mesh_io import READERS as MESH_READERS
from .mesh_io import SHARP_ANGLE, must_end_in
from .rosy_field import RosyField
from .surface import Surface, build_surface
from .validate import (
    STRICT,
    VectorPolicy,
    apply_nonfinite_policy,
    checked_domain,
    validated_directions,
    validated_field,
)
from .vertex_frames import in_space

#: A face of the target mesh gets the field of the closest source face only within these limits: the distance
#: relative to `Surface.extent` of the source, and the angle between the normals in radians.
MAX_DISTANCE, MAX_NORMAL_ANGLE = 0.02, np.radians(60)

#: Largest fraction of the target faces that may exceed these limits. On these faces the field is undefined.
MAX_UNMATCHED_FRACTION = 0.05

#: The function that reads files with each file name extension.
_READERS: dict[str, Callable[[Path], RawField]] = {
    ".rosy": read_rosy,
    ".rawfield": read_rawfield,
    ".obj": read_fieldgen,
    **dict.fromkeys((".txt", ".vec", ".csv"), read_text),
    ".npy": read_npy,
    ".npz": read_npz,
    ".dmat": read_dmat,
    ".crossfield": read_crossfield,
    **dict.fromkeys((".ffield", ".vfield"), read_vcg_frames),
    ".om": read_om,
}
READ_SUFFIXES = tuple(_READERS)

#: The function that returns the contents of files with each file name extension.
_WRITERS: dict[str, Callable[[Surface, RosyField], str | bytes]] = {
    ".rosy": rosy_text,
    ".rawfield": rawfield_text,
    ".obj": fieldgen_text,
    ".txt": rows_text,
    ".npy": npy_bytes,
    ".npz": npz_bytes,
    **{suffix: partial(vtk_bytes, suffix=suffix) for suffix in (".vtp", ".vtu")},
    ".ply": ply_bytes,
    **dict.fromkeys(SINGULARITY_SUFFIXES, sings_text),
}
WRITE_SUFFIXES = tuple(_WRITERS)

#: Degree of fields from files that do not state a degree, if the caller gives none.
DEFAULT_DEGREE = 4

#: Note about rows of two directions that are read as a cross.
HALF_CROSS_NOTE = (
    "rows have two directions that are nowhere opposite; they are read as the lines of a cross (degree 4). "
    "Give the degree 2 for two directions as they are"
)

#: Note about rows that may belong to the faces or to the vertices.
AMBIGUOUS_ROWS_NOTE = "there are as many vertices as faces; the rows are read as those of faces"

#: Peak memory in bytes per byte of an .npy file, until its field is made.
NPY_MEMORY = 4


class LoadedField(NamedTuple):
    """A field read from a file, and a note for the user on how it was read (may be empty)."""

    field: RosyField
    note: str


def load_field(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    surface: Surface,
    degree: int | None = None,
    policy: VectorPolicy = STRICT,
    mesh: str | os.PathLike[str] | None = None,
) -> LoadedField:
    """Read a field from one or several files and fit it to a mesh.

    ============= ==================================================================
    `.rosy`       row count, degree N (or none), then rows x y z with one member vector each
    `.rawfield`   N, row count, then rows of all N directions, which need not be a RoSy
    `.obj`        a mesh with the field in comments, as written by the program fieldgen
    `.txt` `.vec` rows of 3 numbers (one member vector), 3 N numbers (all N
    `.csv`        directions), 6 numbers (two directions that are nowhere opposite: the
                  lines of a cross), 9 numbers (a symmetric 3 x 3 tensor), or 2 numbers
                  (a member vector at each vertex; see `vertex_frames.in_space`)
    `.npy`        the same data as an array: (n, 3), (n, 3 N), (n, N, 3), (n, 3, 3) or (n, 2)
    `.npz`        the same as one of several arrays; see `formats.plain.read_npz`
    `.dmat`       the same as a matrix of libigl
    `.crossfield` crosses of libigl: a flag and two directions in each row
    `.ffield`     frames of VCG on faces (`.vfield`: on vertices): two scales, two directions
    `.om`         a mesh of OpenMesh with vectors on its faces, such as dir_u and dir_v
    ============= ==================================================================

    Numbers are separated by white space. There is a row for each face, or for each vertex. Values at
    vertices are averaged onto the faces. Tensors must be on faces.

    Parameters
    ----------
    path : path-like, or sequence of path-like
        Several files with one vector per row are read together: vector k of a row is from file k.
    surface : Surface
        The mesh to which the field is fitted.
    degree : int, optional
        The required degree N; by default any degree. Files with one member vector per row may not state a
        degree. Their field then has this degree, or `DEFAULT_DEGREE`.
    policy : VectorPolicy
        What to do about vectors that are not finite, or off the surface.
    mesh : path-like, optional
        The mesh file to which the rows of the field belong, if its faces differ from the faces of `surface`,
        for example because one of the meshes was triangulated or reordered. The field is then transferred by
        position. If `mesh` is not given and the number of rows does not fit, a mesh file of the same name in
        the same folder is used.

    Returns
    -------
    LoadedField

    Raises
    ------
    RosyError
        If the file is missing or malformed, has an unknown extension, has another degree, belongs to another
        mesh, or has vectors that are not tangent to the surface.
    """
    paths = [Path(p) for p in ([path] if isinstance(path, (str, os.PathLike)) else path)]
    with progress(0.0, 0.5):
        raws = [_read_rows(file) for file in paths]
    path, raw = paths[0], raws[0]
    if len(raws) > 1:
        raw = replace(raw, values=_joined_rows(raws, paths), degree=None)
    raw, note = _with_degree(raw, path, degree)
    notes = [note]
    with progress(0.5, 0.6):
        source_surface = _source_surface(path, raw, surface, mesh)
    is_transferred = source_surface is not None
    source_surface = source_surface or surface
    if raw.values.shape[2] == 2:
        vectors, domain, frame_note = in_space(source_surface, raw.values[:, 0], str(path))
        raw = replace(raw, values=vectors[:, None], domain=domain)
        notes.append(f"{path.name}: {frame_note}")
    is_ambiguous = len(raw.values) == surface.face_count == len(surface.vertices)
    if is_ambiguous and raw.domain is None and not is_transferred:
        notes.append(f"{path.name}: {AMBIGUOUS_ROWS_NOTE}")
    with progress(0.6, 0.7 if is_transferred else 1.0):
        field = field_from_raw(raw, source_surface, degree, str(path), policy)
    if is_transferred:
        with progress(0.7, 1.0):
            field = transfer_field(source_surface, field, surface, str(path))
        notes.append(
            f"{path.name}: the field has {counted(source_surface.face_count, 'face')}, but the mesh has "
            f"{surface.face_count:,}; the field was transferred by position from "
            f"{Path(source_surface.name).name}"
        )
    return LoadedField(field, "; ".join(filter(None, notes)))


def _read_rows(path: Path) -> RawField:
    """Read the rows of a field file; raise a `RosyError` if it is not one."""
    suffix = path.suffix.lower()
    if suffix in SINGULARITY_SUFFIXES:
        raise RosyError(f"{path}: contains singularities, not directions: choose a field file")
    if suffix not in _READERS:
        raise RosyError(f"{path}: is not a field file: {must_end_in(READ_SUFFIXES)}")
    check_parsing_memory(path, NPY_MEMORY)
    return _READERS[suffix](path)


def _joined_rows(raws: list[RawField], paths: list[Path]) -> np.ndarray:
    """Return (n, k, 3) vectors of k files with one vector in each of their n rows.

    `raws` holds the rows of each file, and `paths` its path for messages.
    """
    count = len(raws[0].values)
    for raw, path in zip(raws, paths, strict=True):
        if raw.values.shape != (count, 1, 3):
            raise RosyError(
                f"{path}: has {counted(len(raw.values), 'row')} of {raw.columns} numbers, but files that are read "
                f"together need one vector in each of {count:,} rows"
            )
    return np.concatenate([raw.values for raw in raws], axis=1)


def _with_degree(raw: RawField, path: Path, degree: int | None) -> tuple[RawField, str]:
    """Return the rows of a file with all N directions, and a note for the user on how they were read.

    If the file stores a cross by two directions, their opposites are added. `degree` is the requested degree,
    or None for any degree. The note is empty if there is nothing to say.
    """
    note, count = "", raw.values.shape[1]
    if raw.degree is None and count > 1:
        values = with_opposites(raw.values, degree)
        if degree is None and len(values[0]) > count:
            note = f"{path.name}: {HALF_CROSS_NOTE}"
        raw = replace(raw, values=values, degree=len(values[0]))
    elif raw.degree is None and degree is None:
        note = f"{path.name}: no degree is stated; it is read as a field of degree {DEFAULT_DEGREE}"
    return raw, note


def field_from_raw(
    raw: RawField, surface: Surface, degree: int | None, source: str, policy: VectorPolicy
) -> RosyField:
    """Make a field from the unchecked rows of a file, on the surface to which the rows belong.

    Parameters
    ----------
    raw : RawField
        The rows of the file.
    surface : Surface
    degree : int or None
        The required degree N. For rows with one member vector, if the file does not state a degree, None is
        `DEFAULT_DEGREE`.
    source : str
        Name of the file, for messages.
    policy : VectorPolicy
        What to do about vectors that are not finite, or off the surface.

    Raises
    ------
    RosyError
        If the field has another degree, the rows belong to another mesh, or a vector is not finite or not tangent to the surface.
    """
    if degree is not None and raw.degree not in (None, degree):
        text = f"the field has degree {raw.degree}, but degree {degree} was requested"
        raise RosyError(f"{source}: {text}")
    _check_header(raw, surface, source)
    values = raw.values
    if raw.tensors:
        if checked_domain(surface, len(values), raw.domain, source) != "face":
            raise RosyError(
                f"{source}: contains tensors on vertices; only tensors on faces are supported"
            )
        apply_nonfinite_policy(values, source, "face", policy.nonfinite)
        return tensor_field(surface, values)
    if raw.degree is None or values.shape[1] == 1:
        known_degree = raw.degree or degree or DEFAULT_DEGREE
        return validated_field(surface, values[:, 0], known_degree, source, policy, raw.domain)
    return validated_directions(surface, values, source, policy, raw.domain)


def _check_header(raw: RawField, surface: Surface, source: str) -> None:
    """Raise a `RosyError` if a file does not have the number of rows that its header declares.

    Some programs write the number of vertices in the header of a field on faces. This is accepted. `source`
    is the name of the file in the message.
    """
    row_count, vertex_count = len(raw.values), len(surface.vertices)
    is_mixed = (raw.header_count, row_count) == (vertex_count, surface.face_count)
    if raw.header_count not in (None, row_count) and not is_mixed:
        raise RosyError(
            f"{source}: declares {counted(raw.header_count, 'row')} of {raw.columns} numbers, but contains {row_count}"
        )


def _source_surface(
    path: Path, raw: RawField, surface: Surface, mesh: str | os.PathLike[str] | None
) -> Surface | None:
    """Return the surface of the mesh file to which the rows of a field file belong.

    The result is None if the rows belong to `surface` itself. `path` is the field file. `mesh` is the mesh
    file that the user has named. If it is None, the mesh in the field file is used or, if the number of rows
    does not fit `surface`, a mesh file of the same name in the same folder.
    """
    if mesh is not None:
        return Surface(mesh)
    count = len(raw.values)
    if raw.polygons is not None:
        counts = len(raw.polygons.vertices), raw.polygons.face_count
        if counts == (len(surface.vertices), surface.face_count):
            return None
        return build_surface(*raw.polygons, name=str(path), sharp_angle=SHARP_ANGLE)
    if count == surface.face_count:
        return None
    suffixes = (suffix for suffix in MESH_READERS if suffix != path.suffix.lower())
    mesh_path = next(filter(Path.is_file, map(path.with_suffix, suffixes)), None)
    if mesh_path is None:
        return None
    source = Surface(mesh_path)
    # The number of rows may fit the vertices of `surface` although the rows belong to faces of the mesh file.
    return source if count == source.face_count or count != len(surface.vertices) else None


def write_field(path: str | os.PathLike[str], field: RosyField, surface: Surface) -> None:
    """Write a field to a file, with one row for each face.

    `.obj` files contain the mesh and one row for each vertex. `.vtp`, `.vtu`, `.ply` and `.npz` files contain
    the mesh, and the directions, magnitudes and singularities of the field. `.sings` and `.sing` files
    contain only the singularities of the field.

    Numbers are written with all digits, so reading the file gives exactly the same float64 values. Only the
    field in an `.obj` file differs, because it is averaged onto the vertices. For a field made from
    directions, the `source_directions` are written if the format stores all directions.

    Warns
    -----
    RosyWarning
        If directions in an `.obj` file deviate from the field by more than `ANGLE_TOLERANCE_DEG`.

    Raises
    ------
    RosyError
        If the extension is not in `WRITE_SUFFIXES`, the format cannot store such a field, or the
        file cannot be written.

    See Also
    --------
    load_field : Description of the formats.
    """
    write_bytes(path, field_file(path, field, surface), follow_links=True)
    if Path(path).suffix.lower() == ".obj":
        members = vertex_members(surface, field)
        stored = validated_field(surface, members, field.degree, str(path), domain="vertex")
        worst = np.degrees(np.nanmax(angle_errors(surface, field, stored), initial=0.0))
        if worst > ANGLE_TOLERANCE_DEG:
            text = (
                f"{path}: an .obj file has one direction for each vertex, so directions of faces are off by up "
                f"to {worst:.0f} degrees, and lengths are 1: .rosy and .rawfield files keep them"
            )
            warnings.warn(text, RosyWarning, stacklevel=3)


def field_file(path: str | os.PathLike[str], field: RosyField, surface: Surface) -> bytes:
    """Return the contents of the file that `write_field` writes, as bytes.

    Raises
    ------
    RosyError
        If the extension is not in `WRITE_SUFFIXES`, or the format cannot store such a field.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITERS:
        raise RosyError(f"{path}: cannot be written as a field: {must_end_in(WRITE_SUFFIXES)}")
    if suffix in (".rosy", ".obj") and field.direction_ratios is not None:
        raise RosyError(
            f"{path}: a {suffix} file stores one member per row, but the directions of this field "
            "do not form a RoSy: write a .rawfield, .txt or .npy file"
        )
    report(0.0, "writing the file")
    contents = _WRITERS[suffix](surface, field)
    return contents if isinstance(contents, bytes) else contents.encode("ascii")


def transfer_field(source: Surface, field: RosyField, target: Surface, name: str) -> RosyField:
    """Transfer a field to another mesh: each face takes the value of the closest source face.

    Parameters
    ----------
    source : Surface
    field : RosyField
        The field on the faces of `source`.
    target : Surface
        The same shape in the same space, with different faces: for example triangulated or reordered.
    name : str
        Name of the field in messages.

    Returns
    -------
    RosyField
        Field on the faces of `target`. It is zero on faces without area, and on faces that have no source
        face near them: the closest one is farther away than `MAX_DISTANCE`, a fraction of the extent of
        `source`, or the angle between the two normals is above `MAX_NORMAL_ANGLE`.

    Raises
    ------
    RosyError
        If more than `MAX_UNMATCHED_FRACTION` of the faces have no source face near them.
    """
    with progress(0.1, 0.9):
        triangle, distance = closest_triangles(source, _face_points(target))
    report(0.9, "transferring the field")
    face = source.triangle_face[triangle]
    normal = target.face_normal
    normal_cosine = dot(normal, source.face_normal[face])
    undefined = distance > MAX_DISTANCE * max(source.extent, 1e-300)
    undefined |= (normal_cosine < np.cos(MAX_NORMAL_ANGLE)) | ~normal.any(axis=1)
    unmatched = undefined & normal.any(axis=1)
    if unmatched.sum() > MAX_UNMATCHED_FRACTION * len(undefined):
        raise RosyError(
            f"{name}: {unmatched.sum()} of {len(undefined)} faces of {target.name} do not lie on "
            f"{source.name} (distances up to {distance.max():.3g}): the two meshes must have the same "
            "shape and position"
        )
    vectors = field.vectors[face]
    length = np.sqrt(dot(vectors, vectors))[:, None]
    vectors = normalize(transport(vectors, source.face_normal[face], normal)) * length
    vectors[undefined] = 0
    direction_ratios = None if field.direction_ratios is None else field.direction_ratios[face]
    return RosyField(field.degree, vectors, direction_ratios, field.family_count)


def _face_points(surface: Surface) -> np.ndarray:
    """Return one (F, 3) point on each face: the centroid of its largest triangle."""
    points = np.empty((surface.face_count, 3))
    for faces in row_blocks(surface.face_count):
        triangles = slice(*np.searchsorted(surface.triangle_face, [faces.start, faces.stop]))
        face = surface.triangle_face[triangles]
        corners = surface.vertices[surface.triangle_vertex[triangles]]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        order = np.lexsort((dot(cross, cross), face))
        last = np.searchsorted(face[order], np.arange(faces.start, faces.stop), "right") - 1
        points[faces] = corners[order[last]].mean(axis=1)
    return points

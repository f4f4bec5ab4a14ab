"""Read binary `.om` files of OpenMesh: the mesh, and directions stored as properties of its faces.

A file consists of chunks, each with a header of 16 bits: the element that it describes, the type of its data,
their dimension and size. Properties that a program has added have a name, the name of their type and a size
in bytes. OpenMesh's package for Python skips these.
"""

import struct
from pathlib import Path

import numpy as np

from ...core.errors import RosyError
from ...core.file_io import read_bytes
from .polygons import Polygons, RawField, offsets_from_sizes

#: Codes of elements and types in the headers of chunks.
_VERTEX, _FACE, _EDGE, _HALFEDGE, _END = 0, 2, 4, 6, 7
_POSITION, _TOPOLOGY = 0, 7

#: numpy's types of numbers by the codes of their sizes.
_FLOATS, _INTEGERS = ("<f4", "<f8"), ("<u1", "<u2", "<u4", "<u8")

#: Types of vectors as names in a file, and their numpy types.
_VECTORS = {b"Vec3d": "<f8", b"Vec3f": "<f4"}


def read_om(path: Path) -> RawField:
    """Read the vectors on the faces of an `.om` file: one member, or two directions of each cross.

    If there are several vectors, they must be called dir_u and dir_v.

    Raises
    ------
    RosyError
        If the file cannot be read, is damaged, or has no such vectors.
    """
    polygons, properties = _read(path)
    names = [b"dir_u", b"dir_v"] if {b"dir_u", b"dir_v"} <= set(properties) else list(properties)
    if len(names) not in (1, 2):
        found = ", ".join(name.decode("ascii", "replace") for name in names) or "none"
        raise RosyError(f"{path}: expected the vectors dir_u and dir_v of faces, found {found}")
    values = np.stack([properties[name] for name in names], axis=1)
    return RawField(values, domain="face", polygons=polygons)


def read_om_mesh(path: Path) -> Polygons:
    """Read the mesh of an `.om` file.

    Raises
    ------
    RosyError
        If the file cannot be read, or is damaged.
    """
    return _read(path)[0]


def _read(path: Path) -> tuple[Polygons, dict[bytes, np.ndarray]]:
    """Return the mesh of a file, and the (F, 3) vectors that are properties of its faces."""
    data = read_bytes(path)
    try:
        return _parse(data)
    except (ValueError, IndexError, KeyError, struct.error):
        fault = "is damaged, or not a binary .om file of OpenMesh 2 or later"
        raise RosyError(f"{path}: {fault}") from None


def _parse(data: bytes) -> tuple[Polygons, dict[bytes, np.ndarray]]:
    """Return the mesh and the (F, 3) vectors that are properties of its faces, in the contents of a file."""
    magic, _, _, vertex_count, face_count, edge_count = struct.unpack_from("<2sccIII", data)
    if magic != b"OM":
        raise ValueError
    counts = {_VERTEX: vertex_count, _FACE: face_count}
    counts |= {_EDGE: edge_count, _HALFEDGE: 2 * edge_count}
    chunks, properties, position = {}, {}, 16
    while True:
        (header,) = struct.unpack_from("<H", data, position)
        element, kind, position = header >> 2 & 7, header >> 5 & 15, position + 2
        if element == _END:
            break
        if header >> 1 & 1:
            name, position = _text(data, position)
            type_name, position = _text(data, position)
            (size,) = struct.unpack_from("<I", data, position)
            position += 4
            if element == _FACE and type_name in _VECTORS:
                values = np.frombuffer(data, _VECTORS[type_name], 3 * face_count, position)
                properties[name] = values.reshape(face_count, 3).astype(np.float64)
        else:
            is_float = kind != _TOPOLOGY and header >> 10 & 1
            dtype = np.dtype((_FLOATS if is_float else _INTEGERS)[header >> 14])
            count = counts[element] * ((header >> 11 & 7) + 1)
            chunks[element, kind] = np.frombuffer(data, dtype, count, position)
            size = count * dtype.itemsize
        position += size
    vertices = chunks[_VERTEX, _POSITION].astype(np.float64).reshape(vertex_count, 3)
    halfedges = chunks[_HALFEDGE, _TOPOLOGY].astype(np.int64).reshape(2 * edge_count, 3)
    first = chunks[_FACE, _TOPOLOGY].astype(np.int64)
    return Polygons(vertices, *_corners(halfedges, first, vertex_count)), properties


def _text(data: bytes, position: int) -> tuple[bytes, int]:
    """Return the text at a position, and the position after it. The byte before the text is its length."""
    end = position + 1 + data[position]
    return data[position + 1 : end], end


def _corners(halfedges: np.ndarray, first: np.ndarray, vertex_count: int) -> list[np.ndarray]:
    """Return `corner_vertex` and `face_start` of F faces (see `Polygons`), given by their halfedges.

    A row of `halfedges` is for one halfedge: the next halfedge, the vertex to which it points, and its face.
    `first` holds the (F,) indices of one halfedge of each face. The file is damaged (`ValueError`) if a
    halfedge points to a vertex that is not below `vertex_count`.
    """
    columns, active, current, visited = [], np.ones(len(first), dtype=bool), first, 0
    while active.any():
        visited += np.count_nonzero(active)
        # Each halfedge belongs to one face, unless the file is damaged.
        if visited > len(halfedges) or halfedges[current[active], 1].max() >= vertex_count:
            raise ValueError
        columns.append(np.where(active, halfedges[current, 1], -1))
        current = np.where(active, halfedges[current, 0], current)
        active &= current != first
    if not columns:
        raise ValueError
    table = np.stack(columns, axis=1)
    return [table[table >= 0], offsets_from_sizes((table >= 0).sum(axis=1))]

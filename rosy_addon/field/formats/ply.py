"""Read Stanford .ply files, text and binary.

A .ply file consists of *elements*: tables with a name, rows and named *properties* (columns). The elements
`vertex` and `face` are read. Other elements are skipped.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from struct import Struct
from typing import Any

import numpy as np

from ...core.errors import RosyError, counted
from ...core.file_io import read_bytes
from ..blocks import as_float64
from .polygons import Polygons, offsets_from_sizes
from .text_rows import TextRows, abbreviate, read_rows

#: numpy's codes of number types, by their names in C, such as char, and in numpy, such as int8.
_CODES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")
_C_NAMES = ("char", "uchar", "short", "ushort", "int", "uint", "float", "double")
_DTYPES = dict(zip(_C_NAMES, _CODES, strict=True)) | {np.dtype(k).name: k for k in _CODES}
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNER_PROPERTIES = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    """A property (column) of an element, as the header declares it: a number or a list in each row.

    Types are codes of numpy, such as "f4".
    """

    name: str
    type: str
    #: Type of the number that precedes each list and is its length; None for a scalar property.
    count_type: str | None = None


@dataclass(frozen=True)
class _Element:
    """An element (table) of a .ply file, as the header declares it; `count` is its number of rows."""

    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


#: Values of an element by the names of its properties: an array for a scalar property, and (values, starts)
#: for a list property. The list of row i is ``values[starts[i] : starts[i + 1]]``.
_Columns = dict[str, "np.ndarray | tuple[np.ndarray, np.ndarray]"]


def read_ply(path: Path) -> Polygons:
    """Read the vertices and polygons of a .ply file.

    Raises
    ------
    RosyError
        If the file cannot be read, is malformed or truncated, or has no vertices or faces, or if an index is
        out of range.
    """
    columns, _ = _read_columns(path)
    try:
        vertices = np.stack([columns["vertex"][axis] for axis in "xyz"], axis=1)
    except KeyError as missing:
        raise RosyError(f"{path}: the vertices have no property {missing}") from None
    face = columns.get("face", {})
    corner_list = next((face[name] for name in _CORNER_PROPERTIES if name in face), None)
    strips = columns.get("tristrips", {}).get("vertex_indices")
    if corner_list is None and isinstance(strips, tuple):
        corner_list = _strip_triangles(*strips)
    if not isinstance(corner_list, tuple):
        raise RosyError(f"{path}: the mesh has no faces")
    corner_vertex, face_start = corner_list
    out_of_range = ~_is_index(corner_vertex, len(vertices))
    if out_of_range.any():
        corner = int(np.argmax(out_of_range))
        face_index = int(np.searchsorted(face_start, corner, side="right")) - 1
        place, last = f"{path}: face {face_index}", len(vertices) - 1
        text = f"refers to vertex {corner_vertex[corner]:.10g}, but the vertices are numbered 0 to {last}"
        raise RosyError(f"{place} {text}")
    return Polygons(as_float64(vertices), corner_vertex.astype(np.int64), face_start)


def _strip_triangles(vertices: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of strips, as the vertices of their corners and the first corner of each.

    The strips are rows of vertices: row i is ``vertices[starts[i] : starts[i + 1]]``. A strip ends at the end
    of its row and at -1. Three consecutive vertices are a triangle, and every other triangle is clockwise.
    Triangles with a repeated vertex, which programs insert to change the direction of a strip, are left out.
    """
    vertices = np.insert(vertices.astype(np.float64), starts[1:-1], -1)
    is_end = vertices == -1
    rank = np.arange(len(vertices))
    rank -= np.maximum.accumulate(np.where(is_end, rank + 1, 0))
    count = max(len(vertices) - 2, 0)
    triangles = np.stack([vertices[k : k + count] for k in range(3)], axis=1)
    is_odd = rank[:count] % 2 == 1
    triangles[is_odd] = triangles[is_odd][:, [1, 0, 2]]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a) & (triangles != -1).all(axis=1)]
    return triangles.ravel(), np.arange(len(triangles) + 1) * 3


def _is_index(values: np.ndarray, count: int) -> np.ndarray:
    """Return (n,) bool: whether each value is a whole number from 0 to `count` - 1."""
    in_range = (values >= 0) & (values < count)
    return in_range & (np.where(in_range, values, 0) % 1 == 0)


def read_values(path: Path, element: str = "vertex") -> dict[str, np.ndarray]:
    """Read the scalar properties of the vertices or faces of a .ply file, except the position.

    Three properties NAME_x, NAME_y and NAME_z of floating-point numbers are also a vector NAME. `element` is
    "vertex" or "face".

    Returns
    -------
    dict of str to (n,) or (n, 3) float64 ndarray
        Values of each property, by its name. Integers are divided by the largest value of their type, so that
        colors range from 0 to 1.

    Raises
    ------
    RosyError
        If the file cannot be read, or is malformed or truncated.
    """
    columns, elements = _read_columns(path)
    values = {}
    for prop in next((e.properties for e in elements if e.name == element), []):
        if prop.name in "xyz" or prop.count_type is not None:
            continue
        dtype = np.dtype(prop.type)
        scale = np.iinfo(dtype).max if dtype.kind in "iu" else 1
        values[prop.name] = columns[element][prop.name].astype(np.float64) / scale
    for name in [name.removesuffix("_x") for name in values if name.endswith("_x")]:
        axes = [f"{name}_{axis}" for axis in "xyz"]
        if name not in values and all(axis in values for axis in axes):
            values[name] = np.stack([values[axis] for axis in axes], axis=1)
    return values


def _read_columns(path: Path) -> tuple[dict[str, _Columns], list[_Element]]:
    """Read a .ply file: return its values by element and property, and the elements of its header."""
    data = read_bytes(path)
    byte_order, elements, offset = _header(path, data)
    if byte_order == "":
        return _text_elements(path, data, elements), elements
    return _binary_elements(path, data, offset, byte_order, elements), elements


def _header(path: Path, data: bytes) -> tuple[str, list[_Element], int]:
    """Parse the header: return the byte order ("" for text), the elements and the byte offset of the data."""
    if data[:3] != b"ply":
        raise RosyError(f"{path}:1: expected 'ply', found {abbreviate(data[:3])}")
    end = re.compile(rb"^end_header[ \t]*\r?\n", re.MULTILINE).search(data)
    if end is None:
        raise RosyError(f"{path}: the header has no line 'end_header'")
    byte_order, elements = None, []
    lines = data[: end.start()].decode("ascii", "replace").split("\n")
    for line_number, line in enumerate(lines, 1):
        place = f"{path}:{line_number}"
        try:
            match line.split():
                case ["format", name, _]:
                    byte_order = _BYTE_ORDERS[name]
                case ["element", name, count] if int(count) >= 0:
                    _declare(place, "element", elements, _Element(name, int(count)))
                case ["property", "list", count_type, kind, name]:
                    column = _Property(name, _DTYPES[kind], _DTYPES[count_type])
                    _declare(place, "property", elements[-1].properties, column)
                case ["property", kind, name]:
                    column = _Property(name, _DTYPES[kind])
                    _declare(place, "property", elements[-1].properties, column)
                case [] | ["ply"] | ["comment", *_] | ["obj_info", *_]:
                    pass
                case _:
                    raise ValueError
        except RosyError:
            raise
        except (KeyError, IndexError, ValueError):
            found = abbreviate(line.strip().encode())
            raise RosyError(f"{place}: expected a line of the header, found {found}") from None
    if byte_order is None:
        raise RosyError(f"{path}: the header has no line 'format'")
    return byte_order, elements, end.end()


def _declare(place: str, kind: str, earlier: list[Any], new: _Element | _Property) -> None:
    """Append the element or property `new` to `earlier` ones. Raise a `RosyError` if one has the same name.

    For the message, `place` is the file and line of the declaration, and `kind` is "element" or "property".
    """
    if any(item.name == new.name for item in earlier):
        raise RosyError(f"{place}: {kind} '{new.name}' is declared twice")
    earlier.append(new)


def _text_elements(path: Path, data: bytes, elements: list[_Element]) -> dict[str, _Columns]:
    """Return the values of all elements of a text file, by element and property; `data` are its contents."""
    # Parse the header as well, so that rows have the line numbers of the file.
    rows = read_rows(path, comment=None, data=data)
    first = next(row for row, words in enumerate(rows.words) if words[0] == b"end_header") + 1
    columns = {}
    for element in elements:
        element_rows = rows[first : first + element.count]
        if len(element_rows) < element.count:
            raise _truncated(path, element, len(element_rows))
        first += element.count
        columns[element.name] = _text_columns(element_rows, element)
    return columns


def _text_columns(rows: TextRows, element: _Element) -> _Columns:
    """Return the values of one element of a text file by property, given its rows."""
    starts = offsets_from_sizes(list(map(len, rows.words)))
    values = rows.floats(f"value of a {element.name}")
    position = starts[:-1]
    columns: _Columns = {}
    for prop in element.properties:
        count = np.ones(len(rows), dtype=np.int64)
        if prop.count_type is not None:
            _check_lengths(rows, element, position + 1, starts)
            count_value = values[position]
            invalid = ~_is_index(count_value, len(values) + 1)
            if invalid.any():
                row = int(np.argmax(invalid))
                raise rows.error(row, f"expected the length of a list, found {count_value[row]:g}")
            count = count_value.astype(np.int64)
            position = position + 1
        _check_lengths(rows, element, position + count, starts)
        list_starts = offsets_from_sizes(count)
        index = np.arange(list_starts[-1]) + np.repeat(position - list_starts[:-1], count)
        part = values[index]
        columns[prop.name] = part if prop.count_type is None else (part, list_starts)
        position = position + count
    return columns


def _check_lengths(rows: TextRows, element: _Element, end: np.ndarray, starts: np.ndarray) -> None:
    """Raise a `RosyError` if a row has too few values.

    All words of `rows` are numbered consecutively. Row i has the words ``starts[i] .. starts[i + 1] - 1``,
    and needs the words up to ``end[i] - 1``. The message names `element`.
    """
    short = end > starts[1:]
    if short.any():
        row = int(np.argmax(short))
        available, required = starts[row + 1] - starts[row], end[row] - starts[row]
        raise rows.error(row, f"{element.name} {row} has {available} values, expected {required}")


def _binary_elements(
    path: Path, data: bytes, offset: int, byte_order: str, elements: list[_Element]
) -> dict[str, _Columns]:
    """Return the values of all elements of a binary file, whose data begin at the byte `offset`.

    `data` are the contents of the file, and `byte_order` is "<" or ">" (numpy's codes). An element in which
    lists have the same lengths in all rows is read as one structured array, which is faster.
    """
    columns = {}
    for element in elements:
        if not element.properties:
            columns[element.name] = {}
            continue
        first_row, _ = _read_rows(path, data, offset, byte_order, element, min(element.count, 1))
        layout = []
        for prop in element.properties:
            if prop.count_type is None:
                layout.append((prop.name, byte_order + prop.type))
            else:
                layout.append((f"{prop.name} count", byte_order + prop.count_type))
                layout.append((prop.name, byte_order + prop.type, first_row[prop.name][0].shape))
        dtype = np.dtype(layout)
        end, count = offset + dtype.itemsize * element.count, element.count
        lists = [prop.name for prop in element.properties if prop.count_type is not None]
        is_cut = end > len(data)
        if is_cut and not lists:
            raise _truncated(path, element, (len(data) - offset) // dtype.itemsize)
        table = np.empty(0, dtype) if is_cut else np.frombuffer(data, dtype, count, offset)
        if is_cut or any((table[f"{k} count"] != table[k].shape[1]).any() for k in lists):
            values, offset = _read_rows(path, data, offset, byte_order, element, count)
        else:
            values, offset = {prop.name: table[prop.name] for prop in element.properties}, end
            for name in lists:
                values[name] = table[name].ravel(), np.arange(count + 1) * table[name].shape[1]
        columns[element.name] = values
    return columns


def _read_rows(
    path: Path, data: bytes, offset: int, byte_order: str, element: _Element, row_count: int
) -> tuple[_Columns, int]:
    """Return the values of the first `row_count` rows of a binary element, and the offset of their end.

    The first row is at the byte `offset` of the contents `data`. `byte_order` is "<" or ">". The position of
    a row depends on the lists in all rows before it, so the rows are read in a loop.
    """
    types = [np.dtype(byte_order + prop.type) for prop in element.properties]
    counts = [
        None if prop.count_type is None else Struct(byte_order + np.dtype(prop.count_type).char)
        for prop in element.properties
    ]
    chunks: list[list[bytes]] = [[] for _ in types]
    sizes: list[list[int]] = [[] for _ in types]
    for row in range(row_count):
        for column, (kind, count) in enumerate(zip(types, counts, strict=True)):
            length = 1
            if count is not None:
                if offset + count.size > len(data):
                    raise _truncated(path, element, row)
                length = count.unpack_from(data, offset)[0]
                if not (0 <= length < np.inf and length == int(length)):
                    raise RosyError(f"{path}: {element.name} {row} has a list of length {length}")
                length, offset = int(length), offset + count.size
            end = offset + length * kind.itemsize
            if end > len(data):
                raise _truncated(path, element, row)
            chunks[column].append(data[offset:end])
            sizes[column].append(length)
            offset = end
    columns: _Columns = {}
    for column, prop in enumerate(element.properties):
        values = np.frombuffer(b"".join(chunks[column]), types[column])
        is_list = prop.count_type is not None
        columns[prop.name] = (values, offsets_from_sizes(sizes[column])) if is_list else values
    return columns, offset


def _truncated(path: Path, element: _Element, row_count: int) -> RosyError:
    """Return the error to raise for a file that ends after `row_count` rows of an element."""
    return RosyError(
        f"{path}: declares {counted(element.count, 'row')} of element '{element.name}', but ends after {row_count}"
    )

"""Stanford .ply, text and binary: the elements `vertex` and `face`; all others are skipped."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from struct import Struct

import numpy as np

from ...errors import RosyError
from ...files import read_bytes
from .polygons import Polygons, starts_of
from .rows import Rows, read_rows, shown

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    name: str
    type: str
    #: Type of the count before a list; None for a single value.
    count_type: str | None = None


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


#: Values of an element, by property: single ones as arrays, lists as (values, starts).
_Columns = dict[str, "np.ndarray | tuple[np.ndarray, np.ndarray]"]


def read_ply(path: Path) -> Polygons:
    """Read a .ply file of polygons."""
    columns, _ = _columns(path)
    try:
        vertices = np.stack([columns["vertex"][axis] for axis in "xyz"], axis=1)
    except KeyError as missing:
        raise RosyError(f"{path}: has no {missing} of vertices") from None
    face = columns.get("face", {})
    corners = next((face[name] for name in _CORNERS if name in face), None)
    if not isinstance(corners, tuple):
        raise RosyError(f"{path}: the mesh has no faces")
    corner_vertex, face_start = corners
    wrong = ~((corner_vertex >= 0) & (corner_vertex < len(vertices)) & (corner_vertex % 1 == 0))
    if wrong.any():
        corner = int(np.argmax(wrong))
        number = int(np.searchsorted(face_start, corner, side="right")) - 1
        raise RosyError(
            f"{path}: face {number} refers to vertex {corner_vertex[corner]:.10g}, "
            f"there are {len(vertices)}, counted from 0"
        )
    with np.errstate(invalid="ignore"):  # signalling NaN; refused with the other ones
        vertices = vertices.astype(np.float64)
    return Polygons(vertices, corner_vertex.astype(np.int64), face_start)


def read_vertex_values(path: Path) -> dict[str, np.ndarray]:
    """What the vertices of a .ply file have besides their places.

    Returns
    -------
    dict of str to (V,) float64 ndarray
        By property. Whole numbers are taken as the share of the largest that their type holds.
    """
    columns, elements = _columns(path)
    found = {}
    for entry in next((e.properties for e in elements if e.name == "vertex"), []):
        if entry.name in "xyz" or entry.count_type is not None:
            continue
        kind = np.dtype(entry.type)
        whole = np.iinfo(kind).max if kind.kind in "iu" else 1
        found[entry.name] = columns["vertex"][entry.name].astype(np.float64) / whole
    return found


def _columns(path: Path) -> tuple[dict[str, _Columns], list[_Element]]:
    """All values of a file by element and property, and what it says its elements are."""
    data = read_bytes(path)
    order, elements, body = _header(path, data)
    read = _text_elements if order == "" else _binary_elements
    return read(path, data, body, order, elements), elements


def _header(path: Path, data: bytes) -> tuple[str, list[_Element], int]:
    """Byte order ("" for text), elements, and where the header ends."""
    if data[:3] != b"ply":
        raise RosyError(f"{path}:1: found {shown(data[:3])}, wanted 'ply'")
    end = re.compile(rb"^end_header[ \t]*\r?\n", re.MULTILINE).search(data)
    if end is None:
        raise RosyError(f"{path}: the header has no end")
    order, elements = None, []
    for number, line in enumerate(data[: end.start()].decode("ascii", "replace").split("\n"), 1):
        try:
            match line.split():
                case ["format", name, _]:
                    order = _ORDERS[name]
                case ["element", name, count]:
                    elements.append(_Element(name, _count(count)))
                case ["property", "list", count_type, kind, name]:
                    listed = _Property(name, _TYPES[kind], _TYPES[count_type])
                    elements[-1].properties.append(listed)
                case ["property", kind, name]:
                    elements[-1].properties.append(_Property(name, _TYPES[kind]))
                case [] | ["ply"] | ["comment", *_] | ["obj_info", *_]:
                    pass
                case _:
                    raise ValueError
        except (KeyError, IndexError, ValueError):
            found = shown(line.strip().encode())
            raise RosyError(f"{path}:{number}: found {found}, wanted a line of a header") from None
    if order is None:
        raise RosyError(f"{path}: the header names no format")
    return order, elements, end.end()


def _count(word: str) -> int:
    count = int(word)
    if count < 0:
        raise ValueError
    return count


def _text_elements(
    path: Path, data: bytes, body: int, order: str, elements: list[_Element]
) -> dict[str, _Columns]:
    # The header stays in for the sake of the line numbers.
    rows = read_rows(path, comment=None, data=data)
    first = next(row for row, words in enumerate(rows.words) if words[0] == b"end_header") + 1
    columns = {}
    for element in elements:
        part = rows[first : first + element.count]
        if len(part) < element.count:
            raise _truncated(path, element, len(part))
        first += element.count
        columns[element.name] = _text_columns(part, element)
    return columns


def _text_columns(rows: Rows, element: _Element) -> _Columns:
    starts = starts_of([len(words) for words in rows.words])
    values = rows.floats(f"value of a {element.name}")
    place = starts[:-1]
    columns: _Columns = {}
    for entry in element.properties:
        count = np.ones(len(rows), dtype=np.int64)
        if entry.count_type is not None:
            _check_room(rows, element, place + 1, starts)
            count = np.maximum(values[place], 0).astype(np.int64)
            place = place + 1
        _check_room(rows, element, place + count, starts)
        ends = starts_of(count)
        each = np.arange(ends[-1]) + np.repeat(place - ends[:-1], count)
        columns[entry.name] = values[each] if entry.count_type is None else (values[each], ends)
        place = place + count
    return columns


def _check_room(rows: Rows, element: _Element, end: np.ndarray, starts: np.ndarray) -> None:
    """Raise an error if some row ends before the values that it should have."""
    short = end > starts[1:]
    if short.any():
        row = int(np.argmax(short))
        found, wanted = starts[row + 1] - starts[row], end[row] - starts[row]
        raise rows.error(row, f"{element.name} {row} has {found} values, {wanted} are wanted")


def _binary_elements(
    path: Path, data: bytes, body: int, order: str, elements: list[_Element]
) -> dict[str, _Columns]:
    columns = {}
    for element in elements:
        columns[element.name], body = _binary_columns(path, data, body, order, element)
    return columns


def _binary_columns(
    path: Path, data: bytes, body: int, order: str, element: _Element
) -> tuple[_Columns, int]:
    """The values of one element, and where the next one begins."""
    lengths = _first_lengths(path, data, body, order, element)
    layout = _row_layout(element, order, lengths)
    if layout.itemsize * element.count <= len(data) - body:
        table = np.frombuffer(data, layout, element.count, body)
        if all((table[f"{name} count"] == length).all() for name, length in lengths.items()):
            columns = {
                entry.name: table[entry.name]
                if entry.count_type is None
                else (
                    table[entry.name].ravel(),
                    starts_of(np.full(element.count, lengths[entry.name])),
                )
                for entry in element.properties
            }
            return columns, body + layout.itemsize * element.count
    if not lengths:
        raise _truncated(path, element, (len(data) - body) // max(layout.itemsize, 1))
    return _mixed_columns(path, data, body, order, element)


def _first_lengths(
    path: Path, data: bytes, body: int, order: str, element: _Element
) -> dict[str, int]:
    """Lengths of the lists of the first row: most files have the same in all rows."""
    lengths: dict[str, int] = {}
    if not element.count:
        return {entry.name: 0 for entry in element.properties if entry.count_type}
    for entry in element.properties:
        if entry.count_type is not None:
            layout = _row_layout(element, order, lengths, until=entry.name)
            if body + layout.itemsize > len(data):
                raise _truncated(path, element, 0)
            row = np.frombuffer(data, layout, 1, body)[0]
            lengths[entry.name] = _list_length(path, element, 0, row[f"{entry.name} count"])
    return lengths


def _row_layout(
    element: _Element, order: str, lengths: dict[str, int], until: str | None = None
) -> np.dtype:
    """The bytes of a row whose lists have these lengths, up to the count of the list `until`."""
    layout = []
    for entry in element.properties:
        if entry.count_type is None:
            layout.append((entry.name, order + entry.type))
            continue
        layout.append((f"{entry.name} count", order + entry.count_type))
        if entry.name == until:
            break
        layout.append((entry.name, order + entry.type, (lengths[entry.name],)))
    return np.dtype(layout)


def _mixed_columns(
    path: Path, data: bytes, body: int, order: str, element: _Element
) -> tuple[_Columns, int]:
    """Rows of different lengths: each begins where the one before ends, so they take a loop."""
    kinds = [
        (np.dtype(order + entry.type), entry.count_type and np.dtype(order + entry.count_type))
        for entry in element.properties
    ]
    pieces: list[list[bytes]] = [[] for _ in kinds]
    sizes: list[list[int]] = [[] for _ in kinds]
    length_of = [count and Struct(order + count.char).unpack_from for _, count in kinds]
    place = body
    for row in range(element.count):
        for column, (kind, count) in enumerate(kinds):
            length = 1
            if count is not None:
                if place + count.itemsize > len(data):
                    raise _truncated(path, element, row)
                length = _list_length(path, element, row, length_of[column](data, place)[0])
                place += count.itemsize
            end = place + length * kind.itemsize
            if end > len(data):
                raise _truncated(path, element, row)
            pieces[column].append(data[place:end])
            sizes[column].append(length)
            place = end
    columns: _Columns = {}
    for entry, (kind, count), parts, size in zip(
        element.properties, kinds, pieces, sizes, strict=True
    ):
        values = np.frombuffer(b"".join(parts), kind)
        columns[entry.name] = values if count is None else (values, starts_of(size))
    return columns, place


def _list_length(path: Path, element: _Element, row: int, length) -> int:
    if not (length >= 0 and length == int(length)):
        raise RosyError(f"{path}: {element.name} {row} has a list of length {length}")
    return int(length)


def _truncated(path: Path, element: _Element, found: int) -> RosyError:
    return RosyError(
        f"{path}: says {element.count} rows of element '{element.name}', but ends after {found}"
    )

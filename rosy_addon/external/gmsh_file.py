"""Read `.msh` files of Gmsh in the formats 4.1, 4.0 and 2.2, whose data refer to nodes and elements by their tags.

meshio is not used for these files: it assumes that data are complete and in the order of the file, and it rejects
nodes with parametric coordinates.
"""

from collections.abc import Iterator
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import RosyError
from ..core.file_io import read_bytes
from ..field.formats.polygons import offsets_from_sizes

#: The shapes of faces and volumes: the type of the linear cell in VTK, the number of its corners, which are the
#: first nodes, and for each of Gmsh's types of this shape the number of all nodes.
_SHAPES = (
    (5, 3, {2: 3, 9: 6, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21}),
    (9, 4, {3: 4, 10: 9, 16: 8, 36: 16, 37: 25, 39: 12, 40: 16}),
    (10, 4, {4: 4, 11: 10, 29: 20, 30: 35, 31: 56, 32: 22, 137: 16}),
    (12, 8, {5: 8, 12: 27, 17: 20, 92: 64, 93: 125, 99: 32, 100: 44}),
    (13, 6, {6: 6, 13: 18, 18: 15, 90: 40, 91: 75}),
    (14, 5, {7: 5, 14: 14, 19: 13, 118: 30, 119: 55, 125: 21, 126: 29}),
)
_CELLS = {
    kind: (cell_type, corners, nodes)
    for cell_type, corners, kinds in _SHAPES
    for kind, nodes in kinds.items()
}

#: Numbers of nodes of points and lines, which are left out.
_LINES = {15: 1, 1: 2, 8: 3, 26: 4, 27: 5, 28: 6}

_NODE_COUNTS = _LINES | {kind: nodes for kind, (_, _, nodes) in _CELLS.items()}

#: The versions of the format that `read_gmsh` reads. Gmsh writes 4 for 4.0.
VERSIONS = (b"2.2", b"4", b"4.0", b"4.1")

#: In the format 2.2, this many rows at most are compared at once to find rows of one length. With 100, an element in
#: text takes 0.6 microseconds, or 12 if types alternate; with 1000, 0.6 and 30.
_RUN = 100


class _Section:
    """The numbers of a section, taken one after the other from text or binary data."""

    def __init__(self, data: bytes, is_text: bool) -> None:
        self._data, self._position = data, 0
        self._words = np.array(data.split(), dtype=np.float64) if is_text else None

    def take(self, dtype: str, count: int) -> np.ndarray:
        """Return the next numbers; raise `ValueError` if there are too few."""
        start = self._position
        if self._words is not None:
            self._position += count
            values = self._words[start : start + count].astype(dtype)
        else:
            self._position += count * np.dtype(dtype).itemsize
            values = np.frombuffer(self._data, dtype, count, start)
        if count < 0 or len(values) != count:
            raise ValueError("it ends too early")
        return values

    def tagged_rows(self, count: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the tags of the next rows, and their (count, columns) numbers."""
        if self._words is not None:
            rows = self.take("<f8", count * (1 + columns)).reshape(count, 1 + columns)
            return rows[:, 0].astype(np.int64), rows[:, 1:]
        row = np.dtype([("tag", "<i4"), ("row", "<f8", (columns,))])
        table = np.frombuffer(self._data, row, count, self._position)
        self._position += table.nbytes
        return table["tag"].astype(np.int64), table["row"]


def is_gmsh(path: Path) -> bool:
    """Return whether a file begins as a `.msh` file of one of the `VERSIONS`."""
    with open(path, "rb") as file:
        first, version = [*file.read(200).split()[:2], b"", b""][:2]
    return first == b"$MeshFormat" and version in VERSIONS


def read_gmsh(path: Path) -> Any:
    """Read a file of one of the `VERSIONS`.

    Returns
    -------
    pyvista.UnstructuredGrid
        The faces and volumes, with the arrays of the sections NodeData and ElementData. If a view has several
        steps, the last one is read. Values are NaN at nodes and elements that have none.
    """
    import pyvista

    sections, is_text = _sections(read_bytes(path))
    named = dict(sections)
    in_nodes = b"Nodes" if b"Nodes" in named else b"ParametricNodes"
    if not {in_nodes, b"Elements"} <= set(named):
        raise RosyError(f"{path}: cannot be read: it has no nodes, or no elements")
    version = named[b"MeshFormat"].split()[0]
    if version == b"2.2":
        nodes = _nodes_2 if in_nodes == b"Nodes" else _parametric_nodes_2
        rows = _rows_2
    else:
        is_old = version != b"4.1"
        nodes, rows = (partial(each, is_old=is_old) for each in (_nodes, _rows))
    node_tags, points = nodes(named[in_nodes], is_text)
    tags, sizes, types, corner_tags = _elements(rows(named[b"Elements"], is_text))
    corner_point = _find(node_tags, corner_tags)
    if (corner_point < 0).any():
        raise RosyError(f"{path}: cannot be read: an element has a node that is missing")
    starts = offsets_from_sizes(sizes)[:-1]
    grid = pyvista.UnstructuredGrid(np.insert(corner_point, starts, sizes), types, points)
    for name, data in sections:
        if name in (b"NodeData", b"ElementData"):
            is_node = name == b"NodeData"
            title, rows, values = _data(data, is_text)
            array = np.full((grid.n_points if is_node else grid.n_cells, values.shape[1]), np.nan)
            index = _find(node_tags if is_node else tags, rows)
            array[index[index >= 0]] = values[index >= 0]
            (grid.point_data if is_node else grid.cell_data)[title] = array
    return grid


def _sections(data: bytes) -> tuple[list[tuple[bytes, bytes]], bool]:
    """Return the names and contents of the sections of a file, and whether it is text."""
    sections, end = [], 0
    while (start := data.find(b"$", end)) >= 0:
        name, _, rest = data[start + 1 : start + 100].partition(b"\n")
        name = name.strip()
        first = start + 1 + len(data[start + 1 : start + 100]) - len(rest)
        last = data.find(b"$End" + name, first)
        if last < 0:
            raise ValueError(f"the section {name.decode('ascii', 'replace')} has no end")
        sections.append((name, data[first:last]))
        end = last + len(name) + 4
    return sections, dict(sections)[b"MeshFormat"].split()[1] == b"0"


def _nodes(data: bytes, is_text: bool, is_old: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the tags and the (n, 3) positions of the nodes, from the format 4.1 or, if `is_old`, 4.0."""
    section = _Section(data, is_text)
    block_count = section.take("<u8", 2 if is_old else 4)[0]
    tags, points = [np.empty(0, np.int64)], [np.empty((0, 3))]
    for _ in range(int(block_count)):
        *entity, is_parametric = section.take("<i4", 3).tolist()
        count = int(section.take("<u8", 1)[0])
        columns = 3 + entity[1 if is_old else 0] * bool(is_parametric)
        if is_old:
            block_tags, rows = section.tagged_rows(count, columns)
        else:
            block_tags = section.take("<u8", count).astype(np.int64)
            rows = section.take("<f8", count * columns).reshape(count, columns)
        tags.append(block_tags)
        points.append(rows[:, :3])
    return np.concatenate(tags), np.concatenate(points)


def _nodes_2(data: bytes, is_text: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the tags and the (n, 3) positions of the nodes, from the format 2.2."""
    count, data = _counted(data)
    return _Section(data, is_text).tagged_rows(count, 3)


def _parametric_nodes_2(data: bytes, is_text: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the tags and the (n, 3) positions of nodes with parametric coordinates, from the format 2.2.

    A row also has the dimension and the tag of the geometric entity of the node (`part`), and the parametric
    coordinates on it: none for points and volumes, one for curves and two for surfaces.
    """
    left, data = _counted(data)
    if is_text:
        rows = np.loadtxt(BytesIO(data), usecols=range(4), max_rows=left, ndmin=2)
        return rows[:, 0].astype(np.int64), rows[:, 1:]
    tags, points, position = [np.empty(0, np.int64)], [np.empty((0, 3))], 0
    while left > 0:
        dimension = int(np.frombuffer(data, "<i4", 1, position + 28)[0])
        layout = [("tag", "<i4"), ("point", "<f8", (3,)), ("part", "<i4", (2,))]
        row = np.dtype([*layout, ("parameters", "<f8", (dimension % 3,))])
        count = min(left, _RUN, (len(data) - position) // row.itemsize)
        rows = np.frombuffer(data, row, count, position)
        rows = rows[np.logical_and.accumulate(rows["part"][:, 0] == dimension)]
        if not len(rows):
            raise ValueError("it ends too early")
        tags.append(rows["tag"].astype(np.int64))
        points.append(rows["point"])
        position, left = position + rows.nbytes, left - len(rows)
    return np.concatenate(tags), np.concatenate(points)


def _rows(data: bytes, is_text: bool, is_old: bool) -> Iterator[tuple[int, np.ndarray]]:
    """Yield blocks of elements: their type, and rows of their tag and the tags of their nodes.

    All elements of a block have the same type, a number of Gmsh. `data` is the contents of the section
    Elements of the format 4.1 or, if `is_old`, 4.0.
    """
    section, dtype = _Section(data, is_text), "<i4" if is_old else "<u8"
    for _ in range(int(section.take("<u8", 2 if is_old else 4)[0])):
        kind, count = int(section.take("<i4", 3)[2]), int(section.take("<u8", 1)[0])
        columns = 1 + _node_count(kind)
        yield kind, section.take(dtype, count * columns).reshape(count, columns).astype(np.int64)


def _rows_2(data: bytes, is_text: bool) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the same blocks of elements as `_rows`, from the format 2.2.

    A row has the tag of the element, in text also its type and a number n, then n numbers for groups, then
    the tags of the nodes.
    """
    left, data = _counted(data)
    if is_text:
        numbers = np.array(data.split(), dtype=np.float64).astype(np.int64)
    else:
        numbers = np.frombuffer(data, "<i4", len(data) // 4).astype(np.int64)
    position = 0
    while left > 0:
        if position + 3 > len(numbers):
            raise ValueError("it ends too early")
        first, second, groups = numbers[position : position + 3].tolist()
        if is_text:
            kind, count, leading = second, min(left, _RUN), 3
        else:
            kind, count, leading = first, second, 1
            position += 3
        nodes = _node_count(kind)
        width = leading + groups + nodes
        rows = numbers[position : position + count * width]
        rows = rows[: len(rows) // width * width].reshape(-1, width)
        if is_text:  # up to the first row of another type, or with another number of groups
            rows = rows[np.logical_and.accumulate((rows[:, 1:3] == (kind, groups)).all(axis=1))]
        if not len(rows):
            raise ValueError("it ends too early")
        yield kind, rows[:, [0, *range(width - nodes, width)]]
        position, left = position + rows.size, left - len(rows)


def _counted(data: bytes) -> tuple[int, bytes]:
    """Return the number in the first line of a section of the format 2.2, and the lines after it."""
    line, _, rest = data.partition(b"\n")
    return int(line), rest


def _node_count(kind: int) -> int:
    """Return the number of nodes of an element of one of Gmsh's types."""
    if kind not in _NODE_COUNTS:
        raise ValueError(f"elements of type {kind} are not known")
    return _NODE_COUNTS[kind]


def _elements(
    blocks: Iterator[tuple[int, np.ndarray]],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the tags, corner counts and VTK types of faces and volumes, and the tags of the nodes at corners.

    Each block has elements of one type: the number of the type, and rows with the tag of an element and the
    tags of its nodes. The first three results have a value for each face or volume. The fourth one has the
    tags of the nodes at all corners, element by element.
    """
    tags, corner_tags = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    sizes, types = [np.empty(0, np.int64)], [np.empty(0, np.uint8)]
    for kind, rows in blocks:
        if kind in _CELLS:
            cell_type, corners, _ = _CELLS[kind]
            tags.append(rows[:, 0])
            corner_tags.append(rows[:, 1 : 1 + corners].ravel())
            sizes.append(np.full(len(rows), corners))
            types.append(np.full(len(rows), cell_type, np.uint8))
    return tuple(np.concatenate(parts) for parts in (tags, sizes, types, corner_tags))


def _data(data: bytes, is_text: bool) -> tuple[str, np.ndarray, np.ndarray]:
    """Return the title of a data section, the tags of its rows, and its (n, components) values."""
    header: list[list[bytes]] = []
    for _ in range(3):  # titles, real numbers, whole numbers
        line, _, data = data.partition(b"\n")
        *lines, data = data.split(b"\n", int(line))
        header.append(lines)
    title = header[0][0].decode("utf-8", "replace").strip().strip('"')
    components, count = int(header[2][1]), int(header[2][2])
    if components not in (1, 3, 9):
        raise ValueError(f"'{title}' has {components} numbers at each element, expected 1, 3 or 9")
    return title, *_Section(data, is_text).tagged_rows(count, components)


def _find(tags: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the index of each wanted tag among `tags`; -1 where it is missing."""
    order = np.argsort(tags, kind="stable")
    index = np.searchsorted(tags[order], wanted)
    found = order[np.minimum(index, len(tags) - 1)] if len(tags) else np.zeros(len(wanted), int)
    return np.where(tags[found] == wanted, found, -1) if len(tags) else found - 1

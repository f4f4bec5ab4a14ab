"""Write strokes as polylines in space, for robots, printers and programs of geometry."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from ..field.blocks import row_blocks
from ..projection.camera import Camera
from .stroke_set import Strokes
from .svg import Pen, simplify_mask
from .visibility import pixel_size

#: Extensions of files of strokes: a picture, and polylines in space.
DRAWING_SUFFIXES = (".svg", ".ply", ".obj", ".csv")

#: Points that are formatted at once.
POINTS_PER_BLOCK = 20_000

#: Largest distance in pixels between a removed point and the simplified stroke, and the number of
#: pixels that a difference of the full width counts as.
SIMPLIFY_TOLERANCE_PX, WIDTH_WEIGHT_PX = 0.08, 2.0

#: The properties of a vertex of a .ply file. Lengths are 8 bytes, so that no position is rounded.
_PLY_VERTEX = np.dtype(
    [
        *((name, "<f8") for name in ("x", "y", "z")),
        *((name, "<f4") for name in ("nx", "ny", "nz", "width")),
        *((name, "<i4") for name in ("stroke", "family")),
    ]
)
_PLY_EDGE = np.dtype([("vertex1", "<i4"), ("vertex2", "<i4")])
_PLY_TYPE_NAMES = {"f8": "double", "f4": "float", "i4": "int"}


def polyline_file(
    suffix: str, strokes: Strokes, camera: Camera, pen: Pen, matrix: np.ndarray | None = None
) -> bytes:
    """Return strokes as the contents of a file.

    Points on straight lines are left out; see `simplify_strokes`.

    Parameters
    ----------
    suffix : {".csv", ".obj", ".ply"}
        Suffix of the file: a table with a row for each point, a Wavefront file with lines, or a binary
        Stanford file with vertices and edges.
    strokes : Strokes
    camera : Camera
        Camera that sets the length of a pixel.
    pen : Pen
        Only its width counts.
    matrix : (4, 4) ndarray, optional
        Rotation and translation from world space to the space of the file.

    Returns
    -------
    bytes
    """
    with progress(0.0, 0.4, "writing strokes"):
        strokes = simplify_strokes(strokes, camera)
    order = np.argsort(strokes.family, kind="stable")
    strokes = strokes.select(order)
    width = pen.width * pixel_size(strokes.points, camera) * strokes.width
    matrix = np.eye(4) if matrix is None else matrix
    points = strokes.points @ matrix[:3, :3].T + matrix[:3, 3]
    normals = strokes.normal @ matrix[:3, :3].T
    contents = {".csv": _csv, ".obj": _obj, ".ply": _ply}[suffix]
    with progress(0.4, 1.0, "writing strokes"):
        return contents(strokes, points, normals, width)


def simplify_strokes(strokes: Strokes, camera: Camera) -> Strokes:
    """Remove points without which strokes change by less than `SIMPLIFY_TOLERANCE_PX` pixels.

    Parameters
    ----------
    strokes : Strokes
    camera : Camera
        Camera that sets the length of a pixel.
    """
    pixel_length = pixel_size(strokes.points, camera)
    min_pixel_length = np.minimum.reduceat(pixel_length, strokes.start[:-1])
    min_pixel_length = np.maximum(min_pixel_length, 1e-3 * pixel_length.max())[strokes.stroke]
    features = np.column_stack(
        [strokes.points / min_pixel_length[:, None], WIDTH_WEIGHT_PX * strokes.width]
    )
    kept = simplify_mask(features, strokes.start, SIMPLIFY_TOLERANCE_PX)
    count = np.add.reduceat(kept, strokes.start[:-1])
    return replace(
        strokes.take_points(np.flatnonzero(kept)), start=np.concatenate([[0], np.cumsum(count)])
    )


def check_drawing_suffix(path: str | os.PathLike[str]) -> str:
    """Return the extension of a file of strokes, in lower case.

    Raises
    ------
    RosyError
        If the file is neither a picture nor one of polylines.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in DRAWING_SUFFIXES:
        raise RosyError(f"{path}: the name of the file must end in .svg, .ply, .obj or .csv")
    return suffix


def _csv(strokes: Strokes, points: np.ndarray, normals: np.ndarray, width: np.ndarray) -> bytes:
    """Return a header, then a row for each point. A closed stroke ends at its first point."""
    blocks = [b"stroke,family,x,y,z,nx,ny,nz,width\n"]
    stroke = strokes.stroke
    for rows in row_blocks(len(points), POINTS_PER_BLOCK):
        report(rows.start / max(len(points), 1), "writing strokes")
        names = [strokes.names[family] for family in strokes.family[stroke[rows]]]
        values = np.column_stack([points[rows], normals[rows], width[rows]]).tolist()
        lines = (
            f"{number},{name},{x:.9g},{y:.9g},{z:.9g},{nx:.6g},{ny:.6g},{nz:.6g},{w:.6g}\n"
            for number, name, (x, y, z, nx, ny, nz, w) in zip(
                stroke[rows].tolist(), names, values, strict=True
            )
        )
        blocks.append("".join(lines).encode())
    return b"".join(blocks)


def _obj(strokes: Strokes, points: np.ndarray, normals: np.ndarray, width: np.ndarray) -> bytes:
    """Return vertices, then a line for each stroke, in a group for each family.

    The format has no normals of lines, so normal n belongs to vertex n. Widths are texture coordinates with
    one component.
    """
    first_of_closed, kept = _without_repeated_points(strokes)
    rows = np.flatnonzero(kept)
    blocks = [
        b"# Each normal and each texture coordinate, the width, is that of the vertex of the same number\n"
    ]
    columns = ("v", points), ("vn", normals), ("vt", width[:, None])
    for index, (keyword, values) in enumerate(columns):
        form = keyword + values.shape[1] * (" %.9g" if keyword == "v" else " %.6g") + "\n"
        for block in row_blocks(len(rows), POINTS_PER_BLOCK):
            report((index + block.start / max(len(rows), 1)) / 4, "writing strokes")
            lines = (form % tuple(row) for row in values[rows[block]].tolist())
            blocks.append("".join(lines).encode())
    number = np.cumsum(kept)
    number[~kept] = number[first_of_closed]
    text, family = [], -1
    for stroke, (first, last) in enumerate(
        zip(strokes.start[:-1].tolist(), strokes.start[1:].tolist(), strict=True)
    ):
        if strokes.family[stroke] != family:
            family = int(strokes.family[stroke])
            text.append(f"g {strokes.names[family].replace(' ', '_')}\n")
        text.append("l " + " ".join(f"{n}/{n}" for n in number[first:last].tolist()) + "\n")
    blocks.append("".join(text).encode())
    return b"".join(blocks)


def _ply(strokes: Strokes, points: np.ndarray, normals: np.ndarray, width: np.ndarray) -> bytes:
    """Return a binary file with the points as vertices and the segments as edges."""
    first_of_closed, kept = _without_repeated_points(strokes)
    stroke = strokes.stroke
    vertex = np.zeros(int(kept.sum()), dtype=_PLY_VERTEX)
    columns = (*points.T, *normals.T, width, stroke, strokes.family[stroke])
    for name, values in zip(_PLY_VERTEX.names, columns, strict=True):
        vertex[name] = values[kept]
    number = np.cumsum(kept) - 1
    number[~kept] = number[first_of_closed]
    last = np.flatnonzero(stroke[1:] == stroke[:-1]) + 1
    edge = np.zeros(len(last), dtype=_PLY_EDGE)
    edge["vertex1"], edge["vertex2"] = number[last - 1], number[last]
    header = ["ply", "format binary_little_endian 1.0"]
    header += [f"comment family {number} {name}" for number, name in enumerate(strokes.names)]
    for name, rows in (("vertex", vertex), ("edge", edge)):
        header.append(f"element {name} {len(rows)}")
        header += [
            f"property {_PLY_TYPE_NAMES[rows.dtype[column].str[1:]]} {column}"
            for column in rows.dtype.names
        ]
    text = "\n".join([*header, "end_header", ""])
    return text.encode() + vertex.tobytes() + edge.tobytes()


def _without_repeated_points(strokes: Strokes) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of the first points of closed strokes, and which points are not repeated.

    The last point of a closed stroke is its first one again.
    """
    kept = np.ones(len(strokes.points), dtype=bool)
    kept[strokes.start[1:][strokes.closed] - 1] = False
    return strokes.start[:-1][strokes.closed], kept

"""Write strokes as 3D polylines, for robots, printers and geometry software."""

import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import transformed
from ..field.up_axis import UP_AXIS_MATRIX
from ..projection.camera import Camera
from ..projection.pixel_blocks import reported_blocks
from .stroke_set import Strokes
from .svg import Pen, simplify_mask
from .visibility import pixel_size

#: Extensions of files with strokes: .svg for a picture, the others for 3D polylines.
DRAWING_SUFFIXES = (".svg", ".ply", ".obj", ".csv")

#: Text that the user sees while a file is written.
LABEL = "writing strokes"

#: Number of points that are formatted at once.
POINTS_PER_BLOCK = 20_000

#: Largest distance in pixels between a removed point and the simplified stroke. Differences in width count as
#: distances as well: a difference of one full width counts as `WIDTH_WEIGHT_PX` pixels.
SIMPLIFY_TOLERANCE_PX, WIDTH_WEIGHT_PX = 0.08, 2.0

#: The properties of a vertex in a .ply file. Coordinates have 8 bytes, so that no position is rounded.
_PLY_VERTEX = np.dtype(
    [
        *((name, "<f8") for name in ("x", "y", "z")),
        *((name, "<f4") for name in ("nx", "ny", "nz", "width")),
        *((name, "<i4") for name in ("stroke", "family")),
    ]
)
_PLY_EDGE = np.dtype([("vertex1", "<i4"), ("vertex2", "<i4")])
_PLY_TYPE_NAMES = {"f8": "double", "f4": "float", "i4": "int"}


def polyline_file(suffix: str, strokes: Strokes, camera: Camera, pen: Pen, up: str) -> bytes:
    """Return the contents of a file with strokes as 3D polylines.

    Points on straight lines are left out; see `simplify_strokes`.

    Parameters
    ----------
    suffix : {".csv", ".obj", ".ply"}
        Suffix that sets the format: a table with a row for each point, a Wavefront file with lines, or a
        binary Stanford file with vertices and edges.
    strokes : Strokes
    camera : Camera
        Camera that sets the length of a pixel.
    pen : Pen
        Width of the strokes, in pixels of the camera. Its other attributes are not used.
    up : {"y", "z"}
        Axis that points up in the space of the file. In world space, z points up.

    Returns
    -------
    bytes
    """
    with progress(0.0, 0.4, LABEL):
        strokes = simplify_strokes(strokes, camera)
    strokes = strokes.select(np.argsort(strokes.family, kind="stable"))
    width = pen.width * pixel_size(strokes.points, camera) * strokes.width
    matrix = UP_AXIS_MATRIX[up].T
    points = transformed(strokes.points, matrix[:3])
    normals = strokes.normal @ matrix[:3, :3].T
    contents = {".csv": _csv, ".obj": _obj, ".ply": _ply}[suffix]
    with progress(0.4, 1.0, LABEL):
        return contents(strokes, points, normals, width)


def simplify_strokes(strokes: Strokes, camera: Camera) -> Strokes:
    """Remove points if strokes then change by less than `SIMPLIFY_TOLERANCE_PX` pixels.

    Parameters
    ----------
    strokes : Strokes
    camera : Camera
        Camera that sets the length of a pixel.
    """
    pixel_length = pixel_size(strokes.points, camera)
    min_pixel_length = np.minimum.reduceat(pixel_length, strokes.start[:-1])
    min_pixel_length = np.maximum(min_pixel_length, 1e-3 * pixel_length.max())[strokes.stroke]
    pixels = strokes.points / min_pixel_length[:, None]
    features = np.column_stack([pixels, WIDTH_WEIGHT_PX * strokes.width])
    kept = simplify_mask(features, strokes.start, SIMPLIFY_TOLERANCE_PX)
    start = offsets_from_sizes(kept)[strokes.start]
    return replace(strokes.take_points(np.flatnonzero(kept)), start=start)


def check_drawing_suffix(path: str | os.PathLike[str]) -> str:
    """Return the extension of a path in lower case, and check that strokes can be written to such a file.

    Raises
    ------
    RosyError
        If the extension is not one of `DRAWING_SUFFIXES`.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in DRAWING_SUFFIXES:
        raise RosyError(f"{path}: the name of the file must end in .svg, .ply, .obj or .csv")
    return suffix


def _csv(strokes: Strokes, points: np.ndarray, normals: np.ndarray, width: np.ndarray) -> bytes:
    """Return a .csv file: a header, then a row for each point.

    A closed stroke repeats its first point at its end. `points` and `normals`, (n, 3), are in the space of
    the file, and `width`, (n,), is the width of the stroke at each point, in world space.
    """
    blocks = [b"stroke,family,x,y,z,nx,ny,nz,width\n"]
    form = "%d,%s" + 3 * ",%.9g" + 4 * ",%.6g" + "\n"
    stroke = strokes.stroke
    for rows in reported_blocks(len(points), LABEL, size=POINTS_PER_BLOCK):
        names = [strokes.names[family] for family in strokes.family[stroke[rows]]]
        values = np.column_stack([points[rows], normals[rows], width[rows]]).tolist()
        lines = (
            form % (number, name, *row)
            for number, name, row in zip(stroke[rows].tolist(), names, values, strict=True)
        )
        blocks.append("".join(lines).encode())
    return b"".join(blocks)


def _obj(strokes: Strokes, points: np.ndarray, normals: np.ndarray, width: np.ndarray) -> bytes:
    """Return an .obj file: vertices, then a line for each stroke, in a group for each family.

    In this format, lines cannot refer to normals, so normal n belongs to vertex n. Widths are stored as
    texture coordinates with one component. `points` and `normals`, (n, 3), are in the space of the file, and
    `width`, (n,), is the width of the stroke at each point, in world space.
    """
    kept, number = _numbered_points(strokes)
    rows = np.flatnonzero(kept)
    blocks = [
        b"# Each normal and each texture coordinate, the width, is that of the vertex of the same number\n"
    ]
    columns = ("v", points), ("vn", normals), ("vt", width[:, None])
    for index, (keyword, values) in enumerate(columns):
        form = keyword + values.shape[1] * (" %.9g" if keyword == "v" else " %.6g") + "\n"
        extent = index / 4, (index + 1) / 4
        for block in reported_blocks(len(rows), LABEL, *extent, POINTS_PER_BLOCK):
            lines = (form % tuple(row) for row in values[rows[block]].tolist())
            blocks.append("".join(lines).encode())
    number += 1
    text, family = [], -1
    for stroke, (first, last) in enumerate(pairwise(strokes.start.tolist())):
        if strokes.family[stroke] != family:
            family = int(strokes.family[stroke])
            text.append(f"g {strokes.names[family].replace(' ', '_')}\n")
        text.append("l " + " ".join(f"{n}/{n}" for n in number[first:last].tolist()) + "\n")
    blocks.append("".join(text).encode())
    return b"".join(blocks)


def _ply(strokes: Strokes, points: np.ndarray, normals: np.ndarray, width: np.ndarray) -> bytes:
    """Return a binary .ply file with the points as vertices and the segments as edges.

    `points` and `normals`, (n, 3), are in the space of the file, and `width`, (n,), is the width of the
    stroke at each point, in world space.
    """
    kept, number = _numbered_points(strokes)
    stroke = strokes.stroke
    vertex = np.zeros(int(kept.sum()), dtype=_PLY_VERTEX)
    columns = (*points.T, *normals.T, width, stroke, strokes.family[stroke])
    for name, values in zip(_PLY_VERTEX.names, columns, strict=True):
        vertex[name] = values[kept]
    last = np.flatnonzero(stroke[1:] == stroke[:-1]) + 1
    edge = np.zeros(len(last), dtype=_PLY_EDGE)
    edge["vertex1"], edge["vertex2"] = number[last - 1], number[last]
    header = ["ply", "format binary_little_endian 1.0"]
    header += [f"comment family {number} {name}" for number, name in enumerate(strokes.names)]
    for name, rows in (("vertex", vertex), ("edge", edge)):
        header.append(f"element {name} {len(rows)}")
        for column, (kind, _) in rows.dtype.fields.items():
            header.append(f"property {_PLY_TYPE_NAMES[kind.str[1:]]} {column}")
    text = "\n".join([*header, "end_header", ""])
    return text.encode() + vertex.tobytes() + edge.tobytes()


def _numbered_points(strokes: Strokes) -> tuple[np.ndarray, np.ndarray]:
    """Return (n,) bool: which points are kept, and (n,) int64: the number of each point in a file, from 0.

    All points are kept except for the last points of closed strokes, which have the number of the first ones.
    """
    kept = np.ones(len(strokes.points), dtype=bool)
    kept[strokes.start[1:][strokes.closed] - 1] = False
    number = np.cumsum(kept) - 1
    number[~kept] = number[strokes.start[:-1][strokes.closed]]
    return kept, number

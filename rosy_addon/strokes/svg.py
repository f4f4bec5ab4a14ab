"""Strokes as an .svg file: for browsers, for Inkscape with a layer a family, and for plotters."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np

from ..errors import RosyError
from ..files import write_bytes
from ..projection.camera import Camera
from .outline import KINDS
from .seen import on_screen
from .strokes import Strokes

#: Steps of opacity in which strokes are drawn.
SHADES = 16

#: Widths, as shares of the full one, that differ by less are the same.
SAME_WIDTH = 0.02

#: How much farther out than half the width the outline of a stroke goes where it turns, at most.
MITRE = 1.25

#: Pixels by which a polyline may miss the points that are left out of it.
TOLERANCE = 0.06


@dataclass(frozen=True)
class Pen:
    """How strokes are drawn.

    Attributes
    ----------
    width : float
        Of a full stroke, in pixels of the camera.
    colours : sequence of str
        Of the families in turn, as SVG names them.
    paper : str or None
        Behind them.
    millimetres : float or None
        What the width of the frame is on paper; pixels if not given.
    plotter : bool
        Lines of constant width, in an order in which a pen travels little.
    outline : str or None
        Colour of silhouettes, creases and borders; the next of the others if not given.
    """

    width: float = 1.0
    colours: Sequence[str] = ("#000000",)
    paper: str | None = "#ffffff"
    millimetres: float | None = None
    plotter: bool = False
    outline: str | None = None

    def __post_init__(self) -> None:
        if not self.width > 0 or not self.colours:
            raise RosyError("a pen has a width above 0, and a colour")
        if self.millimetres is not None and not self.millimetres > 0:
            raise RosyError("a page has a width above 0")

    def inks(self, names: Sequence[str]) -> list[str]:
        """A colour for each of the families of strokes, by `Strokes.names`."""
        return [
            self.colours[place % len(self.colours)]
            if self.outline is None or name not in KINDS
            else self.outline
            for place, name in enumerate(names)
        ]


def write_svg(
    path: str | os.PathLike[str], strokes: Strokes, camera: Camera, pen: Pen | None = None
) -> None:
    """Write what `svg_text` makes.

    Raises
    ------
    RosyError
        If it may not be written.
    """
    write_bytes(path, svg_text(strokes, camera, pen).encode())


def svg_text(strokes: Strokes, camera: Camera, pen: Pen | None = None) -> str:
    """Strokes as a camera sees them; hidden ones are left out by `seen`, not here.

    Parameters
    ----------
    strokes : Strokes
        All in front of the camera.
    camera : Camera
    pen : Pen, optional

    Returns
    -------
    str
        SVG 1.1. Each family is a group that Inkscape takes for a layer, and so is the paper. Each
        stroke is one path.
    """
    pen = pen or Pen()
    pixels, _ = on_screen(strokes.points, camera)
    pixels[:, 1] = camera.height - pixels[:, 1]
    size = f'width="{camera.width}" height="{camera.height}"'
    if pen.millimetres is not None:
        height = pen.millimetres * camera.height / camera.width
        size = f'width="{pen.millimetres:g}mm" height="{height:g}mm"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<svg xmlns="http://www.w3.org/2000/svg" '
        'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
        'xmlns:sodipodi="http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd" version="1.1" '
        f'{size} viewBox="0 0 {camera.width} {camera.height}">',
    ]
    if pen.paper is not None:
        # A layer of its own, and locked: a drag over the drawing takes strokes alone.
        lines += [
            '<g id="paper" inkscape:groupmode="layer" inkscape:label="paper" '
            'sodipodi:insensitive="true">',
            f'<rect width="100%" height="100%" fill={quoteattr(pen.paper)}/>',
            "</g>",
        ]
    for family, (name, colour) in enumerate(
        zip(strokes.names, pen.inks(strokes.names), strict=True)
    ):
        own = strokes.chosen(strokes.family == family)
        if not len(own):
            continue
        flat = pixels[np.repeat(strokes.family == family, np.diff(strokes.start))]
        lines.append(
            f'<g id="layer{family + 1}" inkscape:groupmode="layer" inkscape:label={quoteattr(name)} '
            f'fill="none" stroke={quoteattr(colour)} stroke-width="{pen.width:.3g}" '
            'stroke-linecap="round" stroke-linejoin="round">'
        )
        lines += _plotted(flat, own) if pen.plotter else _drawn(flat, own, pen.width, colour)
        lines.append("</g>")
    lines.append("</svg>")
    return "\n".join(lines) + "\n"


def _plotted(pixels: np.ndarray, strokes: Strokes) -> list[str]:
    """A path a stroke, in the order of `pen_order`."""
    order, turned = pen_order(pixels[strokes.start[:-1]], pixels[strokes.start[1:] - 1])
    kept = simplified(pixels, strokes.start, TOLERANCE)
    paths = []
    for stroke, back in zip(order.tolist(), turned.tolist(), strict=True):
        part = slice(strokes.start[stroke], strokes.start[stroke + 1])
        points = pixels[part][kept[part]]
        points = points[::-1] if back else points
        paths.append(f'<path d="{_path(points, strokes.closed[stroke])}"/>')
    return paths


def _drawn(pixels: np.ndarray, strokes: Strokes, width: float, colour: str) -> list[str]:
    """A path a stroke: a line where it is as wide all along, else its outline, filled.

    Where the opacity changes a stroke is cut, into pieces that end square so as not to overlap.
    """
    shade = np.rint(np.clip(strokes.opacity, 0, 1) * SHADES).astype(np.int64)
    point, start, first = _pieces(shade, strokes)
    radius = np.clip(strokes.width[point], 0, 1) * width / 2
    kept = simplified(np.column_stack([pixels[point], radius]), start, TOLERANCE)
    start = np.concatenate([[0], np.cumsum(kept)])[start]
    flat, radius = pixels[point][kept], radius[kept]
    least, most = (side.reduceat(radius, start[:-1]) for side in (np.minimum, np.maximum))
    left, right = _sides(flat, radius, start)
    whole = np.bincount(strokes.stroke[first], minlength=len(strokes))[strokes.stroke[first]] == 1
    paths = []
    for piece, opaque in enumerate(shade[first].tolist()):
        part = slice(start[piece], start[piece + 1])
        if not opaque or not most[piece]:
            continue
        more = "" if opaque == SHADES else f' opacity="{opaque / SHADES:.3g}"'
        if whole[piece] and most[piece] - least[piece] <= SAME_WIDTH * width / 2:
            wide = 2 * most[piece]
            more += "" if wide > (1 - SAME_WIDTH) * width else f' stroke-width="{wide:.3g}"'
            closed = strokes.closed[strokes.stroke[first[piece]]]
            paths.append(f'<path{more} d="{_path(flat[part], closed)}"/>')
        else:
            more += f' fill={quoteattr(colour)} stroke="none"'
            ends = radius[part][[0, -1]] * whole[piece]
            paths.append(f'<path{more} d="{_outline(left[part], right[part], ends)}"/>')
    return paths


def _pieces(shade: np.ndarray, strokes: Strokes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stretches of strokes of one shade; the point where the next begins belongs to both.

    Returns
    -------
    point : (m,) int64 ndarray
        Of the strokes, for the points of all pieces in turn.
    start : (pieces + 1,) int64 ndarray
    first : (pieces,) int64 ndarray
        Their first points.
    """
    last_of_stroke = np.zeros(len(shade), dtype=bool)
    last_of_stroke[strokes.start[1:] - 1] = True
    begins = np.ones(len(shade), dtype=bool)
    begins[1:] = (shade[1:] != shade[:-1]) | last_of_stroke[:-1]
    # A last point alone is the end of the piece before.
    begins &= ~last_of_stroke
    first = np.flatnonzero(begins)
    end = np.append(first[1:], len(shade))
    # Where a stroke ends the piece does, elsewhere it reaches the next one.
    last = np.where(last_of_stroke[end - 1], end - 1, np.minimum(end, len(shade) - 1))
    start = np.concatenate([[0], np.cumsum(last - first + 1)])
    point = np.arange(start[-1]) + np.repeat(first - start[:-1], last - first + 1)
    return point, start, first


def _sides(
    points: np.ndarray, radius: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) points half a width to either side of polylines."""
    ahead = np.zeros_like(points)
    ahead[:-1] = points[1:] - points[:-1]
    length = np.hypot(*ahead.T)
    ahead /= np.where(length > 0, length, 1)[:, None]
    behind = np.roll(ahead, 1, axis=0)
    ahead[start[1:] - 1] = behind[start[1:] - 1]
    behind[start[:-1]] = ahead[start[:-1]]
    middle = ahead + behind
    size = np.hypot(*middle.T)
    back = size < 1e-6
    middle = np.where(back[:, None], ahead, middle / np.where(back, 1, size)[:, None])
    # Half the width of each straight piece, so more where two meet at an angle.
    farther = np.minimum(2 / np.maximum(size, 1e-6), MITRE)
    off = (radius * farther)[:, None] * middle[:, ::-1] * (1, -1)
    return points + off, points - off


def _outline(left: np.ndarray, right: np.ndarray, ends: np.ndarray) -> str:
    """Down one side, around the end, back on the other, and around the beginning.

    `ends` are the radii there, of the beginning and of the end; 0 is square.
    """
    back = right[::-1]
    return (
        f"M{_listed(left)} {_turn(ends[1])}{_listed(back[:1])} L{_listed(back[1:])} "
        f"{_turn(ends[0])}{_listed(left[:1])}Z"
    )


def _turn(radius: float) -> str:
    """Half a circle clockwise, or straight where it would not be seen."""
    return f"A{radius:.2f},{radius:.2f} 0 0 1 " if radius >= 0.05 else "L"


def _path(points: np.ndarray, closed: bool) -> str:
    """A line; of a closed one the last point is the first and is not said again."""
    return f"M{_listed(points[:-1])}Z" if closed else f"M{_listed(points)}"


def _listed(points: np.ndarray) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points.tolist())


def simplified(points: np.ndarray, start: np.ndarray, tolerance: float) -> np.ndarray:
    """(n,) bool: which points of polylines are enough (Ramer, Douglas and Peucker, all at once).

    Parameters
    ----------
    points : (n, k) ndarray
    start : (S + 1,) ndarray of int
    tolerance : float
        How far points that are left out may be from what is left.
    """
    kept = np.zeros(len(points), dtype=bool)
    first, last = start[:-1].astype(np.int64), start[1:].astype(np.int64) - 1
    kept[first], kept[last] = True, True
    first, last = first[last - first > 1], last[last - first > 1]
    while len(first):
        count = last - first - 1
        begin = np.concatenate([[0], np.cumsum(count)[:-1]])
        piece = np.repeat(np.arange(len(first)), count)
        point = np.arange(count.sum()) + np.repeat(first + 1 - begin, count)
        base = points[first][piece]
        along = points[last][piece] - base
        off = points[point] - base
        square = np.einsum("ni,ni->n", along, along)
        share = np.einsum("ni,ni->n", off, along) / np.where(square > 0, square, 1)
        off = off - np.clip(share, 0, 1)[:, None] * along
        distance = np.einsum("ni,ni->n", off, off)
        most = np.maximum.reduceat(distance, begin)
        split = most > tolerance**2
        at = np.flatnonzero(distance == most[piece])
        where, index = np.unique(piece[at], return_index=True)
        middle = np.zeros(len(first), dtype=np.int64)
        middle[where] = point[at[index]]
        first, middle, last = first[split], middle[split], last[split]
        kept[middle] = True
        first, last = np.concatenate([first, middle]), np.concatenate([middle, last])
        first, last = first[last - first > 1], last[last - first > 1]
    return kept


def pen_order(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An order of strokes, and which of them backward, in which a pen travels little between them.

    Greedy: always the nearest end that is left, found ring by ring in a grid.

    Parameters
    ----------
    first, last : (S, 2) ndarray
        Their ends.

    Returns
    -------
    order : (S,) int64 ndarray
    turned : (S,) bool ndarray
        In that order.
    """
    count = len(first)
    ends = np.concatenate([first, last])
    if not count:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=bool)
    low, extent = ends.min(axis=0), np.maximum(np.ptp(ends, axis=0), 1e-9)
    cells = max(int(np.sqrt(count)), 1)
    cell = np.minimum(((ends - low) / extent.max() * cells).astype(np.int64), cells - 1)
    grid: dict[tuple[int, int], set[int]] = {}
    keys = [tuple(key) for key in cell.tolist()]
    for number, key in enumerate(keys):
        grid.setdefault(key, set()).add(number)
    places = ends.tolist()
    here, order, turned = low.tolist(), [], []
    at = (0, 0)
    for _ in range(count):
        best = _nearest_end(grid, places, here, at, cells, extent.max() / cells)
        stroke = best % count
        order.append(stroke)
        turned.append(best >= count)
        for number in (stroke, stroke + count):
            grid[keys[number]].discard(number)
        other = stroke if best >= count else stroke + count
        here, at = places[other], keys[other]
    return np.array(order), np.array(turned)


def _nearest_end(
    grid: dict[tuple[int, int], set[int]],
    places: list[list[float]],
    here: list[float],
    at: tuple[int, int],
    cells: int,
    side: float,
) -> int:
    best, least = -1, np.inf
    for ring in range(cells + 1):
        if best >= 0 and least <= (max(ring - 1, 0) * side) ** 2:
            break
        for key in _ring(at, ring):
            for number in sorted(grid.get(key, ())):
                x, y = places[number]
                distance = (x - here[0]) ** 2 + (y - here[1]) ** 2
                if distance < least:
                    best, least = number, distance
    return best


def _ring(at: tuple[int, int], ring: int) -> list[tuple[int, int]]:
    x, y = at
    if not ring:
        return [at]
    row = range(-ring, ring + 1)
    column = range(-ring + 1, ring)
    return [(x + i, y + j) for i in row for j in (-ring, ring)] + [
        (x + i, y + j) for i in (-ring, ring) for j in column
    ]

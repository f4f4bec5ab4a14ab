"""Write strokes as SVG documents for browsers, plotters and Inkscape, in which each family is a layer."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np

from ..annotation import singularity_marks
from ..annotation.index_labels import HALO, HALO_COLOR, LABEL_COLOR, placed_labels, stroke_width
from ..annotation.singularity_marks import SingularityMarks
from ..core.errors import RosyError
from ..core.progress import progress, report
from ..field.blocks import mask, numbered_ranges
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import dot
from ..projection.camera import Camera
from .outline import OUTLINE_KINDS
from .stroke_set import Strokes
from .visibility import project_to_pixels

#: A stroke is drawn with a constant width if its widths differ by less than this fraction of the full width.
WIDTH_TOLERANCE = 0.02

_COLOR_NAMES = """
    aliceblue antiquewhite aqua aquamarine azure beige bisque black blanchedalmond blue blueviolet
    brown burlywood cadetblue chartreuse chocolate coral cornflowerblue cornsilk crimson cyan
    darkblue darkcyan darkgoldenrod darkgray darkgreen darkgrey darkkhaki darkmagenta
    darkolivegreen darkorange darkorchid darkred darksalmon darkseagreen darkslateblue
    darkslategray darkslategrey darkturquoise darkviolet deeppink deepskyblue dimgray dimgrey
    dodgerblue firebrick floralwhite forestgreen fuchsia gainsboro ghostwhite gold goldenrod gray
    green greenyellow grey honeydew hotpink indianred indigo ivory khaki lavender lavenderblush
    lawngreen lemonchiffon lightblue lightcoral lightcyan lightgoldenrodyellow lightgray
    lightgreen lightgrey lightpink lightsalmon lightseagreen lightskyblue lightslategray
    lightslategrey lightsteelblue lightyellow lime limegreen linen magenta maroon mediumaquamarine
    mediumblue mediumorchid mediumpurple mediumseagreen mediumslateblue mediumspringgreen
    mediumturquoise mediumvioletred midnightblue mintcream mistyrose moccasin navajowhite navy
    oldlace olive olivedrab orange orangered orchid palegoldenrod palegreen paleturquoise
    palevioletred papayawhip peachpuff peru pink plum powderblue purple red rosybrown royalblue
    saddlebrown salmon sandybrown seagreen seashell sienna silver skyblue slateblue slategray
    slategrey snow springgreen steelblue tan teal thistle tomato turquoise violet wheat white
    whitesmoke yellow yellowgreen
"""
#: The color names of SVG 1.1.
COLOR_NAMES = frozenset(_COLOR_NAMES.split())
#: A color written as ``#rgb`` or ``#rrggbb``.
_COLOR_CODE = re.compile("#(?:[0-9a-f]{3}){1,2}", re.IGNORECASE)

#: Largest distance of the contour of a stroke from its center line at a bend, in half widths.
MAX_MITER = 1.25

#: Number of strokes that are written, or ordered for a plotter, between two reports of the progress.
PATHS_PER_REPORT = 1000

#: Largest distance in pixels between a removed point and the simplified polyline.
SIMPLIFY_TOLERANCE_PX = 0.06

#: A cell of a grid over a drawing, and the ends of strokes in each cell, as indices.
_Cell = tuple[int, int]
_Grid = dict[_Cell, set[int]]


@dataclass(frozen=True)
class Pen:
    """A description of how strokes are drawn: width, colors and page.

    Attributes
    ----------
    width : float
        Full width of a stroke, in pixels of the camera.
    colors : sequence of str
        Colors of the families, in order: ``#rgb``, ``#rrggbb`` or a color name of SVG, such as ``navy``. They
        repeat if there are more families than colors.
    paper : str or None
        Color of the background; None for no background.
    millimeters : float or None
        Width of the page in millimeters. If None, the size of the page is in pixels.
    plotter : bool
        Whether strokes are drawn with constant width, in an order that keeps the travel of the pen short.
    outline : str or None
        Color of silhouettes, creases and borders. If None, they take colors from `colors`.

    Raises
    ------
    RosyError
        If a width is not above 0, there is no color, or a color is not written as described.
    """

    width: float = 1.0
    colors: Sequence[str] = ("#000000",)
    paper: str | None = "#ffffff"
    millimeters: float | None = None
    plotter: bool = False
    outline: str | None = None

    def __post_init__(self) -> None:
        if not self.width > 0 or not self.colors:
            raise RosyError("the pen needs a width above 0, and at least one color")
        if self.millimeters is not None and not self.millimeters > 0:
            raise RosyError("the page needs a width above 0")
        optional = (color for color in (self.paper, self.outline) if color is not None)
        for color in (*self.colors, *optional):
            if not _COLOR_CODE.fullmatch(color) and color.lower() not in COLOR_NAMES:
                raise RosyError(f"{color!r} is not a color: use #rrggbb or a name of SVG")

    def family_colors(self, names: Sequence[str]) -> list[str]:
        """Return the color of each family, given the names of the families (`Strokes.names`)."""
        return [
            self.outline if self.outline is not None and name in OUTLINE_KINDS else color
            for name, color in zip(names, itertools.cycle(self.colors), strict=False)
        ]


def svg_text(
    strokes: Strokes, camera: Camera, pen: Pen | None = None, marks: SingularityMarks | None = None
) -> str:
    """Return strokes as an SVG document, projected by a camera.

    Hidden parts are not removed here; see `clip_to_visible`.

    Parameters
    ----------
    strokes : Strokes
        Strokes whose points are all in front of the camera.
    camera : Camera
    pen : Pen, optional
        Width and colors of the strokes. By default, the defaults of `Pen`.
    marks : SingularityMarks, optional
        Singularities in the view of the camera; they are drawn over the strokes.

    Returns
    -------
    str
        A document of SVG 1.1. Each family is a group, which is a layer in Inkscape. The paper and the
        singularities are layers of their own. Each stroke is one path.
    """
    pen = pen or Pen()
    pixels, _ = project_to_pixels(strokes.points, camera)
    pixels[:, 1] = camera.height - pixels[:, 1]
    size = f'width="{camera.width}" height="{camera.height}"'
    if pen.millimeters is not None:
        height = pen.millimeters * camera.height / camera.width
        size = f'width="{pen.millimeters:g}mm" height="{height:g}mm"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<svg xmlns="http://www.w3.org/2000/svg" '
        'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
        'xmlns:sodipodi="http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd" version="1.1" '
        f'{size} viewBox="0 0 {camera.width} {camera.height}">',
    ]
    if pen.paper is not None:
        # The paper is a locked layer, so that a selection by dragging contains only strokes.
        lines += [
            '<g id="paper" inkscape:groupmode="layer" inkscape:label="paper" '
            'sodipodi:insensitive="true">',
            f'<rect width="100%" height="100%" fill={quoteattr(pen.paper)}/>',
            "</g>",
        ]
    colors = pen.family_colors(strokes.names)
    for family, (name, color) in enumerate(zip(strokes.names, colors, strict=True)):
        family_strokes = strokes.select(strokes.family == family)
        if not len(family_strokes):
            continue
        family_pixels = pixels[np.repeat(strokes.family == family, np.diff(strokes.start))]
        lines.append(
            f'<g id="layer{family + 1}" inkscape:groupmode="layer" inkscape:label={quoteattr(name)} '
            f'fill="none" stroke={quoteattr(color)} stroke-width="{pen.width:.3g}" '
            'stroke-linecap="round" stroke-linejoin="round">'
        )
        with progress(family / len(strokes.names), (family + 1) / len(strokes.names)):
            if pen.plotter:
                lines += _plotter_paths(family_pixels, family_strokes)
            else:
                lines += _stroke_paths(family_pixels, family_strokes, pen.width, color)
        lines.append("</g>")
    if marks is not None and len(marks):
        lines += _singularity_layer(marks, camera.height)
    lines.append("</svg>")
    return "\n".join(lines) + "\n"


def _singularity_layer(marks: SingularityMarks, height: int) -> list[str]:
    """Return the SVG lines of a layer with the dots and labels of singularities.

    `height` is the height of the picture in pixels.
    """
    marks = marks.in_drawing_order()
    outline = singularity_marks.OUTLINE * marks.size
    lines = [
        '<g id="singularities" inkscape:groupmode="layer" inkscape:label="singularities" '
        f'stroke="{singularity_marks.OUTLINE_COLOR}" stroke-width="{outline:.3g}" stroke-linecap="round" '
        'stroke-linejoin="round">'
    ]
    columns = marks.position, marks.radius, marks.index, marks.is_visible
    rows = zip(*(column.tolist() for column in columns), strict=True)
    for (x, y), radius, index, is_visible in rows:
        opacity = "" if is_visible else f' opacity="{singularity_marks.HIDDEN_OPACITY}"'
        lines.append(
            f'<circle cx="{x:.2f}" cy="{height - y:.2f}" r="{radius + outline / 2:.2f}" '
            f'fill="{singularity_marks.COLOR_BY_SIGN[1 if index > 0 else -1]}"{opacity}/>'
        )
    width = stroke_width(marks.size)
    for label in placed_labels(marks):
        segments = label.segments() * (1, -1) + (0, height)
        path = " ".join(f"M{_format_points(segment)}" for segment in segments)
        halo_width = width + 2 * HALO * marks.size
        lines += [
            f'<path fill="none" stroke="{color}" stroke-width="{line_width:.3g}" d="{path}"/>'
            for color, line_width in ((HALO_COLOR, halo_width), (LABEL_COLOR, width))
        ]
    return [*lines, "</g>"]


def _plotter_paths(pixels: np.ndarray, strokes: Strokes) -> list[str]:
    """Return an SVG path for each stroke, in an order that keeps the travel of the pen short.

    `pixels`, (n, 2), holds the points of the strokes in coordinates of the SVG document.
    """
    first, last = pixels[strokes.start[:-1]], pixels[strokes.start[1:] - 1]
    with progress(0.0, 0.5):
        order, is_reversed = plotter_order(first, last)
    with progress(0.5, 0.6):
        kept = simplify_mask(pixels, strokes.start, SIMPLIFY_TOLERANCE_PX)
    paths = []
    for stroke, backward in zip(order.tolist(), is_reversed.tolist(), strict=True):
        if len(paths) % PATHS_PER_REPORT == 0:
            report(0.6 + 0.4 * len(paths) / len(order), "writing strokes")
        span = slice(strokes.start[stroke], strokes.start[stroke + 1])
        points = pixels[span][kept[span]]
        points = points[::-1] if backward else points
        paths.append(f'<path d="{_line_path(points, strokes.closed[stroke])}"/>')
    return paths


def _stroke_paths(pixels: np.ndarray, strokes: Strokes, width: float, color: str) -> list[str]:
    """Return an SVG path for each stroke: a line if its width is constant, otherwise a filled contour.

    `pixels`, (n, 2), holds the points of the strokes in coordinates of the SVG document, and `width` is the
    full width of a stroke in pixels.
    """
    radius = np.maximum(strokes.width, 0) * width / 2
    with progress(0.1, 0.5):
        features = np.column_stack([pixels, radius])
        kept = simplify_mask(features, strokes.start, SIMPLIFY_TOLERANCE_PX)
    start = offsets_from_sizes(kept)[strokes.start]
    points, radius = pixels[kept], radius[kept]
    min_radius = np.minimum.reduceat(radius, start[:-1])
    max_radius = np.maximum.reduceat(radius, start[:-1])
    left, right = _offset_sides(points, radius, start)
    paths = []
    for stroke, closed in enumerate(strokes.closed.tolist()):
        if stroke % PATHS_PER_REPORT == 0:
            report(0.5 + 0.5 * stroke / len(strokes), "writing strokes")
        span = slice(start[stroke], start[stroke + 1])
        if not max_radius[stroke]:
            continue
        if max_radius[stroke] - min_radius[stroke] <= WIDTH_TOLERANCE * width / 2:
            width_px = 2 * max_radius[stroke]
            is_full = abs(width_px - width) < WIDTH_TOLERANCE * width
            attribute = "" if is_full else f' stroke-width="{width_px:.3g}"'
            paths.append(f'<path{attribute} d="{_line_path(points[span], closed)}"/>')
        else:
            data = _tapered_path(left[span], right[span], radius[span][[0, -1]])
            paths.append(f'<path fill={quoteattr(color)} stroke="none" d="{data}"/>')
    return paths


def _offset_sides(
    points: np.ndarray, radius: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (n, 2) points to the left of polylines and (n, 2) points to the right, as seen on screen.

    Parameters
    ----------
    points : (n, 2) ndarray
        Points of all polylines, in coordinates of the SVG document: y points down.
    radius : (n,) ndarray
        Distance from each point to the points on its left and right.
    start : (S + 1,) ndarray of int
        Index of the first point of each polyline, then n.
    """
    forward = np.zeros_like(points)
    forward[:-1] = points[1:] - points[:-1]
    length = np.hypot(*forward.T)
    forward /= np.where(length > 0, length, 1)[:, None]
    backward = np.roll(forward, 1, axis=0)
    forward[start[1:] - 1] = backward[start[1:] - 1]
    backward[start[:-1]] = forward[start[:-1]]
    mean_direction = forward + backward
    norm = np.hypot(*mean_direction.T)
    is_reversal = norm < 1e-6
    mean_direction /= np.where(is_reversal, 1, norm)[:, None]
    mean_direction[is_reversal] = forward[is_reversal]
    # The distance is measured from the segments, so it is larger where two meet at an angle.
    miter = np.minimum(2 / np.maximum(norm, 1e-6), MAX_MITER)
    offset = (radius * miter)[:, None] * mean_direction[:, ::-1] * (1, -1)
    return points + offset, points - offset


def _tapered_path(left: np.ndarray, right: np.ndarray, end_radii: np.ndarray) -> str:
    """Return the SVG path data of a closed contour along points on both sides of a stroke.

    `left` and `right`, (n, 2), are the points on both sides, from the first to the last point of the stroke.
    The contour has round caps, whose radii at the first and at the last point are `end_radii`.
    """
    reversed_right = right[::-1]
    return (
        f"M{_format_points(left)} "
        f"{_end_cap(end_radii[1])}{_format_points(reversed_right[:1])} "
        f"L{_format_points(reversed_right[1:])} "
        f"{_end_cap(end_radii[0])}{_format_points(left[:1])}Z"
    )


def _end_cap(radius: float) -> str:
    """Return the SVG path command of a clockwise half circle, or of a line if the radius is below 0.05.

    The caller appends the coordinates of the point at which it ends.
    """
    return f"A{radius:.2f},{radius:.2f} 0 0 1 " if radius >= 0.05 else "L"


def _line_path(points: np.ndarray, closed: bool) -> str:
    """Return the SVG path data of a polyline. If it is closed, its repeated last point is left out."""
    return f"M{_format_points(points[:-1])}Z" if closed else f"M{_format_points(points)}"


def _format_points(points: np.ndarray) -> str:
    """Return (n, 2) coordinates as SVG text, with two decimals."""
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points.tolist())


def simplify_mask(points: np.ndarray, start: np.ndarray, tolerance: float) -> np.ndarray:
    """Choose the points to keep when polylines are simplified.

    This is the Ramer-Douglas-Peucker algorithm, for all polylines at once.

    Parameters
    ----------
    points : (n, k) ndarray
        Points of all polylines, in k dimensions.
    start : (S + 1,) ndarray of int
        Index of the first point of each polyline, then n.
    tolerance : float
        Largest distance of a removed point from the simplified polyline.

    Returns
    -------
    (n,) bool ndarray
        Whether each point is kept.
    """
    first, last = start[:-1].astype(np.int64), start[1:].astype(np.int64) - 1
    kept = mask(len(points), np.concatenate([first, last]))
    first, last = first[last - first > 1], last[last - first > 1]
    while len(first):
        report(1 - float((last - first).sum()) / len(points), "simplifying strokes")
        count = last - first - 1
        begin = offsets_from_sizes(count)[:-1]
        segment, point = numbered_ranges(first + 1, count)
        origin = points[first][segment]
        chord = points[last][segment] - origin
        delta = points[point] - origin
        chord_squared = dot(chord, chord)
        fraction = dot(delta, chord) / np.where(chord_squared > 0, chord_squared, 1)
        delta = delta - np.clip(fraction, 0, 1)[:, None] * chord
        distance = dot(delta, delta)
        max_distance = np.maximum.reduceat(distance, begin)
        split = max_distance > tolerance**2
        farthest = np.flatnonzero(distance == max_distance[segment])
        split_segment, index = np.unique(segment[farthest], return_index=True)
        middle = np.zeros(len(first), dtype=np.int64)
        middle[split_segment] = point[farthest[index]]
        first, middle, last = first[split], middle[split], last[split]
        kept[middle] = True
        first, last = np.concatenate([first, middle]), np.concatenate([middle, last])
        first, last = first[last - first > 1], last[last - first > 1]
    return kept


def plotter_order(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find an order and orientations of strokes for which the pen travels little between them.

    The next stroke is always the stroke with the nearest end (greedy). A grid speeds up the search.

    Parameters
    ----------
    first, last : (S, 2) ndarray
        First and last points of the strokes.

    Returns
    -------
    order : (S,) int64 ndarray
        Indices of the strokes in the new order.
    is_reversed : (S,) bool ndarray
        Whether each stroke is drawn backward, in the new order.
    """
    count = len(first)
    ends = np.concatenate([first, last])
    low, extent = ends.min(axis=0), max(np.ptp(ends, axis=0).max(), 1e-9)
    cell_count = max(int(np.sqrt(count)), 1)
    cell = np.minimum(((ends - low) / extent * cell_count).astype(np.int64), cell_count - 1)
    keys = [tuple(key) for key in cell.tolist()]
    grid: _Grid = {}
    for end_index, key in enumerate(keys):
        grid.setdefault(key, set()).add(end_index)
    positions = ends.tolist()
    current, current_cell, chosen = low.tolist(), (0, 0), []
    for number in range(count):
        if number % PATHS_PER_REPORT == 0:
            report(number / count, "ordering strokes")
        nearest = _nearest_end(grid, positions, current, current_cell, extent / cell_count)
        far_end = (nearest + count) % (2 * count)
        for end_index in (nearest, far_end):
            grid[keys[end_index]].discard(end_index)
        current, current_cell = positions[far_end], keys[far_end]
        chosen.append(nearest)
    is_last, order = np.divmod(chosen, count)
    return order, is_last > 0


def _nearest_end(
    grid: _Grid, positions: list[list[float]], current: list[float], cell: _Cell, cell_size: float
) -> int:
    """Return the index of the end that is nearest to the position `current`.

    `positions` are the positions of all ends, one or more of which are in the grid. `cell` is the cell of
    `current`, and `cell_size` the side of a cell in the unit of the positions. Rings of cells around `cell`
    are searched until no nearer end is possible.
    """
    best, best_distance = -1, np.inf
    for ring in itertools.count():
        if best_distance <= (max(ring - 1, 0) * cell_size) ** 2:
            break
        for key in _ring_cells(cell, ring):
            for end_index in sorted(grid.get(key, ())):
                x, y = positions[end_index]
                distance = (x - current[0]) ** 2 + (y - current[1]) ** 2
                if distance < best_distance:
                    best, best_distance = end_index, distance
    return best


def _ring_cells(center: _Cell, radius: int) -> list[_Cell]:
    """Return the grid cells on a square ring around a cell. The radius of the ring is in cells."""
    x, y = center
    if not radius:
        return [center]
    across, along = range(-radius, radius + 1), range(-radius + 1, radius)
    cells = [(i, j) for i in across for j in (-radius, radius)]
    cells += [(i, j) for i in (-radius, radius) for j in along]
    return [(x + i, y + j) for i, j in cells]

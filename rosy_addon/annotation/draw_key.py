"""Draw a key (color bar, legend, scale bar and caption) over a picture, according to its layout."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..core.color import from_hex, to_linear
from ..field.blocks import numbered_ranges
from .draw_marks import draw_dot, draw_over, window
from .key_contents import ColorScale
from .key_layout import Box, KeyLayout

#: Exponent that is applied to the transparency of dark text. Colors are mixed in linear light, in
#: which thin dark letters would look too light without it.
DARK_TEXT_EXPONENT = 2.0

#: Number of scan lines in each row of pixels, for the coverage of pixels by text. Along a scan line, it is
#: exact.
SCAN_LINES = 8

#: Radius of the corners of plates (background rectangles), as a multiple of the text size.
CORNER_RADIUS = 0.35


@dataclass(frozen=True)
class KeyColors:
    """The colors of a key: of its text and of the rectangles behind it.

    Attributes
    ----------
    text, plate : str
        Display colors ``#rrggbb`` of the text and of the background rectangles.
    plate_opacity : float
        Opacity of the background rectangles, 0 to 1.
    """

    text: str
    plate: str
    plate_opacity: float


#: Colors that are legible over any picture. The first look best over light pictures, the second over dark
#: ones.
LIGHT_PLATES = KeyColors("#141414", "#ffffff", 0.85)
DARK_PLATES = KeyColors("#f5f5f5", "#141414", 0.88)


def draw_key(
    rgba: np.ndarray,
    layout: KeyLayout,
    color_scale: ColorScale | None,
    text_triangles: Callable[[str], np.ndarray],
    colors: KeyColors = LIGHT_PLATES,
) -> None:
    """Draw a key (color bar, legend, scale bar and caption) over a picture, in place.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Picture: linear, not premultiplied, rows from the bottom.
    layout : KeyLayout
    color_scale : ColorScale or None
        Colors of the color bar; not used if the layout has none.
    text_triangles : callable
        Function that returns a line of text as (n, 3, 2) corners of triangles. Their unit is the text size,
        and their origin the left end of the baseline.
    colors : KeyColors
    """
    text, plate = (to_linear(from_hex(code)) for code in (colors.text, colors.plate))
    for box in layout.plates:
        _draw_plate(rgba, box, CORNER_RADIUS * layout.text_size, plate, colors.plate_opacity)
    for box in layout.strokes:
        _draw_rectangle(rgba, box, text)
    if layout.color_bar is not None:
        _draw_color_bar(rgba, layout.color_bar, color_scale)
    for dot in layout.dots:
        draw_dot(rgba, dot)
    is_dark = text.sum() < plate.sum()
    for line in layout.texts:
        triangles = text_triangles(line.text) * layout.text_size + (line.left, line.baseline)
        _draw_triangles(rgba, triangles, text, DARK_TEXT_EXPONENT if is_dark else 1.0)


def _draw_plate(
    rgba: np.ndarray, box: Box, radius: float, color: np.ndarray, opacity: float
) -> None:
    """Draw a rectangle with round corners over a picture (see `draw_key`), in place.

    `box` and `radius`, the radius of the corners, are in pixels. `color` is a linear color, (3,), and
    `opacity` is from 0 to 1.
    """
    low, high = np.array(box[:2]), np.array(box[2:])
    part, x, y = window(rgba, low, high)
    center, half = (low + high) / 2, (high - low) / 2 - radius
    beyond_x = np.maximum(np.abs(x - center[0]) - half[0], 0)
    beyond_y = np.maximum(np.abs(y - center[1]) - half[1], 0)
    draw_over(part, color, opacity * np.clip(radius + 0.5 - np.hypot(beyond_x, beyond_y), 0, 1))


def _draw_color_bar(rgba: np.ndarray, box: Box, color_scale: ColorScale) -> None:
    """Fill a box of whole pixels with the colors of a color map, from bottom to top, in place."""
    left, bottom, right, top = (round(value) for value in box)
    bar = rgba[bottom:top, left:right]
    bar[..., :3] = to_linear(color_scale.colors(top - bottom))[:, None]
    bar[..., 3] = 1.0


def _draw_rectangle(rgba: np.ndarray, box: Box, color: np.ndarray) -> None:
    """Draw an opaque rectangle of a linear color, (3,), with antialiased edges, in place."""
    part, x, y = window(rgba, np.array(box[:2]), np.array(box[2:]))
    left, bottom, right, top = box
    across = np.minimum(x + 0.5, right) - np.maximum(x - 0.5, left)
    along = np.minimum(y + 0.5, top) - np.maximum(y - 0.5, bottom)
    draw_over(part, color, np.clip(across, 0, 1) * np.clip(along, 0, 1))


def _draw_triangles(
    rgba: np.ndarray, triangles: np.ndarray, color: np.ndarray, exponent: float
) -> None:
    """Draw triangles that do not overlap, with antialiased edges, in place.

    `triangles` are (n, 3, 2) corners in pixels from the lower left, and `color` is linear, (3,). The opacity
    is 1 - (1 - coverage of the pixel)^exponent.
    """
    if not len(triangles):
        return
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    part, _, _ = window(rgba, low, high)
    if not part.size:
        return
    coverage = triangle_coverage(triangles - np.floor(np.maximum(low, 0)), *part.shape[1::-1])
    draw_over(part, color, 1 - (1 - coverage) ** exponent)


def triangle_coverage(triangles: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return the fraction of each pixel that is covered by triangles.

    A scan line crosses a triangle in an interval. The coverage along the line is a cumulative sum over the
    ends of intervals: the left end adds 1 to all pixels to its right, and the right end subtracts it again.
    The pixel that contains the end gets a part of this.

    Parameters
    ----------
    triangles : (n, 3, 2) float ndarray
        Corners in pixels from the lower left, y up, in any order. The triangles must not overlap.
    width, height : int
        Size of the window in pixels. Triangles are clipped to it.

    Returns
    -------
    (height, width) float32 ndarray
        0 to 1.
    """
    corners = np.asarray(triangles, dtype=np.float64)
    corners = np.take_along_axis(corners, np.argsort(corners[..., 1], axis=1)[..., None], axis=1)
    x, y = corners[..., 0], corners[..., 1] * SCAN_LINES
    # Scan line s is at s + 1/2.
    first = np.clip(np.ceil(y[:, 0] - 0.5), 0, SCAN_LINES * height).astype(np.int64)
    stop = np.clip(np.ceil(y[:, 2] - 0.5), 0, SCAN_LINES * height).astype(np.int64)
    count = np.maximum(stop - first, 0)
    owner, line = numbered_ranges(first, count)
    x, y, level = x[owner], y[owner], line + 0.5
    start = np.where(level < y[:, 1], 0, 1)
    sides = _crossing(x, y, start, start + 1, level), _crossing(x, y, 0 * start, 2, level)
    left, right = np.minimum(*sides), np.maximum(*sides)
    total = np.zeros(height * (width + 1))
    for end, sign in ((left, 1.0), (right, -1.0)):
        end = np.clip(end, 0, width)
        pixel = np.minimum(end.astype(np.int64), width - 1)
        inside = pixel + 1 - end  # the part of the pixel to the right of the end
        index = (line // SCAN_LINES) * (width + 1) + pixel
        total += np.bincount(index, sign * inside, len(total))
        total += np.bincount(index + 1, sign * (1 - inside), len(total))
    coverage = np.cumsum(total.reshape(height, width + 1), axis=1)[:, :width] / SCAN_LINES
    return np.clip(coverage, 0, 1).astype(np.float32)


def _crossing(
    x: np.ndarray, y: np.ndarray, first: np.ndarray, last: np.ndarray | int, level: np.ndarray
) -> np.ndarray:
    """Return (n,) x coordinates at which edges of triangles cross horizontal lines.

    The edge is from the corner `first` to the corner `last` of each triangle, whose coordinates are `x` and
    `y`, (n, 3). `level`, (n,), is the y coordinate of the line.
    """
    rows = np.arange(len(x))
    x0, y0 = x[rows, first], y[rows, first]
    rise = y[rows, last] - y0
    along = np.divide(level - y0, rise, out=np.zeros_like(level), where=rise > 0)
    return x0 + np.clip(along, 0, 1) * (x[rows, last] - x0)

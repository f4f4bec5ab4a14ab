"""Draw arrowheads, and the dots and labels of singularities, over a picture in linear light."""

from functools import lru_cache

import numpy as np

from ..core.color import from_hex, to_linear
from ..core.progress import report
from ..field.blocks import blocks_by_count, concatenated_ranges, numbered_ranges
from . import arrow_marks, singularity_marks
from .arrow_marks import NOTCH, WIDTH, ArrowMarks
from .index_labels import HALO, HALO_COLOR, LABEL_COLOR, Label, placed_labels, stroke_width
from .singularity_marks import Dot, SingularityMarks

#: Number of dots that are drawn between two reports of the progress, and number of pixels of arrowheads that
#: are drawn at once.
DOTS_PER_BLOCK, PIXELS_PER_BLOCK = 256, 1 << 19


def window(
    rgba: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the part of a picture between two corners, and the x and y coordinates of its pixel centers.

    `low` and `high` are the lower left and the upper right corner, in pixels from the lower left of the
    picture. The part, (h, w, 4), is a view of the picture. It is empty if the corners are outside of the
    picture. x and y, (h, w) each, are pixels of the whole picture.
    """
    size = rgba.shape[1::-1]
    left, bottom = np.floor(np.clip(low, 0, size)).astype(int)
    right, top = np.ceil(np.clip(high, 0, size)).astype(int)
    y, x = np.mgrid[bottom:top, left:right] + 0.5
    return rgba[bottom:top, left:right], x, y


def draw_over(part: np.ndarray, color: np.ndarray, opacity: np.ndarray) -> None:
    """Composite a linear color, with an opacity for each pixel, over a part of a picture, in place.

    `part`, (h, w, 4), is linear and not premultiplied. `color` is (3,), and `opacity`, 0 to 1, is (h, w).
    """
    opacity = opacity.astype(np.float32)
    alpha = opacity + part[..., 3] * (1 - opacity)
    share = np.divide(opacity, alpha, out=np.zeros_like(alpha), where=alpha > 0)[..., None]
    part[..., :3] += share * (color - part[..., :3])
    part[..., 3] = alpha


def draw_marks(rgba: np.ndarray, marks: SingularityMarks) -> np.ndarray:
    """Draw the dots of singularities and their labels over a picture.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Picture: linear, not premultiplied, rows from the bottom. It is not changed.
    marks : SingularityMarks

    Returns
    -------
    (H, W, 4) float32 ndarray
        The picture with dots and labels.
    """
    rgba = rgba.copy()
    marks = marks.in_drawing_order()
    outline = singularity_marks.OUTLINE * marks.size
    rows = zip(marks.position, marks.radius.tolist(), marks.index, marks.is_visible, strict=True)
    for number, (center, radius, index, is_visible) in enumerate(rows):
        if number % DOTS_PER_BLOCK == 0:
            report(number / len(marks), "drawing singularities")
        opacity = 1.0 if is_visible else singularity_marks.HIDDEN_OPACITY
        draw_dot(rgba, Dot(*center, radius, outline, int(index)), opacity)
    for label in placed_labels(marks):
        _draw_label(rgba, label, marks.size)
    return rgba


def draw_dot(rgba: np.ndarray, dot: Dot, opacity: float = 1.0) -> None:
    """Draw the dot of a singularity over a picture, in place.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Picture: linear, not premultiplied, rows from the bottom.
    dot : Dot
    opacity : float
        Opacity of the whole dot, 0 to 1.
    """
    center, outer = np.array((dot.x, dot.y)), dot.radius + dot.outline
    part, x, y = window(rgba, center - outer - 1, center + outer + 1)
    distance = np.hypot(x - dot.x, y - dot.y)
    inner = np.clip(dot.radius + 0.5 - distance, 0, 1)[..., None].astype(np.float32)
    fill = _linear_color(singularity_marks.COLOR_BY_SIGN[int(np.sign(dot.index))])
    line = _linear_color(singularity_marks.OUTLINE_COLOR)
    draw_over(part, line + inner * (fill - line), opacity * np.clip(outer + 0.5 - distance, 0, 1))


@lru_cache(maxsize=8)
def _linear_color(code: str) -> np.ndarray:
    """Return (3,) float32: a color ``#rrggbb`` in linear light. Do not change the array, as it is cached."""
    return to_linear(from_hex(code))


def _draw_label(rgba: np.ndarray, label: Label, size: float) -> None:
    """Draw the label of a singularity and the halo around it, in place.

    `size` is the diameter, in pixels, of a dot of index 1 / N.
    """
    segments = label.segments()
    width = stroke_width(size) / 2
    reach = width + HALO * size + 1
    part, x, y = window(rgba, segments.min(axis=(0, 1)) - reach, segments.max(axis=(0, 1)) + reach)
    distance = np.min([_edge_distance(x, y, *ends)[0] for ends in segments], axis=0)
    for color, radius in ((HALO_COLOR, width + HALO * size), (LABEL_COLOR, width)):
        draw_over(part, _linear_color(color), np.clip(radius + 0.5 - distance, 0, 1))


# --- arrowheads --------------------------------------------------------------------------------------


def draw_arrows(rgba: np.ndarray, marks: ArrowMarks) -> np.ndarray:
    """Draw arrowheads over a picture. Arrowheads that overlap have a common outline.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Picture: linear, not premultiplied, rows from the bottom. It is not changed.
    marks : ArrowMarks

    Returns
    -------
    (H, W, 4) float32 ndarray
        The picture with arrowheads.
    """
    rgba = rgba.copy()
    height, width = rgba.shape[:2]
    distance = np.full(height * width, np.inf, dtype=np.float32)
    reach = np.hypot(1, WIDTH) / 2 * marks.size + marks.outline + 1
    low = np.clip(np.floor(marks.position - reach), 0, (width, height)).astype(np.intp)
    high = np.clip(np.ceil(marks.position + reach), 0, (width, height)).astype(np.intp)
    # The rows of pixels of each arrowhead.
    row_count = high[:, 1] - low[:, 1]
    head, row = numbered_ranges(low[:, 1], row_count)
    length = (high - low)[head, 0]
    for part in blocks_by_count(length, PIXELS_PER_BLOCK):
        report(part.start / len(head), "drawing arrowheads")
        column = concatenated_ranges(low[head[part], 0], length[part])
        of_head, of_row = (np.repeat(values[part], length[part]) for values in (head, row))
        x, y = column + 0.5 - marks.position[of_head, 0], of_row + 0.5 - marks.position[of_head, 1]
        nearest = head_distance(x, y, marks.direction[of_head], marks.size).astype(np.float32)
        near = np.flatnonzero(nearest < marks.outline + 0.5)
        np.minimum.at(distance, of_row[near] * width + column[near], nearest[near])
    drawn = np.flatnonzero(distance < marks.outline + 0.5)
    pixels = rgba.reshape(-1, 4)
    part, distance = pixels[drawn], distance[drawn]
    fill, line = _linear_color(arrow_marks.FILL_COLOR), _linear_color(arrow_marks.OUTLINE_COLOR)
    inner = np.clip(0.5 - distance, 0, 1)[:, None]
    draw_over(part, line + inner * (fill - line), np.clip(marks.outline + 0.5 - distance, 0, 1))
    pixels[drawn] = part
    return rgba


def head_distance(x: np.ndarray, y: np.ndarray, direction: np.ndarray, size: float) -> np.ndarray:
    """Return the signed distances from points to the outlines of arrowheads.

    Parameters
    ----------
    x, y : (n,) float64 ndarray
        Each point, relative to the middle of its arrowhead, in pixels.
    direction : (n, 2) float64 ndarray
        Unit vector in which the arrowhead of each point points.
    size : float
        Length of an arrowhead, pixels.

    Returns
    -------
    (n,) float64 ndarray
        Distances in pixels; negative inside the arrowhead.
    """
    along = x * direction[:, 0] + y * direction[:, 1]
    across = np.abs(y * direction[:, 0] - x * direction[:, 1])
    tip, barb, notch = head_outline(size)
    to_side, is_inside_side = _edge_distance(along, across, tip, barb)
    to_back, is_inside_back = _edge_distance(along, across, barb, notch)
    distance = np.minimum(to_side, to_back)
    return np.where(is_inside_side & is_inside_back, -distance, distance)


def head_outline(size: float) -> np.ndarray:
    """Return (3, 2) float64: the tip, the left barb and the notch of an arrowhead that is `size` long.

    The first coordinate is forward and the second to the left, from the middle of the arrowhead.
    """
    return size * np.array([[0.5, 0.0], [-0.5, 0.5 * WIDTH], [NOTCH - 0.5, 0.0]])


def _edge_distance(
    x: np.ndarray, y: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances from points to an edge, and whether points are to its left or on its line.

    `x` and `y` are the coordinates of the points, in any shape, which is also the shape of the results.
    `start` and `end`, (2,), are the ends of the edge. Left is as seen from the start toward the end.
    """
    dx, dy = end - start
    px, py = x - start[0], y - start[1]
    share = np.clip((px * dx + py * dy) / (dx * dx + dy * dy or 1.0), 0, 1)
    return np.hypot(px - share * dx, py - share * dy), dx * py - dy * px >= 0

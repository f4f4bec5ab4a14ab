"""Draw a key over a picture, by its layout."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..color import from_hex, to_linear
from .draw_marks import draw_dot
from .key_contents import ColorScale
from .key_layout import Box, KeyLayout
from .painting import draw_over, window
from .text_coverage import triangle_coverage

#: Exponent of the transparency of dark text at the edges of letters. Light is mixed, and thin dark letters
#: would look too light.
DARK_TEXT_EXPONENT = 2.0

#: Radius of the corners of plates, in text sizes.
CORNER_RADIUS = 0.35


@dataclass(frozen=True)
class KeyColors:
    """The colors of a key.

    Attributes
    ----------
    text, plate : str
        Display colors ``#rrggbb``.
    plate_opacity : float
    """

    text: str
    plate: str
    plate_opacity: float


#: Keys that can be read on any background; each looks best on backgrounds like its plate.
LIGHT_PLATES = KeyColors("#141414", "#ffffff", 0.85)
DARK_PLATES = KeyColors("#f5f5f5", "#141414", 0.88)


def draw_key(
    rgba: np.ndarray,
    layout: KeyLayout,
    color_scale: ColorScale | None,
    text_triangles: Callable[[str], np.ndarray],
    colors: KeyColors = LIGHT_PLATES,
) -> None:
    """Draw a key over a picture, in place.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear, not premultiplied, rows from the bottom.
    layout : KeyLayout
    color_scale : ColorScale or None
        What the color bar shows, if there is one.
    text_triangles : callable
        Returns the (n, 3, 2) triangles of a line of text, in text sizes from its left end and baseline.
    colors : KeyColors
    """
    text, plate = (to_linear(from_hex(code)) for code in (colors.text, colors.plate))
    for box in layout.plates:
        _draw_plate(rgba, box, CORNER_RADIUS * layout.text_size, plate, colors.plate_opacity)
    if layout.color_bar is not None:
        _draw_color_bar(rgba, layout.color_bar, color_scale)
    for box in layout.strokes:
        _draw_rectangle(rgba, box, text)
    for dot in layout.dots:
        draw_dot(rgba, np.array((dot.x, dot.y)), dot.radius, dot.outline, dot.index)
    is_dark = text.sum() < plate.sum()
    for line in layout.texts:
        triangles = text_triangles(line.text) * layout.text_size + (line.left, line.baseline)
        _draw_triangles(rgba, triangles, text, DARK_TEXT_EXPONENT if is_dark else 1.0)


def _draw_plate(
    rgba: np.ndarray, box: Box, radius: float, color: np.ndarray, opacity: float
) -> None:
    """Draw a rectangle with round corners."""
    low, high = np.array(box[:2]), np.array(box[2:])
    found = window(rgba, low, high)
    if found is None:
        return
    part, x, y = found
    center, half = (low + high) / 2, (high - low) / 2 - radius
    beyond = (
        np.maximum(np.abs(x - center[0]) - half[0], 0),
        np.maximum(np.abs(y - center[1]) - half[1], 0),
    )
    draw_over(part, color, opacity * np.clip(radius + 0.5 - np.hypot(*beyond), 0, 1))


def _draw_color_bar(rgba: np.ndarray, box: Box, color_scale: ColorScale) -> None:
    """Draw a color map from the bottom to the top of a box of whole pixels."""
    left, bottom, right, top = (round(value) for value in box)
    bar = rgba[bottom:top, left:right]
    bar[..., :3] = to_linear(color_scale.colors(top - bottom))[:, None]
    bar[..., 3] = 1.0


def _draw_rectangle(rgba: np.ndarray, box: Box, color: np.ndarray) -> None:
    """Draw a rectangle."""
    found = window(rgba, np.array(box[:2]), np.array(box[2:]))
    if found is None:
        return
    part, x, y = found
    left, bottom, right, top = box
    across = np.minimum(x + 0.5, right) - np.maximum(x - 0.5, left)
    along = np.minimum(y + 0.5, top) - np.maximum(y - 0.5, bottom)
    draw_over(part, color, np.clip(across, 0, 1) * np.clip(along, 0, 1))


def _draw_triangles(
    rgba: np.ndarray, triangles: np.ndarray, color: np.ndarray, exponent: float
) -> None:
    """Draw triangles that do not overlap, with an exponent of the transparency."""
    if not len(triangles):
        return
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    found = window(rgba, low, high)
    if found is None:
        return
    part = found[0]
    corner = np.floor(np.maximum(low, 0))
    coverage = triangle_coverage(triangles - corner, part.shape[1], part.shape[0])
    draw_over(part, color, 1 - (1 - coverage) ** exponent)

"""The layout of a key in the frame of a picture: a color bar, a legend, a scale bar and a caption.

The color bar is at the right edge, the legend in the lower right corner, the scale bar in the lower left
corner, and the caption at the bottom. Each has a plate of its own. If they do not fit, all are drawn
smaller. Coordinates are pixels from the lower left corner of the frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..field.singularities import format_index
from .key_contents import ColorScale, IndexCount
from .round_numbers import MINUS, tick_labels
from .singularity_marks import OUTLINE, dot_diameters

#: Text size if none is given, as a fraction of the smaller side of the frame, and its least value in pixels.
TEXT_SIZE, MIN_TEXT_SIZE = 0.022, 9.0

#: Factor by which everything is made smaller until it fits, and text size in pixels at which this ends.
SHRINK, END_TEXT_SIZE = 0.94, 2.0

#: Distance of plates from the edges of the frame, as a fraction of its smaller side.
MARGIN = 0.025

# All lengths below are in text sizes.

#: Height of capitals and digits, depth of letters below the baseline, and distance of baselines.
CAP_HEIGHT, DESCENT, LINE = 0.7, 0.23, 1.3

#: Distance of the contents of a plate from its edges, and of plates from one another.
PADDING, PLATE_GAP = 0.6, 0.6

#: Width of the color bar, length of its ticks, distance of labels from them, and of the title from the bar.
BAR_WIDTH, TICK_LENGTH, LABEL_GAP, TITLE_GAP = 0.9, 0.35, 0.35, 1.0

#: Largest and smallest length of the color bar, and the largest as a fraction of the height of the frame.
MAX_BAR, MIN_BAR, MAX_BAR_FRACTION = 20.0, 5.0, 0.5

#: Least distance of the labels of the color bar, and width at which its title is wrapped.
TICK_DISTANCE, TITLE_WIDTH = 2.0, 9.0

#: Distance of the rows of the legend, and of the labels from the dots.
ROW_GAP, DOT_GAP = 0.6, 0.5

#: Height of the ends of the scale bar, and its distance from the text.
SCALE_END, SCALE_GAP = 0.5, 0.3

#: Width of lines.
STROKE = 0.07

#: Width of the caption, as a fraction of the width of the frame.
CAPTION_WIDTH = 0.8

#: Left, bottom, right and top.
Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class KeyParts:
    """What a key shows.

    Attributes
    ----------
    color_scale : ColorScale or None
        Its title may have several lines.
    indices : sequence of IndexCount
        The rows of the legend.
    dot_size : float
        Diameter of a dot of index 1 / N, pixels.
    has_counts : bool
        Whether rows of the legend say how many singularities are visible.
    scale : (float, str) or None
        Length of the scale bar in pixels, and its label.
    caption : str
        May have several lines.
    """

    color_scale: ColorScale | None = None
    indices: Sequence[IndexCount] = ()
    dot_size: float = 0.0
    has_counts: bool = False
    scale: tuple[float, str] | None = None
    caption: str = ""


@dataclass(frozen=True)
class PlacedText:
    """A line of text: its left end and its baseline."""

    text: str
    left: float
    baseline: float


@dataclass(frozen=True)
class PlacedDot:
    """The dot of a singularity: its center, its radius, and the width of its outline."""

    x: float
    y: float
    radius: float
    outline: float
    index: int


@dataclass
class KeyLayout:
    """Where the parts of a key are.

    Attributes
    ----------
    text_size : float
        Pixels.
    plates : list of Box
    texts : list of PlacedText
    strokes : list of Box
        Rectangles in the color of the text.
    dots : list of PlacedDot
    color_bar : Box or None
        The first color is at its bottom.
    """

    text_size: float
    plates: list[Box] = field(default_factory=list)
    texts: list[PlacedText] = field(default_factory=list)
    strokes: list[Box] = field(default_factory=list)
    dots: list[PlacedDot] = field(default_factory=list)
    color_bar: Box | None = None

    @property
    def stroke(self) -> float:
        """Width of lines, whole pixels."""
        return max(round(STROKE * self.text_size), 1)


def lay_out_key(
    parts: KeyParts,
    frame: tuple[int, int],
    text_width: Callable[[str], float],
    text_size: float = 0.0,
) -> KeyLayout:
    """Place the parts of a key in a frame so that they do not overlap.

    Parameters
    ----------
    parts : KeyParts
    frame : (int, int)
        Width and height of the picture in pixels.
    text_width : callable
        Returns the width of a line of text, in text sizes.
    text_size : float
        Pixels. 0: `TEXT_SIZE` of the frame. The size that fits may be smaller.

    Returns
    -------
    KeyLayout
    """
    size = first_size = text_size or max(TEXT_SIZE * min(frame), MIN_TEXT_SIZE)
    while True:
        layout = _Arrangement(parts, frame, text_width, size, size / first_size).layout()
        if layout is not None or size <= END_TEXT_SIZE:
            return layout or KeyLayout(size)
        size *= SHRINK


def wrapped(text: str, width: float, text_width: Callable[[str], float]) -> list[str]:
    """Return the lines of a text, broken at spaces where they are wider than a width.

    A word that is wider has a line of its own.
    """
    lines: list[str] = []
    for paragraph in text.strip().splitlines():
        line = ""
        for word in paragraph.split():
            longer = f"{line} {word}" if line else word
            if line and text_width(longer) > width:
                lines.append(line)
                longer = word
            line = longer
        lines.append(line)
    return lines


@dataclass
class _Arrangement:
    """Places the parts of a key for one text size. `layout` returns None if they do not fit."""

    parts: KeyParts
    frame: tuple[int, int]
    text_width: Callable[[str], float]
    size: float
    dot_scale: float

    def __post_init__(self) -> None:
        self.margin = MARGIN * min(self.frame)
        self.result = KeyLayout(self.size)

    def layout(self) -> KeyLayout | None:
        """Place everything."""
        parts = self.parts
        if parts.caption.strip():
            self._caption()
        if parts.scale is not None:
            self._scale_bar(*parts.scale)
        lowest = 0.0
        if parts.indices:
            lowest = self._legend() + PLATE_GAP * self.size
        if parts.color_scale is not None and not self._color_bar(parts.color_scale, lowest):
            return None
        return self.result if self._fits() else None

    def _fits(self) -> bool:
        """Return whether all plates are inside the frame and none overlap."""
        low, high = np.array(self.result.plates).reshape(-1, 2, 2).transpose(1, 0, 2)
        meets = ((low[:, None] < high[None]) & (high[:, None] > low[None])).all(axis=2)
        return bool((low >= 0).all() and (high <= self.frame).all()) and meets.sum() == len(low)

    def _width(self, texts: Sequence[str]) -> float:
        """Return the width of the widest of some texts, pixels."""
        return self.size * max((self.text_width(text) for text in texts), default=0.0)

    def _bottom(self, left: float, width: float) -> float:
        """Return the lowest bottom of a plate with this left side and width: above the caption, or beside it."""
        gap = PLATE_GAP * self.size
        if self.parts.caption.strip():
            caption_left, _, caption_right, caption_top = self.result.plates[0]
            if left < caption_right + gap and left + width > caption_left - gap:
                return caption_top + gap
        return self.margin

    def _add_plate(
        self, left: float, bottom: float, width: float, height: float
    ) -> tuple[float, float]:
        """Add the plate of contents of a size. Return the lower left corner of the contents."""
        left, bottom = round(left), round(bottom)
        padding = round(PADDING * self.size)
        self.result.plates.append(
            (left, bottom, left + round(width) + 2 * padding, bottom + round(height) + 2 * padding)
        )
        return left + padding, bottom + padding

    def _add_text(self, text: str, left: float, baseline: float) -> None:
        self.result.texts.append(PlacedText(text, left, baseline))

    def _plate_size(self, length: float) -> float:
        """Return a side of the plate of contents of a size."""
        return round(length) + 2 * round(PADDING * self.size)

    def _caption(self) -> None:
        """Place the caption, before all others."""
        size, width = self.size, self.frame[0]
        lines = wrapped(self.parts.caption, CAPTION_WIDTH * width / size, self.text_width)
        text_width = self._width(lines)
        height = (CAP_HEIGHT + DESCENT + LINE * (len(lines) - 1)) * size
        left, bottom = self._add_plate(
            (width - self._plate_size(text_width)) / 2, self.margin, text_width, height
        )
        for number, line in enumerate(lines):
            indent = (text_width - self._width([line])) / 2
            baseline = bottom + (DESCENT + LINE * (len(lines) - 1 - number)) * size
            self._add_text(line, left + indent, baseline)

    def _scale_bar(self, length: float, label: str) -> None:
        """Place the scale bar."""
        size, stroke = self.size, self.result.stroke
        label_width = self._width([label])
        width = max(length, label_width)
        end = round(SCALE_END * size)
        bottom = self._bottom(self.margin, self._plate_size(width))
        left, bottom = self._add_plate(
            self.margin, bottom, width, end + (SCALE_GAP + CAP_HEIGHT) * size
        )
        start = left + (width - length) / 2
        middle = bottom + (end - stroke) // 2
        self.result.strokes += [
            (start, middle, start + length, middle + stroke),
            (start, bottom, start + stroke, bottom + end),
            (start + length - stroke, bottom, start + length, bottom + end),
        ]
        self._add_text(label, left + (width - label_width) / 2, bottom + end + SCALE_GAP * size)

    def _legend(self) -> float:
        """Place the legend of the singularities, and return its top."""
        parts, size = self.parts, self.size
        labels = [_index_label(entry, parts.has_counts) for entry in parts.indices]
        outline = OUTLINE * parts.dot_size * self.dot_scale
        index = np.array([entry.index for entry in parts.indices])
        diameters = dot_diameters(index, parts.dot_size * self.dot_scale) + 2 * outline
        heights = np.maximum(diameters, CAP_HEIGHT * size)
        column = float(diameters.max())
        width = column + DOT_GAP * size + self._width(labels)
        height = float(heights.sum()) + ROW_GAP * size * (len(labels) - 1)
        plate_width = self._plate_size(width)
        left = self.frame[0] - self.margin - plate_width
        left, bottom = self._add_plate(left, self._bottom(left, plate_width), width, height)
        top = bottom + height
        for entry, label, diameter, row in zip(
            parts.indices, labels, diameters.tolist(), heights.tolist(), strict=True
        ):
            y = top - row / 2
            radius = diameter / 2 - outline
            self.result.dots.append(PlacedDot(left + column / 2, y, radius, outline, entry.index))
            self._add_text(label, left + column + DOT_GAP * size, y - CAP_HEIGHT / 2 * size)
            top -= row + ROW_GAP * size
        return self.result.plates[-1][3]

    def _color_bar(self, scale: ColorScale, lowest: float) -> bool:
        """Place the color bar above `lowest`. Return whether there is room."""
        size, stroke = self.size, self.result.stroke
        width, height = self.frame
        title = wrapped(scale.title, TITLE_WIDTH, self.text_width)
        # Half a label is below the bar, and half a label or the title above it.
        above = CAP_HEIGHT / 2 * size
        if title:
            above = (TITLE_GAP + CAP_HEIGHT + LINE * (len(title) - 1)) * size
        around = CAP_HEIGHT / 2 * size + above
        widest = max(self._width(title), 8 * size)
        lowest = max(lowest, self._bottom(width - self.margin - self._plate_size(widest), width))
        room = height - self.margin - lowest - self._plate_size(around)
        length = int(min(MAX_BAR_FRACTION * height, MAX_BAR * size, room))
        if length < MIN_BAR * size:
            return False
        max_steps = int(length / (TICK_DISTANCE * size))
        ticks = _ticks(scale, max_steps, CAP_HEIGHT * 1.7 * size / length)
        beside = (TICK_LENGTH + LABEL_GAP) * size + self._width([label for _, label in ticks])
        content = max(BAR_WIDTH * size + beside, self._width(title))
        plate_height = self._plate_size(around + length)
        left, bottom = self._add_plate(
            width - self.margin - self._plate_size(content),
            max((height - plate_height) / 2, lowest),
            content,
            around + length,
        )
        bar_bottom = bottom + round(CAP_HEIGHT / 2 * size)
        right = left + round(BAR_WIDTH * size)
        self.result.color_bar = bar = (left, bar_bottom, right, bar_bottom + length)
        self.result.strokes += _frame_strokes(bar, stroke)
        for fraction, label in ticks:
            y = bar_bottom + fraction * (length - stroke)
            end = right + round(TICK_LENGTH * size)
            self.result.strokes.append((right, round(y), end, round(y) + stroke))
            baseline = y + stroke / 2 - CAP_HEIGHT / 2 * size
            self._add_text(label, right + (TICK_LENGTH + LABEL_GAP) * size, baseline)
        for number, line in enumerate(title):
            above = TITLE_GAP + LINE * (len(title) - 1 - number)
            self._add_text(line, left, bar_bottom + length + above * size)
        return True


def _ticks(scale: ColorScale, max_steps: int, gap: float) -> list[tuple[float, str]]:
    """Return the ticks of a color bar: their places from 0 to 1, and their labels."""
    if scale.high is None:
        low = "min" if scale.low is None else tick_labels(scale.low, scale.low, 1, 0.0)[0][1]
        return [(0.0, low), (1.0, "max")]
    low, high = sorted((scale.low, scale.high))
    labels = tick_labels(low, high, max(max_steps, 1), gap)
    extent = high - low or 1.0
    return [((value - low) / extent, label) for value, label in labels]


def _frame_strokes(box: Box, width: float) -> list[Box]:
    """Return the four lines around a box, outside of it."""
    left, bottom, right, top = box
    return [
        (left - width, bottom - width, right + width, bottom),
        (left - width, top, right + width, top + width),
        (left - width, bottom, left, top),
        (right, bottom, right + width, top),
    ]


def _index_label(entry: IndexCount, has_count: bool) -> str:
    """Return the label of a row of the legend."""
    label = format_index(entry.index, entry.degree).replace("-", MINUS)
    return f"{label} ({entry.count})" if has_count and entry.count is not None else label

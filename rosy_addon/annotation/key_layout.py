"""The layout of a key in the frame of a picture: a color bar, a legend, a scale bar and a caption.

The color bar is at the right edge, the legend in the lower right corner, the scale bar in the lower left
corner, and the caption at the bottom. Each is drawn on a plate of its own, a rectangle that hides the picture
behind it. If the plates do not fit, all parts are drawn smaller. Coordinates are pixels from the lower left
corner of the frame.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..field.singularities import format_index
from .key_contents import ColorScale, IndexCount, PictureKey
from .round_numbers import MINUS, tick_labels
from .singularity_marks import OUTLINE, Dot, dot_diameters

#: Text size if none is given, as a fraction of the smaller side of the frame. It is at least `MIN_TEXT_SIZE`
#: pixels.
TEXT_SIZE, MIN_TEXT_SIZE = 0.022, 9.0

#: While the parts do not fit, the text size is multiplied by `SHRINK`, until it is at most `END_TEXT_SIZE`
#: pixels.
SHRINK, END_TEXT_SIZE = 0.94, 2.0

#: Distance of plates (background rectangles) from the edges of the frame, as a fraction of its smaller side.
MARGIN = 0.025

# All lengths below are multiples of the text size, except fractions of the frame.

#: Height of capitals and digits, depth of letters below the baseline, and distance between baselines.
CAP_HEIGHT, DESCENT, LINE = 0.7, 0.23, 1.3

#: Distance between the contents of a plate and its edges, and distance between plates.
PADDING, PLATE_GAP = 0.6, 0.6

#: Width of the color bar, length of its ticks, distance from ticks to labels, and from the bar to its title.
BAR_WIDTH, TICK_LENGTH, LABEL_GAP, TITLE_GAP = 0.9, 0.35, 0.35, 1.0

#: Largest and smallest length of the color bar. It is also at most `MAX_BAR_FRACTION` of the height of the
#: frame.
MAX_BAR, MIN_BAR, MAX_BAR_FRACTION = 20.0, 5.0, 0.5

#: Smallest distance between the labels of the color bar, and width at which its title is wrapped.
TICK_DISTANCE, TITLE_WIDTH = 2.0, 9.0

#: Distance between rows of the legend, and distance from dots to labels.
ROW_GAP, DOT_GAP = 0.6, 0.5

#: Height of the ticks at both ends of the scale bar, and distance from the bar to its label.
SCALE_END, SCALE_GAP = 0.5, 0.3

#: Thickness of drawn lines.
STROKE = 0.07

#: Largest width of the caption, as a fraction of the width of the frame.
CAPTION_WIDTH = 0.8

#: Left, bottom, right and top of a rectangle, pixels.
Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class KeyParts(PictureKey):
    """Contents of a key: color bar, legend of singularities, scale bar and caption.

    Attributes
    ----------
    color_scale : ColorScale or None
        Values and title of the color bar; None: no color bar. The title may have several lines.
    indices : sequence of IndexCount
        Singularity indices, one for each row of the legend; empty: no legend.
    dot_size : float
        Diameter in pixels of the dot for the index 1 / N.
    has_counts : bool
        Whether rows of the legend say how many singularities are visible.
    scale : (float, str) or None
        Length of the scale bar in pixels, and its label; None: no scale bar.
    caption : str
        Text of one or several lines; empty: no caption.
    """

    has_counts: bool = False
    scale: tuple[float, str] | None = None
    caption: str = ""


@dataclass(frozen=True)
class PlacedText:
    """A line of text with the coordinates, in pixels, of its left end (x) and its baseline (y)."""

    text: str
    left: float
    baseline: float


@dataclass
class KeyLayout:
    """Positions of all parts of a key, in pixels from the lower left corner of the frame.

    Attributes
    ----------
    text_size : float
        Size of the text, pixels.
    plates : list of Box
        Background rectangles of the parts.
    texts : list of PlacedText
        Lines of text.
    strokes : list of Box
        Lines, as thin rectangles, in the color of the text; and the frame of the color bar, as a rectangle
        below its colors.
    dots : list of Dot
        Dots of the legend.
    color_bar : Box or None
        Rectangle of the colors, with the first color at the bottom; None: no color bar.
    """

    text_size: float
    plates: list[Box] = field(default_factory=list)
    texts: list[PlacedText] = field(default_factory=list)
    strokes: list[Box] = field(default_factory=list)
    dots: list[Dot] = field(default_factory=list)
    color_bar: Box | None = None

    @property
    def stroke(self) -> float:
        """Thickness of lines in whole pixels."""
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
        Function that returns the width of a line of text, as a multiple of the text size.
    text_size : float
        Text size in pixels. It is reduced until the parts fit. 0: the fraction `TEXT_SIZE` of the smaller
        side of the frame.

    Returns
    -------
    KeyLayout
        Without any part if they do not fit at the smallest text size.
    """
    size = first_size = text_size or max(TEXT_SIZE * min(frame), MIN_TEXT_SIZE)
    while True:
        layout = _Arrangement(parts, frame, text_width, size, size / first_size).layout()
        if layout is not None or size <= END_TEXT_SIZE:
            return layout or KeyLayout(size)
        size *= SHRINK


def wrapped(text: str, width: float, text_width: Callable[[str], float]) -> list[str]:
    """Return the lines of a text, broken at spaces so that they are not wider than `width`.

    A single word that is wider is on a line of its own. `text_width` returns the width of a string, in the
    unit of `width`.
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
    """The arrangement of the parts of a key for one text size, `size`, in pixels.

    The diameters of the dots in the legend are multiplied by `dot_scale`.
    """

    parts: KeyParts
    frame: tuple[int, int]
    text_width: Callable[[str], float]
    size: float
    dot_scale: float

    def __post_init__(self) -> None:
        self.margin = MARGIN * min(self.frame)
        self.result = KeyLayout(self.size)

    def layout(self) -> KeyLayout | None:
        """Return the layout of all parts, or None if they do not fit into the frame."""
        parts = self.parts
        if parts.caption.strip():
            self._caption()
        if parts.scale is not None:
            self._scale_bar(*parts.scale)
        lowest = self._legend() + PLATE_GAP * self.size if parts.indices else 0.0
        has_room = parts.color_scale is None or self._color_bar(parts.color_scale, lowest)
        return self.result if has_room and self._fits() else None

    def _fits(self) -> bool:
        """Return whether all background rectangles are inside the frame and no two of them overlap."""
        low, high = np.array(self.result.plates).reshape(-1, 2, 2).transpose(1, 0, 2)
        meets = ((low[:, None] < high[None]) & (high[:, None] > low[None])).all(axis=2)
        return bool((low >= 0).all() and (high <= self.frame).all()) and meets.sum() == len(low)

    def _width(self, texts: Sequence[str]) -> float:
        """Return the width in pixels of the widest of the texts."""
        return self.size * max((self.text_width(text) for text in texts), default=0.0)

    def _bottom(self, left: float, width: float) -> float:
        """Return the smallest y coordinate, in pixels, at which the bottom of a background rectangle may be.

        The rectangle is given by its left edge and its width, in pixels. If it would overlap the caption
        horizontally, its bottom is above the caption, otherwise at the margin of the frame.
        """
        gap = PLATE_GAP * self.size
        if self.parts.caption.strip():
            caption_left, _, caption_right, caption_top = self.result.plates[0]
            if left < caption_right + gap and left + width > caption_left - gap:
                return caption_top + gap
        return self.margin

    def _add_plate(
        self, left: float, bottom: float, width: float, height: float
    ) -> tuple[float, float]:
        """Add a background rectangle. Return the lower left corner of its contents, x and y in pixels.

        (`left`, `bottom`) is the lower left corner of the rectangle. `width` and `height` are the size of its
        contents, without the padding. All are in pixels.
        """
        left, bottom = round(left), round(bottom)
        right, top = left + self._plate_size(width), bottom + self._plate_size(height)
        self.result.plates.append((left, bottom, right, top))
        padding = round(PADDING * self.size)
        return left + padding, bottom + padding

    def _add_text(self, text: str, left: float, baseline: float) -> None:
        self.result.texts.append(PlacedText(text, left, baseline))

    def _plate_size(self, length: float) -> float:
        """Return the side of a background rectangle whose contents have the side `length`, in pixels."""
        return round(length) + 2 * round(PADDING * self.size)

    def _caption(self) -> None:
        """Place the caption. It is placed first, as other parts have to avoid it."""
        size, width = self.size, self.frame[0]
        lines = wrapped(self.parts.caption, CAPTION_WIDTH * width / size, self.text_width)
        text_width = self._width(lines)
        height = (CAP_HEIGHT + DESCENT + LINE * (len(lines) - 1)) * size
        left = (width - self._plate_size(text_width)) / 2
        left, bottom = self._add_plate(left, self.margin, text_width, height)
        for number, line in enumerate(lines):
            baseline = bottom + (DESCENT + LINE * (len(lines) - 1 - number)) * size
            self._add_text(line, left + (text_width - self._width([line])) / 2, baseline)

    def _scale_bar(self, length: float, label: str) -> None:
        """Place the scale bar, `length` pixels long, and its label."""
        size, stroke = self.size, self.result.stroke
        label_width = self._width([label])
        width = max(length, label_width)
        end = round(SCALE_END * size)
        bottom = self._bottom(self.margin, self._plate_size(width))
        height = end + (SCALE_GAP + CAP_HEIGHT) * size
        left, bottom = self._add_plate(self.margin, bottom, width, height)
        start = left + (width - length) / 2
        middle = bottom + (end - stroke) // 2
        self.result.strokes += [
            (start, middle, start + length, middle + stroke),
            (start, bottom, start + stroke, bottom + end),
            (start + length - stroke, bottom, start + length, bottom + end),
        ]
        self._add_text(label, left + (width - label_width) / 2, bottom + end + SCALE_GAP * size)

    def _legend(self) -> float:
        """Place the legend of the singularities, and return the y coordinate of its top in pixels."""
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
        rows = zip(parts.indices, labels, diameters.tolist(), heights.tolist(), strict=True)
        for entry, label, diameter, row in rows:
            y = top - row / 2
            radius = diameter / 2 - outline
            self.result.dots.append(Dot(left + column / 2, y, radius, outline, entry.index))
            self._add_text(label, left + column + DOT_GAP * size, y - CAP_HEIGHT / 2 * size)
            top -= row + ROW_GAP * size
        return self.result.plates[-1][3]

    def _color_bar(self, scale: ColorScale, lowest: float) -> bool:
        """Place the color bar above the y coordinate `lowest`. Return whether there is room for it."""
        size, stroke = self.size, self.result.stroke
        width, height = self.frame
        title = wrapped(scale.title, TITLE_WIDTH, self.text_width)
        # Half of the lowest label is below the bar, and half of the highest label or the title is above it.
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
        left = width - self.margin - self._plate_size(content)
        bottom = max((height - self._plate_size(around + length)) / 2, lowest)
        left, bottom = self._add_plate(left, bottom, content, around + length)
        bar_bottom = bottom + round(CAP_HEIGHT / 2 * size)
        right, top = left + round(BAR_WIDTH * size), bar_bottom + length
        self.result.color_bar = (left, bar_bottom, right, top)
        # The colors are drawn over this rectangle, so that only its margin is seen.
        frame = left - stroke, bar_bottom - stroke, right + stroke, top + stroke
        self.result.strokes.append(frame)
        for fraction, label in ticks:
            y = bar_bottom + fraction * (length - stroke)
            end = right + round(TICK_LENGTH * size)
            self.result.strokes.append((right, round(y), end, round(y) + stroke))
            baseline = y + stroke / 2 - CAP_HEIGHT / 2 * size
            self._add_text(label, right + (TICK_LENGTH + LABEL_GAP) * size, baseline)
        for number, line in enumerate(title):
            above = TITLE_GAP + LINE * (len(title) - 1 - number)
            self._add_text(line, left, top + above * size)
        return True


def _ticks(scale: ColorScale, max_steps: int, gap: float) -> list[tuple[float, str]]:
    """Return the ticks of a color bar, at most `max_steps` + 1: positions from 0 to 1 along it, and labels.

    `gap` is the smallest distance between two labels, as a fraction of the length of the bar.
    """
    if scale.high is None:
        low = "min" if scale.low is None else tick_labels(scale.low, scale.low, 1, 0.0)[0][1]
        return [(0.0, low), (1.0, "max")]
    low, high = sorted((scale.low, scale.high))
    labels = tick_labels(low, high, max(max_steps, 1), gap)
    return [((value - low) / (high - low or 1.0), label) for value, label in labels]


def _index_label(entry: IndexCount, has_count: bool) -> str:
    """Return the label of a row of the legend: a singularity index and, if `has_count`, its count."""
    label = format_index(entry.index, entry.degree).replace("-", MINUS)
    return f"{label} ({entry.count})" if has_count and entry.count is not None else label

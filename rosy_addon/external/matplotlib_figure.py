"""Draw figures with matplotlib: pictures, with keys (legends) as vectors and text.

`api.figures` imports this module when a figure is drawn, and raises an error if matplotlib is missing.
"""

import io
import logging
import re
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.cbook import is_math_text
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgba_array
from matplotlib.figure import Figure as Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.textpath import text_to_path

from ..annotation.figure_parts import ColorBar, Panel, Row
from ..annotation.index_labels import placed_labels
from ..annotation.round_numbers import MINUS
from ..annotation.singularity_marks import (
    COLOR_BY_SIGN,
    HIDDEN_OPACITY,
    OUTLINE,
    OUTLINE_COLOR,
    SingularityMarks,
)
from ..core.errors import RosyError, RosyWarning, one_line
from ..field.singularities import format_index

#: Font sizes in points, of titles and of all other text.
TITLE_SIZE, TEXT_SIZE = 8.0, 7.0

#: Points per inch, and the height of a line of text relative to its font size.
POINTS, LINE_HEIGHT = 72, 1.35

#: Lengths in inches: gap between panels, height of the titles above a row, gap between rows, and width of
#: the column of keys.
GAP, TITLE_HEIGHT, ROW_GAP, KEY_WIDTH = 0.08, 0.2, 0.14, 0.95

#: Average width of a letter, and height of a capital letter, relative to the font size.
LETTER_WIDTH, CAPITAL_HEIGHT = 0.52, 0.73

#: Largest length of a scale bar, as a fraction of the width of a panel.
SCALE_BAR_SHARE = 0.3

INK = "#141414"

#: Settings of matplotlib in which figures differ from its defaults: fonts are embedded as TrueType in a .pdf,
#: as journals ask; in an .svg, text stays text, and equal figures give equal bytes.
FILE_SETTINGS = {"pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "rosyfields"}

#: Number of letters that the warning about letters without a glyph names.
NAMED_LETTERS = 20

#: Drawing orders: marks are drawn over the lines that connect them (order 2), and the cross at the largest
#: angle over marks.
MARK_ORDER = 3


def encode_figures(figures: Sequence[Figure], suffix: str) -> bytes:
    """Return the contents of a file with figures: the pages of a .pdf, or a single figure as .svg or .png.

    Equal figures give equal bytes.

    Parameters
    ----------
    figures : sequence of matplotlib.figure.Figure
    suffix : {".pdf", ".svg", ".png"}

    Raises
    ------
    RosyError
        If a text between dollar signs is not a formula that matplotlib can read, or a text is smaller than a
        pixel.
    """
    contents = io.BytesIO()
    with own_settings():
        if suffix == ".pdf":
            with PdfPages(contents, metadata={"CreationDate": None}) as pages:
                for figure in figures:
                    pages.savefig(figure)
        else:
            metadata = {"Date": None} if suffix == ".svg" else {}
            figures[0].savefig(contents, format=suffix[1:], metadata=metadata)
    return contents.getvalue()


@contextmanager
def own_settings() -> Iterator[None]:
    """Context manager: let matplotlib draw with its defaults and `FILE_SETTINGS`, and raise its errors as `RosyError`.

    A file ``matplotlibrc`` of the user, or of the current folder, may set fonts and sizes, and start LaTeX.
    With the defaults, the same figure has the same bytes everywhere. The settings of the user apply again
    after the block. What matplotlib logs about letters without a glyph, and fontTools about old fonts, is dropped.

    Raises
    ------
    RosyError
        If a text between dollar signs is not a formula, or a text is smaller than a pixel.
    """
    levels = {log: log.level for log in map(logging.getLogger, ("matplotlib", "fontTools"))}
    try:
        with matplotlib.rc_context(), warnings.catch_warnings():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(FILE_SETTINGS)
            warnings.filterwarnings("ignore", "Glyph .* missing")
            for log in levels:
                log.setLevel(logging.ERROR)
            yield
    except (ValueError, RuntimeError) as error:
        first_line = str(error).strip().partition("\n")[0]
        if re.search(r"\bParse\w*Exception\b", str(error)):
            message = f"{first_line}: is not a formula: write \\$ for a dollar sign"
            raise RosyError(message) from None
        if "FT_Set_Char_Size" in str(error):
            message = "a text of the figure is smaller than a pixel: choose a larger width or resolution, or shorter titles"
            raise RosyError(message) from None
        raise
    finally:
        for log, level in levels.items():
            log.setLevel(level)


def _warn_of_missing_letters(figure: Figure, only_formulas: bool) -> None:
    """Warn of the letters in a figure for which its fonts have no glyph.

    `only_formulas` says whether only texts with formulas are checked, as for an .svg. The viewer of an .svg draws
    all other texts with its own fonts.
    """
    letters_by_families: dict[tuple[str, ...], set[str]] = {}
    for text in figure.findobj(Text):
        if not only_formulas or is_math_text(text.get_text()):
            letters = letters_by_families.setdefault(tuple(text.get_fontfamily()), set())
            letters.update("".join(text.get_text().split()))
    missing: set[str] = set()
    for families, letters in letters_by_families.items():
        paths = [findfont(FontProperties(family=[family])) for family in families]
        glyphs = {code for path in paths for code in get_font(path).get_charmap()}
        missing |= {letter for letter in letters if ord(letter) not in glyphs}
    if missing:
        names = "".join(sorted(missing)[:NAMED_LETTERS])
        rest = " and others" if len(missing) > NAMED_LETTERS else ""
        cure = "write an .svg, without formulas in texts that have these letters"
        message = f"the font of the figure has no glyph for {names}{rest}: {cure}"
        warnings.warn(message, RosyWarning, stacklevel=3)


def panel_width(width: float, columns: int, has_key: bool, dpi: int) -> int:
    """Return the width of a panel in pixels.

    Parameters
    ----------
    width : float
        Width of the figure, inches.
    columns : int
        Number of panels side by side.
    has_key : bool
        Whether there is a column of keys.
    dpi : int
        Resolution of the pictures, in pixels per inch.
    """
    room = width - (KEY_WIDTH + GAP if has_key else 0.0) - (columns - 1) * GAP
    return max(int(room / columns * dpi), 1)


class FieldFigure(Figure):
    """A figure that is written with `own_settings`. A notebook shows it as a picture, without pyplot."""

    def savefig(self, fname: Any, **keywords: Any) -> None:
        """Write the figure, as `matplotlib.figure.Figure.savefig` does, with `own_settings`.

        A `RosyWarning` names letters that the font lacks.
        """
        with own_settings():
            super().savefig(fname, **keywords)
            kind = keywords.get("format") or str(fname)
            _warn_of_missing_letters(self, only_formulas=kind.lower().endswith("svg"))

    def _repr_png_(self) -> bytes:
        contents = io.BytesIO()
        self.savefig(contents, format="png")
        return contents.getvalue()


@dataclass(frozen=True, eq=False)
class Page:
    """The contents of a figure, from top to bottom. Positions are in inches from its upper left corner.

    Attributes
    ----------
    rows : sequence of Row
        Rows of panels. If a row has more panels than `columns`, it is broken into several lines. Pictures
        have the width `panel_width`.
    table : list of list of str
        The texts of a table. Its first row has the titles. Empty if there is no table.
    caption : str
    scale_bar : (float, str) or None
        Length of the scale bar in pixels, and its text. None if there is no scale bar.
    width : float
        Width in inches. The height follows from the contents.
    columns : int
        Number of columns of the grid of panels.
    dpi : int
        Resolution of the pictures, in pixels per inch.
    """

    rows: Sequence[Row]
    table: list[list[str]]
    caption: str
    scale_bar: tuple[float, str] | None
    width: float
    columns: int
    dpi: int

    @cached_property
    def _figure(self) -> Figure:
        """The matplotlib figure."""
        size = self.width, max(self._height, 0.1)
        return FieldFigure(figsize=size, dpi=self.dpi)

    # --- places --------------------------------------------------------------------------------

    @cached_property
    def _panels(self) -> list[Panel]:
        return [panel for row in self.rows for panel in row.drawn]

    @cached_property
    def _panel_size(self) -> tuple[float, float]:
        height, width = self._panels[0].picture.shape[:2] if self._panels else (0, 0)
        return width / self.dpi, height / self.dpi

    @cached_property
    def _caption_lines(self) -> list[str]:
        letters = max(int(self.width * POINTS / (TITLE_SIZE * LETTER_WIDTH)), 8)
        lines = []
        for paragraph in self.caption.split("\n") if self.caption else []:
            lines += textwrap.wrap(one_line(paragraph), letters) or [""]
        return lines

    @cached_property
    def _height(self) -> float:
        height = sum(self._row_height(row) + ROW_GAP for row in self.rows) + self._table_height
        lines = self._caption_lines
        return height + ((len(lines) + 0.5) * _text_height(TITLE_SIZE) if lines else 0.0)

    @property
    def _table_height(self) -> float:
        return (len(self.table) + 1) * _text_height(TEXT_SIZE) * 1.15 if self.table else 0.0

    def _row_height(self, row: Row) -> float:
        lines = -(-len(row.panels) // self.columns)
        return lines * self._line_height(row) + (lines - 1) * ROW_GAP

    def _line_height(self, row: Row) -> float:
        note = _text_height(TEXT_SIZE) if any(panel.note for panel in row.drawn) else 0.0
        return self._title_height(row) + self._panel_size[1] + note

    def _title_height(self, row: Row) -> float:
        return TITLE_HEIGHT if any(panel.title for panel in row.drawn) else 0.0

    def _axes(self, left: float, top: float, width: float, height: float) -> Axes:
        """Add axes, given their upper left corner and size in inches. They are rounded to whole pixels."""
        unit = self.dpi * self.width, self.dpi * self._height
        x, y = round(left * self.dpi), round((self._height - top - height) * self.dpi)
        size = round(width * self.dpi), round(height * self.dpi)
        place = x / unit[0], y / unit[1], size[0] / unit[0], size[1] / unit[1]
        return self._figure.add_axes(place)

    def _text(self, left: float, top: float, text: str, size: float, **options: object) -> None:
        """Write a line of text with its upper left corner at (`left`, `top`), inches. `size` is in points.

        Characters that a file cannot hold are escaped by `one_line`.
        """
        baseline = top + 0.8 * _text_height(size)
        place = left / self.width, 1 - baseline / self._height
        style = {"fontsize": size, "color": INK, "va": "baseline"}
        self._figure.text(*place, one_line(text), **style, **options)

    # --- drawing -------------------------------------------------------------------------------

    def draw(self) -> Figure:
        """Draw all contents with `own_settings`, and return the figure."""
        top = 0.0
        with own_settings():
            for row in self.rows:
                self._draw_row(row, top)
                top += self._row_height(row) + ROW_GAP
            if self.table:
                self._draw_table(top)
            top += self._table_height
            for number, line in enumerate(self._caption_lines):
                self._text(0.0, top + (number + 0.25) * _text_height(TITLE_SIZE), line, TITLE_SIZE)
        return self._figure

    def _draw_row(self, row: Row, top: float) -> None:
        """Draw a row of panels, with its keys. Its upper edge is at `top`, in inches."""
        panel_width, panel_height = self._panel_size
        legend, title_height = row.legend, self._title_height(row)
        for place, panel in enumerate(row.panels):
            line, column = divmod(place, self.columns)
            left = column * (panel_width + GAP)
            line_top = top + line * (self._line_height(row) + ROW_GAP)
            if panel is None:
                for text_line, text in enumerate(legend.splitlines()):
                    offset = title_height + text_line * _text_height(TEXT_SIZE)
                    self._text(left, line_top + offset, text, TEXT_SIZE)
                legend = ""
                continue
            number = self._panels.index(panel)
            letter = f"({chr(ord('a') + number % 26)}) " if len(self._panels) > 1 else ""
            self._text(left, line_top, letter + panel.title, TITLE_SIZE)
            axes = self._axes(left, line_top + title_height, panel_width, panel_height)
            _draw_panel(axes, panel, self.dpi)
            note_top = line_top + title_height + panel_height
            if panel.note:
                self._text(left, note_top, panel.note, TEXT_SIZE)
            if self.scale_bar is not None and number == 0:
                _draw_scale_bar(axes, *self.scale_bar, self.dpi)
        self._draw_keys(row, top)

    def _draw_keys(self, row: Row, top: float) -> None:
        """Draw the keys of a row in their column: the color bar and the legend of singularities."""
        left = self.columns * (self._panel_size[0] + GAP) + GAP
        top, text_height = top + self._title_height(row), _text_height(TEXT_SIZE)
        marks = [marks for panel in row.drawn for marks in (panel.dots, panel.rings)]
        entries = _legend_entries([each for each in marks if each is not None])
        legend_height = len(entries) * text_height * 1.2
        if row.color_bar is not None:
            height = self._panel_size[1] - (legend_height + ROW_GAP if entries else 0.0)
            self._draw_color_bar(row.color_bar, left, top, max(height, 0.5 * self._panel_size[1]))
        bottom = top + self._panel_size[1] - legend_height
        for number, (text, color, diameter) in enumerate(entries):
            line_top = bottom + number * text_height * 1.2
            middle = line_top + 0.8 * text_height - 0.5 * CAPITAL_HEIGHT * TEXT_SIZE / POINTS
            axes = self._axes(left, middle - 0.1, 0.2, 0.2)
            axes.axis("off")
            size, line_width = _marker_size(np.array([diameter / self.dpi * POINTS]), False)
            style = {"edgecolors": OUTLINE_COLOR, "linewidths": line_width}
            axes.scatter(0.5, 0.5, s=size**2, c=color, **style)
            axes.set(xlim=(0, 1), ylim=(0, 1))
            self._text(left + 0.25, line_top, text, TEXT_SIZE)

    def _draw_color_bar(self, bar: ColorBar, left: float, top: float, height: float) -> None:
        """Draw a color bar with ticks and its label."""
        axes = self._axes(left, top, 0.12, height)
        colors = LinearSegmentedColormap.from_list("rosy", bar.stops)
        low, high = sorted((bar.low, bar.high))
        if low > bar.low or high < bar.high:
            colors = colors.reversed()
        mappable = ScalarMappable(Normalize(low, high if high > low else low + 1), colors)
        drawn = Colorbar(axes, mappable)
        drawn.set_label(one_line(bar.label), fontsize=TEXT_SIZE, color=INK)
        drawn.ax.tick_params(labelsize=TEXT_SIZE, width=0.5, length=2, color=INK)
        drawn.outline.set_linewidth(0.5)
        drawn.solids.set_edgecolor("face")

    def _draw_table(self, top: float) -> None:
        """Draw the table, with horizontal lines above it, under its titles and below it."""
        table, height = self.table, _text_height(TEXT_SIZE) * 1.15
        widths = np.array([max(map(_text_width, column)) for column in zip(*table, strict=True)])
        # The font is made smaller if the columns are too wide for the figure.
        room, least_gap = self.width, _text_width("mm") * (len(widths) - 1)
        scale = min(room / (widths.sum() + least_gap), 1.0)
        gap = (room - scale * widths.sum()) / max(len(widths) - 1, 1)
        right = np.cumsum(scale * widths) + gap * np.arange(len(widths))
        size = scale * TEXT_SIZE
        for number, row in enumerate(table):
            line_top = top + (number + (0.4 if number else 0.2)) * height
            for column, text in enumerate(row):
                left = 0.0 if column == 0 else float(right[column])
                self._text(left, line_top, text, size, ha="left" if column == 0 else "right")
        for offset, line_width in ((0.1, 0.8), (1.25, 0.5), (len(table) + 0.55, 0.8)):
            y = 1 - (top + offset * height) / self._height
            self._figure.add_artist(Line2D([0, 1], [y, y], linewidth=line_width, color=INK))


def _text_height(size: float) -> float:
    """Return the height of a line of text in inches, given its font size in points."""
    return LINE_HEIGHT * size / POINTS


def _text_width(text: str) -> float:
    """Return the width of a text of font size `TEXT_SIZE`, in inches."""
    font = FontProperties(size=TEXT_SIZE)
    width, _, _ = text_to_path.get_text_width_height_descent(text, font, ismath=False)
    return width / POINTS


def _draw_panel(axes: Axes, panel: Panel, dpi: int) -> None:
    """Draw the picture of a panel, with the marks over it. `dpi` is its resolution in pixels per inch."""
    height, width = panel.picture.shape[:2]
    axes.imshow(panel.picture, extent=(0, width, 0, height), interpolation="antialiased")
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.axis("off")
    if panel.links is not None:
        for link in panel.links:
            axes.plot(*link.T, color=OUTLINE_COLOR, linewidth=0.6, solid_capstyle="round")
    for marks, is_open in ((panel.rings, True), (panel.dots, False)):
        if marks is not None:
            _draw_marks(axes, marks, dpi, is_open)
    if panel.cross is not None:
        for color, line_width in (("white", 2.4), (INK, 1.2)):
            style = {"markersize": 6, "markeredgewidth": line_width, "zorder": MARK_ORDER + 1}
            axes.plot(*panel.cross, marker="x", color=color, **style)


def _draw_marks(axes: Axes, marks: SingularityMarks, dpi: int, is_open: bool) -> None:
    """Draw singularities as dots, with labels beside visible dots, or as rings (`is_open`) without labels."""
    marks = marks.in_drawing_order()
    signs = np.sign(marks.index).astype(int)
    colors = to_rgba_array([COLOR_BY_SIGN[sign] for sign in signs.tolist()])
    outlines = colors.copy() if is_open else to_rgba_array([OUTLINE_COLOR] * len(colors))
    colors[:, 3] = 0.0 if is_open else np.where(marks.is_visible, 1.0, HIDDEN_OPACITY)
    outlines[:, 3] = np.where(marks.is_visible, 1.0, HIDDEN_OPACITY)
    size, line_width = _marker_size(2 * marks.radius * POINTS / dpi, is_open)
    style = {"facecolors": colors, "edgecolors": outlines, "linewidths": line_width}
    axes.scatter(*marks.position.T, s=size**2, zorder=MARK_ORDER, **style)
    if is_open:
        return
    plate = {"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.4}
    for label in placed_labels(marks):
        size = label.height / CAPITAL_HEIGHT * POINTS / dpi
        text = label.text.replace("-", MINUS)
        style = {"fontsize": size, "color": INK, "zorder": MARK_ORDER}
        axes.text(label.left, label.bottom, text, bbox=plate, **style)


def _marker_size(diameter: np.ndarray, is_open: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the diameters and line widths of the markers of singularities, in points.

    Parameters
    ----------
    diameter : ndarray
        Diameters of dots without their outlines, in points.
    is_open : bool
        Whether the markers are rings, which are larger than the dots. If not, they are dots with outlines.
    """
    if is_open:
        return 1.75 * diameter, 0.22 * diameter
    outline = OUTLINE / (1 + 2 * OUTLINE) * diameter
    return diameter + outline, outline


def _legend_entries(marks: Sequence[SingularityMarks]) -> list[tuple[str, str, float]]:
    """Return text, color (``#rrggbb``) and diameter (pixels) of each singularity index, the largest first."""
    diameters: dict[tuple[float, int, int], float] = {}
    for part in marks:
        columns = part.index.tolist(), part.degree.tolist(), part.radius.tolist()
        for index, degree, radius in zip(*columns, strict=True):
            key = index / degree, index, degree
            diameters[key] = max(2 * radius, diameters.get(key, 0.0))
    entries = []
    for key in sorted(diameters, reverse=True):
        _, index, degree = key
        text = f"index {format_index(index, degree)}".replace("-", MINUS)
        entries.append((text, COLOR_BY_SIGN[int(np.sign(index))], diameters[key]))
    return entries


def _draw_scale_bar(axes: Axes, length: float, text: str, dpi: int) -> None:
    """Draw a scale bar of a given length in pixels at the lower left of a panel, with its text."""
    margin, gap = 0.06 * dpi, 0.03 * dpi
    ends = [margin, margin + length]
    axes.plot(ends, [margin, margin], color=INK, linewidth=1.2, solid_capstyle="butt")
    axes.text(margin, margin + gap, one_line(text), fontsize=TEXT_SIZE, color=INK, va="bottom")

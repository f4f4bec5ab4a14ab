"""What a figure consists of: rows of panels with their keys. `external.matplotlib_figure` draws them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .singularity_marks import SingularityMarks


@dataclass(frozen=True, eq=False)
class Panel:
    """A picture with a title.

    Attributes
    ----------
    title : str
    picture : (H, W, 4) uint8 ndarray
        sRGB, the top row first.
    dots : SingularityMarks or None
        Filled dots, in pixels of the picture.
    rings : SingularityMarks or None
        Drawn as open circles.
    links : (n, 2, 2) float64 ndarray
        Ends of lines that connect pairs, in pixels from the lower left.
    cross : (2,) float64 ndarray or None
        Where a cross is drawn, in pixels from the lower left.
    note : str
        Below the picture.
    """

    title: str
    picture: np.ndarray
    dots: SingularityMarks | None = None
    rings: SingularityMarks | None = None
    links: np.ndarray | None = None
    cross: np.ndarray | None = None
    note: str = ""


@dataclass(frozen=True, eq=False)
class ColorBar:
    """The key of a color map.

    Attributes
    ----------
    label : str
    low, high : float
        The numbers at its ends.
    stops : (n, 3) float64 ndarray
        Display values at even distances from the lower end.
    """

    label: str
    low: float
    high: float
    stops: np.ndarray


@dataclass(frozen=True, eq=False)
class Row:
    """Panels with one key.

    Attributes
    ----------
    panels : sequence of Panel or None
        None for an empty place.
    color_bar : ColorBar or None
    legend : str
        Shown in the first empty place.
    """

    panels: Sequence[Panel | None]
    color_bar: ColorBar | None = None
    legend: str = ""

    @property
    def drawn(self) -> list[Panel]:
        """The panels without the empty places."""
        return [panel for panel in self.panels if panel is not None]

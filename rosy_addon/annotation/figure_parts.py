"""The data of a figure: rows of panels with pictures, and their keys.

`external.matplotlib_figure` draws figures.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .singularity_marks import SingularityMarks


@dataclass(frozen=True, eq=False)
class Panel:
    """A picture in a figure, with a title and with marks over it.

    Attributes
    ----------
    title : str
    picture : (H, W, 4) uint8 ndarray
        Display values (sRGB) and opacity, the top row first.
    dots : SingularityMarks or None
        Singularities that are drawn as filled dots.
    rings : SingularityMarks or None
        Singularities that are drawn as open circles.
    links : (n, 2, 2) float64 ndarray or None
        Ends of lines that connect pairs of singularities, in pixels from the lower left.
    cross : (2,) float64 ndarray or None
        Position of a cross, in pixels from the lower left; None: no cross.
    note : str
        Text below the picture.
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
    """A color bar, which explains the colors of pictures.

    Attributes
    ----------
    label : str
    low, high : float
        Values at its lower and its upper end.
    stops : (n, 3) float64 ndarray
        Colors (sRGB display values) at evenly spaced positions, from the lower to the upper end.
    """

    label: str
    low: float
    high: float
    stops: np.ndarray


@dataclass(frozen=True, eq=False)
class Row:
    """A row of panels in a figure, with one color bar and one legend.

    Attributes
    ----------
    panels : sequence of Panel or None
        Panels from left to right. None leaves a position empty.
    color_bar : ColorBar or None
    legend : str
        Text that is shown in the first empty position.
    """

    panels: Sequence[Panel | None]
    color_bar: ColorBar | None = None
    legend: str = ""

    @property
    def drawn(self) -> list[Panel]:
        """Panels of the row without the empty positions."""
        return [panel for panel in self.panels if panel is not None]

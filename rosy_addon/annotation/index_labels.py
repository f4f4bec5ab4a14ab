"""Place the indices of singularities as labels beside their dots.

The letters are made of line segments. No font is needed, so that labels look the same on all systems.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..field.singularities import format_index
from ..projection.pixel_blocks import part_of
from .singularity_marks import OUTLINE, SingularityMarks, dot_diameters

#: Display colors of labels, and of the halo around them.
LABEL_COLOR, HALO_COLOR = "#141414", "#ffffff"

#: Height of a label, width of its lines and width of its halo, as multiples of the diameter of a dot of index
#: 1 / N; then the distance between letters, as a multiple of their height.
LABEL_HEIGHT, STROKE_WIDTH, HALO, LETTER_SPACING = 1.1, 0.17, 0.16, 0.3

#: Smallest width of the lines of labels, pixels.
MIN_STROKE_WIDTH = 1.0

#: Largest number of labels. More would hide the dots.
MAX_LABELS = 250


#: Positions of a label relative to its dot, in order of preference: (1, 1) is to the right and above.
SIDES = ((1, 1), (-1, 1), (1, -1), (-1, -1))


@dataclass(frozen=True)
class Label:
    """The index of a singularity as a text, which is drawn beside its dot.

    Attributes
    ----------
    text : str
    left, bottom, height : float
        Lower left corner of the text, in pixels from the lower left of the picture, and height of the
        letters.
    """

    text: str
    left: float
    bottom: float
    height: float

    def segments(self) -> np.ndarray:
        """Return the (n, 2, 2) ends of the line segments of which the letters are made, in pixels."""
        return text_segments(self.text) * self.height + (self.left, self.bottom)


def placed_labels(marks: SingularityMarks) -> list[Label]:
    """Place a label beside each visible dot if there is room for it.

    The dots nearest to the camera are handled first.

    Parameters
    ----------
    marks : SingularityMarks

    Returns
    -------
    list of Label
        Empty if `marks.has_labels` is false, or if more than `MAX_LABELS` dots are visible.
    """
    visible = np.flatnonzero(marks.is_visible)
    if not marks.has_labels or len(visible) > MAX_LABELS:
        return []
    marks = part_of(marks, visible[np.argsort(marks.depth[visible], kind="stable")])
    size = marks.size
    height, padding = LABEL_HEIGHT * size, stroke_width(size) / 2 + HALO * size

    def label_size(text: str) -> tuple[float, float]:
        return text_width(text) * height + 2 * padding, height + 2 * padding

    places = place_indices(marks.position, marks.index, marks.degree, size, label_size, marks.frame)
    return [Label(text, left + padding, bottom + padding, height) for text, left, bottom in places]


def place_indices(
    position: np.ndarray,
    index: np.ndarray,
    degree: np.ndarray,
    size: float,
    label_size: Callable[[str], tuple[float, float]],
    frame: tuple[int, int],
) -> list[tuple[str, float, float]]:
    """Place the index of each singularity beside its dot if there is room for it.

    Labels cover neither dots nor each other. Singularities are handled in the given order.

    Parameters
    ----------
    position : (K, 2) ndarray
        Centers of the dots, pixels from the lower left.
    index, degree : (K,) int ndarray
        Indices of the singularities in units of 1 / N, and N.
    size : float
        Diameter of a dot of index 1 / N, pixels.
    label_size : callable
        Function that returns the width and the height, in pixels, of the label with a text.
    frame : (int, int)
        Width and height of the picture in pixels. No label reaches beyond it.

    Returns
    -------
    list of (str, float, float)
        The text of each label that was placed, and x and y of its lower left corner in pixels.
    """
    labels = []
    radii = dot_diameters(index, size) / 2 + OUTLINE * size
    low, high = position - radii[:, None], position + radii[:, None]
    singularities = zip(position, radii.tolist(), index.tolist(), degree.tolist(), strict=True)
    for dot, radius, *fraction in singularities:
        text = format_index(*fraction)
        extent = np.array(label_size(text))
        for side in SIDES:
            corner = dot + np.where(np.array(side) > 0, radius, -radius - extent)
            is_inside = (corner >= 0).all() and (corner + extent <= frame).all()
            is_covered = (corner < high) & (corner + extent > low)
            if is_inside and not is_covered.all(axis=1).any():
                labels.append((text, *corner.tolist()))
                low, high = np.vstack([low, corner]), np.vstack([high, corner + extent])
                break
    return labels


def stroke_width(size: float) -> float:
    """Return the width of the lines of labels in pixels, given the diameter of a dot of index 1 / N."""
    return max(STROKE_WIDTH * size, MIN_STROKE_WIDTH)


# --- letters -------------------------------------------------------------------------------------


def text_width(text: str) -> float:
    """Return the width of a text, as a multiple of the height of its letters."""
    widths = [_letter(letter)[1] for letter in text]
    return sum(widths) + LETTER_SPACING * (len(widths) - 1)


def text_segments(text: str) -> np.ndarray:
    """Return the (n, 2, 2) ends of the line segments of which a text is made.

    The unit is the height of the letters, and the origin the lower left corner.
    """
    parts, left = [], 0.0
    for letter in text:
        segments, width = _letter(letter)
        parts.append(segments + (left, 0.0))
        left += width + LETTER_SPACING
    return np.concatenate(parts)


def _letter(letter: str) -> tuple[np.ndarray, float]:
    """Return the (n, 2, 2) ends of the line segments of a letter of height 1, and the width of the letter."""
    lines = [np.array(line) for line in LETTERS[letter]]
    width = max(line[:, 0].max() for line in lines)
    return np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines]), float(width)


def _arc(
    center: tuple[float, float], radii: tuple[float, float], first: float, last: float
) -> list[tuple[float, float]]:
    """Return points on an arc of an ellipse, from the angle `first` to the angle `last` in degrees.

    `radii` are half of the width and half of the height of the ellipse.
    """
    angles = np.radians(np.linspace(first, last, max(int(abs(last - first) / 20), 2)))
    x, y = center[0] + radii[0] * np.cos(angles), center[1] + radii[1] * np.sin(angles)
    return list(zip(x.tolist(), y.tolist(), strict=True))


#: For each letter that an index may contain, the polylines of which it is made. Its height is 1.
LETTERS: dict[str, list[list[tuple[float, float]]]] = {
    "0": [_arc((0.28, 0.5), (0.28, 0.5), 0, 360)],
    "1": [[(0.0, 0.75), (0.25, 1.0), (0.25, 0.0)]],
    "2": [[*_arc((0.28, 0.72), (0.28, 0.28), 170, -35), (0.0, 0.0), (0.58, 0.0)]],
    "3": [_arc((0.26, 0.74), (0.26, 0.26), 150, -90) + _arc((0.26, 0.25), (0.29, 0.25), 90, -150)],
    "4": [[(0.45, 0.0), (0.45, 1.0), (0.0, 0.3), (0.6, 0.3)]],
    "5": [[(0.52, 1.0), (0.08, 1.0), (0.05, 0.58), *_arc((0.25, 0.32), (0.31, 0.32), 115, -150)]],
    "6": [[(0.45, 1.0), (0.04, 0.45)], _arc((0.28, 0.3), (0.28, 0.3), 0, 360)],
    "7": [[(0.0, 1.0), (0.55, 1.0), (0.18, 0.0)]],
    "8": [_arc((0.28, 0.75), (0.25, 0.25), 0, 360), _arc((0.28, 0.26), (0.28, 0.26), 0, 360)],
    "9": [[(0.11, 0.0), (0.52, 0.55)], _arc((0.28, 0.7), (0.28, 0.3), 0, 360)],
    "+": [[(0.0, 0.5), (0.5, 0.5)], [(0.25, 0.25), (0.25, 0.75)]],
    "-": [[(0.0, 0.5), (0.5, 0.5)]],
    "/": [[(0.0, -0.1), (0.4, 1.1)]],
}

"""The indices of singularities as labels, drawn with lines and no font, so that they are the same everywhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..field.singularities import format_index
from .label_placement import place_labels
from .singularity_marks import OUTLINE, SingularityMarks

#: Display colors of labels, and of the halo around them.
LABEL_COLOR, HALO_COLOR = "#141414", "#ffffff"

#: Height of a label, width of its lines and of its halo, in diameters of a dot of index 1 / N; distance of
#: letters, in heights.
LABEL_HEIGHT, STROKE_WIDTH, HALO, LETTER_SPACING = 1.1, 0.17, 0.16, 0.3

#: Largest number of labels. More would hide the dots.
MAX_LABELS = 250


@dataclass(frozen=True)
class Label:
    """The index of a singularity, beside its dot.

    Attributes
    ----------
    text : str
    left, bottom, height : float
        Of the letters, pixels.
    """

    text: str
    left: float
    bottom: float
    height: float

    def segments(self) -> np.ndarray:
        """Return the (n, 2, 2) ends of the lines of the letters, pixels."""
        return text_segments(self.text) * self.height + (self.left, self.bottom)


def placed_labels(marks: SingularityMarks) -> list[Label]:
    """Place a label beside each visible dot that has room for it, the nearest dots first.

    Parameters
    ----------
    marks : SingularityMarks

    Returns
    -------
    list of Label
        Empty if there are to be none, or more than `MAX_LABELS`.
    """
    visible = np.flatnonzero(marks.is_visible)
    if not marks.has_labels or not 0 < len(visible) <= MAX_LABELS:
        return []
    size = marks.size
    visible = visible[np.argsort(marks.depth[visible], kind="stable")]
    texts = [
        format_index(index, degree)
        for index, degree in zip(
            marks.index[visible].tolist(), marks.degree[visible].tolist(), strict=True
        )
    ]
    height, padding = LABEL_HEIGHT * size, (STROKE_WIDTH / 2 + HALO) * size
    sizes = [(text_width(text) * height + 2 * padding, height + 2 * padding) for text in texts]
    radii = marks.radius[visible] + OUTLINE * size
    corners = place_labels(marks.position[visible], np.array(sizes), radii, marks.frame)
    return [
        Label(text, left + padding, bottom + padding, height)
        for text, (left, bottom) in zip(texts, corners.tolist(), strict=True)
        if np.isfinite(left)
    ]


# --- letters -------------------------------------------------------------------------------------


def text_width(text: str) -> float:
    """Return the width of a text, in heights of its letters."""
    widths = [_letter(letter)[1] for letter in text]
    return sum(widths) + LETTER_SPACING * (len(widths) - 1)


def text_segments(text: str) -> np.ndarray:
    """Return the (n, 2, 2) ends of the lines of a text, in heights of its letters, from the lower left."""
    parts, left = [], 0.0
    for letter in text:
        segments, width = _letter(letter)
        parts.append(segments + (left, 0.0))
        left += width + LETTER_SPACING
    return np.concatenate(parts)


def _letter(letter: str) -> tuple[np.ndarray, float]:
    """Return the (n, 2, 2) ends of the lines of a letter of height 1, and its width."""
    lines = [np.array(line) for line in LETTERS[letter]]
    width = max(line[:, 0].max() for line in lines)
    return np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines]), float(width)


def _arc(
    center: tuple[float, float], radii: tuple[float, float], first: float, last: float
) -> list[tuple[float, float]]:
    """Return points of an arc of an ellipse between two angles in degrees."""
    angles = np.radians(np.linspace(first, last, max(int(abs(last - first) / 20), 2)))
    x, y = center[0] + radii[0] * np.cos(angles), center[1] + radii[1] * np.sin(angles)
    return list(zip(x.tolist(), y.tolist(), strict=True))


#: The lines of each letter that an index may have, of height 1.
LETTERS: dict[str, list[list[tuple[float, float]]]] = {
    "0": [_arc((0.28, 0.5), (0.28, 0.5), 0, 360)],
    "1": [[(0.0, 0.75), (0.25, 1.0), (0.25, 0.0)]],
    "2": [[*_arc((0.28, 0.72), (0.28, 0.28), 170, -35), (0.0, 0.0), (0.58, 0.0)]],
    "3": [_arc((0.26, 0.74), (0.26, 0.26), 150, -90) + _arc((0.26, 0.25), (0.29, 0.25), 90, -150)],
    "4": [[(0.45, 0.0), (0.45, 1.0), (0.0, 0.3), (0.6, 0.3)]],
    "5": [[(0.52, 1.0), (0.08, 1.0), (0.05, 0.58), *_arc((0.25, 0.32), (0.31, 0.32), 115, -150)]],
    "6": [[(0.45, 1.0), (0.04, 0.45)], _arc((0.28, 0.3), (0.28, 0.3), 0, 360)],
    "7": [[(0.0, 1.0), (0.55, 1.0), (0.18, 0.0)]],
    "8": [
        _arc((0.28, 0.75), (0.25, 0.25), 0, 360),
        _arc((0.28, 0.26), (0.28, 0.26), 0, 360),
    ],
    "9": [[(0.11, 0.0), (0.52, 0.55)], _arc((0.28, 0.7), (0.28, 0.3), 0, 360)],
    "+": [[(0.0, 0.5), (0.5, 0.5)], [(0.25, 0.25), (0.25, 0.75)]],
    "-": [[(0.0, 0.5), (0.5, 0.5)]],
    "/": [[(0.0, -0.1), (0.4, 1.1)]],
}

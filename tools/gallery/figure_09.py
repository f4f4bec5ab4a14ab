"""Draw figure 9: the magnitude of a field as color, as the length of streaks, and as both."""

from itertools import pairwise

import numpy as np
from scipy.stats import spearmanr

from rosy_addon.compositor.look import Look
from tests.harness.streaks import persistence

from .looks import MEASURED, PLANE
from .page import fill_tables, picture
from .plane import compose_field, draw_field, points
from .sheet import Panel

DEGREE, SIZE = 4, 400

#: Look of the pictures. Half of the noise cells are bright: with few of them, the shortest streaks would be
#: dots.
LOOK = PLANE.with_settings({"density": 0.5, "gain": 2.5})

#: Ways to show the magnitude: label of the picture, label of the table, and settings.
WAYS = (
    ("magnitude not shown", "not shown", {}),
    ("as color", "color", {"hue": "magnitude"}),
    ("as length of the streaks", "length", {"magnitude_length": True}),
    ("as both", "both", {"hue": "magnitude", "magnitude_length": True}),
)

#: Zeros of the field: positions in pixels from the center, and signs of their indices.
ZEROS = ((-95 + 70j, 1), (80 + 95j, -1), (20 - 20j, 1), (-70 - 110j, -1), (120 - 90j, 1))

#: Distance from a zero in pixels at which the field reaches most of its magnitude.
REACH = 90.0

#: Limits of the ranges of magnitude in the table, relative to the largest magnitude.
EDGES = (0.0, 0.25, 0.5, 0.75, 1.0)


def field(p: np.ndarray) -> np.ndarray:
    """Return a 4-RoSy field at points, with three singularities of index +1/4 and two of −1/4."""
    z = np.ones(p.shape, dtype=complex)
    for position, index in ZEROS:
        offset = p - position
        z *= (offset if index > 0 else offset.conj()) / np.sqrt(np.abs(offset) ** 2 + REACH**2)
    return z


def write() -> None:
    """Draw the picture and measure the table."""
    z = field(points(SIZE))
    magnitude = np.abs(z) / np.abs(z).max()
    panels, rows = [], []
    for letter, (label, name, settings) in zip("abcd", WAYS, strict=True):
        shown = draw_field(field, DEGREE, SIZE, LOOK.with_settings(settings))
        panels.append(Panel(shown, f"({letter}) {label}"))
        look = MEASURED.with_settings(settings)
        rows.append([name, _rank(look, magnitude), *_half_lengths(look, z, magnitude)])
    picture("figure-09", panels[:2], panels[2:])
    fill_tables("figure-09", rows)


def _rank(look: Look, magnitude: np.ndarray) -> float:
    """Return the rank correlation of magnitude and luminance, both averaged over 10 x 10 pixels."""
    rgba = compose_field(field, DEGREE, SIZE, look).rgba
    luminance = rgba[..., :3] @ np.array([0.2126, 0.7152, 0.0722])
    cells = (SIZE // 10, 10, SIZE // 10, 10)
    means = [values.reshape(cells).mean(axis=(1, 3)).ravel() for values in (magnitude, luminance)]
    return float(spearmanr(*means).statistic)


def _half_lengths(look: Look, z: np.ndarray, magnitude: np.ndarray) -> list[str]:
    """Return the distance at which the correlation along streaks falls to 0.5, by range of magnitude."""
    look = look.with_settings({"weights": "none"})
    image = compose_field(field, DEGREE, SIZE, look).layer.images.members[0, :, 0]
    angle = np.angle(z) / DEGREE
    # Leave out the borders, and the part of the measured image where its streaks are interrupted.
    selected = np.abs(DEGREE * angle) < 2.0
    margin = 45
    selected[:margin] = selected[-margin:] = selected[:, :margin] = selected[:, -margin:] = False
    lengths = []
    for low, high in pairwise(EDGES):
        part = selected & (magnitude >= low) & (magnitude < high)
        values = persistence(image.reshape(SIZE, SIZE), np.exp(1j * angle), part, 60)
        below = int(np.argmax(values < 0.5))
        fraction = (values[below - 1] - 0.5) / (values[below - 1] - values[below])
        lengths.append(f"{below - 1 + fraction:.1f} px")
    return lengths

"""Figure 9: the magnitude of a field as color, as the length of streaks, and as both."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from .looks import MEASURED, PLANE
from .measure import persistence
from .page import Page
from .plane import compose_field, draw_field, points
from .sheet import Panel

DEGREE, SIZE = 4, 400
#: With few bright cells, the shortest streaks would be dots, so half of the cells are bright.
LOOK = PLANE.with_settings({"density": 0.5, "gain": 2.5})
#: Zeros of the field: positions in pixels from the center, and signs of their indices.
ZEROS = ((-95 + 70j, 1), (80 + 95j, -1), (20 - 20j, 1), (-70 - 110j, -1), (120 - 90j, 1))
#: Distance from a zero in pixels at which the field reaches most of its magnitude.
REACH = 90.0


def field(p: np.ndarray) -> np.ndarray:
    """Return a 4-RoSy field with three singularities of index +1/4 and two of −1/4."""
    z = np.ones(p.shape, dtype=complex)
    for position, index in ZEROS:
        offset = p - position
        z *= (offset if index > 0 else offset.conj()) / np.sqrt(np.abs(offset) ** 2 + REACH**2)
    return z


#: The settings with which the magnitude is shown, by the names of the panels.
MAPPINGS: dict[str, dict[str, Any]] = {
    "not shown": {},
    "color": {"hue": "magnitude"},
    "length": {"magnitude_length": True},
    "both": {"hue": "magnitude", "magnitude_length": True},
}


def write() -> None:
    """Draw and write the page."""
    page = Page("figure-09", "Magnitude")
    page.text(
        """This page shows how RoSy can display the magnitude of a field. The field is a 4-RoSy
        field with five singularities, where its magnitude is zero. In (a), the magnitude is not
        shown. It can be mapped to color (b), to the length of the streaks (c), or to both (d).
        Short streaks are means of few samples and would have too much contrast, so their contrast
        is reduced."""
    )
    labels = (
        "(a) magnitude not shown",
        "(b) as color",
        "(c) as length of the streaks",
        "(d) as both",
    )
    panels = [
        Panel(draw_field(field, DEGREE, SIZE, LOOK.with_settings(settings)), label)
        for label, settings in zip(labels, MAPPINGS.values(), strict=True)
    ]
    page.picture([panels[:2], panels[2:]], "The magnitude of a 4-RoSy field shown in three ways")
    _measure(page)
    page.write("Figure 9")


def _measure(page: Page) -> None:
    page.text("## Measurements")
    z = field(points(SIZE))
    rho = np.abs(z) / np.abs(z).max()
    page.text(
        """The column for luminance lists the rank correlation of the magnitude with the luminance
        of the picture, averaged over squares of 10 pixels so that single streaks have no effect.
        The half-length is the distance along a member at which the image of that member has an
        autocorrelation of one half, by ranges of the magnitude ρ. Near zeros of the field it is
        shorter even for streaks of full length, because they bend."""
    )
    cells = (SIZE // 10, 10, SIZE // 10, 10)
    luminance = {}
    for mapping, settings in MAPPINGS.items():
        rgba = compose_field(field, DEGREE, SIZE, MEASURED.with_settings(settings)).rgba
        luminance[mapping] = rgba[..., :3] @ np.array([0.2126, 0.7152, 0.0722])
    ranks = {
        mapping: float(
            spearmanr(
                rho.reshape(cells).mean(axis=(1, 3)).ravel(),
                values.reshape(cells).mean(axis=(1, 3)).ravel(),
            ).statistic
        )
        for mapping, values in luminance.items()
    }
    edges = (0.0, 0.25, 0.5, 0.75, 1.0)
    heads = [f"Half-length, ρ {low:g} to {high:g}" for low, high in pairwise(edges)]
    rows = [
        [mapping, ranks[mapping], *_half_lengths(mapping, z, rho, edges)] for mapping in MAPPINGS
    ]
    page.table(["Magnitude as", "Luminance", *heads], rows)


def _half_lengths(
    mapping: str, z: np.ndarray, rho: np.ndarray, edges: tuple[float, ...]
) -> list[str]:
    """Return the distance at which the correlation along streaks has halved, by range of magnitude."""
    look = MEASURED.with_settings({**MAPPINGS[mapping], "weights": "none"})
    image = compose_field(field, DEGREE, SIZE, look).layer.images.members[0, :, 0]
    image = image.reshape(SIZE, SIZE)
    angle = np.angle(z) / DEGREE
    # Leave out the borders, and the breaking points of the image that is measured.
    selected = np.abs(DEGREE * angle) < 2.0
    margin = 45
    selected[:margin] = selected[-margin:] = selected[:, :margin] = selected[:, -margin:] = False
    lengths = []
    for low, high in pairwise(edges):
        correlations = persistence(
            image, np.exp(1j * angle), selected & (rho >= low) & (rho < high), 60
        )
        first_below = int(np.argmax(correlations < 0.5))
        fraction = (correlations[first_below - 1] - 0.5) / (
            correlations[first_below - 1] - correlations[first_below]
        )
        lengths.append(f"{first_below - 1 + fraction:.1f} px")
    return lengths

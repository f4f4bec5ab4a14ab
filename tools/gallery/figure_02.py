"""Figure 2: one direction of a 6-RoSy field, and all six."""

from __future__ import annotations

import numpy as np

from .looks import MEASURED, PLANE, RED
from .measure import orientation_spectrum, peaks
from .page import Page, listed, signed
from .plane import PlanarField, channel, compose_field, draw_field, singularity
from .sheet import Panel, dotted

DEGREE, SIZE = 6, 400


def one_direction(index: int) -> PlanarField:
    """Return one member of `singularity(index)` as a field, continuous around the center."""
    return lambda p: np.exp(1j * index * (np.angle(p) % (2 * np.pi)) / DEGREE)


def write() -> None:
    """Draw and write the page."""
    page = Page("figure-02", "One direction is not enough")
    page.text(
        """This page shows why all directions of a field must be visible. The field is a 6-RoSy
        field around a singularity, which the dot marks. On a path once around the dot, the members
        rotate by a sixth of a turn: in the sense of the path for index +1/6 (top row), against it
        for index −1/6 (bottom row). A single direction (a, c) must jump somewhere, here along the
        line to the right of the dot, and it shows little of the pattern. All six directions (b, d)
        are continuous everywhere. Straight lines leave the dot in five directions in (b), and in
        seven in (d)."""
    )
    rows, letters = [], iter("abcd")
    for index in (1, -1):
        row = []
        for field, degree, name in (
            (one_direction(index), 1, "one direction"),
            (singularity(index), DEGREE, "all six"),
        ):
            picture = dotted(draw_field(field, degree, SIZE, PLANE), SIZE / 2, SIZE / 2, RED)
            row.append(Panel(picture, f"({next(letters)}) {name}, index {signed(index)}/6"))
        rows.append(row)
    page.picture(rows, "One direction of a 6-RoSy field beside all six, around two singularities")
    page.text("## Measurements")
    page.text(
        """The table lists the orientations of the streaks, in degrees, in two windows of 128 by 64
        pixels to the right of the dot, just above and just below the line. The columns show the
        members in the center of each window, and the peaks of the orientation spectrum of the
        picture. The single direction changes by nearly a sixth of a turn from one window to the
        other. The six directions are nearly the same in both windows."""
    )
    page.table(
        ["Picture", "Members above", "Measured above", "Members below", "Measured below"],
        [_measured(index, degree) for index in (1, -1) for degree in (1, DEGREE)],
    )
    page.write("Figure 2")


def _measured(index: int, degree: int) -> list[object]:
    field = one_direction(index) if degree == 1 else singularity(index)
    tone = channel(compose_field(field, degree, SIZE, MEASURED).layer.tone, SIZE)
    row = [f"{'one direction' if degree == 1 else 'all six'}, index {signed(index)}/6"]
    middle, columns = SIZE // 2, slice(SIZE // 2 + 52, SIZE // 2 + 180)
    for rows in (slice(middle + 2, middle + 66), slice(middle - 66, middle - 2)):
        x, y = ((side.start + side.stop) / 2 - middle for side in (columns, rows))
        z = field(np.array(x + 1j * y))
        members = np.degrees((np.angle(z) + 2 * np.pi * np.arange(degree)) / degree) % 180
        row.append(listed(np.unique(members.round(6))))
        row.append(listed(peaks(orientation_spectrum(tone[rows, columns]))))
    return row

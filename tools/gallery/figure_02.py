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
    """A member of the field of `singularity(index)`, followed once around from the right."""
    return lambda p: np.exp(1j * index * (np.angle(p) % (2 * np.pi)) / DEGREE)


def write() -> None:
    """Draw and write the page."""
    page = Page("figure-02", "One direction is not enough")
    page.text(
        """A 6-RoSy field around a singularity: going once around the dot, its members turn by a
        sixth of a circle, forward above (index +1/6), backward below (−1/6). One direction out of
        the six (a, c) has to jump somewhere, here along the line to the right of the dot, and says
        little of the pattern. All six (b, d) go on everywhere, and show it: straight lines leave
        the dot in five directions in (b), in seven in (d)."""
    )
    rows, letters = [], iter("abcd")
    for index in (1, -1):
        row = []
        for field, degree, what in (
            (one_direction(index), 1, "one direction"),
            (singularity(index), DEGREE, "all six"),
        ):
            drawn = dotted(draw_field(field, degree, SIZE, PLANE), SIZE / 2, SIZE / 2, RED)
            row.append(Panel(drawn, f"({next(letters)}) {what}, index {signed(index)}/6"))
        rows.append(row)
    page.picture(rows, "One direction of a 6-RoSy field beside all six, around two singularities")
    page.text("## Measured")
    page.text(
        """The orientations of the streaks in two windows of 128 by 64 pixels to the right of the
        dot, just above and just below the line, in degrees: those of the members in the middle of
        each window, and those at which the power of streaks peaks. One direction changes from one
        window to the other by nearly a sixth of a circle; all six are nearly the same ones."""
    )
    page.table(
        ["Picture", "Members above", "Found above", "Members below", "Found below"],
        [_measured(index, degree) for index in (1, -1) for degree in (1, DEGREE)],
    )
    page.write("Figure 2")


def _measured(index: int, degree: int) -> list[object]:
    field = one_direction(index) if degree == 1 else singularity(index)
    tone = channel(compose_field(field, degree, SIZE, MEASURED).layers[0].tone, SIZE)
    row = [f"{'one direction' if degree == 1 else 'all six'}, index {signed(index)}/6"]
    middle, columns = SIZE // 2, slice(SIZE // 2 + 52, SIZE // 2 + 180)
    for rows in (slice(middle + 2, middle + 66), slice(middle - 66, middle - 2)):
        across, upward = ((side.start + side.stop) / 2 - middle for side in (columns, rows))
        z = field(np.array(across + 1j * upward))
        members = np.degrees((np.angle(z) + 2 * np.pi * np.arange(degree)) / degree) % 180
        row.append(listed(np.unique(members.round(6))))
        row.append(listed(peaks(orientation_spectrum(tone[rows, columns]))))
    return row

"""Draw figure 2: one direction of a 6-RoSy field, and all six directions."""

import numpy as np

from tests.harness.streaks import orientation_spectrum, peaks

from .looks import MEASURED, PLANE, RED
from .page import fill_tables, listed, picture, signed
from .plane import PlanarField, channel, compose_field, draw_field, singularity
from .sheet import Panel, dotted

DEGREE, SIZE = 6, 400


def one_direction(index: int) -> PlanarField:
    """Return one member of `singularity(index)` as a vector field.

    It jumps only across the positive x axis.
    """
    return lambda p: np.exp(1j * index * (np.angle(p) % (2 * np.pi)) / DEGREE)


def write() -> None:
    """Draw the pictures and measure the table."""
    cases = [
        (field, degree, f"{name}, index {signed(index)}/6")
        for index in (1, -1)
        for field, degree, name in (
            (one_direction(index), 1, "one direction"),
            (singularity(index), DEGREE, "all six"),
        )
    ]
    panels = []
    for (field, degree, name), letter in zip(cases, "abcd", strict=True):
        shown = dotted(draw_field(field, degree, SIZE, PLANE), SIZE / 2, SIZE / 2, RED)
        panels.append(Panel(shown, f"({letter}) {name}"))
    picture("figure-02", panels[:2], panels[2:])
    fill_tables("figure-02", [_measured(*case) for case in cases])


def _measured(field: PlanarField, degree: int, name: str) -> list[object]:
    tone = channel(compose_field(field, degree, SIZE, MEASURED).layer.tone, SIZE)
    row: list[object] = [name]
    middle, columns = SIZE // 2, slice(SIZE // 2 + 52, SIZE // 2 + 180)
    for rows in (slice(middle + 2, middle + 66), slice(middle - 66, middle - 2)):
        x, y = ((side.start + side.stop) / 2 - middle for side in (columns, rows))
        z = field(np.array(x + 1j * y))
        members = np.degrees((np.angle(z) + 2 * np.pi * np.arange(degree)) / degree) % 180
        row.append(listed(np.unique(members.round(6))))
        row.append(listed(peaks(orientation_spectrum(tone[rows, columns]))))
    return row

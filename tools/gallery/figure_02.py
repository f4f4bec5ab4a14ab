"""Figure 2: one direction of a 6-RoSy field, and all six."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from rosy_addon.compositor.compose import compose_planar

from .looks import MEASURED, PLANE, RED
from .measure import correlation, orientation_spectrum, peaks
from .page import Page, listed, signed
from .plane import PlanarField, channel, compose_field, draw_field, points, singularity
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
        sixth of a circle, forward above (index +1/6), backward below (−1/6). One direction out
        of the six (a, c) has to jump somewhere, here along the line to the right of the dot, and
        says little of the pattern. All six (b, d) go on everywhere, and show it: straight lines
        leave the dot in five directions in (b), in seven in (d)."""
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
        """How much goes on across the line to the right of the dot: the correlation of the
        pixels of a row below it with those to which their members lead three rows higher, above
        it, over the same correlation 18 rows farther down, where nothing jumps (1 is as if there
        were no line; 24 noises). And in a
        window of 128 pixels above the dot: the orientations at which the power of streaks
        peaks, and those of the field at its middle."""
    )
    page.table(
        ["Picture", "Goes on", "Found at (degrees)", "Field there (degrees)"],
        [_measured(index, degree) for index in (1, -1) for degree in (1, DEGREE)],
    )
    page.write("Figure 2")


def _measured(index: int, degree: int) -> list[object]:
    field = one_direction(index) if degree == 1 else singularity(index)
    tone = channel(compose_field(field, degree, SIZE, MEASURED).layers[0].tone, SIZE)
    middle, window = SIZE // 2, slice(SIZE - 150, SIZE - 22)
    found = peaks(orientation_spectrum(tone[window, middle - 64 : middle + 64]))
    centre = (window.start + window.stop) / 2 - middle
    member = np.degrees(np.angle(field(np.array([1j * centre]))[0])) / degree
    turns = 360 / degree * np.arange(degree)
    there = sorted({round(angle, 6) for angle in (member + turns) % 180})
    name = f"{'one direction' if degree == 1 else 'all six'}, index {signed(index)}/6"
    return [name, _kept(field, degree), listed(found), listed(there)]


def _kept(field: PlanarField, degree: int, seeds: int = 24) -> float:
    """How much of the streaks goes on across the line to the right, 1 being as elsewhere."""
    middle, half, rise = SIZE // 2, 64, 3
    columns = slice(middle + 40, SIZE - 40)
    z = field(points(SIZE))[middle - half : middle + half]
    # From the last row but one below the line to the second above it; and the same farther down.
    starts = {"across": half - 2, "below": half - 20}
    here, there = ({name: [] for name in starts} for _ in range(2))
    for seed in range(seeds):
        look = MEASURED.with_settings({"seed": seed})
        picture = compose_planar(np.angle(z) / degree, degree, look)
        tone = picture.layers[0].tone[:, 0].reshape(z.shape)
        for name, row in starts.items():
            turns = 2 * np.pi * np.arange(degree)[:, None]
            for ahead in np.exp(1j * (np.angle(z[row, columns]) + turns) / degree):
                if np.abs(ahead.imag).min() < 0.3:
                    continue
                way = rise / ahead.imag * ahead
                place = [row + way.imag, np.arange(SIZE)[columns] + way.real]
                there[name].append(ndimage.map_coordinates(tone, place, order=1))
                here[name].append(tone[row, columns])
    kept = {name: correlation(np.array(here[name]), np.array(there[name])) for name in starts}
    return kept["across"] / kept["below"]

"""Figure 10: legibility of fields with many directions."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from .figure_06 import constant
from .looks import MEASURED, PLANE
from .measure import mean_spectrum, peak_to_floor
from .page import Page
from .plane import channel, compose_field, draw_field, singularity
from .sheet import Panel, chart

SIZE, MEMBER, SIDE, SEEDS, BINS = 400, np.radians(12), 64, 2, 60


def write() -> None:
    """Draw and write the page."""
    page = Page("figure-10", "Many directions are hard to read")
    page.text(
        """This page shows how many directions can be read. The fields have degree 5 and 7, with a
        singularity of index +1/N. All N directions are drawn, but each of the M images contributes
        only 1/M of the variance of the blend. An odd N needs N images, an even N only half as many.
        So the pattern gets hard to read."""
    )
    panels = [
        Panel(draw_field(singularity(1), degree, SIZE, PLANE), f"({letter}) N = {degree}")
        for degree, letter in ((5, "a"), (7, "b"))
    ]
    page.picture([panels], "A 5-RoSy and a 7-RoSy field around a singularity")
    page.text("## Measurements")
    page.text(
        f"""The measurements use constant fields of each degree, drawn with the same settings. The
        charts show the power of the streaks by orientation, in windows of {SIDE} pixels, divided by
        the mean over all orientations. Legibility is the power at the directions of the members
        divided by the power midway between them. A streak has no arrowhead, so N = 1 and 2 look the
        same, and so do 3 and 6."""
    )
    spectra = {degree: _spectrum(degree) for degree in range(1, 8)}
    page.picture(
        [[Panel(_chart(spectra), "")]], "Power by orientation for N from 1 to 7", "spectra"
    )
    rows = []
    for degree, spectrum in spectra.items():
        lines = degree if degree % 2 else degree // 2
        rows.append([degree, lines, f"{peak_to_floor(spectrum, lines, np.degrees(MEMBER)):.1f}"])
    page.table(["N", "Orientations M", "Legibility"], rows)
    page.write("Figure 10")


def _spectrum(degree: int) -> np.ndarray:
    total = np.zeros(BINS)
    for seed in range(SEEDS):
        look = MEASURED.with_settings({"seed": seed})
        tone = compose_field(constant(MEMBER, degree), degree, SIZE, look).layer.tone
        total += mean_spectrum(channel(tone, SIZE)[40:-40, 40:-40], SIDE, BINS) / SEEDS
    return total


def _chart(spectra: dict[int, np.ndarray]) -> np.ndarray:
    figure = Figure(layout="constrained")
    plots = figure.subplots(2, 4, sharex=True, sharey=True).ravel()
    for axes, (degree, spectrum) in zip(plots, spectra.items(), strict=False):
        axes.fill_between(
            (np.arange(BINS) + 0.5) * 180 / BINS, spectrum, color="#7f9fbf", linewidth=0
        )
        axes.set_title(f"N = {degree}", fontsize=9, color="#333333")
        axes.set_xlim(0, 180)
        axes.set_xticks([0, 60, 120, 180])
        axes.set_ylim(0.03, 40)
        axes.set_yscale("log")
        axes.tick_params(labelsize=8, colors="#444444")
        axes.spines[["top", "right"]].set_visible(False)
    plots[-1].axis("off")
    figure.supxlabel("orientation (degrees)", fontsize=9, color="#333333")
    figure.supylabel("power over mean", fontsize=9, color="#333333")
    return chart(figure, 820, 360)

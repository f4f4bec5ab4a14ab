"""Draw figure 10: how legible fields with many directions are."""

import numpy as np
from matplotlib.figure import Figure

from tests.harness.streaks import mean_spectrum, peak_to_floor

from .figure_06 import MEMBER, constant
from .looks import MEASURED, PLANE
from .page import fill_tables, picture
from .plane import channel, compose_field, draw_field, singularity
from .sheet import Panel, chart

#: Sides of a picture and of the windows of a spectrum in pixels, number of seeds of the noise, and number of
#: bins of a spectrum.
SIZE, SIDE, SEEDS, BINS = 400, 64, 2, 60


def write() -> None:
    """Draw the pictures and measure the table."""
    panels = [
        Panel(draw_field(singularity(1), degree, SIZE, PLANE), f"({letter}) N = {degree}")
        for degree, letter in ((5, "a"), (7, "b"))
    ]
    picture("figure-10", panels)
    spectra = {degree: _spectrum(degree) for degree in range(1, 8)}
    picture("figure-10-spectra", [Panel(_chart(spectra))])
    rows = []
    for degree, spectrum in spectra.items():
        lines = degree if degree % 2 else degree // 2
        rows.append([degree, lines, f"{peak_to_floor(spectrum, lines, np.degrees(MEMBER)):.1f}"])
    fill_tables("figure-10", rows)


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
    orientation = (np.arange(BINS) + 0.5) * 180 / BINS
    for axes, (degree, spectrum) in zip(plots, spectra.items(), strict=False):
        axes.fill_between(orientation, spectrum, color="#7f9fbf", linewidth=0)
        axes.set_title(f"N = {degree}", fontsize=9, color="#333333")
        axes.set(xlim=(0, 180), xticks=[0, 60, 120, 180], yscale="log")
        axes.set_ylim(0.03, 40)
        axes.tick_params(labelsize=8, colors="#444444")
        axes.spines[["top", "right"]].set_visible(False)
    plots[-1].axis("off")
    figure.supxlabel("orientation (degrees)", fontsize=9, color="#333333")
    figure.supylabel("power over mean", fontsize=9, color="#333333")
    return chart(figure, 820, 360)

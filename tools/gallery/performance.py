"""Draw closeups of singularities, for docs/performance.md."""

from dataclasses import replace

import numpy as np

from rosy_addon.compositor.look import Look
from tests.harness.planar import compose_planar

from .page import IMAGES
from .plane import points, singularity
from .sheet import Panel, display, magnified, save, sheet

#: Look with the noise and contrast of the paper, which show grain and interrupted streaks best.
PLAIN = Look(length=40, gain=1.5, density=0.5, high_pass=0.0)

#: Sides in pixels of a picture and of a closeup.
SIDE, CLOSE = 400, 128


def write() -> None:
    """Draw closeups of singularities, where the LIC methods differ, enlarged by 2."""
    inner = slice((SIDE - CLOSE) // 2, (SIDE + CLOSE) // 2)
    rows: list[list[Panel]] = []
    for degree, index, name in ((3, 1, "1/3"), (4, 1, "1/4"), (4, -1, "-1/4"), (6, -1, "-1/6")):
        angles = np.angle(singularity(index)(points(SIDE))) / degree
        rows.append([])
        for method in ("brute", "members", "sheets"):
            rgba = compose_planar(angles, degree, replace(PLAIN, method=method)).rgba
            shown = magnified(display(rgba)[inner, inner], 2)
            rows[-1].append(Panel(shown, f"{method}, N = {degree}, index {name}"))
    save(sheet(rows), IMAGES / "performance-singularities.png")

"""Measure how long a frame of a cross field takes, relative to one vector field by VTK, each on two cores.

The comparison is that of `surface_vtk`, but RoSy draws with two processes, and VTK's driver with two threads.
"""

from dataclasses import replace

import numpy as np

from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

from . import cases
from .surface_vtk import AZIMUTH_STEP, DEGREE, LARGE_SIZE, LOOK, SAMPLES_LABEL, vtk_renderer
from .timing import Bench, main, use_cores

TRIANGLES, SAMPLES, CORES = 12_000, 2, 2


def measure(bench: Bench) -> None:
    """Time the large picture."""
    use_cores(CORES)
    draw_next, read_pixels, name = vtk_renderer(TRIANGLES, LARGE_SIZE)
    print(name, flush=True)
    look = replace(LOOK, supersampling=SAMPLES)
    instances = (cases.instance(TRIANGLES, DEGREE),)
    azimuths = iter(np.arange(1, 10_000) * AZIMUTH_STEP)

    def draw() -> None:
        view = ViewInput(instances, cases.camera(LARGE_SIZE, azimuth=next(azimuths)), look)
        draw_picture(view, cases.CORNER_FIELDS, keep_gbuffers=False, workers=CORES)

    bench.compare(
        f"N = 4{SAMPLES_LABEL[SAMPLES]} / VTK's one vector field, frame, two cores each",
        draw,
        lambda: (draw_next(), read_pixels()),
        at_most=0.8,
    )


if __name__ == "__main__":
    main(__doc__, measure)

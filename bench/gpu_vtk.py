"""Measure how long the shaders take for a frame of a cross field, relative to VTK's surface LIC.

VTK draws only one vector field. Both use the same driver (Mesa's llvmpipe if there is no graphics card)
with all cores, the same mesh, camera and coverage, and 41 samples per streamline. A frame is the work
after the camera has moved, until the driver is done; neither picture is read back.
"""

import sys

import numpy as np

from rosy_addon.gpu.renderer import GpuRenderer

from . import cases
from .gpu import draw_texture, open_device
from .surface_vtk import AZIMUTH_STEP, DEGREE, LOOK, print_coverage, vtk_renderer
from .timing import Bench, main


def measure(bench: Bench) -> None:
    """Time a small and a large mesh. RoSy and VTK have separate OpenGL contexts."""
    for triangles in (12_000, 200_000):
        draw_next, read_pixels, vtk_name = vtk_renderer(triangles)
        device = open_device()
        if device.name != vtk_name:
            sys.exit(f"skipped: the shaders use {device.name}, VTK uses {vtk_name}")
        renderer = GpuRenderer(device)
        items = renderer.upload([cases.instance(triangles, DEGREE)], LOOK.display)
        picture = draw_texture(renderer, items, cases.camera(), LOOK)
        rgba = device.read(picture)
        draw_next()
        print_coverage(vtk_name, read_pixels(), rgba)
        azimuths = iter(np.arange(1, 10_000) * AZIMUTH_STEP)

        def draw_frame(device=device, renderer=renderer, items=items, azimuths=azimuths) -> None:
            # VTK has made its own context current in the frame before.
            with device.context:
                draw_texture(renderer, items, cases.camera(azimuth=next(azimuths)), LOOK)
                device.finish()

        bench.compare(
            f"shaders, N = 4 / VTK's one vector field, {triangles // 1000}K triangles",
            draw_frame,
            draw_next,
            at_most=1.0,
        )


if __name__ == "__main__":
    main(__doc__, measure)

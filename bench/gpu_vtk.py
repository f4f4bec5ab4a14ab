"""Time of a frame of a cross field by the shaders, relative to VTK's surface LIC.

VTK draws one vector field. Both use the same driver (Mesa's llvmpipe if there is no graphics card)
with all cores, the same mesh, camera and coverage, and 41 samples per streamline. A frame is the work
after the camera has moved, until the driver is done; neither picture is read back.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from rosy_addon.gpu.renderer import GpuRenderer

from . import cases
from .gpu import draw_texture, open_device
from .surface_vtk import AZIMUTH_STEP, DEGREE, LOOK, vtk_renderer
from .timing import Case, compare, main


def measure(runs: int) -> Iterator[Case]:
    """Time a small and a large mesh."""
    if open_device() is None:
        return
    try:
        import vtk
    except ImportError:
        print("shaders beside VTK: skipped, because vtk is not installed", file=sys.stderr)
        return
    for triangles in (12_000, 200_000):
        case = _compare_mesh(vtk, triangles, runs)
        if case is not None:
            yield case


def _compare_mesh(vtk: Any, triangles: int, runs: int) -> Case | None:
    """Time one mesh. Each needs its own context, because VTK makes the context of its window current."""
    draw_next, read_pixels, vtk_name = vtk_renderer(vtk, triangles)
    device = open_device()
    print(f"shaders: {device.name}; VTK: {vtk_name}", flush=True)
    if device.name != vtk_name:
        print("shaders beside VTK: skipped, because they use different renderers", file=sys.stderr)
        return None
    renderer = GpuRenderer(device)
    items = renderer.upload([cases.instance(triangles, DEGREE)], LOOK.display)
    picture = renderer.read(
        draw_texture(renderer, items, cases.camera(), LOOK), cases.SIZE, cases.SIZE
    )
    draw_next()
    coverage, vtk_coverage = (picture[..., 3] > 0).mean(), (read_pixels().min(axis=1) < 255).mean()
    print(f"covered: {vtk_coverage:.1%} by VTK, {coverage:.1%} by the shaders", flush=True)
    azimuths = iter(np.arange(1, 10_000) * AZIMUTH_STEP)

    def draw_frame() -> None:
        # VTK makes its own context current in every frame.
        with device.context:
            draw_texture(renderer, items, cases.camera(azimuth=next(azimuths)), LOOK)
            device.finish()

    return compare(
        f"shaders, N = 4 / VTK's one vector field, {triangles // 1000}K triangles",
        draw_frame,
        draw_next,
        target=1.0,
        higher_is_better=False,
        runs=runs,
    )


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))

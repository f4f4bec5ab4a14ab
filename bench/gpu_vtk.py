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
from .gpu import device, draw_texture
from .surface_vtk import DEGREE, LOOK, ON, renderer
from .timing import Case, compare, main


def measure(runs: int) -> Iterator[Case]:
    """Time a small and a large mesh."""
    if device() is None:
        return
    try:
        import vtk
    except ImportError:
        print("shaders beside VTK: skipped, because vtk is not installed", file=sys.stderr)
        return
    for triangles in (12_000, 200_000):
        case = _compared(vtk, triangles, runs)
        if case is not None:
            yield case


def _compared(vtk: Any, triangles: int, runs: int) -> Case | None:
    """Time one mesh. Each needs its own context, because VTK makes the context of its window current."""
    turn, read, theirs = renderer(vtk, triangles)
    drawn_by = device()
    print(f"shaders: {drawn_by.name}; VTK: {theirs}", flush=True)
    if drawn_by.name != theirs:
        print("shaders beside VTK: skipped, because they use different renderers", file=sys.stderr)
        return None
    card = GpuRenderer(drawn_by)
    placed = card.upload([cases.instance(triangles, DEGREE)], LOOK.display)
    picture = card.read(draw_texture(card, placed, cases.camera(), LOOK), cases.SIZE, cases.SIZE)
    turn()
    ours, covered = (picture[..., 3] > 0).mean(), (read().min(axis=1) < 255).mean()
    print(f"covered: {covered:.1%} by VTK, {ours:.1%} by the shaders", flush=True)
    azimuths = iter(np.arange(1, 10_000) * ON)

    def frame() -> None:
        # VTK makes its own context current in every frame.
        with drawn_by.context:
            draw_texture(card, placed, cases.camera(azimuth=next(azimuths)), LOOK)
            drawn_by.finish()

    return compare(
        f"shaders, N = 4 / VTK's one vector field, {triangles // 1000}K triangles",
        frame,
        turn,
        target=1.0,
        higher_is_better=False,
        runs=runs,
    )


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))

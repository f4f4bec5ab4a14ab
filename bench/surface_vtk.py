"""A frame of a cross field over a frame of one vector field by VTK's surface LIC, one core each.

The same mesh, camera and coverage, 41 samples of a streamline. VTK draws on the processor here, by
Mesa's llvmpipe, unless the system gives it a graphics card; its renderer is printed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from . import cases
from .timing import Case, compare, main, use_one_core

DEGREE = 4

#: 41 samples of a streamline.
LOOK = replace(cases.LOOK, length=20)

#: Radians by which both cameras go on from frame to frame.
ON = 0.01


def measure(runs: int) -> Iterator[Case]:
    """Few and many triangles."""
    use_one_core()
    # Before the library is loaded: llvmpipe counts the cores of the machine, not of the process.
    os.environ["LP_NUM_THREADS"] = "0"
    try:
        import vtk
    except ImportError:
        print("surfaces of VTK: left out, there is no vtk here", file=sys.stderr)
        return
    for triangles in (12_000, 200_000):
        draw, renderer = _renderer(vtk, triangles)
        theirs = float((draw().min(axis=1) < 255).mean())
        ours = float((cases.frame(triangles, DEGREE, LOOK)[..., 3] > 0).mean())
        print(f"{renderer}; covered: {theirs:.1%} by VTK, {ours:.1%} by RoSy", flush=True)
        turn = iter(np.arange(1, 10_000) * ON)
        yield compare(
            f"N = 4 / VTK's one vector field, frame, {triangles // 1000}K triangles",
            lambda t=triangles, turn=turn: cases.frame(t, DEGREE, LOOK, azimuth=next(turn)),
            draw,
            target=0.5,
            higher_is_better=False,
            runs=runs,
        )


def _renderer(vtk: Any, triangles: int) -> tuple[Callable[[], np.ndarray], str]:
    """A function that turns the camera and draws, (P, 3) uint8, and what it is done by."""
    from vtk.util.numpy_support import vtk_to_numpy

    mapper = vtk.vtkSurfaceLICMapper()
    mapper.SetInputData(_poly_data(vtk, triangles))
    mapper.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, "field")
    settings = mapper.GetLICInterface()
    settings.SetNumberOfSteps(LOOK.length)
    settings.SetStepSize(LOOK.step)
    settings.EnhancedLICOff()  # a second pass, which would double its samples
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.AddActor(actor)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(cases.SIZE, cases.SIZE)
    window.AddRenderer(renderer)
    ours = cases.camera()
    eye = -ours.view[:3, :3].T @ ours.view[:3, 3]
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*eye)
    camera.SetFocalPoint(0, 0, 0)
    camera.SetViewUp(0, 0, 1)
    camera.SetViewAngle(np.degrees(2 * np.arctan(1 / ours.projection[1, 1])))
    renderer.ResetCameraClippingRange()
    pixels = vtk.vtkUnsignedCharArray()

    def draw() -> np.ndarray:
        camera.Azimuth(np.degrees(ON))
        window.Render()
        last = cases.SIZE - 1
        window.GetPixelData(0, 0, last, last, 0, pixels, 0)
        return vtk_to_numpy(pixels)

    draw()
    lines = window.ReportCapabilities().splitlines()
    names = [line.split(":", 1)[1].strip() for line in lines if "renderer string" in line]
    return draw, names[0] if names else window.GetClassName()


def _poly_data(vtk: Any, triangles: int) -> Any:
    """The ball with a member of the field, averaged at its points."""
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

    body = cases.body(triangles, DEGREE)
    surface = body.surface
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(surface.vertices.astype(np.float32), deep=True))
    ids = surface.triangle_vertex.astype(np.int64).ravel()
    cells = vtk.vtkCellArray()
    cells.SetData(3, numpy_to_vtkIdTypeArray(ids, deep=True))
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cells)
    vectors = np.zeros_like(surface.vertices)
    np.add.at(vectors, surface.corner_vertex, body.field.vectors[surface.corner_face])
    field = numpy_to_vtk(vectors.astype(np.float32), deep=True)
    field.SetName("field")
    data.GetPointData().SetVectors(field)
    return data


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))

"""Measure how long a frame of a cross field takes, relative to one vector field by VTK's surface LIC.

Both use one core, the same mesh and camera, the same part of the picture, and 41 samples per streamline. VTK
draws with Mesa's llvmpipe unless the system has a graphics card. The name of its renderer is printed.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from . import cases
from .timing import Bench, main, peer, use_cores

DEGREE = 4

#: Look with 41 samples per streamline.
LOOK = replace(cases.LOOK, length=20)

#: Side of the large picture in pixels, and texts about its size by the samples along each side of a pixel.
#: VTK always has one sample per pixel.
LARGE_SIZE = 1080
SAMPLES_LABEL = {1: "", 2: ", 1080 x 1080, 2 x 2 samples a pixel"}

#: Rotation of both cameras between frames, in radians.
AZIMUTH_STEP = 0.01


def measure(bench: Bench) -> None:
    """Time a small and a large mesh."""
    use_cores(1)
    for triangles, size, samples, target in (
        (12_000, cases.SIZE, 1, 0.5),
        (200_000, cases.SIZE, 1, 0.5),
        (12_000, LARGE_SIZE, 2, 0.6),
    ):
        look = replace(LOOK, supersampling=samples)
        draw_next, read_pixels, name = vtk_renderer(triangles, size)
        print_coverage(name, read_pixels(), cases.frame(triangles, DEGREE, look, size))
        azimuths = iter(np.arange(1, 10_000) * AZIMUTH_STEP)
        bench.compare(
            f"N = 4{SAMPLES_LABEL[samples]} / VTK's one vector field, frame, "
            f"{triangles // 1000}K triangles",
            lambda t=triangles, look=look, size=size, azimuths=azimuths: cases.frame(
                t, DEGREE, look, size, azimuth=next(azimuths)
            ),
            lambda draw=draw_next, read=read_pixels: (draw(), read()),
            at_most=target,
        )


def print_coverage(name: str, vtk_pixels: np.ndarray, rgba: np.ndarray) -> None:
    """Print which fraction of the picture VTK and RoSy cover, as a check that they draw the same."""
    vtk_coverage, coverage = (vtk_pixels.min(axis=1) < 255).mean(), (rgba[..., 3] > 0).mean()
    print(f"{name}; covered: {vtk_coverage:.1%} by VTK, {coverage:.1%} by RoSy", flush=True)


def vtk_renderer(
    triangles: int, size: int = cases.SIZE
) -> tuple[Callable[[], None], Callable[[], np.ndarray], str]:
    """Set up VTK's surface LIC of the ball.

    Returns
    -------
    draw_next : function
        Rotates the camera, draws, and waits until the picture is done.
    read_pixels : function
        Returns the pixels of the picture, (P, 3) uint8.
    name : str
        Name of the renderer that the driver reports.
    """
    vtk = peer("vtk")
    from vtk.util.numpy_support import vtk_to_numpy

    mapper = vtk.vtkSurfaceLICMapper()
    mapper.SetInputData(_poly_data(vtk, triangles))
    mapper.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, "field")
    settings = mapper.GetLICInterface()
    settings.SetNumberOfSteps(LOOK.length)
    settings.SetStepSize(1.0)
    settings.EnhancedLICOff()  # without a second LIC pass, which would double the samples
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    scene = vtk.vtkRenderer()
    scene.SetBackground(1, 1, 1)
    scene.AddActor(actor)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(size, size)
    window.AddRenderer(scene)
    camera = _set_camera(scene)
    pixels = vtk.vtkUnsignedCharArray()

    def draw_next() -> None:
        camera.Azimuth(np.degrees(AZIMUTH_STEP))
        window.Render()
        window.WaitForCompletion()

    def read_pixels() -> np.ndarray:
        window.GetPixelData(0, 0, size - 1, size - 1, 0, pixels, 0)
        return vtk_to_numpy(pixels)

    draw_next()
    lines = window.ReportCapabilities().splitlines()
    names = [line.split(":", 1)[1].strip() for line in lines if "renderer string" in line]
    return draw_next, read_pixels, names[0] if names else window.GetClassName()


def _set_camera(scene: Any) -> Any:
    """Place VTK's camera like the camera of `cases`, and return it."""
    rosy_camera = cases.camera()
    camera = scene.GetActiveCamera()
    camera.SetPosition(*(-rosy_camera.view[:3, :3].T @ rosy_camera.view[:3, 3]))
    camera.SetFocalPoint(0, 0, 0)
    camera.SetViewUp(0, 0, 1)
    camera.SetViewAngle(np.degrees(2 * np.arctan(1 / rosy_camera.projection[1, 1])))
    scene.ResetCameraClippingRange()
    return camera


def _poly_data(vtk: Any, triangles: int) -> Any:
    """Return the ball as VTK's data, with one member of the field averaged at the vertices."""
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

    instance = cases.instance(triangles, DEGREE)
    surface = instance.surface
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(surface.vertices.astype(np.float32), deep=True))
    ids = surface.triangle_vertex.astype(np.int64).ravel()
    cells = vtk.vtkCellArray()
    cells.SetData(3, numpy_to_vtkIdTypeArray(ids, deep=True))
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cells)
    vectors = np.zeros_like(surface.vertices)
    np.add.at(vectors, surface.corner_vertex, instance.field.vectors[surface.corner_face])
    field = numpy_to_vtk(vectors.astype(np.float32), deep=True)
    field.SetName("field")
    data.GetPointData().SetVectors(field)
    return data


if __name__ == "__main__":
    main(__doc__, measure)

"""Choice of the renderer, by device: for pictures and for 3D views."""

from __future__ import annotations

from dataclasses import replace

from ..cache import Cache
from ..compositor.look import Look
from ..errors import DeviceError
from ..rendering.band_workers import BandWorkers
from ..rendering.cpu import CpuRenderer
from ..rendering.renderer import Renderer, ViewportRenderer
from .cpu_viewport import CpuViewportRenderer
from .device import blender_device
from .renderer import GpuRenderer, check_method

#: Devices that draw pictures, by key: label and description in the user interface.
RENDER_DEVICES = {
    "cpu": ("Processor", "Identical pixels on every machine"),
    "gpu": ("Graphics Card", "Faster. Single pixels can differ between cards"),
    "auto": ("Automatic", "The graphics card if there is one, otherwise the processor"),
}


def select_renderer(
    device: str,
    look: Look,
    cache: Cache | None = None,
    *,
    keep_gbuffers: bool = True,
    workers: BandWorkers | None = None,
) -> Renderer:
    """Return the renderer that draws a look on a device.

    The choice depends on the device and on the look alone.

    Parameters
    ----------
    device : {"cpu", "gpu", "auto"}
        "auto" is the graphics card if there is one that draws the look, otherwise the processor.
    look : Look
    cache : Cache, optional
    keep_gbuffers : bool
        Whether the processor keeps G-buffers in the cache; see `CpuRenderer`.
    workers : BandWorkers, optional
        Processes that draw large pictures, if the processor does.

    Raises
    ------
    DeviceError
        If the device is "gpu" and there is no graphics card, or it does not draw this look.
    """
    if device == "cpu":
        return CpuRenderer(cache, keep_gbuffers=keep_gbuffers, workers=workers)
    try:
        check_method(look)
        return GpuRenderer(blender_device())
    except DeviceError:
        if device == "gpu":
            raise
    return CpuRenderer(cache, keep_gbuffers=keep_gbuffers, workers=workers)


def automatic_device(look: Look) -> str:
    """Return which device draws a look if the device is "auto": "cpu" or "gpu"."""
    return select_renderer("auto", look).device_name


def select_viewport_renderer(device: str) -> ViewportRenderer:
    """Return the renderer for 3D views: numpy if the device is "cpu", otherwise the graphics card.

    Raises
    ------
    DeviceError
        If there is no graphics context: then no picture can be shown.
    """
    gpu_device = blender_device()
    return CpuViewportRenderer(gpu_device) if device == "cpu" else GpuRenderer(gpu_device)


def look_in_view(look: Look, renderer: ViewportRenderer) -> tuple[Look, str | None]:
    """Return the look that a renderer draws in 3D views, and a line that says so if it is another one.

    Parameters
    ----------
    look : Look
    renderer : ViewportRenderer

    Returns
    -------
    look : Look
        Of a method that the renderer has.
    message : str or None
    """
    method = renderer.stand_ins.get(look.method)
    if method is None:
        return look, None
    message = (
        f"live views on the graphics card draw the method '{method}' instead of '{look.method}': bake to see "
        f"'{look.method}'"
    )
    return replace(look, method=method), message

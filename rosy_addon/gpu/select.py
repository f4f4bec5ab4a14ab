"""Choice of the renderer for pictures and for 3D views: numpy, or the graphics card."""

from dataclasses import replace

from ..compositor.look import Look
from ..compositor.picture import Picture
from ..core.errors import DeviceError
from ..image_io.image_data import ImageData
from ..rendering.draw import bake_picture
from ..rendering.picture_images import CONVERSION_START, draw_image, picture_image
from ..rendering.renderer import ViewportRenderer
from ..rendering.view_input import ViewInput
from ..worker.job import Call, Steps, call_steps, part
from .cpu_viewport import CpuViewportRenderer
from .device import blender_device
from .renderer import GpuRenderer, check_method

#: Devices that draw pictures, by key: label and description in the user interface.
RENDER_DEVICES = {
    "cpu": ("Processor", "Identical pixels on every machine"),
    "gpu": ("Graphics Card", "Faster. Single pixels can differ between cards"),
    "auto": ("Automatic", "The graphics card if there is one, otherwise the processor"),
}


def select_device(device: str, look: Look) -> str:
    """Return which device draws the pictures of a look.

    Parameters
    ----------
    device : {"cpu", "gpu", "auto"}
        "auto" is the graphics card if there is one that draws the look, otherwise the processor.
    look : Look

    Returns
    -------
    {"cpu", "gpu"}
        The device. It is a part of cache keys, because the pixels of both devices differ slightly.

    Raises
    ------
    DeviceError
        If the device is "gpu" and there is no graphics card, or it does not draw this look.
    """
    if device == "cpu":
        return "cpu"
    try:
        check_method(look)
        blender_device()
    except DeviceError:
        if device == "gpu":
            raise
        return "cpu"
    return "gpu"


def picture_steps(view: ViewInput, device: str) -> Steps[Picture]:
    """Draw a picture as part of a job: on the graphics card in steps, or with numpy in one call.

    Parameters
    ----------
    view : ViewInput
    device : {"cpu", "gpu"}
        Result of `select_device`.

    Returns
    -------
    Picture
    """
    if device == "cpu":
        return call_steps(bake_picture, view)
    return GpuRenderer(blender_device()).picture_steps(view)


def image_steps(
    view: ViewInput, device: str, as_float: bool, *, keep_gbuffers: bool = True, workers: int = 0
) -> Steps[tuple[Picture, ImageData]]:
    """Draw a picture as part of a job, and convert it to an image.

    Parameters
    ----------
    view : ViewInput
    device : {"cpu", "gpu"}
        Result of `select_device`.
    as_float : bool
        Whether the image has linear values in single precision, instead of 8-bit sRGB.
    keep_gbuffers : bool
        Whether G-buffers are kept in the cache. Only used by the CPU.
    workers : int
        Number of processes that draw a large picture on the CPU. 0 means one per processor core.
    """
    if device == "cpu":
        return (yield Call(draw_image, (view, as_float, keep_gbuffers, workers)))
    picture = yield from part(picture_steps(view, device), 0.0, CONVERSION_START)
    return picture, (yield Call(picture_image, (picture, as_float), CONVERSION_START))


def automatic_device(look: Look) -> str:
    """Return the device that draws a look if the user has chosen "auto": "cpu" or "gpu"."""
    return select_device("auto", look)


def select_viewport_renderer(device: str) -> ViewportRenderer:
    """Return the renderer for 3D views: numpy if the device is "cpu", otherwise the graphics card.

    Raises
    ------
    DeviceError
        If there is no graphics context, so that no picture can be shown.
    """
    gpu_device = blender_device()
    return CpuViewportRenderer(gpu_device) if device == "cpu" else GpuRenderer(gpu_device)


def look_in_view(look: Look, renderer: ViewportRenderer) -> tuple[Look, str | None]:
    """Return the look that a renderer draws in 3D views, and a message if it differs from the given look.

    Parameters
    ----------
    look : Look
    renderer : ViewportRenderer

    Returns
    -------
    look : Look
        The look, with an LIC method that the renderer supports.
    message : str or None
        A line of text for the user if the method is another one, otherwise None.
    """
    method = renderer.stand_ins.get(look.method)
    if method is None:
        return look, None
    message = (
        f"live views on the graphics card draw the method '{method}' instead of '{look.method}': bake to see "
        f"'{look.method}'"
    )
    return replace(look, method=method), message

"""Drawing a picture on either device, and converting it for a Blender image."""

from __future__ import annotations

from ..compositor.picture import Picture
from ..image_io.image_data import ImageData
from ..rendering.picture_images import CONVERSION_START, draw_image, picture_image
from ..rendering.view_input import ViewInput
from ..worker.job import Call, Steps, part
from .select import picture_steps


def image_steps(
    view: ViewInput, device: str, as_float: bool, *, keep_gbuffers: bool = True, workers: int = 0
) -> Steps[tuple[Picture, ImageData]]:
    """Draw a picture as part of a job, and convert it; see `picture_steps` and `picture_image`."""
    if device == "cpu":
        return (yield Call(draw_image, (view, as_float, keep_gbuffers, workers)))
    picture = yield from part(picture_steps(view, device), 0.0, CONVERSION_START)
    return picture, (yield Call(picture_image, (picture, as_float), CONVERSION_START))

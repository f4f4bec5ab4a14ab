"""The viewport renderer for machines without a graphics card that compiles the shaders."""

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..core.errors import NothingInViewError
from ..projection.gbuffer import MeshInstance
from ..rendering.draw import bake_picture
from ..rendering.renderer import ViewportRenderer
from ..rendering.view_input import ViewInput
from ..worker.job import Call, Steps
from .background import draw_texture
from .device import Device
from .passes import RasterPass
from .preparation import prepare_steps
from .uniforms import NO_CLIP_PLANES, matrix_rows


class CpuViewportRenderer(ViewportRenderer):
    """A renderer that draws the pictures of 3D views with numpy.

    Each picture is drawn by one function call, which a helper process can make. The device only composites
    the picture over the view. Pictures have no depth, so the meshes must include occluders.

    Parameters
    ----------
    device : Device
    """

    downscale_factors = 4, 2
    needs_occluders = True

    def __init__(self, device: Device) -> None:
        self.device = device
        # Two triangles that fill the view, in front of everything in it.
        vertices = np.zeros((6, 4), dtype=np.float32)
        vertices[:, :2] = [(-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1)]
        vertices[:, 2] = -0.9999
        uniforms = matrix_rows("clip", "xyzw", np.eye(4))
        uniforms |= matrix_rows("plane", range(6), NO_CLIP_PLANES)
        self._fullscreen_batch = device.batch(vertices), uniforms

    def prepare_steps(self, instances: Sequence[MeshInstance], display: str) -> Steps[Any]:
        """Compile the two shaders that draw into views."""
        return prepare_steps((), self.device, [RasterPass("composite"), RasterPass("background")])

    def texture_steps(
        self, items: Sequence[MeshInstance], view: ViewInput, target_key: Hashable = None
    ) -> Steps[Any]:
        """Draw a picture by one function call, and send it to the device. Clip planes are ignored."""
        try:
            picture = yield Call(bake_picture, (replace(view, instances=tuple(items)), True, 1))
        except NothingInViewError:
            return None
        return self.device.texture(picture.rgba.shape[1::-1], "RGBA16F", data=picture.rgba)

    def composite(self, texture: Any, items: list[Any], view: ViewInput, opacity: float) -> None:
        """Fill the 3D view that is being drawn with a texture."""
        if texture is not None:
            draw_texture(self.device, texture, [self._fullscreen_batch], opacity)

"""The viewport renderer for machines without a graphics card that compiles the shaders."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..core.errors import NothingInViewError
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..rendering.draw import bake_picture
from ..rendering.view_input import Background, ViewInput
from ..worker.job import Call, Steps
from .background import draw_background, draw_texture
from .device import Device
from .passes import RasterPass
from .preparation import compile_lookups, prepare_steps
from .uniforms import NO_CLIP_PLANES, matrix_rows


class CpuViewportRenderer:
    """Draws the pictures of 3D views with numpy. Implements `ViewportRenderer`.

    Each picture is one call, for a helper process. The device only composites it over the view.

    Parameters
    ----------
    device : Device

    Attributes
    ----------
    downscale_factors, needs_occluders, stand_ins
        See `ViewportRenderer`. Pictures have no depth, so occluders are needed.
    """

    downscale_factors = 4, 2
    needs_occluders = True
    stand_ins: Mapping[str, str] = {}

    def __init__(self, device: Device) -> None:
        self._device = device
        # Two triangles that fill the view, in front of everything in it.
        vertices = np.zeros((6, 4), dtype=np.float32)
        vertices[:, :2] = [(-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1)]
        vertices[:, 2] = -0.9999
        uniforms = {
            **matrix_rows("clip", "xyzw", np.eye(4)),
            **matrix_rows("plane", range(6), NO_CLIP_PLANES),
        }
        self._fullscreen_batch = device.batch(vertices), uniforms

    def prepare_steps(self, instances: Sequence[MeshInstance], display: str) -> Steps[Any]:
        """As `ViewportRenderer.prepare_steps`."""
        shaders = RasterPass("composite"), RasterPass("background")
        return prepare_steps(compile_lookups(self._device, shaders))

    def upload(self, instances: Sequence[MeshInstance], display: str) -> list[MeshInstance]:
        """As `ViewportRenderer.upload`."""
        return list(instances)

    def covered_pixels(self, items: Sequence[MeshInstance], camera: Camera) -> int:
        """As `ViewportRenderer.covered_pixels`."""
        return camera.width * camera.height

    def texture_steps(
        self, items: Sequence[MeshInstance], view: ViewInput, target_key: Hashable = None
    ) -> Steps[Any]:
        """As `ViewportRenderer.texture_steps`. Clip planes are ignored."""
        try:
            picture = yield Call(bake_picture, (replace(view, instances=tuple(items)), True, 1))
        except NothingInViewError:
            return None
        height, width = picture.rgba.shape[:2]
        return self._device.texture(width, height, "RGBA16F", data=picture.rgba)

    def composite(
        self, texture: Any, items: Sequence[MeshInstance], view: ViewInput, opacity: float = 1.0
    ) -> None:
        """As `ViewportRenderer.composite`: the texture fills the view."""
        if texture is None:
            return
        draw_texture(self._device, texture, [self._fullscreen_batch], opacity)

    def draw_background(self, background: Background) -> None:
        """As `ViewportRenderer.draw_background`."""
        draw_background(self._device, background)

    def finish(self) -> None:
        """As `ViewportRenderer.finish`."""

    def release(self) -> None:
        """As `ViewportRenderer.release`."""

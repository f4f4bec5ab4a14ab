"""The viewport renderer for machines without a graphics card that compiles the shaders."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..cache import Cache
from ..errors import NothingInViewError
from ..progress import Task
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..rendering.view_input import Background, ViewInput
from .background import draw_background
from .device import Device
from .passes import BACKGROUND, COMPOSITE


class CpuViewportRenderer:
    """Draws the pictures of 3D views with numpy. Implements `ViewportRenderer`.

    The device only composites the finished picture over the view.

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
        self._cache = Cache()
        self._renderer = CpuRenderer(self._cache)
        # Two triangles that fill the view, in front of everything in it.
        vertices = np.zeros((6, 4), dtype=np.float32)
        vertices[:, :2] = [(-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1)]
        vertices[:, 2] = -0.9999
        self._fullscreen_batch = device.batch(vertices)

    def prepare_task(self, instances: Sequence[MeshInstance], display: str) -> Task[None]:
        """As `ViewportRenderer.prepare_task`."""
        yield from self._device.compile_task((COMPOSITE, BACKGROUND))

    def upload(self, instances: Sequence[MeshInstance], display: str) -> list[MeshInstance]:
        """As `ViewportRenderer.upload`."""
        return list(instances)

    def covered_pixels(self, items: Sequence[MeshInstance], camera: Camera) -> int:
        """As `ViewportRenderer.covered_pixels`."""
        return camera.width * camera.height

    def render_texture_task(
        self, items: Sequence[MeshInstance], view: ViewInput, target_key: Hashable = None
    ) -> Task[Any]:
        """As `ViewportRenderer.render_texture_task`. Clip planes are ignored."""
        try:
            picture = yield from self._renderer.render_task(replace(view, instances=tuple(items)))
        except NothingInViewError:
            return None
        finally:
            self._cache.evict_over_limit()
        height, width = picture.rgba.shape[:2]
        return self._device.texture(width, height, "RGBA16F", data=picture.rgba)

    def composite(
        self, texture: Any, items: Sequence[MeshInstance], view: ViewInput, opacity: float = 1.0
    ) -> None:
        """As `ViewportRenderer.composite`: the texture fills the view."""
        if texture is None:
            return
        left, bottom, width, height = self._device.viewport()
        uniforms = {
            **{f"clip_{axis}": tuple(row) for axis, row in zip("xyzw", np.eye(4), strict=True)},
            **{f"plane{number}": (0.0, 0.0, 0.0, 1.0) for number in range(6)},
            "depth_bias": 0.0,
            "view_origin": (float(left), float(bottom)),
            "pixel_scale": (texture.width / width, texture.height / height),
            "opacity": opacity,
        }
        self._device.draw_to_view(
            COMPOSITE, [(self._fullscreen_batch, {})], {"picture": texture}, uniforms
        )

    def draw_background(self, background: Background) -> None:
        """As `ViewportRenderer.draw_background`."""
        draw_background(self._device, background)

    def finish(self) -> None:
        """As `ViewportRenderer.finish`."""

    def release(self) -> None:
        """As `ViewportRenderer.release`."""
        self._cache.clear()

"""The protocols that renderers implement: one for pictures, one for views."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Protocol

from ..compositor.picture import Picture
from ..progress import Task
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from .view_input import Background, ViewInput


class Renderer(Protocol):
    """Draws pictures into memory.

    Attributes
    ----------
    device_name : {"cpu", "gpu"}
        Part of cache keys: the pixels of the two differ slightly.
    """

    device_name: str

    def render_task(self, view: ViewInput) -> Task[Picture]:
        """Draw a picture of the size of `view.camera`.

        Raises
        ------
        RosyError
            If an input is invalid, the tone has no source, or the device cannot draw this picture.
        NothingInViewError
            If no mesh with a field is visible.
        """


class ViewportRenderer(Protocol):
    """Draws pictures that stay on the graphics card, and composites them over a 3D view.

    Draw items and textures are opaque handles.

    Attributes
    ----------
    downscale_factors : (int, int)
        View pixels per picture pixel, each way: of a preview, and of the final picture.
    needs_occluders : bool
        Whether the meshes must include those without a field. Otherwise the view's own depth
        buffer hides what is occluded.
    stand_ins : mapping of str to str
        LIC methods that it does not have, and those that it draws instead.
    """

    downscale_factors: tuple[int, int]
    needs_occluders: bool
    stand_ins: Mapping[str, str]

    def prepare_task(self, instances: Sequence[MeshInstance], display: str) -> Task[None]:
        """Do what takes long before the first picture: compile shaders, and `upload`.

        Each step is named before it begins.
        """

    def upload(self, instances: Sequence[MeshInstance], display: str) -> list[Any]:
        """Return draw items of mesh instances. Meshes that are on the card are not sent again.

        Parameters
        ----------
        instances : sequence of MeshInstance
        display : {"smooth", "flat"}
            `Look.display` of the views that are drawn with them.
        """

    def covered_pixels(self, items: Sequence[Any], camera: Camera) -> int:
        """Return an upper bound of the number of pixels that must be drawn."""

    def render_texture_task(
        self, items: Sequence[Any], view: ViewInput, target_key: Hashable = None
    ) -> Task[Any]:
        """Draw a picture into a texture. Other pictures may be drawn between two steps.

        Parameters
        ----------
        items : sequence
            From `upload`, of the view's instances.
        view : ViewInput
        target_key : hashable
            Pictures with equal keys and sizes share one texture.

        Returns
        -------
        texture or None
            (H, W, 4), linear, of the size of `view.camera`. None if no mesh with a field is
            visible.
        """

    def composite(
        self, texture: Any, items: Sequence[Any], view: ViewInput, opacity: float = 1.0
    ) -> None:
        """Draw a texture over the 3D view that is being drawn.

        Parameters
        ----------
        texture : texture or None
            From `render_texture_task`, of any size.
        items : sequence
        view : ViewInput
            Its camera and clip planes are those of the 3D view.
        opacity : float
        """

    def draw_background(self, background: Background) -> None:
        """Fill a part of the 3D view that is being drawn, wherever its depth is at the far end."""

    def finish(self) -> None:
        """Wait until the device has done all work."""

    def release(self) -> None:
        """Free all resources."""

"""`ViewportRenderer`: the interface of the renderers of 3D views."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..worker.job import Steps
from .view_input import ViewInput


class ViewportRenderer:
    """Draw pictures that stay on the graphics card, and composite them over a 3D view.

    Draw items and textures are opaque handles.

    Attributes
    ----------
    device : Device
        The graphics context of the 3D views (`gpu.device.Device`).
    downscale_factors : (int, int)
        View pixels per picture pixel, each way: of a preview, and of the final picture.
    needs_occluders : bool
        Whether the meshes must include those without a field. Otherwise the view's own depth
        buffer hides what is occluded.
    stand_ins : mapping of str to str
        LIC methods that it does not have, and the methods that it draws instead.
    """

    device: Any
    downscale_factors: tuple[int, int]
    needs_occluders = False
    stand_ins: Mapping[str, str] = {}

    def prepare_steps(self, instances: Sequence[MeshInstance], display: str) -> Steps[Any]:
        """Do what takes long before a picture: compile shaders, prepare meshes and upload them.

        Each step is named before it begins. There are none if everything is prepared.
        """
        raise NotImplementedError

    def upload(self, instances: Sequence[MeshInstance], display: str) -> list[Any]:
        """Return draw items of mesh instances. Meshes that are on the card are not sent again.

        Parameters
        ----------
        instances : sequence of MeshInstance
        display : {"smooth", "flat"}
            `Look.display` of the views that are drawn with them.
        """
        return list(instances)

    def covered_pixels(self, items: Sequence[Any], camera: Camera) -> int:
        """Return an upper bound of the number of pixels that must be drawn."""
        return camera.width * camera.height

    def texture_steps(
        self, items: Sequence[Any], view: ViewInput, target_key: Hashable = None
    ) -> Steps[Any]:
        """Draw a picture into a texture. Other pictures may be drawn between two steps.

        Parameters
        ----------
        items : sequence
            Result of `upload`, for the view's instances.
        view : ViewInput
        target_key : hashable
            Pictures with equal keys and sizes share one texture.

        Returns
        -------
        texture or None
            (H, W, 4), linear, of the size of `view.camera`. None if no mesh with a field is
            visible.
        """
        raise NotImplementedError

    def composite(
        self, texture: Any, items: Sequence[Any], view: ViewInput, opacity: float = 1.0
    ) -> None:
        """Draw a texture over the 3D view that is being drawn.

        Parameters
        ----------
        texture : texture or None
            Result of `texture_steps`, of any size.
        items : sequence
        view : ViewInput
            With the camera and the clip planes of the 3D view.
        opacity : float
        """
        raise NotImplementedError

    def finish(self) -> None:
        """Wait until the device has done all work."""

    def release(self) -> None:
        """Free all resources."""

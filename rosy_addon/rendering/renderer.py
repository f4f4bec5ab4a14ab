"""`ViewportRenderer`: the interface of the renderers of 3D views."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..worker.job import Steps
from .view_input import ViewInput


class ViewportRenderer:
    """A renderer of pictures that stay on the graphics card and are composited over a 3D view.

    Draw items (mesh instances on the card) and textures are opaque handles of the renderer.

    Attributes
    ----------
    device : Device
        The graphics context of the 3D views (`gpu.device.Device`).
    downscale_factors : (int, int)
        Pixels of the 3D view per pixel of the picture, in each direction: first for previews, then for the
        final picture.
    needs_occluders : bool
        Whether meshes without a field must be given too, as they hide others. If not, the renderer uses the
        depth buffer of the 3D view.
    stand_ins : mapping of str to str
        Names of LIC methods that the renderer lacks, and of the methods with which it draws instead.
    """

    device: Any
    downscale_factors: tuple[int, int]
    needs_occluders = False
    stand_ins: Mapping[str, str] = {}

    def prepare_steps(self, instances: Sequence[MeshInstance], display: str) -> Steps[Any]:
        """Do the slow work before a picture, step by step: compile shaders, prepare meshes and upload them.

        Each yielded step names the work that comes next. No step is yielded if everything is prepared. The
        arguments are the mesh instances of the picture and `Look.display` of its look, as for `upload`.
        """
        raise NotImplementedError

    def upload(self, instances: Sequence[MeshInstance], display: str) -> list[Any]:
        """Return draw items of mesh instances. Meshes that are on the card already are not sent again.

        Parameters
        ----------
        instances : sequence of MeshInstance
        display : {"smooth", "flat"}
            `Look.display` of the views for which the draw items are used.
        """
        return list(instances)

    def covered_pixels(self, items: Sequence[Any], camera: Camera) -> int:
        """Return an upper bound of the number of pixels of a camera that the meshes cover."""
        return camera.width * camera.height

    def texture_steps(
        self, items: Sequence[Any], view: ViewInput, target_key: Hashable = None
    ) -> Steps[Any]:
        """Draw a picture into a texture, step by step. Other pictures may be drawn between two steps.

        Parameters
        ----------
        items : sequence
            Result of `upload` for the instances of the view.
        view : ViewInput
            What to draw.
        target_key : hashable
            Pictures with equal keys and sizes are drawn into the same texture.

        Returns
        -------
        texture or None
            Linear RGBA of the size of `view.camera`. None if no mesh with a field is visible.
        """
        raise NotImplementedError

    def composite(self, texture: Any, items: list[Any], view: ViewInput, opacity: float) -> None:
        """Draw a texture over the 3D view that is being drawn.

        Parameters
        ----------
        texture : texture or None
            Result of `texture_steps`. It may be smaller or larger than the 3D view.
        items : sequence
            The draw items of the picture.
        view : ViewInput
            It has the camera and the clip planes of the 3D view.
        opacity : float
            Opacity of the picture, 0 to 1.
        """
        raise NotImplementedError

    def finish(self) -> None:
        """Wait until the graphics card has done all work."""

    def release(self) -> None:
        """Free all resources of the renderer."""

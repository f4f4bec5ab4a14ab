"""The numpy rooms in place of a card, where there is none that takes the shaders."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np

from ..compositor.look import Look
from ..compositor.shading import Light
from ..compositor.tone import Rendered
from ..errors import NothingInViewError
from ..progress import Work
from ..projection.camera import Camera
from ..projection.gbuffer import Body
from .device import Device
from .painter import painting
from .passes import SHOW


class Processor:
    """Draws what a `Card` draws, in numpy; all that the card has to do is to show it.

    Parameters
    ----------
    device : Device

    Attributes
    ----------
    coarseness : (int, int)
        Pixels of a view for one of its picture, each way: while things move, and when they rest.
    sees_others : bool
        Whether it has to be given what hides the fields: its pictures know no depth.
    """

    coarseness = 4, 2
    sees_others = True

    def __init__(self, device: Device) -> None:
        self._device = device
        # Two triangles that fill the view, in front of all that is in it.
        corners = np.zeros((6, 4), dtype=np.float32)
        corners[:, :2] = [(-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1)]
        corners[:, 2] = -0.9999
        self._frame = device.batch(corners)

    def place(self, bodies: Sequence[Body], display: str) -> list[Body]:
        """As `Card.place`."""
        return list(bodies)

    def covered(self, placed: Sequence[Body], camera: Camera) -> int:
        """As `Card.covered`."""
        return camera.width * camera.height

    def drawing(
        self,
        placed: Sequence[Body],
        camera: Camera,
        look: Look,
        lights: Sequence[Light] = (),
        planes: np.ndarray | None = None,
        name: Hashable = None,
        rendered: Rendered | None = None,
    ) -> Work[Any]:
        """As `Card.drawing`, but that nothing is cut away."""
        try:
            picture = yield from painting(None, placed, camera, look, lights, rendered=rendered)
        except NothingInViewError:
            return None
        height, width = picture.rgba.shape[:2]
        return self._device.texture(width, height, "RGBA16F", data=picture.rgba)

    def show(
        self,
        picture: Any,
        placed: Sequence[Body],
        camera: Camera,
        planes: np.ndarray | None = None,
        opacity: float = 1.0,
    ) -> None:
        """Draw a picture over a view."""
        if picture is None:
            return
        left, bottom, width, height = self._device.viewport()
        constants = {
            **{f"clip_{axis}": tuple(row) for axis, row in zip("xyzw", np.eye(4), strict=True)},
            **{f"plane{number}": (0.0, 0.0, 0.0, 1.0) for number in range(6)},
            "nearer": 0.0,
            "origin": (float(left), float(bottom)),
            "pixels": (picture.width / width, picture.height / height),
            "opacity": opacity,
        }
        self._device.draw_over(SHOW, [(self._frame, {})], {"picture": picture}, constants)

    def wait(self) -> None:
        """As `Card.wait`."""

    def release(self) -> None:
        """As `Card.release`."""

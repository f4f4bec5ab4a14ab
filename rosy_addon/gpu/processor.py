"""The numpy rooms in place of a card, where there is none that takes the shaders."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np

from ..compositor.colour import to_display
from ..compositor.compose import composing
from ..compositor.look import Look
from ..compositor.shading import Light
from ..errors import NothingInViewError
from ..progress import Work, part
from ..projection.camera import Camera
from ..projection.gbuffer import Body
from ..projection.project import projecting


class Processor:
    """Draws what a `Card` draws, in numpy, and shows it with a shader of Blender's own.

    Attributes
    ----------
    coarseness : (int, int)
        Pixels of a view for one of its picture, each way: while things move, and when they rest.
    sees_others : bool
        Whether it has to be given what hides the fields: its pictures know no depth.
    """

    coarseness = 4, 2
    sees_others = True

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
    ) -> Work[Any]:
        """As `Card.drawing`, but that nothing is cut away."""
        try:
            gbuffer = yield from part(projecting(placed, camera, look.display), 0.0, 0.4)
        except NothingInViewError:
            return None
        picture = yield from part(composing(gbuffer, look, lights), 0.4, 1.0)
        return _texture(picture.rgba)

    def show(
        self,
        picture: Any,
        placed: Sequence[Body],
        camera: Camera,
        planes: np.ndarray | None = None,
        opacity: float = 1.0,
    ) -> None:
        """Draw a picture over a view."""
        import gpu
        from gpu_extras.batch import batch_for_shader
        from mathutils import Matrix

        if picture is None:
            return
        shader = gpu.shader.from_builtin("IMAGE_COLOR")
        corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        texture_corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
        quad = batch_for_shader(shader, "TRI_FAN", {"pos": corners, "texCoord": texture_corners})
        gpu.state.blend_set("ALPHA_PREMULT")
        with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            gpu.matrix.load_identity()
            gpu.matrix.load_projection_matrix(Matrix.Identity(4))
            shader.uniform_sampler("image", picture)
            shader.uniform_float("color", (opacity, opacity, opacity, opacity))
            quad.draw(shader)
        gpu.state.blend_set("NONE")

    def wait(self) -> None:
        """As `Card.wait`."""

    def release(self) -> None:
        """As `Card.release`."""


def _texture(rgba: np.ndarray) -> Any:
    """Display values, as Blender's own shader wants, premultiplied, as borders are interpolated."""
    import gpu

    height, width = rgba.shape[:2]
    colours = np.empty_like(rgba)
    colours[..., :3] = to_display(rgba[..., :3]) * rgba[..., 3:]
    colours[..., 3] = rgba[..., 3]
    flat = np.ascontiguousarray(colours, dtype=np.float32).reshape(-1)
    buffer = gpu.types.Buffer("FLOAT", len(flat), flat)
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)

"""Compare the G-buffers and pictures of the graphics card with the results of numpy."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .one_streamline import one_streamline_per_pixel
from .rosy_modules import rosy

#: Largest distance between two points that count as equal, in pixels. OpenGL rounds the vertices of
#: triangles to 1/256 of a pixel, and on steep parts the depth changes by many pixels per pixel.
MAX_DISTANCE_PX = 0.1

#: Largest difference of unit normals, and of representations relative to the larger modulus.
MAX_DIFFERENCE = 1e-3

ViewInput, run = rosy("rendering.view_input").ViewInput, rosy("worker.job").run
has_flow = rosy("compositor.look").has_flow
compose, project = rosy("compositor.compose").compose, rosy("projection.project").project


@dataclass(frozen=True, eq=False)
class Pair:
    """The same picture by the graphics card and by numpy.

    Attributes
    ----------
    gbuffer : GBuffer
        The G-buffer of numpy.
    images : dict of str to (H, W, 4) float32 ndarray
        The G-buffer of the card.
    card, numpy : (H, W, 4) float32 ndarray
        The pictures, linear.
    is_center : (P,) bool ndarray or None
        The pixels of the G-buffer whose centers show a surface with a field; None if all do.
    """

    gbuffer: Any
    images: dict[str, np.ndarray]
    card: np.ndarray
    numpy: np.ndarray
    is_center: np.ndarray | None = None

    @property
    def agreement(self) -> float:
        """Return the fraction of pixels at which both G-buffers agree.

        The pixels are those that at least one of the G-buffers covers with a field. They agree if

        - both cover the pixel, with the same instance;
        - the points are within `MAX_DISTANCE_PX`. Both are on the ray through the pixel, so their
          distance is the difference in depth, in pixels at that depth. The triangles may be different
          where two meet, because OpenGL rounds their corners, but the points may not;
        - the normals differ by less than `MAX_DIFFERENCE`, and both G-buffers see the same side;
        - the representations z differ by at most `MAX_DIFFERENCE` times the greater modulus; 0 agrees
          only with 0.

        Where only samples beside the center show a surface, the two take other points of the triangle. There,
        the instance has to agree.
        """
        gbuffer, is_center = self.gbuffer, self.is_center
        camera, pixel = gbuffer.camera, gbuffer.pixel
        normals, values = (self.images[name].reshape(-1, 4) for name in ("normals", "field_values"))
        covered = np.zeros(camera.width * camera.height, dtype=bool)
        covered[pixel] = True
        either = np.count_nonzero(covered | (values[:, 3] > 0))
        normals, values = normals[pixel].astype(np.float64), values[pixel].astype(np.float64)
        same = values[:, 3] == gbuffer.instance_id + 1
        depth = -gbuffer.position[:, 2].astype(np.float64)
        distance = np.abs(np.abs(normals[:, 3]) - depth)
        if camera.is_perspective:
            # Along the ray, and in units of a pixel at that depth.
            distance = distance / gbuffer.view_direction[:, 2] / depth
        same &= distance * camera.pixels_per_unit < MAX_DISTANCE_PX
        same &= np.linalg.norm(normals[:, :3] - gbuffer.normal, axis=1) < MAX_DIFFERENCE
        same &= (normals[:, 3] > 0) == gbuffer.front_facing
        z = values[:, 0] + 1j * values[:, 1]
        expected = gbuffer.representation.astype(np.complex128)
        same &= np.abs(z - expected) <= MAX_DIFFERENCE * np.maximum(np.abs(z), np.abs(expected))
        if is_center is not None:
            same |= ~is_center & (values[:, 3] == gbuffer.instance_id + 1)
        return np.count_nonzero(same) / either

    @property
    def likeness(self) -> float:
        """See `likeness`."""
        return likeness(self.card, self.numpy)


def draw_on_card(card: Any, view: Any) -> np.ndarray:
    """Draw the picture of a view on a card: (H, W, 4), without marks over it."""
    texture = run(card.texture_steps(card.upload(view.instances, view.look.display), view))
    return card.device.read(texture)


def draw_pair(card: Any, instances: Sequence[Any], camera: Any, look: Any, **scene: Any) -> Pair:
    """Draw a picture on the card and with numpy.

    Numpy uses brute force, which averages each streamline separately.

    Parameters
    ----------
    card : GpuRenderer
    instances : sequence of MeshInstance
    camera : Camera
        With `look.supersampling` times the width and height of the picture.
    look : Look
    **scene
        The other attributes of the `ViewInput`.
    """
    supersampling = look.supersampling
    width, height = camera.width // supersampling, camera.height // supersampling
    view = ViewInput(tuple(instances), camera.resized(width, height), look, **scene)
    card_picture = draw_on_card(card, view)
    images = read_gbuffer(card, width, height)
    gbuffer = project(instances, view.camera, look.display, samples=supersampling)
    is_center = None
    if supersampling > 1:
        centers = project(instances, view.camera, look.display)
        is_center = np.isin(gbuffer.pixel, centers.pixel)
    light = view.lights, view.reference
    if has_flow(look) or supersampling > 1:
        with one_streamline_per_pixel():
            numpy_picture = compose(gbuffer, look, *light, drift=view.drift).rgba
    else:
        numpy_picture = compose(gbuffer, replace(look, method="brute"), *light).rgba
    return Pair(gbuffer, images, card_picture, numpy_picture, is_center)


def read_gbuffer(card: Any, width: int, height: int) -> dict[str, np.ndarray]:
    """Return the G-buffer of the last picture of a card, by the names of its images."""
    names = "normals", "field_values"
    return {name: card.device.read(card.resources.image(name, (width, height))) for name in names}


def likeness(one: np.ndarray, other: np.ndarray) -> float:
    """Return the correlation of two (H, W, 4) linear pictures over pixels that both cover fully.

    It is the smallest of the correlations of the three channels.
    """
    both = (one[..., 3] == 1) & (other[..., 3] == 1)
    one, other = one[both].astype(np.float64), other[both].astype(np.float64)
    return min(float(np.corrcoef(one[:, c], other[:, c])[0, 1]) for c in range(3))

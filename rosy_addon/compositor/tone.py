"""How light each pixel is to be: by the light, or by what else says so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import RosyError
from ..projection.camera import Camera
from ..projection.gbuffer import GBuffer
from ..projection.tone import Pyramid, surface_tones
from .look import Look
from .shading import Light, diffuse

#: Black and white are kept so far apart.
LEAST_SPAN = 1e-3

#: How far the sides of a picture may be from those of the frame, in proportion.
SAME_SHAPE = 0.01


@dataclass(frozen=True, eq=False)
class Rendered:
    """A picture of the scene that somebody else has made.

    Attributes
    ----------
    luminance : (H, W) float32 ndarray
        Linear, rows from the bottom.
    camera : Camera
        Through which it was made, of any size in the same proportions.
    name : str
        For messages.
    """

    luminance: np.ndarray
    camera: Camera
    name: str = "picture"

    def __post_init__(self) -> None:
        height, width = self.luminance.shape
        ratio = width / height * self.camera.height / self.camera.width
        if not 1 - SAME_SHAPE <= ratio <= 1 + SAME_SHAPE:
            raise RosyError(
                f"{self.name}: is {width} x {height} pixels, which is not the shape of the frame of "
                f"camera '{self.camera.name}', {self.camera.width} x {self.camera.height}"
            )

    @cached_property
    def pyramid(self) -> Pyramid:
        """The picture at all sizes."""
        return Pyramid(self.luminance)

    def level_for(self, camera: Camera) -> float:
        """How often it is halved for its pixels to be as wide as those of a camera."""
        height, width = self.luminance.shape
        own = self.camera.resized(width, height).pixels_per_unit
        return max(float(np.log2(own / camera.pixels_per_unit)), 0.0)

    def at(self, gbuffer: GBuffer) -> np.ndarray:
        """(P,) float32: what it shows where the pixels of a G-buffer are."""
        between = self.between(gbuffer.camera)
        clip = gbuffer.position @ between[[0, 1, 3], :3].T + between[[0, 1, 3], 3]
        across, upward = clip[:, :2].T / np.maximum(clip[:, 2], 1e-12) * 0.5 + 0.5
        level = np.full(len(clip), self.level_for(gbuffer.camera))
        return self.pyramid.at(across, upward, level, repeat=False)

    def between(self, camera: Camera) -> np.ndarray:
        """(4, 4) float64: from the space of a camera to the clip space of the picture."""
        turn, shift = camera.view[:3, :3], camera.view[:3, 3]
        back = np.eye(4)
        back[:3, :3], back[:3, 3] = turn.T, -turn.T @ shift
        return self.camera.projection @ self.camera.view @ back


def tone_of(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    rendered: Rendered | None = None,
) -> np.ndarray:
    """How light each pixel is to be.

    Parameters
    ----------
    gbuffer : GBuffer
    look : Look
        Its light, and its settings that begin with `tone`.
    lights : sequence of Light
        For the light "scene".
    rendered : Rendered, optional
        For the tone "picture".

    Returns
    -------
    (P, 3) float32 ndarray
        Linear factors. Where a surface has no tone of its own, what light there is.

    Raises
    ------
    RosyError
        If the tone is to come from what is not there.
    """
    if look.tone == "light":
        return curved(diffuse(gbuffer, look, lights), look)
    check_tone(look, [body.tone for body in gbuffer.bodies], rendered)
    own = rendered.at(gbuffer) if look.tone == "picture" else surface_tones(gbuffer)
    without = np.isnan(own)
    tone = np.repeat(curved(own, look)[:, None], 3, axis=1)
    if look.tone_lit or without.any():
        light = diffuse(gbuffer, look, lights)
        tone = tone * light if look.tone_lit else tone
        tone[without] = light[without]
    return tone


def check_tone(look: Look, own: Sequence[object], rendered: Rendered | None) -> None:
    """Refuse a look whose tone comes from what is not there.

    Parameters
    ----------
    look : Look
    own : sequence of SurfaceTone or None
        Of the bodies.
    rendered : Rendered or None

    Raises
    ------
    RosyError
    """
    if look.tone == "picture" and rendered is None:
        raise RosyError("the tone is to come from a picture, but none is given")
    if look.tone in ("attribute", "image") and all(tone is None for tone in own):
        what = {"attribute": "such an attribute", "image": "an image"}[look.tone]
        raise RosyError(f"the tone is to come from the {look.tone}, but no object has {what}")


def curved(tone: np.ndarray, look: Look) -> np.ndarray:
    """Tones from a look's black to its white as 0 to 1, and beyond, bent by its gamma; float32."""
    scale, black = curve_of(look)
    stretched = np.maximum((tone - np.float32(black)) * np.float32(scale), 0)
    if look.tone_gamma != 1:
        stretched = stretched ** np.float32(1 / look.tone_gamma)
    return stretched.astype(np.float32, copy=False)


def curve_of(look: Look) -> tuple[float, float]:
    """What a look's tones are stretched by, from where."""
    span = look.tone_white - look.tone_black
    if abs(span) < LEAST_SPAN:
        span = LEAST_SPAN if span >= 0 else -LEAST_SPAN
    return 1 / span, look.tone_black

"""Visible pixels and their field -> the picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..memory import keep_freed_memory
from ..progress import Work, drain, part
from ..projection.gbuffer import GBuffer
from .anchored import surface_noise
from .brute import brute_images
from .colour import map_colours, to_linear
from .contour import contour
from .contrast import averaging_gain, blend_gain, scale_contrast
from .flow import Flow, planar_flow, surface_flow
from .hatching import (
    Hand,
    has_outline,
    has_pieces,
    has_tooth,
    hatched,
    piece_length,
    runs_on,
    statistics_of,
)
from .hues import family_hues
from .images import Images, relative_magnitude
from .look import Look
from .members import members_images
from .noise import MEAN, image_noise
from .paper import TEETH, paper_tooth, surface_tooth
from .picture import Layers, Picture
from .scale import measured_look, scaled_look, unit_of
from .shading import Light
from .sheets import sheets_images
from .tone import Rendered, tone_of
from .waver import swayed, waver, wavers

#: The ways to compose, by their names in a look.
METHODS: dict[str, Callable[[Flow, Look, np.ndarray], Work[Images]]] = {
    "members": members_images,
    "brute": brute_images,
    "sheets": sheets_images,
}

#: Settings of a look that LIC images do not depend on.
AFTERWARDS = (
    "gain",
    "shading",
    "light",
    "shadows",
    "tone",
    "tone_lit",
    "tone_black",
    "tone_white",
    "tone_gamma",
    "colour_map",
    "hue",
    "ink",
    "ink_colour",
    "ink_ramp",
    "ink_colour_light",
    "ink_middle",
    "ink_colour_middle",
    "paper_colour",
    "clear_paper",
    "crispness",
    "layers",
    "layering",
    "breaks",
    "overshoot",
    "paper_grain",
    "outline",
)


def composing(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    rendered: Rendered | None = None,
) -> Work[Picture]:
    """Draw the fields of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
        Of `look.supersampling` times the size of the picture each way.
    look : Look
    lights : sequence of Light
        For a look lit by the scene.
    rendered : Rendered, optional
        For a look whose tone is that of a picture.

    Returns
    -------
    Picture

    Raises
    ------
    RosyError
        If the tone is to come from what is not there.
    """
    camera = gbuffer.camera
    look = measured_look(look, camera, gbuffer.bodies)
    finer = scaled_look(look)
    colour = np.empty((len(gbuffer.pixel), 3), dtype=np.float32)
    alpha = np.ones(len(gbuffer.pixel), dtype=np.float32)
    light = tone_of(gbuffer, look, lights, rendered)
    degree_of = np.asarray(gbuffer.degrees)[gbuffer.body]
    layers = []
    degrees = np.unique(degree_of).tolist()
    for count, degree in enumerate(degrees):
        flow = _flow(gbuffer, degree, finer)
        start, stop = count / len(degrees), (count + 1) / len(degrees)
        images = yield from part(_images_of(gbuffer, flow, finer), start, stop)
        layer = _layers(flow, finer, images)
        own = degree_of == degree
        if look.ink == "hatch":
            tone = np.clip(light[own].mean(axis=1), 0, 1)
            hand = yield from part(_hand(gbuffer, flow, finer, tone), stop, stop)
            colour[own], alpha[own] = hatched(flow, images, finer, tone, hand)
        else:
            colour[own] = _ink(flow, layer, finer)
        layers.append(layer)
    if look.ink == "soft":
        colour *= light
    rgba = _frame(gbuffer.pixel, colour, alpha, camera.width, camera.height, look.supersampling)
    return Picture(rgba, tuple(layers))


def compose(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    rendered: Rendered | None = None,
) -> Picture:
    """`composing`, run to its end."""
    return drain(composing(gbuffer, look, lights, rendered))


def compose_planar(
    angles: np.ndarray,
    degree: int,
    look: Look,
    magnitude: np.ndarray | float | None = None,
    noise: np.ndarray | None = None,
) -> Picture:
    """Draw a field in the plane, without a mesh, a camera or light.

    Parameters
    ----------
    angles : (H, W) ndarray
        Angle of a member at each pixel, radians counter-clockwise from the direction of the rows;
        rows from the bottom. NaN is undefined.
    degree : int
    look : Look
        Its supersampling does not count here: give finer angles instead.
    magnitude : (H, W) ndarray or float, optional
        rho, 1 if not given.
    noise : (H, W) or (H, W, 3) ndarray, optional
        Instead of the look's own.

    Returns
    -------
    Picture
    """
    flow = planar_flow(angles, degree, magnitude)
    if noise is not None:
        noise = np.asarray(noise, dtype=np.float32).reshape(len(flow.pixel), -1)
    look = replace(look, supersampling=1)
    layers = _layers(flow, look, drain(_images(flow, look, noise)))
    colour = _ink(flow, layers, look)
    opaque = np.ones(len(flow.pixel), dtype=np.float32)
    return Picture(_frame(flow.pixel, colour, opaque, flow.width, flow.height, 1), (layers,))


def _kept(gbuffer: GBuffer, name: Any, key: Any, make: Callable[[], Any]) -> Any:
    """What was made under a name for the last look, or made anew if it would not be the same."""
    made = gbuffer.made.get(name)
    if made is None or made[0] != key:
        made = gbuffer.made[name] = key, make()
    return made[1]


def _flow(gbuffer: GBuffer, degree: int, look: Look) -> Flow:
    """`surface_flow` of a degree, its course wavering if the look's does."""
    key = look.crease_angle, look.cross_creases
    flow = _kept(gbuffer, ("flow", degree), key, lambda: surface_flow(gbuffer, degree, *key))
    if not wavers(look):
        return flow
    own = np.searchsorted(gbuffer.pixel, flow.pixel)
    return swayed(flow, np.float32(look.wobble) * _waver(gbuffer, look)[own])


def _waver(gbuffer: GBuffer, look: Look) -> np.ndarray:
    """(P,) `waver` of a look."""
    key = look.anchor, look.grain, look.unit, look.unit_size
    return _kept(gbuffer, "waver", key, lambda: waver(gbuffer, look))


def _images_of(gbuffer: GBuffer, flow: Flow, look: Look, name: str = "images") -> Work[Images]:
    """`_images`, or those made for the last look under this name if they would be the same."""
    key = replace(look, **{name: getattr(Look, name) for name in AFTERWARDS})
    key = replace(key, wobble=look.wobble if wavers(look) else 0.0)
    made = gbuffer.made.get((name, flow.degree))
    if made is None or made[0] != key:
        made = key, (yield from _images(flow, look, _noise(gbuffer, flow, look)))
        gbuffer.made[name, flow.degree] = made
    return made[1]


def _hand(gbuffer: GBuffer, flow: Flow, look: Look, tone: np.ndarray) -> Work[Hand]:
    """What makes the lines of a flow uneven."""
    pieces = tooth = tones = None
    if has_pieces(look):
        shorter = replace(look, length=piece_length(look))
        pieces = yield from _images_of(gbuffer, flow, shorter, "pieces")
    if has_tooth(look):
        tooth = _tooth(gbuffer, flow, look)
    if runs_on(look):
        tones = yield from _tones_along(flow, look, tone)
    outline = _outline(gbuffer, flow, look) if has_outline(look) else None
    return Hand(pieces, tooth, tones, outline)


def _outline(gbuffer: GBuffer, flow: Flow, look: Look) -> np.ndarray:
    """(P,) `contour` at the pixels of a flow."""
    key = look.outline, look.crease_angle, look.cross_creases
    drawn = _kept(gbuffer, "contour", key, lambda: contour(gbuffer, look))
    return drawn[np.searchsorted(gbuffer.pixel, flow.pixel)]


def _tones_along(flow: Flow, look: Look, tone: np.ndarray) -> Work[np.ndarray]:
    """(M, P) means of (P,) tones along lines, as far each way as these run on."""
    near = replace(look, length=max(round(look.overshoot / look.step), 1), taper=False)
    # What evening out does to means along streamlines that end early, it does to ones as well. Of
    # channels there are one or three.
    ones = np.ones_like(tone)
    images = yield from METHODS[look.method](flow, near, np.stack([tone, ones, ones], axis=1))
    spread = images.members - np.float32(MEAN)
    means = MEAN + np.float32(1 - MEAN) * spread[..., 0] / spread[..., 1]
    return np.clip(means, 0, 1)


def _tooth(gbuffer: GBuffer, flow: Flow, look: Look) -> np.ndarray:
    """(M, P) how well the paper takes the ink of each line."""
    if look.anchor == "picture":
        side = look.supersampling
        grain = look.grain / side
        return paper_tooth(flow.pixel, flow.width, grain, look.seed, side, flow.lines)
    heights = _on_surfaces(gbuffer, flow, "tooth", surface_tooth(look) | unit_of(look))
    heights = heights - np.float32(MEAN)
    heights /= np.float32(statistics_of(look).tooth_deviation)
    return heights.T[np.arange(flow.lines) % TEETH]


def _noise(gbuffer: GBuffer, flow: Flow, look: Look) -> np.ndarray | None:
    """(P, K) noise on the surfaces at the pixels of a flow; None for that of the picture."""
    if look.anchor == "picture":
        return None
    return _on_surfaces(gbuffer, flow, "noise", noise_of(look) | unit_of(look))


def _on_surfaces(gbuffer: GBuffer, flow: Flow, name: str, key: dict[str, Any]) -> np.ndarray:
    """(P, K) `surface_noise` at the pixels of a flow."""
    noise = _kept(gbuffer, name, key, lambda: surface_noise(gbuffer, **key))
    if len(flow.pixel) == len(gbuffer.pixel):
        return noise
    return noise[np.searchsorted(gbuffer.pixel, flow.pixel)]


def _images(flow: Flow, look: Look, noise: np.ndarray | None = None) -> Work[Images]:
    """LIC images of the members, by the look's method."""
    keep_freed_memory()
    if noise is None:
        noise = look_noise(flow, look)
    return (yield from METHODS[look.method](flow, look, noise))


def look_noise(flow: Flow, look: Look) -> np.ndarray:
    """(P, K) float32: the noise that a look asks for, at the pixels of a flow."""
    return image_noise(flow.pixel, flow.width, **noise_of(look))


def noise_of(look: Look) -> dict[str, Any]:
    """What a look says about its noise, by the parameters of `image_noise` and `surface_noise`."""
    return {
        "grain": look.grain,
        "seed": look.seed,
        "channels": 3 if look.noise == "colour" else 1,
        "density": look.density,
        "high_pass": look.high_pass,
    }


def _layers(flow: Flow, look: Look, images: Images) -> Layers:
    """Images blended, with the contrast of one of them times the gain."""
    gain = look.gain * blend_gain(flow.lines, images.samples, look)
    if look.supersampling > 1:
        gain *= np.float32(averaging_gain(look))
    tone = scale_contrast(images.blend, gain[:, None])
    return Layers(flow.degree, flow.pixel, images, tone)


def _ink(flow: Flow, layers: Layers, look: Look) -> np.ndarray:
    """(P, 3) or (P, 1) linear light of the tones, coloured by magnitude or family if so wished."""
    hue = None
    if look.magnitude in ("colour", "both"):
        hue = map_colours(relative_magnitude(flow, look), look.colour_map)
    elif look.hue == "families":
        hue = family_hues(flow, layers.images, look)
    if hue is None:
        return to_linear(layers.tone)
    return to_linear(hue * (1 + 1.5 * (layers.tone - MEAN)))


def _frame(
    pixel: np.ndarray,
    colour: np.ndarray,
    alpha: np.ndarray,
    width: int,
    height: int,
    supersampling: int,
) -> np.ndarray:
    """(H, W, 4) float32: colours put in their places, blocks of subpixels averaged."""
    rows = np.empty((len(pixel), 4), dtype=np.float32)
    # Subpixels are premultiplied for their sums; those that see nothing are black and of alpha 0.
    rows[:, :3] = colour if supersampling == 1 else colour * alpha[:, None]
    rows[:, 3] = alpha
    if len(pixel) == height * width:
        rgba = rows
    else:
        rgba = np.zeros((height * width, 4), dtype=np.float32)
        # Four numbers of a pixel at once, as one of their size.
        rgba.view(np.complex128)[:, 0][pixel] = rows.view(np.complex128)[:, 0]
    s = supersampling
    if s == 1:
        return rgba.reshape(height, width, 4)
    rgba = rgba.reshape(height // s, s, width // s, s, 4).mean(axis=(1, 3))
    alpha = rgba[..., 3:]
    np.divide(rgba[..., :3], alpha, out=rgba[..., :3], where=alpha > 0)
    return rgba

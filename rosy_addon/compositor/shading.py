"""Diffuse light on the visible pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..field.frames import dot, unit
from ..projection.gbuffer import GBuffer
from ..projection.shadows import light_cameras, reached
from .look import Look


@dataclass(frozen=True, eq=False)
class Light:
    """A light as seen from the camera.

    Attributes
    ----------
    kind : {"sun", "point"}
    vector : (3,) ndarray
        Camera space: for a sun the unit direction to it, for a point its position.
    colour : (3,) ndarray
        Linear.
    strength : float
        For a sun, what a white surface facing it sends out (1 is white). For a point, the same at
        a distance of one Blender unit.
    """

    kind: str
    vector: np.ndarray
    colour: np.ndarray
    strength: float


#: Over the left shoulder of whoever looks.
LAMP = Light("sun", np.array([-0.50, 0.60, 0.62]) / 0.9975, np.ones(3), 1.0)


def lights_of(look: Look, lights: Sequence[Light]) -> Sequence[Light]:
    """The lights that a look is lit by, given those of the scene; none of them is the headlight."""
    return {"headlight": (), "lamp": (LAMP,), "scene": lights}[look.light]


def diffuse(gbuffer: GBuffer, look: Look, lights: Sequence[Light] = ()) -> np.ndarray:
    """What Lambert's law leaves of each pixel's colour.

    Parameters
    ----------
    gbuffer : GBuffer
    look : Look
        Its `light`, `shadows`, and `shading`, the strength: 0 leaves all pixels at 1.
    lights : sequence of Light
        For the light "scene".

    Returns
    -------
    (P, 3) float32 ndarray
        Linear factors.
    """
    if look.shading == 0:
        return np.ones((len(gbuffer.pixel), 3), dtype=np.float32)
    if look.light == "headlight":
        facing = np.maximum(dot(gbuffer.normal, gbuffer.toward_eye), 0)
        light = np.repeat(facing[:, None], 3, axis=1)
    else:
        light = np.zeros((len(gbuffer.pixel), 3), dtype=np.float32)
        for source in lights_of(look, lights):
            given = _lambert(gbuffer, source)
            if look.shadows:
                given = given * _reaching(gbuffer, source)
            light += given[:, None] * source.colour
    return (1 - look.shading + look.shading * light).astype(np.float32)


def _lambert(gbuffer: GBuffer, light: Light) -> np.ndarray:
    """(P,) what one light gives, without its colour."""
    vector = np.asarray(light.vector, dtype=np.float32)
    if light.kind == "sun":
        return light.strength * np.maximum(dot(gbuffer.normal, vector), 0)
    way = vector - gbuffer.position
    squared = np.maximum(dot(way, way), 1e-12)
    return light.strength * np.maximum(dot(gbuffer.normal, unit(way)), 0) / squared


def _reaching(gbuffer: GBuffer, light: Light) -> np.ndarray:
    """(P,) the share of a light that nothing keeps from a pixel, found once for all looks."""
    key = "reached", light.kind, np.asarray(light.vector, dtype=np.float64).tobytes()
    if key not in gbuffer.made:
        cameras = light_cameras(gbuffer.bodies, gbuffer.camera, light.kind, light.vector)
        gbuffer.made[key] = reached(gbuffer, cameras)
    return gbuffer.made[key]

"""Diffuse shading of the pixels of a G-buffer: lights, Lambert's law and cast shadows."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.cache import Cache
from ..field.frames import dot, normalize
from ..projection.gbuffer import GBuffer
from ..projection.shadow_maps import light_cameras, shadow_visibility
from .look import Look


@dataclass(frozen=True, eq=False)
class Light:
    """A light, in the space of the camera or the world.

    Attributes
    ----------
    kind : {"sun", "point"}
    vector : (3,) ndarray
        The unit direction to a sun, or the position of a point light.
    color : (3,) ndarray
        Linear.
    strength : float
        Radiance of a white diffuse surface that faces the light; 1 is white. For a point light, at
        a distance of one Blender unit.
    """

    kind: str
    vector: np.ndarray
    color: np.ndarray
    strength: float

    def transformed(self, matrix: np.ndarray) -> Light:
        """Return the light in another space, given the (4, 4) rigid transform to it."""
        vector = matrix[:3, :3] @ self.vector
        if self.kind == "point":
            vector = vector + matrix[:3, 3]
        return replace(self, vector=vector)

    def irradiance(self, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Return (n,) the irradiance at points, without the color of the light and shadows.

        Parameters
        ----------
        position, normal : (n, 3) float32 ndarray
            In the space of the light; the normals are unit vectors.
        """
        vector = np.asarray(self.vector, dtype=np.float32)
        if self.kind == "sun":
            return self.strength * np.maximum(dot(normal, vector), 0)
        to_light = vector - position
        distance_squared = np.maximum(dot(to_light, to_light), 1e-12)
        return self.strength * np.maximum(dot(normal, normalize(to_light)), 0) / distance_squared


#: The light "lamp", over the left shoulder of the viewer.
KEY_LIGHT = Light("sun", np.array([-0.50, 0.60, 0.62]) / 0.9975, np.ones(3), 1.0)


def lights_of(look: Any, lights: Sequence[Light]) -> Sequence[Light]:
    """Return the lights that a look or a style of strokes uses, given the lights of the scene.

    There are none for the headlight.
    """
    return {"lamp": (KEY_LIGHT,), "scene": lights}.get(look.light, ())


def diffuse(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    visibility: Sequence[np.ndarray] | None = None,
) -> np.ndarray:
    """Compute the diffuse lighting of each pixel by Lambert's law.

    Parameters
    ----------
    gbuffer : GBuffer
    look : Look
        Its `light`, `shadows` and `shading` are used. With a `shading` of 0 all pixels are 1.
    lights : sequence of Light
        Lights of the scene in the space of the camera. Used if the light of the look is "scene".
    visibility : sequence of (P,) ndarray, optional
        By default from `light_visibility`.

    Returns
    -------
    (P, 3) float32 ndarray
        Linear factors.
    """
    if look.shading == 0:
        return np.ones((len(gbuffer.pixel), 3), dtype=np.float32)
    if look.light == "headlight":
        cosine = np.maximum(dot(gbuffer.normal, gbuffer.view_direction), 0)
        light = np.repeat(cosine[:, None], 3, axis=1)
    else:
        if visibility is None:
            visibility = light_visibility(gbuffer, look, lights)
        light = np.zeros((len(gbuffer.pixel), 3), dtype=np.float32)
        for index, source in enumerate(lights_of(look, lights)):
            irradiance = source.irradiance(gbuffer.position, gbuffer.normal)
            if visibility:
                irradiance = irradiance * visibility[index]
            light += irradiance[:, None] * source.color
    return (1 - look.shading + look.shading * light).astype(np.float32)


def light_visibility(
    gbuffer: GBuffer, look: Look, lights: Sequence[Light] = (), cache: Cache | None = None
) -> list[np.ndarray]:
    """Compute the fraction of each light that reaches each pixel.

    Parameters
    ----------
    gbuffer, look, lights
        See `diffuse`.
    cache : Cache, optional
        Stores the results, which do not depend on the other settings of the look.

    Returns
    -------
    list of (P,) float32 ndarray
        One for each of the `lights_of` the look. Empty if nothing casts shadows.
    """
    if look.shading == 0 or not look.shadows:
        return []
    cache = Cache() if cache is None else cache
    visibility = []
    for light in lights_of(look, lights):
        vector = np.asarray(light.vector, dtype=np.float64)
        cameras = light_cameras(gbuffer.instances, gbuffer.camera, light.kind, vector)
        visibility.append(
            cache.get_or_create(
                ("shadow", gbuffer, light.kind, vector.tobytes()),
                functools.partial(shadow_visibility, gbuffer, cameras),
            )
        )
    return visibility

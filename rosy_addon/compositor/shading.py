"""Diffuse shading of the pixels of a G-buffer: lights, Lambert's law and cast shadows."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.cache import Cache, cached
from ..core.color import LUMINANCE_WEIGHTS
from ..field.frames import dot, normalize
from ..projection.gbuffer import GBuffer, MeshInstance, with_field
from ..projection.shadow_maps import light_cameras, shadow_visibility
from .look import Look


@dataclass(frozen=True, eq=False)
class Light:
    """A light in camera space or world space.

    Attributes
    ----------
    kind : {"sun", "point"}
    vector : (3,) ndarray
        The unit vector toward a sun, or the position of a point light.
    color : (3,) ndarray
        Linear RGB.
    strength : float
        Radiance of a white diffuse surface that faces the light; 1 is white. If the light is a point light,
        the surface is at a distance of one Blender unit.
    has_shadow : bool
        Whether it casts shadows, where shadows are drawn.
    """

    kind: str
    vector: np.ndarray
    color: np.ndarray
    strength: float
    has_shadow: bool = True

    @property
    def luminance(self) -> float:
        """The luminance of the color."""
        return float(LUMINANCE_WEIGHTS @ self.color)

    def transformed(self, matrix: np.ndarray) -> Light:
        """Return the light in another space. `matrix` is the (4, 4) rigid transform to that space."""
        vector = matrix[:3, :3] @ self.vector
        if self.kind == "point":
            vector = vector + matrix[:3, 3]
        return replace(self, vector=vector)

    def irradiance(self, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Return the irradiance of surface points by Lambert's law, as if the light were white.

        Shadows are ignored.

        Parameters
        ----------
        position, normal : (n, 3) float32 ndarray
            Positions and unit normals of the points, in the space in which the light is given.

        Returns
        -------
        (n,) float32 ndarray
            In the unit of `strength`.
        """
        vector = np.asarray(self.vector, dtype=np.float32)
        if self.kind == "sun":
            return self.strength * np.maximum(dot(normal, vector), 0)
        to_light = vector - position
        distance_squared = np.maximum(dot(to_light, to_light), 1e-12)
        return self.strength * np.maximum(dot(normal, normalize(to_light)), 0) / distance_squared


#: Largest number of triangles on which lights are metered. If there are more, only every n-th one is used.
METERED_TRIANGLES = 20_000

#: The light of a look whose `light` is "lamp": a sun over the left shoulder of the viewer.
KEY_LIGHT = Light("sun", np.array([-0.50, 0.60, 0.62]) / 0.9975, np.ones(3), 1.0)


def lights_of(look: Any, lights: Sequence[Light]) -> Sequence[Light]:
    """Return the lights that a look or a style of strokes uses.

    They depend on the `light_source`: `KEY_LIGHT` for "lamp", the given lights of the scene for "scene", and none
    for "headlight", which needs no `Light`.
    """
    return {"lamp": (KEY_LIGHT,), "scene": lights}.get(light_source(look, lights), ())


def light_source(look: Any, lights: Sequence[Light]) -> str:
    """Return the light of a look or a style of strokes, given the lights of the scene.

    It is the setting `light`. If that is "scene" and there are no lights, it is "headlight" for soft streaks and
    "lamp" for ink and strokes.
    """
    if look.light != "scene" or lights:
        return look.light
    return "headlight" if getattr(look, "ink", "") == "soft" else "lamp"


def casts_shadows(look: Look, lights: Sequence[Light]) -> bool:
    """Return whether a look draws cast shadows, given the lights of the scene."""
    return look.shadows or (look.light == "scene" and any(light.has_shadow for light in lights))


def metered(
    lights: Sequence[Light], instances: Sequence[MeshInstance], exposure: float = 0.0
) -> tuple[Light, ...]:
    """Return lights scaled so that the brightest tenth of the lit surface is white.

    Shadows are ignored, and so is the camera: the result is the same for all views.

    Parameters
    ----------
    lights : sequence of Light
        In world space.
    instances : sequence of MeshInstance
        Only the surfaces of instances with a field are used.
    exposure : float
        Further scale, in stops: 1 doubles the light.
    """
    if not lights:
        return ()
    meshes = with_field(instances)
    step = sum(len(mesh.surface.triangles) for mesh in meshes) // METERED_TRIANGLES + 1
    irradiance, area = [np.zeros(0)], [np.zeros(0)]
    for mesh in meshes:
        corners = mesh.to_world(mesh.surface.vertices[mesh.surface.triangle_vertex[::step]])
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area.append(np.linalg.norm(normal, axis=1))
        position, normal = corners.mean(axis=1), normalize(normal)
        irradiance.append(
            sum(light.luminance * light.irradiance(position, normal) for light in lights)
        )
    value, weight = np.concatenate(irradiance), np.concatenate(area)
    lit = np.flatnonzero(value > 0)
    if not len(lit):
        return tuple(lights)
    order = lit[np.argsort(value[lit])]
    covered = np.cumsum(weight[order])
    white = value[order[np.searchsorted(covered, 0.9 * covered[-1])]]
    return tuple(replace(light, strength=light.strength * 2**exposure / white) for light in lights)


def diffuse(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    visibility: Sequence[np.ndarray] = (),
) -> np.ndarray:
    """Compute the diffuse lighting of each pixel by Lambert's law.

    Parameters
    ----------
    gbuffer : GBuffer
    look : Look
        Its `light` and `shading` are used. With a `shading` of 0 all pixels are 1.
    lights : sequence of Light
        Lights of the scene in camera space. Used if the light of the look is "scene".
    visibility : sequence of (P,) ndarray, optional
        The fraction of each light that reaches each pixel, for the lights in the order of `lights_of` (see
        `light_visibility`). By default, nothing casts shadows.

    Returns
    -------
    (P, 3) float32 ndarray
        Linear factors of the color.
    """
    if look.shading == 0:
        return np.ones((len(gbuffer.pixel), 3), dtype=np.float32)
    if light_source(look, lights) == "headlight":
        cosine = np.maximum(dot(gbuffer.normal, gbuffer.view_direction), 0)
        light = np.repeat(cosine[:, None], 3, axis=1)
    else:
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
    gbuffer : GBuffer
    look : Look
        Its `light`, `shading` and `shadows` are used.
    lights : sequence of Light
        Lights of the scene in camera space. Used if the light of the look is "scene".
    cache : Cache, optional
        Stores the results, which do not depend on the other settings of the look.

    Returns
    -------
    list of (P,) float32 ndarray
        One array for each light from `lights_of`. The list is empty if there are no shadows.
    """
    if look.shading == 0 or not casts_shadows(look, lights):
        return []
    visibility = []
    for light in lights_of(look, lights):
        if not light.has_shadow:
            visibility.append(np.ones(len(gbuffer.pixel), dtype=np.float32))
            continue
        vector = np.asarray(light.vector, dtype=np.float64)
        cameras = light_cameras(gbuffer.instances, gbuffer.camera, light.kind, vector)
        compute = functools.partial(shadow_visibility, gbuffer, cameras)
        visibility.append(cached(cache, compute, "shadow", gbuffer, light.kind, vector))
    return visibility

"""Reading the lights of a scene."""

from __future__ import annotations

import bpy
import numpy as np

from ..compositor.shading import Light


def read_lights(depsgraph: bpy.types.Depsgraph, view_matrix: np.ndarray) -> list[Light]:
    """Return all lights that are visible in renders, including instances, in camera space.

    A sun with a strength of pi W/m2 gives a white diffuse surface that faces it a radiance of 1. A
    point light with the power P gives P / (4 pi^2 r^2) at the distance r. Spots and area lights are
    treated as point lights. An area light gets the factor 4 of its radiance along its axis.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
    view_matrix : (4, 4) ndarray
        World to camera space.

    Returns
    -------
    list of Light
    """
    return [light for light, _ in rendered_lights(depsgraph, view_matrix)]


def rendered_lights(
    depsgraph: bpy.types.Depsgraph, view_matrix: np.ndarray
) -> list[tuple[Light, bpy.types.Object]]:
    """Return the lights of `read_lights`, each with its original object."""
    lights = []
    for instance in depsgraph.object_instances:
        obj = instance.object
        if obj.type == "LIGHT" and not obj.original.hide_render and instance.show_self:
            matrix = view_matrix @ np.array(instance.matrix_world)
            lights.append((_convert_light(obj.data, matrix), obj.original))
    return lights


def _convert_light(data: bpy.types.Light, matrix: np.ndarray) -> Light:
    """Convert a Blender light with a local-to-camera matrix."""
    color = np.array(data.color) * _temperature_color(data)
    energy = data.energy * 2.0 ** getattr(data, "exposure", 0.0)
    if data.type == "SUN":
        direction = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        return Light("sun", direction, color, energy / np.pi)
    axial_gain = 4.0 if data.type == "AREA" else 1.0
    return Light("point", matrix[:3, 3].copy(), color, axial_gain * energy / (4 * np.pi**2))


def _temperature_color(data: bpy.types.Light) -> np.ndarray:
    """Return the RGB factor of a light's color temperature; ones if it is not used."""
    if not getattr(data, "use_temperature", False):
        return np.ones(3)
    return np.array(data.temperature_color)

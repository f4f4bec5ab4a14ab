"""The lights of a scene."""

from __future__ import annotations

import bpy
import numpy as np

from ..compositor.shading import Light


def read_lights(depsgraph: bpy.types.Depsgraph, view_matrix: np.ndarray) -> list[Light]:
    """All lights that shine in renders, instances included, in the space of a camera.

    A sun of strength pi (W/m2) makes a white surface that faces it send out 1. A point light of
    power P does P / (4 pi^2 r^2) at distance r; spots and areas count as points, an area with the
    factor 4 that it has along its axis.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
    view_matrix : (4, 4) ndarray
        World to camera space.
    """
    lights = []
    for instance in depsgraph.object_instances:
        thing = instance.object
        if thing.type != "LIGHT" or thing.original.hide_render or not instance.show_self:
            continue
        matrix = view_matrix @ np.array(instance.matrix_world)
        lights.append(_light(thing.data, matrix))
    return lights


def _light(data: bpy.types.Light, matrix: np.ndarray) -> Light:
    colour = np.array(data.color) * _temperature(data)
    energy = data.energy * 2.0 ** getattr(data, "exposure", 0.0)
    if data.type == "SUN":
        toward = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        return Light("sun", toward, colour, energy / np.pi)
    along_axis = 4.0 if data.type == "AREA" else 1.0
    return Light("point", matrix[:3, 3].copy(), colour, along_axis * energy / (4 * np.pi**2))


def _temperature(data: bpy.types.Light) -> np.ndarray:
    if not getattr(data, "use_temperature", False):
        return np.ones(3)
    return np.array(data.temperature_color)

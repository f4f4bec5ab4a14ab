"""Dots at singularities in a 3D view, and labels with their indices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import blf
import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ..annotation.index_labels import MAX_LABELS, place_indices
from ..annotation.singularity_marks import (
    COLOR_BY_SIGN,
    HIDDEN_OPACITY,
    OUTLINE,
    OUTLINE_COLOR,
    dot_diameters,
)
from ..cache import Cache
from ..color import from_hex
from ..field.singularities import find_singularities
from ..gpu.preparation import Preparation
from ..projection.gbuffer import MeshInstance
from ..projection.visible_vertices import is_cut_away
from ..worker.job import Call
from .pixel_frames import pixel_frames

#: Number of sides of the polygon that approximates a disc.
DISC_SEGMENTS = 20

#: Largest distance at which a surface does not hide a point, as a fraction of the distance that a view shows.
NEAR_SURFACE = 1e-3

#: Height of labels, in diameters of a dot of index 1 / N.
LABEL_SIZE = 4 / 3

#: Seconds for each triangle of a mesh that finding its singularities takes.
SINGULARITY_SECONDS = 1.2e-6


@dataclass(frozen=True, eq=False)
class SingularityDots:
    """The singularities of an object.

    Attributes
    ----------
    points : (K, 3) ndarray
        World space.
    index : (K,) int ndarray
        In units of 1 / N.
    degree : int
        N.
    """

    points: np.ndarray
    index: np.ndarray
    degree: int


def look_up_singularities(
    instance: MeshInstance, cache: Cache
) -> tuple[np.ndarray, np.ndarray] | Preparation:
    """Look up the singularities of an instance with a field; see `field.find_singularities`.

    They are the same for all deformations of a mesh.
    """
    surface, field = instance.surface, instance.field
    key = "singularities", surface.rest_shape_key, field
    found = cache.get(key)
    if found is not None:
        return found
    arguments = surface.in_rest_shape(), field
    call = Call(find_singularities, arguments, label="finding singularities")
    return Preparation(call, SINGULARITY_SECONDS * len(surface.triangles), partial(cache.put, key))


def singularity_dots(
    instance: MeshInstance, cache: Cache, clip_planes: np.ndarray | None
) -> SingularityDots | None:
    """Return the singularities of an instance with a field, without those that are cut away.

    Parameters
    ----------
    instance : MeshInstance
    cache : Cache
        Stores the singularities of fields.
    clip_planes : (6, 4) float64 ndarray or None
        See `rendering.view_input.ViewInput`.

    Returns
    -------
    SingularityDots or None
        None if they are not found yet.
    """
    found = look_up_singularities(instance, cache)
    if isinstance(found, Preparation):
        return None
    vertex, index = found
    points = instance.world_points()[vertex]
    kept = ~is_cut_away(points, clip_planes)
    return SingularityDots(points[kept], index[kept], instance.field.degree)


def draw_dots(
    context: bpy.types.Context,
    objects: Sequence[SingularityDots],
    size: float,
    *,
    shows_hidden: bool = False,
) -> None:
    """Draw dots in a view, behind what is in front of them.

    Parameters
    ----------
    context : bpy.types.Context
    objects : sequence of SingularityDots
    size : float
        Diameter of the dot of an index of 1 / N, pixels.
    shows_hidden : bool
        Whether hidden dots are drawn as well, fainter.
    """
    if shows_hidden:
        gpu.state.blend_set("ALPHA")
        _draw_all(context, objects, size, HIDDEN_OPACITY)
        gpu.state.blend_set("NONE")
    gpu.state.depth_test_set("LESS_EQUAL")
    _draw_all(context, objects, size, 1.0)
    gpu.state.depth_test_set("NONE")


def _draw_all(
    context: bpy.types.Context, objects: Sequence[SingularityDots], size: float, opacity: float
) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    outline = from_hex(OUTLINE_COLOR)
    for dots in objects:
        radii = dot_diameters(dots.index, size) / 2
        for sign, code in COLOR_BY_SIGN.items():
            chosen = np.sign(dots.index) == sign
            if not chosen.any():  # Blender makes no batch without vertices
                continue
            points, radius = dots.points[chosen], radii[chosen]
            # The outline first, slightly behind the dot.
            for part_radius, depth_offset, color in (
                (radius + OUTLINE * size, 2 * radius, outline),
                (radius, 3 * radius, from_hex(code)),
            ):
                vertices = _disc_triangles(context, points, part_radius, depth_offset)
                shader.uniform_float("color", (*color.tolist(), opacity))
                batch_for_shader(shader, "TRIS", {"pos": vertices}).draw(shader)


def _disc_triangles(
    context: bpy.types.Context, points: np.ndarray, radius: np.ndarray, depth_offset: np.ndarray
) -> np.ndarray:
    """Return the (n, 3) corners of the triangles of a disc at each of K points, facing the camera.

    (K,) radii are in pixels, and so are (K,) offsets toward the camera.
    """
    frames = pixel_frames(context, points)
    angles = np.linspace(0, 2 * np.pi, DISC_SEGMENTS + 1)
    x, y = (
        np.stack([np.zeros(DISC_SEGMENTS), values[:-1], values[1:]], axis=1).reshape(-1, 1)
        for values in (np.cos(angles), np.sin(angles))
    )
    center = points + depth_offset[:, None] * frames.nearer
    circle = x * frames.right[:, None] + y * frames.up[:, None]
    vertices = center[:, None] + radius[:, None, None] * circle
    return vertices.reshape(-1, 3).astype(np.float32)


def draw_labels(
    context: bpy.types.Context, objects: Sequence[SingularityDots], size: float
) -> None:
    """Write the indices beside the dots that nothing hides, where there is room.

    Parameters
    ----------
    context : bpy.types.Context
    objects : sequence of SingularityDots
        Those with more than `MAX_LABELS` dots have no labels.
    size : float
        Diameter of the dot of an index of 1 / N, pixels.
    """
    font_id = 0
    blf.size(font_id, LABEL_SIZE * size)
    blf.color(font_id, 1.0, 1.0, 1.0, 1.0)
    blf.enable(font_id, blf.SHADOW)
    blf.shadow(font_id, 5, 0.0, 0.0, 0.0, 1.0)
    places, indices, degrees = [], [], []
    for dots in objects:
        if len(dots.index) > MAX_LABELS:
            continue
        for point, index in zip(dots.points, dots.index.tolist(), strict=True):
            place = location_3d_to_region_2d(context.region, context.region_data, Vector(point))
            if place is not None and not is_occluded(context, point):
                places.append(place)
                indices.append(index)
                degrees.append(dots.degree)
    for text, left, bottom in place_indices(
        np.array(places),
        np.array(indices),
        np.array(degrees),
        size,
        partial(blf.dimensions, font_id),
        (context.region.width, context.region.height),
    ):
        blf.position(font_id, left, bottom, 0)
        blf.draw(font_id, text)
    blf.disable(font_id, blf.SHADOW)


def is_occluded(context: bpy.types.Context, point: np.ndarray) -> bool:
    """Return whether something is between a point in world space and the camera.

    What is closer to the point than a small part of the view does not count, so that the point may be on
    a surface.
    """
    point = Vector(point)
    view_to_world = context.region_data.view_matrix.inverted()
    view_direction = (
        view_to_world.translation - point
        if context.region_data.is_perspective
        else view_to_world.col[2].xyz
    )
    view_direction.normalize()
    start = point + NEAR_SURFACE * context.region_data.view_distance * view_direction
    return context.scene.ray_cast(context.view_layer.depsgraph, start, view_direction)[0]

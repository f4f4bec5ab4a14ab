"""Measure how long each stage of a frame takes, relative to the whole frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from harness.planar import lic

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.lic import look_noise
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.pixel_field import surface_pixel_field
from rosy_addon.compositor.shading import diffuse
from rosy_addon.core.cache import Cache
from rosy_addon.projection.corner_field import field_at_corners
from rosy_addon.projection.pixel_neighbors import neighbor_masks, screen_jacobians
from rosy_addon.projection.project import project
from rosy_addon.projection.rasterizer import rasterize

from . import cases
from .timing import Bench, main

DEGREE = 4


def measure(bench: Bench) -> None:
    """Time all stages for a small and a large mesh."""
    for triangles in (12_000, 200_000):
        for stage, work in _stages(triangles).items():
            name = f"{stage} / frame, {triangles // 1000}K triangles, N = {DEGREE}"
            bench.compare(name, work, lambda t=triangles: cases.frame(t, DEGREE))


def _stages(triangles: int) -> dict[str, Callable[[], object]]:
    """Return functions that run one stage of a frame each, on results of the earlier stages, by label."""
    look, camera, instance = cases.LOOK, cases.camera(), cases.instance(triangles, DEGREE)
    cache = Cache()
    gbuffer = project([instance], camera, look.display, cache)
    field = surface_pixel_field(gbuffer, DEGREE, look.crease_angle)
    noise = look_noise(field, pixel_look(look))
    points = np.column_stack([instance.surface.vertices, np.ones(len(instance.surface.vertices))])
    clip = points @ (camera.projection @ camera.view).T
    triangle = instance.surface.triangle_vertex
    return {
        "average the field at the corners, once per mesh": lambda: field_at_corners(
            instance.surface, instance.matrix, instance.field, look.display
        ),
        "project": lambda: project([instance], camera, look.display, cache),
        "  of which rasterize": lambda: rasterize(clip, triangle, camera.width, camera.height),
        "compose": lambda: compose(gbuffer, look),
        "  of which neighbor links": lambda: neighbor_masks(gbuffer, look.crease_angle),
        "  of which directions on screen": lambda: screen_jacobians(gbuffer),
        "  of which noise": lambda: look_noise(field, pixel_look(look)),
        "  of which streamlines": lambda: lic(field, look, noise),
        "  of which shading": lambda: diffuse(gbuffer, look, ()),
    }


if __name__ == "__main__":
    main(__doc__, measure)

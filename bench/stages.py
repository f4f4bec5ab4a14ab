"""Where the time of a frame goes: each stage over the whole."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from rosy_addon.compositor.compose import METHODS, compose, look_noise
from rosy_addon.compositor.flow import surface_flow
from rosy_addon.compositor.shading import diffuse
from rosy_addon.progress import drain
from rosy_addon.projection.carried import carrying
from rosy_addon.projection.project import project
from rosy_addon.projection.raster import rasterise
from rosy_addon.projection.steps import links, screen_axes

from . import cases
from .timing import Case, compare, main

DEGREE = 4


def measure(runs: int) -> Iterator[Case]:
    """All stages, for few and for many triangles."""
    for triangles in (12_000, 200_000):
        for name, work in _stages(triangles).items():
            yield compare(
                f"{name} / frame, {triangles // 1000}K triangles, N = {DEGREE}",
                work,
                lambda t=triangles: cases.frame(t, DEGREE),
                higher_is_better=False,
                runs=runs,
            )


def _stages(triangles: int) -> dict[str, Callable[[], object]]:
    """What a frame does, each alone, on what the stages before have left."""
    look, camera, body = cases.LOOK, cases.camera(), cases.body(triangles, DEGREE)
    gbuffer = project([body], camera, look.display)
    flow = surface_flow(gbuffer, DEGREE, look.crease_angle, look.cross_creases)
    grain = look_noise(flow, look)
    points = np.column_stack([body.surface.vertices, np.ones(len(body.surface.vertices))])
    clip = points @ (camera.projection @ camera.view).T
    triangle = body.surface.triangle_vertex
    return {
        "carry the field to the corners, once a mesh": lambda: drain(
            carrying(body.surface, body.matrix, body.field, look.display)
        ),
        "project": lambda: project([body], camera, look.display),
        "  of which rasterise": lambda: rasterise(clip, triangle, camera.width, camera.height),
        "compose": lambda: compose(replace(gbuffer, made={}), look),
        "  of which links": lambda: links(gbuffer, look.crease_angle, look.cross_creases),
        "  of which axes on screen": lambda: screen_axes(gbuffer),
        "  of which noise": lambda: look_noise(flow, look),
        "  of which streamlines": lambda: drain(METHODS[look.method](flow, look, grain)),
        "  of which shading": lambda: diffuse(gbuffer, look, ()),
    }


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))

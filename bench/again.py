"""Time of a bake in Blender after a change of one setting of the look, relative to a first bake."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rosy_addon.compositor.look import Look
from rosy_addon.projection.camera import Camera

from . import cases
from .timing import Case, compare, main

#: Settings that a user changes, with the two values between which each alternates.
CHANGES: dict[str, tuple[object, ...]] = {
    "gain": (3.0, 3.5),
    "shading": (0.5, 0.6),
    "color_map": ("magma", "gray"),
    "seed": (1, 2),
    "line_width": (2.0, 2.5),
    "density": (0.2, 0.3),
    "hue": ("noise", "one"),
    "length": (30, 50),
    "guiding_angle": (0.2, 0.4),
    "crease_angle": (0.8, 0.9),
}


def measure(runs: int) -> Iterator[Case]:
    """Time bakes of the ball as a mesh of Blender."""
    try:
        import bpy
    except ImportError:
        print("changes of a look: left out, there is no bpy here", file=sys.stderr)
        return
    from rosy_addon.core.cache import BAKE_CACHE
    from rosy_addon.jobs.bake import bake

    for triangles in (12_000, 200_000):
        scene = ball_scene(bpy, triangles)
        view = cases.camera()

        def bake_look(look: Look, scene: object = scene, view: Camera = view) -> None:
            bake(scene, look=look, cameras=[view])

        def bake_first(bake_look=bake_look) -> None:
            BAKE_CACHE.clear()
            bake_look(cases.LOOK)

        for setting, values in CHANGES.items():
            alternating = itertools.cycle(values)

            def bake_changed(setting=setting, alternating=alternating, bake_look=bake_look) -> None:
                bake_look(replace(cases.LOOK, **{setting: next(alternating)}))

            yield compare(
                f"bake after a change of {setting} / first bake, {triangles // 1000}K",
                bake_changed,
                bake_first,
                target=0.5,
                higher_is_better=False,
                runs=runs,
            )


def ball_scene(bpy, triangles: int) -> object:
    """Return a scene that contains only the ball, with a field of degree 4."""
    from rosy_addon.scene.write_field import write_mesh_field
    from rosy_addon.ui.properties import ensure_registered

    bpy.ops.wm.read_factory_settings(use_empty=True)
    ensure_registered()
    surface = cases.ball(triangles)
    mesh = bpy.data.meshes.new("Ball")
    corners = surface.corner_vertex[surface.triangles]
    mesh.from_pydata(surface.vertices.tolist(), [], corners.tolist())
    mesh.shade_smooth()
    write_mesh_field(mesh, cases.instance(triangles, 4).field)
    obj = bpy.data.objects.new("Ball", mesh)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    assert np.allclose(obj.matrix_world, np.eye(4))
    return bpy.context.scene


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))

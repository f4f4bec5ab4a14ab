"""Measure how long a bake in Blender takes after a change of one setting, relative to a first bake."""

import itertools
from dataclasses import replace

from . import cases
from .timing import Bench, main, peer

#: Settings that are changed, each with the two values between which it alternates.
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


def measure(bench: Bench) -> None:
    """Time first and later bakes of the ball (`cases.ball`) in Blender."""
    peer("bpy")
    from rosy_addon.core.cache import BAKE_CACHE
    from rosy_addon.jobs.bake import bake

    view = cases.camera()
    for triangles in (12_000, 200_000):
        scene = cases.ball_scene(triangles)

        def bake_first(scene: object = scene) -> None:
            BAKE_CACHE.clear()
            bake(scene, look=cases.LOOK, cameras=[view])

        for setting, values in CHANGES.items():
            looks = itertools.cycle([replace(cases.LOOK, **{setting: value}) for value in values])
            bench.compare(
                f"bake after a change of {setting} / first bake, {triangles // 1000}K",
                lambda scene=scene, looks=looks: bake(scene, look=next(looks), cameras=[view]),
                bake_first,
                at_most=0.5,
            )


if __name__ == "__main__":
    main(__doc__, measure)

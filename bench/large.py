"""Measure pictures at the sizes that users draw: presets, sizes, and several processes."""

from dataclasses import replace
from functools import lru_cache

from rosy_addon.compositor.look import is_hatched
from rosy_addon.core.cache import Cache
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

from . import cases
from .timing import Bench, main

DEGREE, TRIANGLES = 4, 12_000

#: Cache of results that do not depend on the camera.
CACHE = Cache()


@lru_cache
def view(preset: str, width: int, height: int, samples: int) -> ViewInput:
    """Return the input for a picture of the ball with a preset.

    `samples` of 0 is the preset's supersampling.
    """
    look = load_preset(preset).look
    look = replace(look, supersampling=samples or look.supersampling)
    return ViewInput((cases.instance(TRIANGLES, DEGREE),), cases.camera(width, height), look)


def draw(preset: str, width: int, height: int, *, workers: int = 1, samples: int = 0) -> None:
    """Draw the ball with only the work that is necessary after the camera has moved; see `view`."""
    picture_view = view(preset, width, height, samples)
    draw_picture(picture_view, CACHE, keep_gbuffers=False, workers=workers)


def measure(bench: Bench) -> None:
    """Time all cases."""
    for preset in preset_keys():
        if is_hatched(load_preset(preset).look):
            bench.compare(
                f"{preset} / default, 1920 x 1080 pixels, 2 x 2 samples",
                lambda name=preset: draw(name, 1920, 1080, samples=2),
                lambda: draw("default", 1920, 1080, samples=2),
                at_most=1.4,
            )
    for side, target in ((2048, 16.5), (4096, 66.0)):
        bench.compare(
            f"{side} x {side} / 512 x 512 pixels, one process",
            lambda side=side: draw("default", side, side),
            lambda: draw("default", 512, 512),
            at_most=target,
        )
    for size in ((1920, 1080), (3840, 2160)):
        for preset in ("default", "cross-hatch"):
            bench.compare(
                f"one process / two, {preset}, {size[0]} x {size[1]} pixels",
                lambda name=preset, size=size: draw(name, *size),
                lambda name=preset, size=size: draw(name, *size, workers=2),
                at_least=1.75,
            )


if __name__ == "__main__":
    main(__doc__, measure)

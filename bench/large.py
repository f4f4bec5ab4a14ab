"""Pictures at the sizes people use: presets, and worker processes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

from rosy_addon.compositor.look import is_hatched
from rosy_addon.core.cache import Cache
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

from . import cases
from .timing import Case, compare, main

DEGREE, TRIANGLES = 4, 12_000

#: Sizes of the pictures that workers draw.
SIZES = (1920, 1080), (3840, 2160)

#: Sides of square pictures that are compared with 512 pixels, and the largest ratios of the times.
SQUARES = {2048: 16.5, 4096: 66.0}

#: Presets that workers draw.
WORKER_PRESETS = ("default", "cross-hatch")

#: Keeps what does not depend on the camera.
CACHE = Cache()


@lru_cache
def view(preset: str, width: int, height: int, samples: int = 0) -> ViewInput:
    """Return the view of the ball, which covers 98 % of the picture.

    `samples` replaces the supersampling of the preset, if it is not 0.
    """
    ball = cases.instance(TRIANGLES, DEGREE)
    look = load_preset(preset).look
    look = replace(look, supersampling=samples or look.supersampling)
    return ViewInput((ball,), cases.camera(width, height), look)


def draw(preset: str, width: int, height: int, *, workers: int = 1, samples: int = 0) -> None:
    """Draw a picture after the camera has moved."""
    picture_view = view(preset, width, height, samples)
    draw_picture(picture_view, CACHE, keep_gbuffers=False, workers=workers)


def measure(runs: int) -> Iterator[Case]:
    """Time all cases."""
    for preset in preset_keys():
        if is_hatched(load_preset(preset).look):
            yield compare(
                f"{preset} / default, 1920 x 1080 pixels, 2 x 2 samples",
                lambda name=preset: draw(name, 1920, 1080, samples=2),
                lambda: draw("default", 1920, 1080, samples=2),
                target=1.4,
                higher_is_better=False,
                runs=runs,
            )
    for side, target in SQUARES.items():
        yield compare(
            f"{side} x {side} / 512 x 512 pixels, one process",
            lambda side=side: draw("default", side, side),
            lambda: draw("default", 512, 512),
            target=target,
            higher_is_better=False,
            runs=runs,
        )
    for width, height in SIZES:
        for preset in WORKER_PRESETS:
            yield compare(
                f"one process / two, {preset}, {width} x {height} pixels",
                lambda name=preset, size=(width, height): draw(name, *size),
                lambda name=preset, size=(width, height): draw(name, *size, workers=2),
                target=1.75,
                runs=runs,
            )


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))

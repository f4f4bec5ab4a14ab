"""Measure how long the method "ibfv" (image based flow visualization) takes, relative to the method "sheets".

Both are timed for a single picture, and for a frame of an animation in which mesh and camera stay and the
streaks drift.
"""

import itertools
from collections.abc import Callable
from dataclasses import replace

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.flow import drift_at
from rosy_addon.core.cache import Cache
from rosy_addon.projection.gbuffer import GBuffer
from rosy_addon.projection.project import project

from . import cases
from .timing import Bench, main

TRIANGLES, DEGREES = 12_000, (1, 4, 6)


def measure(bench: Bench) -> None:
    """Time pictures and frames."""
    for degree in DEGREES:
        gbuffer = project([cases.instance(TRIANGLES, degree)], cases.camera())
        picture, still = _picture(gbuffer, "ibfv"), _picture(gbuffer, "sheets")
        frame, drifting = _next_frame(gbuffer, "ibfv"), _next_frame(gbuffer, "sheets")
        bench.compare(f"ibfv / sheets, picture, N = {degree}", picture, still)
        bench.compare(f"ibfv / sheets, frame whose streaks drift, N = {degree}", frame, drifting)
        name = f"frame of ibfv whose streaks drift / picture of sheets, N = {degree}"
        bench.compare(name, frame, still)


def _picture(gbuffer: GBuffer, method: str) -> Callable[[], object]:
    """Return a function that composes a picture from a G-buffer, without a cache."""
    return lambda: compose(gbuffer, replace(cases.LOOK, method=method))


def _next_frame(gbuffer: GBuffer, method: str) -> Callable[[], object]:
    """Return a function that composes the next frame of an animation, with streaks a pixel further."""
    look, cache, numbers = replace(cases.LOOK, method=method, flow=1.0), Cache(), itertools.count()

    def draw() -> None:
        compose(gbuffer, look, cache=cache, drift=drift_at(look, next(numbers)))
        cache.evict_unused()

    return draw


if __name__ == "__main__":
    main(__doc__, measure)

"""Films of the documentation: the turntable of docs/animation.md, and the loops of docs/motion.md."""

from __future__ import annotations

from functools import partial

import numpy as np

from rosy_addon.compositor.look import Look
from rosy_addon.core.cache import Cache
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.turntable import draw_next, turntable, turntable_views

from .page import IMAGES
from .shapes import sphere, suzanne

#: Side in pixels, azimuth and elevation in degrees, and number of pictures.
SIDE, ANGLES, COUNT = 240, (-26.0, 10.0), 24

TURNTABLE = Look(length=40, gain=2.8, supersampling=2)

#: Sparse streaks, with a bright head and a faint tail.
ORIENTED = Look(
    supersampling=2,
    flow=1.5,
    oriented=True,
    density=0.03,
    grain=2.5,
    length=36,
    high_pass=0.0,
    gain=1.8,
)

#: Lines of four directions, which drift toward the right of the picture.
CROSSING = Look(supersampling=2, flow=1.5, length=36, grain=2.0)


def write() -> None:
    """Draw and save the films."""
    ball, head = sphere(), suzanne()
    four = generate(head, "smoothest", 4)
    wind = generate(ball, GeneratorSettings("axis", axis=(0.3, 0.2, 1.0)), 1)
    for name, surface, field, look, rate in (
        ("turntable", head, four, TURNTABLE, 10),
        ("motion-vector", ball, wind, ORIENTED, 20),
        ("motion-four", head, four, CROSSING, 20),
    ):
        is_still = look.flow != 0
        instance = MeshInstance(surface, np.eye(4), field)
        views = turntable_views(instance, look, COUNT, (SIDE, SIDE), ANGLES, still=is_still)
        draw = partial(draw_next, cache=Cache()) if is_still else draw_picture
        turntable(draw, views, COUNT, IMAGES / f"{name}.gif", rate)

"""The loops of docs/motion.md: streaks that drift along a vector field, and along four directions."""

from __future__ import annotations

from functools import partial

import numpy as np

from rosy_addon.compositor.look import Look
from rosy_addon.core.cache import Cache
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.rendering.turntable import draw_next, turntable, turntable_views

from .page import ROOT
from .shapes import sphere, suzanne

IMAGES = ROOT / "docs" / "images"

SIDE, ANGLES, COUNT, RATE = 240, (-26.0, 10.0), 24, 20.0

#: Sparse streaks, with a bright head and a faint tail.
ORIENTED = Look(
    supersampling=2,
    flow=1.5,
    fade="tail",
    density=0.03,
    line_width=2.5,
    length=36,
    high_pass=0.0,
    gain=1.8,
)

#: Lines of four directions, which drift toward the right of the picture.
CROSSING = Look(supersampling=2, flow=1.5, length=36, line_width=2.0)


def write() -> None:
    """Draw and save the loops."""
    ball, head = sphere(), suzanne()
    wind = generate(ball, GeneratorSettings("axis", axis=(0.3, 0.2, 1.0)), 1)
    _write_loop(ball, wind, ORIENTED, "motion-vector.gif")
    _write_loop(head, generate(head, "smoothest", 4), CROSSING, "motion-four.gif")


def _write_loop(surface: Surface, field: RosyField, look: Look, name: str) -> None:
    """Write a loop before a still camera."""
    instance = MeshInstance(surface, np.eye(4), field)
    views = turntable_views(instance, look, COUNT, (SIDE, SIDE), ANGLES, still=True)
    draw = partial(draw_next, cache=Cache())
    turntable(draw, views, COUNT, IMAGES / name, RATE)

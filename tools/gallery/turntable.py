"""The turntable of docs/animation.md."""

from __future__ import annotations

import numpy as np

from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.turntable import turntable, turntable_views

from .page import ROOT
from .shapes import suzanne

LOOK = Look(length=40, gain=2.8, supersampling=2)


def write() -> None:
    """Draw the turntable of Suzanne."""
    monkey = suzanne()
    instance = MeshInstance(monkey, np.eye(4), generate(monkey, "smoothest", 4))
    views = turntable_views(instance, LOOK, 24, (240, 240), (-26.0, 10.0))
    path = ROOT / "docs" / "images" / "turntable.gif"
    turntable(draw_picture, views, 24, path, 10)

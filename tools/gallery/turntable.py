"""The film of docs/animation.md."""

from __future__ import annotations

import numpy as np

from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate
from rosy_addon.projection.gbuffer import Body
from rosy_addon.turntable import pictures, write_film

from .page import ROOT
from .shapes import suzanne

LOOK = Look(length=40, gain=2.8, supersampling=2)


def write() -> None:
    """Suzanne from all around."""
    monkey = suzanne()
    body = Body(monkey, np.eye(4), generate(monkey, "smoothest", 4))
    frames = pictures(body, LOOK, 24, (240, 240), (-26.0, 10.0))
    write_film(ROOT / "docs" / "images" / "turntable.gif", frames, 10)

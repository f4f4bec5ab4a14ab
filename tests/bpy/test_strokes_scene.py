"""Strokes in a scene: what they are made into, where they are, and that nothing else changes."""

from __future__ import annotations

import bpy
import numpy as np
from rosy.rosy_addon.sketch import sketch


def test_pencil(monkey, camera):
    made = sketch(bpy.context.scene)
    assert made.thing.type in ("GPENCIL", "GREASEPENCIL")
    print(len(made.drawn.strokes), np.diff(made.drawn.strokes.start).mean())

"""Pictures are drawn in steps that do not grow with the picture."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from shapes import plane

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light
from rosy_addon.field.generate import axis_field
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import look_at, orthographic_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.pixel_blocks import BLOCK_PIXELS
from rosy_addon.rendering.view_input import ViewInput

#: Labels of the steps of all pictures, and of those of hatching.
ALWAYS = {
    "finding visible pixels",
    "rotating the field into the view plane",
    "finding tones",
    "finding neighbors",
    "finding directions",
    "making noise",
    "tracing streamlines",
    "blending lines",
    "drawing the ink",
}
HATCHED = {"bending lines", "drawing outlines", "drawing the paper grain"}

INK = load_preset("pen-and-ink").look
SUN = Light("sun", np.array([0.3, 0.5, 0.8]), np.ones(3), 1.0)


def steps_by_label(look: Look, side: int) -> Counter[str]:
    """Return the number of steps with each label, of a picture that a plane fills."""
    surface = plane()
    instance = MeshInstance(surface, np.eye(4), axis_field(surface, 4, (1, 0.3, 0)))
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), side, side, scale=1.9)
    view = ViewInput((instance,), camera, look, (SUN,))
    return Counter(progress.label for progress in CpuRenderer().render_task(view))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("look", "more"),
    [
        (Look(), set()),
        (load_preset("paper").look, set()),
        (
            replace(INK, anchor="surface", paper_grain=0.5, light="scene", shadows=True),
            HATCHED | {"casting shadows", "finding points on the surface"},
        ),
        (replace(INK, anchor="picture", paper_grain=0.5), HATCHED),
        (replace(Look(), method="brute", magnitude="length", high_pass=20.0), set()),
        (replace(Look(), method="ibfv", flow=1.0, magnitude="length"), set()),
    ],
    ids=["default", "paper", "on the surface", "on the picture", "brute", "ibfv"],
)
def test_a_step_is_at_most_two_blocks_of_pixels(look, more):
    """So the longest step does not grow with the picture."""
    steps = steps_by_label(replace(look, supersampling=1), side=384)
    least = 384**2 / (2 * BLOCK_PIXELS)
    assert not {label: steps[label] for label in ALWAYS | more if steps[label] < least}

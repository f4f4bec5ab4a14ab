"""The logo and the favicon of the site: streaks around a singularity of a 4-RoSy field, in a disc."""

from __future__ import annotations

import numpy as np
from PIL import Image

from rosy_addon.compositor.look import Look
from rosy_addon.core.color import from_hex, to_display

from .page import ROOT
from .plane import compose_field, points, singularity

#: Side of the picture that is drawn, and of the files, in pixels.
DRAWN, LOGO, FAVICON = 512, 128, 48

#: A singularity of index -1/4. Broad streaks stay legible at the size of a favicon.
DEGREE, INDEX = 4, -1
LOOK = Look(length=400, line_width=26.0, density=0.15, high_pass=70.0, gain=3.0, seed=2)

#: Tones, from 0 to 1, at which the ground ends and the streaks have their full color.
RANGE = (0.50, 0.80)
GROUND, STREAKS = from_hex("#1f2a52"), from_hex("#ffffff")


def write() -> None:
    """Draw docs/images/logo.png and docs/images/favicon.png."""
    # With the field turned like this, one of the five straight lines points down.
    rgba = compose_field(lambda p: singularity(INDEX)(1j * p), DEGREE, DRAWN, LOOK).rgba
    low, high = RANGE
    tone = np.clip((to_display(rgba[::-1, :, :1]) - low) / (high - low), 0, 1)
    color = np.asarray(GROUND) * (1 - tone) + np.asarray(STREAKS) * tone
    disc = np.clip(DRAWN / 2 - np.abs(points(DRAWN)), 0, 1)[..., None]
    drawn = Image.fromarray(np.rint(np.concatenate([color, disc], axis=-1) * 255).astype(np.uint8))
    for name, size in (("logo", LOGO), ("favicon", FAVICON)):
        drawn.resize((size, size), Image.Resampling.BOX).save(
            ROOT / "docs" / "images" / f"{name}.png", optimize=True
        )

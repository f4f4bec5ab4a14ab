"""Draw the logo and the favicon of the site: a disc of streaks around a singularity of a 4-RoSy field."""

import numpy as np
from PIL import Image

from rosy_addon.compositor.look import Look
from rosy_addon.core.color import from_hex, to_display

from .page import IMAGES
from .plane import compose_field, points, singularity

#: Sides in pixels of the picture that is drawn, of the logo, and of the favicon.
DRAWN, LOGO, FAVICON = 512, 128, 48

#: Degree of the field, and index of its singularity in units of 1/4. The streaks are broad, to be legible in
#: a favicon.
DEGREE, INDEX = 4, -1
LOOK = Look(length=400, line_width=26.0, density=0.15, high_pass=70.0, gain=3.0, seed=2)

#: Tones from 0 to 1 between which colors are blended: from the color of the ground to that of the streaks.
RANGE = (0.50, 0.80)
GROUND, STREAKS = from_hex("#1f2a52"), from_hex("#ffffff")


def write() -> None:
    """Draw docs/images/logo.png and docs/images/favicon.png."""
    # The field is rotated so that one of the five straight streamlines of the singularity points down.
    rgba = compose_field(lambda p: singularity(INDEX)(1j * p), DEGREE, DRAWN, LOOK).rgba
    low, high = RANGE
    tone = np.clip((to_display(rgba[::-1, :, :1]) - low) / (high - low), 0, 1)
    color = np.asarray(GROUND) * (1 - tone) + np.asarray(STREAKS) * tone
    disc = np.clip(DRAWN / 2 - np.abs(points(DRAWN)), 0, 1)[..., None]
    drawn = Image.fromarray(np.rint(np.concatenate([color, disc], axis=-1) * 255).astype(np.uint8))
    for name, size in (("logo", LOGO), ("favicon", FAVICON)):
        drawn.resize((size, size), Image.Resampling.BOX).save(IMAGES / f"{name}.png", optimize=True)

"""Draw the picture at the top of the README."""

import numpy as np
from PIL import Image

from .looks import PLAID, SOLID
from .page import IMAGES
from .shapes import suzanne, torus, triple_torus
from .sheet import display, save
from .solid import around_field, compose_view, even_curvature, ring_curvature, view

WIDTH, HEIGHT = 1200, 600


def write() -> None:
    """Draw and save the picture."""
    monkey, rings, ring = suzanne(), triple_torus(), torus()
    streaks = SOLID.with_settings({"gain": 2.8})
    shots = (
        (rings, ring_curvature(rings), PLAID, (14, 50), (0, 190, 424, 396)),
        (monkey, even_curvature(monkey, 4), streaks, (-24, 8), (338, 4, 604, 540)),
        (ring, around_field(ring, 6), streaks, (24, 44), (806, 268, 394, 332)),
    )
    canvas = Image.new("RGB", (WIDTH, HEIGHT), (255, 255, 255))
    for surface, field, look, angles, (left, top, width, height) in shots:
        camera = view(surface, angles, (width, height), look.supersampling)
        rgba = compose_view(surface, field, look, camera).rgba
        alpha = Image.fromarray(np.rint(rgba[::-1, :, 3] * 255).astype(np.uint8))
        opaque = np.concatenate([rgba[..., :3], np.ones_like(rgba[..., 3:])], axis=-1)
        canvas.paste(Image.fromarray(display(opaque)), (left, top), alpha)
    save(canvas, IMAGES / "hero.png")

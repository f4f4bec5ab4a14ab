"""The picture at the top of the README."""

from __future__ import annotations

import numpy as np
from PIL import Image

from rosy_addon.field.curvature import curvature_field

from .figure_11 import PLAID, smoothed_a_little
from .looks import SOLID
from .page import ROOT
from .shapes import suzanne, torus, triple_torus
from .sheet import display, save
from .solid import around_field, compose_view, smoothed, view

WIDTH, HEIGHT = 1200, 600


def write() -> None:
    """Draw and save the picture."""
    monkey, rings, ring = suzanne(), triple_torus(), torus()
    looks = {"gray": SOLID.with_settings({"gain": 2.8}), "plaid": PLAID}
    shots = (
        (
            rings,
            smoothed(rings, curvature_field(rings, 4), 200),
            "plaid",
            (14, 50),
            (0, 190, 424, 396),
        ),
        (
            monkey,
            smoothed_a_little(monkey, curvature_field(monkey, 4)),
            "gray",
            (-24, 8),
            (338, 4, 604, 540),
        ),
        (ring, around_field(ring, 6), "gray", (24, 44), (806, 268, 394, 332)),
    )
    canvas = Image.new("RGB", (WIDTH, HEIGHT), (255, 255, 255))
    for surface, field, name, angles, (left, top, width, height) in shots:
        look = looks[name]
        camera = view(surface, angles, (width, height), look.supersampling)
        rgba = compose_view(surface, field, look, camera).rgba
        alpha = Image.fromarray(np.rint(rgba[::-1, :, 3] * 255).astype(np.uint8))
        opaque = np.concatenate([rgba[..., :3], np.ones_like(rgba[..., 3:])], axis=-1)
        canvas.paste(Image.fromarray(display(opaque)), (left, top), alpha)
    path = ROOT / "docs" / "images" / "hero.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    save(canvas, path)

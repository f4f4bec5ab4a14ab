"""The pictures of docs/fields.md: what the generators make."""

from __future__ import annotations

import numpy as np

from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import Recipe, generate
from rosy_addon.field.surface import Surface, build_surface

from .page import ROOT
from .shapes import sphere, suzanne
from .sheet import Panel, display, save, sheet
from .solid import compose_view, view

IMAGES = ROOT / "docs" / "images"

LOOK = Look(length=50, gain=2.8, supersampling=2)
SIDE, WIDE = 256, 394


def write() -> None:
    """Draw and save all of them."""
    monkey, box = suzanne(), _box()
    smooth = [
        _panel(monkey, "smoothest", degree, (-26, 8), f"Smoothest, N = {degree}")
        for degree in (2, 4, 6)
    ]
    save(sheet([smooth]), IMAGES / "fields-smoothest.png")
    curved = [
        _panel(monkey, Recipe("curvature", reach=reach), 4, (-26, 8), text, WIDE)
        for reach, text in ((0.0, "Curvature of each face"), (0.05, "Curvature, reach 0.05"))
    ]
    save(sheet([curved]), IMAGES / "fields-curvature.png")
    along = [
        _panel(box, recipe, degree, (32, 28), text)
        for recipe, degree, text in (
            ("smoothest", 4, "Smoothest, N = 4"),
            ("features", 4, "Features, N = 4"),
            ("features", 2, "Features, N = 2"),
        )
    ]
    save(sheet([along]), IMAGES / "fields-features.png")


def _box() -> Surface:
    """A leaning box with as many faces as the sphere it is made from."""
    ball = sphere()
    points = ball.vertices / np.abs(ball.vertices).max(axis=1)[:, None]
    points[:, 0] += 0.6 * points[:, 2]
    return build_surface(points, ball.corner_vertex, ball.face_start, name="box", sharp_angle=0.7)


def _panel(
    surface: Surface,
    recipe: Recipe | str,
    degree: int,
    angles: tuple[float, float],
    text: str,
    side: int = SIDE,
) -> Panel:
    field = generate(surface, recipe, degree)
    camera = view(surface, angles, (side, side), LOOK.supersampling)
    return Panel(display(compose_view(surface, field, LOOK, camera).rgba), text)

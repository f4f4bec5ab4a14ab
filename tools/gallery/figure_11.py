"""Draw figure 11: fields on surfaces."""

from __future__ import annotations

import numpy as np

from rosy_addon.compositor.contrast import expected_std
from rosy_addon.compositor.look import Look
from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.surface import Surface
from rosy_addon.projection.camera import Camera

from .looks import PLAID, RED, SOLID
from .page import fill_tables, picture, signed
from .plane import enlarged
from .shapes import knot, sphere, suzanne, torus, triple_torus
from .sheet import Panel, display, dotted
from .solid import (
    around_field,
    compose_view,
    even_curvature,
    harmonic_field,
    icosahedron_axes,
    layer_in_view,
    ring_curvature,
    view,
    visible_points,
)

WIDTH = 402
MAGNITUDE = SOLID.with_settings({"hue": "magnitude", "gain": 2.0})

#: For each picture: surface, look, azimuth and elevation in degrees, height in pixels, and label.
SHOTS = (
    ("Suzanne", SOLID, (-28, 8), 380, "(a) Suzanne, 4-RoSy"),
    ("Suzanne", PLAID, (-28, 8), 380, "(b) the same, colored noise"),
    ("triple torus", SOLID, (14, 52), 330, "(c) triple torus, 4-RoSy"),
    ("triple torus", PLAID, (14, 52), 330, "(d) the same, colored noise"),
    ("knot", MAGNITUDE, (0, 74), 402, "(e) trefoil knot, 4-RoSy, magnitude as color"),
    ("sphere", SOLID, (20, 20), 402, "(f) sphere, 6-RoSy with twelve singularities"),
    ("torus", SOLID, (20, 42), 290, "(g) torus, 6-RoSy"),
    ("torus", PLAID, (20, 42), 290, "(h) the same, colored noise"),
)


def write() -> None:
    """Draw the pictures and measure the tables."""
    monkey, rings, ring, ball, trefoil = suzanne(), triple_torus(), torus(), sphere(64), knot()
    fields = {
        "Suzanne": (monkey, even_curvature(monkey, 4)),
        "triple torus": (rings, ring_curvature(rings)),
        "knot": (trefoil, curvature_field(trefoil, 4)),
        "sphere": (ball, harmonic_field(ball, 6, icosahedron_axes())),
        "torus": (ring, around_field(ring, 6)),
    }
    panels, rows = [], []
    for name, look, angles, height, label in SHOTS:
        camera = view(fields[name][0], angles, (WIDTH, height), look.supersampling)
        shown = display(compose_view(*fields[name], look, camera).rgba)
        if name == "sphere":
            shown = _marked(shown, *fields[name], camera, look.supersampling)
        panels.append(Panel(shown, label))
        rows.append([label, *_spread(layer_in_view(*fields[name], look, camera).tone, look)])
    for number, letter in enumerate("abcd"):
        picture(f"figure-11-{letter}", panels[2 * number : 2 * number + 2])
    census = [_census(name, surface, field) for name, (surface, field) in fields.items()]
    fill_tables("figure-11", census, rows)


def _marked(
    shown: np.ndarray, surface: Surface, field: RosyField, camera: Camera, supersampling: int
) -> np.ndarray:
    """Draw dots at the visible singularities on a picture of the unit sphere."""
    positions = surface.vertices[find_singularities(surface, field)[0]]
    for x, y in visible_points(positions, positions, camera, supersampling):
        shown = dotted(shown, x, y, RED)
    return shown


def _census(name: str, surface: Surface, field: RosyField) -> list[object]:
    """Return a table row: counts of singularities by index, sum of the indices, and sum by Poincaré-Hopf."""
    _, index = find_singularities(surface, field)
    kinds, counts = np.unique(index, return_counts=True)
    shown = [f"{count} of {signed(kind)}" for kind, count in zip(kinds, counts, strict=True)]
    expected = field.degree * surface.euler_characteristic
    listed = ", ".join(shown) or "none"
    return [name, surface.face_count, field.degree, listed, int(index.sum()), expected]


def _spread(tone: np.ndarray, look: Look) -> list[object]:
    theory = look.gain * expected_std(enlarged(look, look.supersampling))
    return [float(tone.mean()), float(tone.std()), theory]

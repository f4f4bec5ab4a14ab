"""Figure 11: fields on surfaces."""

from __future__ import annotations

import numpy as np

from rosy_addon.compositor.contrast import expected_std
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import euler_characteristic, find_singularities
from rosy_addon.field.surface import Surface
from rosy_addon.projection.camera import Camera

from .looks import RED, SOLID
from .page import Page, signed
from .shapes import knot, sphere, suzanne, torus, triple_torus
from .sheet import Panel, display, dotted
from .solid import (
    around_field,
    compose_view,
    harmonic_field,
    icosahedron_axes,
    layer_in_view,
    smoothed,
    view,
    visible_points,
)

WIDTH = 402
PLAID = SOLID.with_settings({"hue": "noise", "line_width": 3.0, "gain": 3.0, "length": 60})
MAGNITUDE = SOLID.with_settings({"hue": "magnitude", "gain": 2.0})


def write() -> None:
    """Draw and write the page."""
    page = Page("figure-11", "Surfaces")
    page.text(
        """This page shows fields on surfaces. (a) to (d) are 4-RoSy fields along the principal
        curvatures of Suzanne and of a triple torus, with gray noise and with colored noise, which
        gives a plaid. (e) is a trefoil knot with the confidence of its curvature as color. (f) is a
        6-RoSy field on a sphere with singularities at the twelve vertices of an icosahedron. (g)
        and (h) are a 6-RoSy field on a torus without singularities. The light comes from the eye.
        Blender and the script of this page generate all meshes."""
    )
    monkey, rings, ring, ball, trefoil = suzanne(), triple_torus(), torus(), sphere(64), knot()
    fields = {
        "Suzanne": (monkey, smoothed_a_little(monkey, curvature_field(monkey, 4))),
        "triple torus": (rings, smoothed(rings, curvature_field(rings, 4), 200)),
        "knot": (trefoil, curvature_field(trefoil, 4)),
        "sphere": (ball, harmonic_field(ball, 6, icosahedron_axes())),
        "torus": (ring, around_field(ring, 6)),
    }
    shots = (
        ("Suzanne", SOLID, (-28, 8), 380, "(a) Suzanne, 4-RoSy"),
        ("Suzanne", PLAID, (-28, 8), 380, "(b) the same, colored noise"),
        ("triple torus", SOLID, (14, 52), 330, "(c) triple torus, 4-RoSy"),
        ("triple torus", PLAID, (14, 52), 330, "(d) the same, colored noise"),
        ("knot", MAGNITUDE, (0, 74), 402, "(e) trefoil knot, 4-RoSy, magnitude as color"),
        ("sphere", SOLID, (20, 20), 402, "(f) sphere, 6-RoSy with twelve singularities"),
        ("torus", SOLID, (20, 42), 290, "(g) torus, 6-RoSy"),
        ("torus", PLAID, (20, 42), 290, "(h) the same, colored noise"),
    )
    panels, rows = [], []
    for name, look, angles, height, label in shots:
        camera = view(fields[name][0], angles, (WIDTH, height), look.supersampling)
        shown = display(compose_view(*fields[name], look, camera).rgba)
        if name == "sphere":
            shown = _marked(shown, *fields[name], camera, look.supersampling)
        panels.append(Panel(shown, label))
        rows.append([label, *_spread(layer_in_view(*fields[name], look, camera).tone, look)])
    captions = (
        "Suzanne with a 4-RoSy field",
        "A triple torus with a 4-RoSy field",
        "A knot and a sphere",
        "A torus with a 6-RoSy field",
    )
    for number, caption in enumerate(captions):
        page.picture([panels[2 * number : 2 * number + 2]], caption, "abcd"[number])
    page.text("## Measurements")
    page.text(
        """The first table lists the singularities with their indices in units of 1/N. By the
        Poincaré-Hopf theorem, the indices sum to N times the Euler characteristic."""
    )
    page.table(
        [
            "Surface",
            "Faces",
            "N",
            "Singularities",
            "Sum of indices",
            "N times Euler characteristic",
        ],
        [_census(name, surface, field) for name, (surface, field) in fields.items()],
    )
    page.text(
        """The second table lists the mean and the standard deviation of all visible pixels after
        correction. Theory is the standard deviation of a single member image with full-length
        streamlines, times the gain. The pictures are drawn at twice the size and measured before
        light and averaging."""
    )
    page.table(["Picture", "Mean", "Standard deviation", "Theory"], rows)
    page.write("Figure 11")


def smoothed_a_little(surface: Surface, field: RosyField) -> RosyField:
    """Return a slightly smoothed curvature field, without the noise of small faces."""
    return smoothed(surface, field, 6)


def _marked(
    shown: np.ndarray, surface: Surface, field: RosyField, camera: Camera, supersampling: int
) -> np.ndarray:
    """Return a picture of the unit sphere with dots at the singularities."""
    positions = surface.vertices[find_singularities(surface, field)[0]]
    for x, y in visible_points(positions, positions, camera, supersampling):
        shown = dotted(shown, x, y, RED)
    return shown


def _census(name: str, surface: Surface, field: RosyField) -> list[object]:
    _, index = find_singularities(surface, field)
    kinds, counts = np.unique(index, return_counts=True)
    shown = ", ".join(
        f"{count} of {signed(kind)}" for kind, count in zip(kinds, counts, strict=True)
    )
    expected = field.degree * euler_characteristic(surface)
    return [name, surface.face_count, field.degree, shown or "none", int(index.sum()), expected]


def _spread(tone: np.ndarray, look: Look) -> list[object]:
    theory = look.gain * expected_std(pixel_look(look).in_samples(look.supersampling))
    return [float(tone.mean()), float(tone.std()), theory]

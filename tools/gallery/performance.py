"""The pictures of docs/performance.md: sheets next to brute force and members, and samples of a pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import axis_field
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput
from tests.harness.planar import compose_planar

from .page import IMAGES
from .plane import points, singularity
from .shapes import sphere, torus
from .sheet import Panel, display, magnified, save, sheet
from .solid import around_field, compose_view, view

#: Look with one sample per pixel, which hides no artifacts.
LOOK = Look(length=40, gain=2.5)

#: Look with the noise and contrast of the paper, which show grain and breaking points best.
PLAIN = Look(length=40, gain=1.5, density=0.5, high_pass=0.0)

#: Sides of a picture, of a closeup, and of the pictures with several samples a pixel.
SIDE, CLOSE, SAMPLED_SIDE = 400, 128, 256


def write() -> None:
    """Draw and save the pictures."""
    save(sheet(_singularities()), IMAGES / "performance-singularities.png")
    ball, ring = sphere(), torus()
    left, right = points(SIDE) + SIDE / 6, points(SIDE) - SIDE / 6
    pair = left / np.abs(left) * (right / np.abs(right)).conj() * np.exp(0.6j)
    rows = [
        [
            Panel(
                display(compose_planar(np.angle(pair) / 4, 4, look).rgba),
                f"Singularities of index 1/4 and -1/4 in the plane, N = 4: {look.method}",
            )
            for look in _looks("brute", "sheets")
        ],
        _row(ball, axis_field(ball, 6, (0.3, 0.2, 1.0)), (20, 30), "A sphere, N = 6"),
        _row(ring, around_field(ring, 4), (24, 44), "A torus, N = 4"),
    ]
    save(sheet(rows), IMAGES / "performance-surfaces.png")
    for name, look in (("samples", LOOK), ("hatching", load_preset("cross-hatch").look)):
        save(sheet(_samples(look)), IMAGES / f"performance-{name}.png")


def _looks(*methods: str, look: Look = LOOK) -> list[Look]:
    return [look.with_settings({"method": method}) for method in methods]


def _row(surface, field, angles: tuple[float, float], about: str) -> list[Panel]:
    """Draw a field on a surface by brute force and by sheets."""
    camera = view(surface, angles, (SIDE, SIDE), 1)
    return [
        Panel(display(compose_view(surface, field, look, camera).rgba), f"{about}: {look.method}")
        for look in _looks("brute", "sheets")
    ]


def _singularities() -> list[list[Panel]]:
    """Draw closeups of singularities, where the methods differ, enlarged twice."""
    inner = slice((SIDE - CLOSE) // 2, (SIDE + CLOSE) // 2)
    rows = []
    for degree, index, name in ((3, 1, "1/3"), (4, 1, "1/4"), (4, -1, "-1/4"), (6, -1, "-1/6")):
        angles = np.angle(singularity(index)(points(SIDE))) / degree
        row = []
        for look in _looks("brute", "members", "sheets", look=PLAIN):
            shown = magnified(display(compose_planar(angles, degree, look).rgba)[inner, inner], 2)
            row.append(Panel(shown, f"{look.method}, N = {degree}, index {name}"))
        rows.append(row)
    return rows


def _samples(look: Look) -> list[list[Panel]]:
    """Draw a torus with one and four samples a pixel, at 100 % and at 400 %."""
    ring = torus()
    instance = MeshInstance(ring, np.eye(4), around_field(ring, 4))
    camera = orbit_camera(ring.vertices, 24, 44, SAMPLED_SIDE, SAMPLED_SIDE)
    one, four = (
        draw_picture(ViewInput((instance,), camera, replace(look, supersampling=samples)))
        for samples in (1, 2)
    )
    every = compose(project([instance], camera.scaled(4)), replace(look, supersampling=4))
    labels = ("one sample", "2 x 2 samples", "streaks at each of 4 x 4 samples")
    shown = [display(picture.rgba) for picture in (one, four, every)]
    part, top, left = SAMPLED_SIDE // 4, round(0.12 * SAMPLED_SIDE), round(0.6 * SAMPLED_SIDE)
    close = slice(top, top + part), slice(left, left + part)
    enlarged = np.ones((4, 4, 1), np.uint8)
    return [
        [Panel(picture, label) for picture, label in zip(shown, labels, strict=True)],
        [Panel(np.kron(picture[close], enlarged)) for picture in shown],
    ]

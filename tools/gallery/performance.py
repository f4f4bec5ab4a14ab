"""Draw pictures of docs/performance.md: closeups of singularities, and different numbers of samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput
from tests.harness.planar import compose_planar

from .page import IMAGES
from .plane import points, singularity
from .shapes import torus
from .sheet import Panel, display, magnified, save, sheet
from .solid import around_field

#: Look with the noise and contrast of the paper, which show grain and interrupted streaks best.
PLAIN = Look(length=40, gain=1.5, density=0.5, high_pass=0.0)

#: Looks with one sample per pixel, so that artifacts are visible.
SAMPLED = {"samples": Look(length=40, gain=2.5), "hatching": load_preset("cross-hatch").look}

#: Sides in pixels of a picture, of a closeup, and of the pictures that compare numbers of samples.
SIDE, CLOSE, SAMPLED_SIDE = 400, 128, 256


def write() -> None:
    """Draw and save the pictures."""
    save(sheet(_singularities()), IMAGES / "performance-singularities.png")
    for name, look in SAMPLED.items():
        save(sheet(_samples(look)), IMAGES / f"performance-{name}.png")


def _singularities() -> list[list[Panel]]:
    """Draw closeups of singularities, where the LIC methods differ, enlarged by 2."""
    inner = slice((SIDE - CLOSE) // 2, (SIDE + CLOSE) // 2)
    rows = []
    for degree, index, name in ((3, 1, "1/3"), (4, 1, "1/4"), (4, -1, "-1/4"), (6, -1, "-1/6")):
        angles = np.angle(singularity(index)(points(SIDE))) / degree
        row = []
        for method in ("brute", "members", "sheets"):
            rgba = compose_planar(angles, degree, replace(PLAIN, method=method)).rgba
            shown = magnified(display(rgba)[inner, inner], 2)
            row.append(Panel(shown, f"{method}, N = {degree}, index {name}"))
        rows.append(row)
    return rows


def _samples(look: Look) -> list[list[Panel]]:
    """Draw a torus with one sample and with four samples per pixel, each at 100 % and at 400 %."""
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

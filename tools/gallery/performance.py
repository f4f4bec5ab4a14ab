"""The pictures of docs/performance.md: sheets next to brute force and members.

`python -m tools.gallery.performance FOLDER` also draws the bunny and the vase, from a folder with
`meshes/stanford-bunny.obj`, `meshes/vase.off` and `fields/vase-4.rawfield`.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.field_io import load_field
from rosy_addon.field.generate import axis_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface, build_surface
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput
from tests.harness.planar import compose_planar

from .page import ROOT
from .plane import PlanarField, points, singularity
from .shapes import sphere, torus
from .sheet import Panel, display, magnified, save, sheet
from .solid import around_field, compose_view, smoothed, view

IMAGES = ROOT / "docs" / "images"

#: Look with one sample per pixel, which hides no artifacts.
LOOK = Look(length=40, gain=2.5)
#: Look with the noise and contrast of the paper, which show grain and breaking points best.
PLAIN = Look(length=40, gain=1.5, density=0.5, high_pass=0.0)

METHODS = ("brute", "members", "sheets")
SIDE, CLOSE = 400, 128

#: Side of the pictures with several samples a pixel.
SAMPLED_SIDE = 256


def write() -> None:
    """Draw and save the pictures that need no files."""
    _singularities()
    ball, ring = sphere(), torus()
    rows = [_planar_row(_pair, 4, "Singularities of index 1/4 and -1/4 in the plane, N = 4")]
    rows += [
        _surface_row(ball, axis_field(ball, 6, (0.3, 0.2, 1.0)), (20, 30), "A sphere, N = 6"),
        _surface_row(ring, around_field(ring, 4), (24, 44), "A torus, N = 4"),
    ]
    save(sheet(rows), IMAGES / "performance-surfaces.png")
    _samples(LOOK, "performance-samples.png")
    _samples(load_preset("cross-hatch").look, "performance-hatching.png")


def _samples(look: Look, name: str) -> None:
    """Draw and save pictures with one and four samples a pixel, at 100 % and at 400 %."""
    ring = torus()
    instance = MeshInstance(ring, np.eye(4), around_field(ring, 4))
    camera = orbit_camera(ring.vertices, 24, 44, SAMPLED_SIDE, SAMPLED_SIDE)
    pictures = {}
    for label, samples in (("one sample", 1), ("2 x 2 samples", 2)):
        sampled = replace(look, supersampling=samples)
        pictures[label] = display(draw_picture(ViewInput((instance,), camera, sampled)).rgba)
    gbuffer = project([instance], camera.scaled(4))
    every_sample = compose(gbuffer, replace(look, supersampling=4))
    pictures["streaks at each of 4 x 4 samples"] = display(every_sample.rgba)
    part = SAMPLED_SIDE // 4
    top, left = round(0.12 * SAMPLED_SIDE), round(0.6 * SAMPLED_SIDE)
    close = slice(top, top + part), slice(left, left + part)
    rows = [
        [Panel(picture, label) for label, picture in pictures.items()],
        [
            Panel(np.kron(picture[close], np.ones((4, 4, 1), np.uint8)))
            for picture in pictures.values()
        ],
    ]
    save(sheet(rows), IMAGES / name)


def write_others(folder: Path) -> None:
    """Draw and save the bunny and the vase."""
    bunny = _upright(Surface(folder / "meshes" / "stanford-bunny.obj"))
    vase = Surface(folder / "meshes" / "vase.off")
    curved = smoothed(bunny, curvature_field(bunny, 4), 20)
    rows = [
        _surface_row(bunny, curved, (25, 12), "The Stanford bunny, N = 4"),
        _surface_row(
            vase,
            load_field(folder / "fields" / "vase-4.rawfield", vase).field,
            (-30, 35),
            "A vase, N = 4",
        ),
    ]
    save(sheet(rows), IMAGES / "performance-meshes.png")


def _upright(surface: Surface) -> Surface:
    """Rotate a surface whose y axis points up so that z points up."""
    x, y, z = surface.vertices.T
    points = np.stack([x, -z, y], axis=1)
    return build_surface(points, surface.corner_vertex, surface.face_start, name=surface.name)


def _singularities() -> None:
    """Draw closeups of singularities, where the methods differ, enlarged twice."""
    rows = []
    for degree, index in ((3, 1), (4, 1), (4, -1), (6, -1)):
        z = singularity(index)(points(SIDE))
        panels = []
        for method in METHODS:
            look = PLAIN.with_settings({"method": method})
            shown = display(compose_planar(np.angle(z) / degree, degree, look).rgba)
            inner = slice((SIDE - CLOSE) // 2, (SIDE + CLOSE) // 2)
            sign = "-" if index < 0 else ""
            label = f"{method}, N = {degree}, index {sign}1/{degree}"
            panels.append(Panel(magnified(shown[inner, inner], 2), label))
        rows.append(panels)
    save(sheet(rows), IMAGES / "performance-singularities.png")


def _pair(p: np.ndarray) -> np.ndarray:
    left, right = p + SIDE / 6, p - SIDE / 6
    return left / np.abs(left) * (right / np.abs(right)).conj() * np.exp(0.6j)


def _planar_row(field: PlanarField, degree: int, about: str) -> list[Panel]:
    angles = np.angle(field(points(SIDE))) / degree
    return [
        Panel(
            display(compose_planar(angles, degree, LOOK.with_settings({"method": method})).rgba),
            f"{about}: {method}",
        )
        for method in ("brute", "sheets")
    ]


def _surface_row(
    surface: Surface, field: RosyField, angles: tuple[float, float], about: str
) -> list[Panel]:
    camera = view(surface, angles, (SIDE, SIDE), 1)
    panels = []
    for method in ("brute", "sheets"):
        look = LOOK.with_settings({"method": method})
        shown = display(compose_view(surface, field, look, camera).rgba)
        panels.append(Panel(shown, f"{about}: {method}"))
    return panels


if __name__ == "__main__":
    write_others(Path(sys.argv[1]))

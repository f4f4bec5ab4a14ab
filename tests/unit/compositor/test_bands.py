"""A picture is the same to the last bit, however its rows are divided into bands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import long
from shapes import icosphere, torus

from rosy_addon.compositor import fast_lic
from rosy_addon.compositor.band import Band
from rosy_addon.compositor.band_division import context_rows, divide_rows
from rosy_addon.compositor.compose import compose, compose_task
from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.preset_files.store import load_preset
from rosy_addon.progress import Progress, run_to_completion
from rosy_addon.projection.camera import look_at, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project, project_task
from rosy_addon.rendering.view_input import ViewInput

WIDTH, HEIGHT = 96, 320
CAMERA = perspective_camera(look_at((0.4, -6.0, 3.0), (0, 0, 0.5)), WIDTH, HEIGHT, fov=0.5)


@pytest.fixture(autouse=True)
def _many_strips(monkeypatch):
    """Small pictures have strips, too."""
    monkeypatch.setattr(fast_lic, "STRIP_STATES", 1 << 14)
    monkeypatch.setattr(fast_lic, "MIN_STRIP_MARGINS", 1)


class OneAfterTheOther:
    """The exchange of bands that are drawn from the bottom, in one process."""

    def __init__(self):
        self.values = {}

    def put(self, key, values):
        self.values[key] = values

    def get_task(self, key):
        yield Progress(1.0, "")
        return self.values.pop(key, None)


def instances() -> tuple[MeshInstance, ...]:
    """A torus with a field of degree 4, and in front a ball with one of degree 7: with more strips."""
    ring, ball = torus(30, 15), icosphere(3)
    moved = np.eye(4)
    moved[:3, 3] = 0.2, -0.5, 1.0
    return (
        MeshInstance(ring, np.eye(4), axis_field(ring, 4, (0, 0, 1))),
        MeshInstance(ball, moved, generate(ball, "smoothest", 7)),
    )


def drawn(view: ViewInput, rows: list[tuple[int, int]], context: int) -> np.ndarray:
    """Draw bands from the bottom, and put them together."""
    exchange, parts = OneAfterTheOther(), []
    samples = view.samples_per_side
    for start, stop in rows:
        band = Band(start, stop, context, exchange)
        task = project_task(
            view.instances, CAMERA, view.look.display, samples=samples, rows=band.rows(HEIGHT)
        )
        gbuffer = run_to_completion(task)
        parts.append(run_to_completion(compose_task(gbuffer, view.look, band=band)).rgba)
    return np.concatenate(parts)


LOOKS = {
    "default": Look(length=14),
    "color noise, by families": Look(length=14, noise="colour", hue="families"),
    "cross-hatch": replace(load_preset("cross-hatch").look, length=14, overshoot=4.0),
    "pencil": replace(load_preset("pencil").look, length=14, overshoot=4.0),
    "wide grain": Look(length=14, grain=4.0, high_pass=40.0, ink="hatch", outline=3.0),
    "wide paper grain": Look(
        length=6, grain=10.0, anchor="surface", high_pass=0.0, ink="hatch", paper_grain=0.8
    ),
    "magnitude": Look(length=14, magnitude="both", magnitude_range=1.0),
    "flow": Look(length=10, flow=1.0, flow_phase=0.2),
}
#: Those that need each kind of rows around a band.
COMMON = "color noise, by families", "cross-hatch", "wide paper grain", "flow"


@pytest.mark.parametrize(
    ("name", "samples"),
    [
        ("default", 1),
        *(pytest.param(name, 2, marks=pytest.mark.slow) for name in COMMON),
        *long(*((name, 2) for name in LOOKS if name not in COMMON)),
        *long(*((name, 1) for name in LOOKS if name != "default")),
    ],
)
@pytest.mark.parametrize("count", [3, *long(2)])
def test_bands_are_parts_of_the_picture(name, samples, count):
    view = ViewInput(instances(), CAMERA, replace(LOOKS[name], supersampling=samples))
    gbuffer = project(view.instances, CAMERA, view.look.display, samples=view.samples_per_side)
    whole = compose(gbuffer, view.look).rgba
    context = context_rows(view.look, CAMERA, view.instances)
    rows = divide_rows(view.look, CAMERA, view.instances, count)
    assert len(rows) == count and rows[0][0] == 0 and rows[-1][1] == HEIGHT
    assert drawn(view, rows, context).tobytes() == whole.tobytes()


@pytest.mark.parametrize(
    "look",
    [
        Look(method="brute"),
        load_preset("engraving").look,
        Look(magnitude="colour"),
        Look(high_pass=1024.0),
        Look(length=200),
    ],
)
def test_pictures_that_depend_on_all_pixels_are_not_divided(look):
    assert divide_rows(look, CAMERA, instances(), 2) == [(0, HEIGHT)]


@pytest.mark.parametrize("count", [2, 3, 5, 8])
def test_bands_end_where_strips_of_all_fields_do(count):
    look = Look(length=14)
    rows = divide_rows(look, CAMERA, instances(), count)
    for lines in (2, 7):
        strips = fast_lic.strip_count(WIDTH, HEIGHT, lines, fast_lic.streamline_margin(look))
        assert {start for start, _ in rows} <= {HEIGHT * k // strips for k in range(strips)}

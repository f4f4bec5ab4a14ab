"""Progress: long functions report it to a listener, which can end them."""

import contextvars
import itertools

import numpy as np
import pytest
from listeners import CancelledError, cancel_at, reported
from shapes import instance_of, torus
from uv_maps import torus_uv

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light
from rosy_addon.core.errors import RosyError
from rosy_addon.core.progress import current_report, listening, progress, report
from rosy_addon.field.convert import Conversion, convert
from rosy_addon.field.generate import generate
from rosy_addon.field.prescribed import prescribed_field
from rosy_addon.line_drawing.pipeline import draw_instances
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.projection.ambient_occlusion import ambient_occlusion
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.surface_texture.draw import draw_texture

INSTANCE = instance_of(torus(48, 24), 4)
SURFACE, FIELD = INSTANCE.surface, INSTANCE.field
SUN = Light("sun", np.array([0.3, 0.5, 0.8]), np.ones(3), 1.0)
CAMERA = orbit_camera(INSTANCE.face_points(), 20, 40, 200, 200)


# --- parts and labels -----------------------------------------------------------------------------


def steps(*fractions: float) -> None:
    for fraction in fractions:
        report(fraction, "step")


def test_parts_are_scaled_within_parts():
    def work():
        steps(0.0)
        with progress(0.5, 1.0):
            steps(0.0, 0.5)
            with progress(0.5, 0.75):
                steps(0.0, 1.0)
        steps(1.0)

    fractions = [fraction for fraction, _ in reported(work)]
    assert fractions == [0.0, 0.5, 0.75, 0.75, 0.875, 1.0]


def test_nobody_need_listen():
    with progress(0.0, 1.0):
        report(0.5, "unheard")
    heard = []
    with listening(lambda *told: heard.append(told)):
        with listening(None), progress(0.0, 1.0):
            report(0.5, "unheard")
        report(1.0, "heard")
    report(1.0, "unheard")
    assert heard == [(1.0, "heard")]


def test_the_part_ends_with_an_exception():
    def work():
        with pytest.raises(RosyError), progress(0.5, 0.6):
            raise RosyError("a mistake")
        report(1.0, "after")

    assert reported(work) == [(1.0, "after")]


def test_a_report_to_a_part_from_elsewhere():
    """As by a process pool, which hears the progress of its own part of the work itself."""

    def work():
        with progress(0.5, 1.0):
            report_here = current_report()
            with listening(lambda fraction, label: report_here(fraction / 2, label)):
                report(0.5, "elsewhere")
        report_here(1.0, "elsewhere")

    assert reported(work) == [(0.625, "elsewhere"), (1.0, "elsewhere")]
    current_report()(0.5, "unheard")


def test_each_context_has_its_own_listener():
    def work():
        contextvars.Context().run(report, 0.5, "unheard")
        contextvars.copy_context().run(report, 0.5, "heard")

    assert reported(work) == [(0.5, "heard")]


# --- long functions -------------------------------------------------------------------------------


CONVERSION = Conversion(
    2, rotation=0.1, smoothing_length=0.05, pair_distance=0.2, magnitude="curvature"
)
VIEW = ViewInput((INSTANCE,), CAMERA, Look(), (SUN,))
STYLE = StrokeStyle(spacing=40.0, arrows=30.0, overshoot=4.0, outline=1.0)

#: Long functions, their arguments, and the least part of the work at which the last report comes.
LONG = {
    "smoothest": (generate, (SURFACE, "smoothest", 4), 0.9),
    "form": (generate, (SURFACE, "form", 4), 0.8),
    "prescribed": (prescribed_field, (SURFACE, 4, np.array([5, 200]), np.array([1, -1])), 0.8),
    "convert": (convert, (SURFACE, FIELD, CONVERSION), 0.9),
    "occlusion": (ambient_occlusion, ([INSTANCE], 0, 16), 0.9),
    "picture": (draw_picture, (VIEW,), 0.9),
    "strokes": (draw_instances, ([INSTANCE], CAMERA, STYLE), 0.9),
    "texture": (draw_texture, (INSTANCE, torus_uv(48, 24), Look(length=20), 128), 0.9),
}


@pytest.mark.parametrize("name", LONG)
def test_progress_never_goes_back(name):
    function, arguments, last = LONG[name]
    fractions = [fraction for fraction, _ in reported(function, *arguments)]
    assert len(fractions) > 5
    assert all(later >= sooner - 1e-9 for sooner, later in itertools.pairwise(fractions))
    assert 0 <= fractions[0] < 0.1 and last <= fractions[-1] <= 1 + 1e-9


@pytest.mark.parametrize("name", ["form", "picture"])
def test_a_listener_ends_the_work(name):
    """And what is left does not change what is done next."""
    function, arguments, _ = LONG[name]
    function(*arguments)  # fills the caches
    count = len(reported(function, *arguments))
    for stop in (1, count // 2, count):
        with listening(cancel_at(stop)), pytest.raises(CancelledError):
            function(*arguments)
    assert len(reported(function, *arguments)) <= count

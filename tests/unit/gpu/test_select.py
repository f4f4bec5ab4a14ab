"""Which looks the graphics card refuses, before it is asked for, and what 3D views draw of them."""

from types import SimpleNamespace

import pytest

from rosy_addon.compositor.look import Look, has_flow
from rosy_addon.gpu import select
from rosy_addon.gpu.cpu_viewport import CpuViewportRenderer
from rosy_addon.gpu.renderer import GpuRenderer
from rosy_addon.rendering.draw import bake_picture
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.worker.job import Call, call_steps, run

REFUSED = {"members": "brute", "ibfv": "sheets"}


@pytest.fixture(autouse=True)
def _unused_card(monkeypatch):
    """A graphics card that is never drawn with."""
    monkeypatch.setattr(select, "blender_device", lambda: None)


@pytest.mark.parametrize("device", ["gpu", "auto"])
@pytest.mark.parametrize("method", ["sheets", "brute"])
def test_methods_that_the_card_draws(method, device):
    assert select.select_device(device, Look(method=method)) == "gpu"


@pytest.mark.parametrize("method", REFUSED)
def test_methods_that_the_processor_draws_instead(method, error_of):
    look = Look(method=method)
    message = error_of(select.select_device, "gpu", look)
    assert f"'{method}'" in message and "processor" in message
    assert select.select_device("auto", look) == "cpu"
    steps = GpuRenderer(None).picture_steps(ViewInput((), None, look))
    assert error_of(run, steps) == message


def test_pictures_are_a_part_of_a_job(monkeypatch):
    """The processor draws in one call; the card in steps, with calls of its own."""
    view = ViewInput((), None, Look())
    assert list(select.picture_steps(view, "cpu")) == [Call(bake_picture, (view,))]

    card = SimpleNamespace(picture_steps=lambda view: call_steps(len, [1, 2]))
    monkeypatch.setattr(select, "GpuRenderer", lambda device: card)
    assert run(select.picture_steps(view, "gpu")) == 2


@pytest.mark.parametrize("method", REFUSED)
def test_views_say_that_they_draw_another_method(method):
    look = Look(method=method, flow=1.5)
    drawn, message = select.look_in_view(look, GpuRenderer(None))
    assert drawn == look.with_settings({"method": REFUSED[method]})
    assert has_flow(drawn) == has_flow(look)
    assert f"'{method}'" in message and f"'{drawn.method}'" in message and "bake" in message


def test_views_draw_other_methods_as_they_are():
    on_card, on_processor = GpuRenderer(None), object.__new__(CpuViewportRenderer)
    for renderer, methods in ((on_card, ("sheets", "brute")), (on_processor, REFUSED)):
        for method in methods:
            look = Look(method=method)
            assert select.look_in_view(look, renderer) == (look, None)

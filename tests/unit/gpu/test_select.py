"""Which looks the graphics card refuses, before it is asked for."""

from __future__ import annotations

import pytest

from rosy_addon.compositor.look import Look
from rosy_addon.gpu import select
from rosy_addon.gpu.renderer import GpuRenderer
from rosy_addon.rendering.cpu import CpuRenderer

HATCHED = {"ink": "hatch", "breaks": 0.5}
DRAWN = {
    "ibfv": {"method": "ibfv"},
    "ibfv, drifting": {"method": "ibfv", "flow": 1.0, "magnitude": "both"},
    "ibfv, with breaks": {"method": "ibfv", **HATCHED},
    "ibfv, even lines": {"method": "ibfv", "ink": "hatch", "lines": "even"},
}
REFUSED = {
    "members": {"method": "members"},
    "drift": {"method": "ibfv", "flow": 1.0, **HATCHED},
    "colored": {"method": "ibfv", "noise": "colour", "ink": "hatch", "wobble": 0.3},
    "even lines": {"method": "ibfv", "lines": "even", **HATCHED},
}


@pytest.fixture
def card(monkeypatch):
    """A graphics card that is never drawn with."""
    monkeypatch.setattr(select, "blender_device", lambda: None)


@pytest.mark.usefixtures("card")
@pytest.mark.parametrize("name", DRAWN)
def test_looks_that_the_card_draws(name):
    for device in ("gpu", "auto"):
        renderer = select.select_renderer(device, Look(**DRAWN[name]))
        assert isinstance(renderer, GpuRenderer)


@pytest.mark.usefixtures("card")
@pytest.mark.parametrize("name", REFUSED)
def test_looks_that_the_processor_draws_instead(name, error_of):
    look = Look(**REFUSED[name])
    message = error_of(select.select_renderer, "gpu", look)
    assert look.method in message and name in message and "processor" in message
    assert isinstance(select.select_renderer("auto", look), CpuRenderer)

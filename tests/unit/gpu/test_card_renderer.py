"""What the renderer on the graphics card keeps, refuses, prepares and draws besides single pictures."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from harness.gpu_parity import read_gbuffer
from harness.gpu_scenes import (
    AXIS,
    BALL,
    EVEN_LINES,
    LOOK,
    SHEAR,
    SIZE,
    ball,
    boxes,
    card_rgba,
    draw,
    rotation,
    shown,
    view,
)
from shapes import icosphere

from rosy_addon.field.generate import axis_field
from rosy_addon.gpu import lic_stage, mesh_buffers, passes, preparation, resources, uniforms
from rosy_addon.gpu.preparation import prepare_steps
from rosy_addon.gpu.renderer import GpuRenderer
from rosy_addon.preset_files.store import load_preset
from rosy_addon.worker.job import Call, run


def kept_kinds(card):
    """Return the first parts of the keys of what is on the device."""
    return [key[0] for key in card.resources._kept]


def test_meshes_stay_on_the_card(device):
    card = GpuRenderer(device)
    (first,) = card.upload([ball()], "smooth")
    moved = ball(4, 2 * rotation(1, 2, 3), (4, 5, 6))
    (second,) = card.upload([moved], "smooth")
    (sheared,) = card.upload([ball(4, SHEAR)], "smooth")
    assert second.mesh is first.mesh is not sheared.mesh and kept_kinds(card) == ["mesh", "mesh"]
    for _ in range(resources.MESH_LIFETIME + 1):
        assert card.upload([moved], "smooth")[0].mesh is first.mesh
    assert kept_kinds(card) == ["mesh"]
    card.release()
    assert not card.resources._kept and not card.resources._lookup_textures


def test_even_lines_stay_on_the_card(device):
    """There are two textures: the lines of slanted parts have another distance."""
    card = GpuRenderer(device)
    for azimuth in (0.0, 1.0):
        card_rgba(card, [ball()], EVEN_LINES, view(azimuth=azimuth))
        assert sorted(kept_kinds(card)).count("lines") == 2


def test_creases_are_found_for_each_angle(card):
    (item,) = card.upload([shown(boxes(), axis_field(boxes(), 4, AXIS))], "smooth")

    def textures(crease_angle):
        (found,) = run(prepare_steps([lambda: card.resources.outline_textures(item, crease_angle)]))
        return found

    first = textures(0.7)
    assert first.crease_count == 24 and first.triangle_parts is not None
    assert textures(1.7).crease_count == textures(None).crease_count == 0 and textures(0.7) is first


@pytest.mark.parametrize("max_steps", [None, 1, 200_000, 300_000, 450_000])
def test_nothing_is_left_of_the_previous_picture(card, monkeypatch, max_steps):
    """Whose meshes have other positions, degrees and boxes. Bands of a picture leave no seam."""
    small = ball(3, 0.37 * rotation(1, 1, 0), (0.31, 0, 0.23))
    expected = card_rgba(GpuRenderer(card.device), [small])
    if max_steps is not None:
        monkeypatch.setattr(lic_stage, "MAX_DISPATCH_STEPS", max_steps)
    card_rgba(card, [ball(3 if max_steps else 4)])
    for _ in range(2):
        np.testing.assert_array_equal(card_rgba(card, [small]), expected)


def test_clip_planes(card):
    planes = uniforms.NO_CLIP_PLANES.copy()
    planes[3] = (1.0, 0.0, 0.0, 0.2)
    instances = [ball(4, rotation(0, 0, 1))]
    unclipped, clipped = (card_rgba(card, instances, clip_planes=each) for each in (None, planes))
    visible = read_gbuffer(card, *SIZE)["field_values"][..., 3] > 0
    assert 0.2 < visible.sum() / (unclipped[..., 3] > 0).sum() < 1.0
    assert (clipped[..., 3] > 0).sum() == visible.sum()


@pytest.mark.parametrize("degree, marks", [(4, {"singularity_dots": "all"}), (3, {"arrows": 32.0})])
def test_singularities_and_arrowheads_are_drawn_over_the_picture(card, degree, marks):
    """At the same pixels as in the picture of numpy."""
    changed, looks = [], (replace(LOOK, **marks), LOOK)
    for renderer in (card, None):
        marked, plain = (draw(renderer, [ball(degree)], look).rgba for look in looks)
        changed.append((marked != plain).any(axis=2))
    assert changed[0].sum() > 100 and (changed[0] != changed[1]).sum() <= 2


def test_what_is_too_large_is_refused(device, error_of, monkeypatch):
    card = GpuRenderer(device)
    monkeypatch.setattr(device, "max_texture_size", 128)
    message = error_of(card_rgba, card, [ball()])
    assert "160 x 144" in message and "128" in message
    monkeypatch.setattr(device, "max_texture_size", 1)
    monkeypatch.setattr(mesh_buffers, "ROW_TEXELS", 64)
    message = error_of(card.upload, [ball(surface=icosphere(4))], "smooth")
    assert "sphere" in message and str(20 * 4**4) in message


def test_nothing_is_compiled_or_sent_after_the_preparation(device):
    card = GpuRenderer(device)
    run(card.prepare_steps([ball()], "smooth"))
    prepared = {shader for shader in passes.all_passes() if not shader.declared.switches}
    assert set(device._shaders) >= prepared and kept_kinds(card) == ["mesh"]
    card_rgba(card, [ball()])
    shaders = dict(device._shaders)  # now with the switches of this look
    card_rgba(card, [ball()], replace(LOOK, gain=2.0))
    assert device._shaders == shaders and kept_kinds(card).count("mesh") == 1
    assert not list(card.prepare_steps([ball()], "smooth"))


def test_what_takes_long_is_left_to_others(device, monkeypatch):
    """Meshes, outlines, features and lines are calls that a helper can make; the picture is the same."""
    look = replace(load_preset("engraving").look, anchor="surface", detail=0.5, outline=2.0)
    expected = draw(GpuRenderer(device), [ball()], look).rgba
    monkeypatch.setattr(preparation, "IN_PLACE_SECONDS", 0.0)
    calls = []

    def call_elsewhere(call):
        sent = pickle.loads(pickle.dumps(call, 5))
        calls.append(sent.function.__name__)
        return sent.function(*sent.arguments)

    monkeypatch.setattr(Call, "__call__", call_elsewhere)
    picture = draw(GpuRenderer(device), [ball()], look)
    assert set(calls) == {"mesh_buffers", "outline_records", "feature_records", "line_records"}
    assert picture.rgba.tobytes() == expected.tobytes()


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("top", [0.0, 0.7])
def test_the_range_of_the_colors(card, samples, top):
    """It is the range of numpy, and a look with this range gives the same picture."""
    look = replace(LOOK, hue="magnitude", color_range=(0.0, top), supersampling=samples)
    instances = ball(), shown(BALL, axis_field(BALL, 2), shift=(0, 0, -9))
    drawn, expected = (draw(each, instances, look) for each in (card, None))
    # Numpy finds the field of several samples at the centers of pixels.
    tolerance = 1e-4 if samples == 1 else 5e-3
    assert drawn.color_range == pytest.approx(expected.color_range, rel=tolerance)
    assert (drawn.color_range == (0.0, 0.7)) == bool(top)
    again = draw(card, instances, replace(look, color_range=drawn.color_range))
    np.testing.assert_allclose(again.rgba, drawn.rgba, atol=1e-6)


def test_no_common_range_of_the_colors(card):
    """Fields of several degrees have ranges of their own, and lengths have none."""
    instances = ball(), shown(BALL, axis_field(BALL, 2), shift=(0.7, 0, 0))
    look = replace(LOOK, hue="magnitude")
    for renderer in (card, None):
        assert draw(renderer, instances, look).color_range is None
    look = replace(look, hue="one", magnitude_length=True)
    assert draw(card, instances[:1], look).color_range is None

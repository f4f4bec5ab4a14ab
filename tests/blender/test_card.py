"""The graphics card against numpy, in this Blender: software OpenGL will do.

`bench/parity.py` says what is measured, and runs the same at 512 x 512 for a table.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import bpy
import gpu
import numpy as np
import pytest
from conftest import EXTENSION

sys.path.insert(0, str(Path(__file__).parents[2]))
from bench.parity import (
    DEGREES,
    VIEWS,
    camera_of_shape,
    draw_on_card,
    draw_pair,
    likeness,
    module_of,
    rooms,
    surface_of_shape,
)

PACKAGE = f"{EXTENSION}.rosy_addon"
#: Meshes of others.
DATA = Path(__file__).parents[3] / "shared" / "data"
#: Half of the table's, and half of a streamline's usual length: the same part of the picture.
SIZE, LENGTH = 256, 20


@pytest.fixture(scope="module")
def rosy():
    return rooms(PACKAGE)


@pytest.fixture(scope="module")
def card(rosy):
    errors = module_of(PACKAGE, "errors")
    try:
        device = module_of(PACKAGE, "gpu.device").BlenderDevice()
    except errors.RosyError as error:
        pytest.skip(str(error))
    return rosy.GpuRenderer(device)


@pytest.fixture(scope="module")
def surface_of(rosy):
    bpy.ops.wm.read_homefile(use_empty=True)
    return lru_cache(lambda name: surface_of_shape(rosy, name, DATA))


def test_it_is_drawn_with_what_was_asked_for(card):
    assert gpu.platform.backend_type_get() == os.environ["ROSY_BACKEND"].upper()


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("name", VIEWS)
def test_parity(rosy, card, surface_of, name, degree):
    """Without shading, which would be the same in both and flatter the correlation."""
    surface = surface_of(name)
    if surface is None:
        pytest.skip(f"no {name} in ../shared/data")
    camera = camera_of_shape(rosy, name, surface, SIZE)
    instance = rosy.MeshInstance(surface, np.eye(4), rosy.generate(surface, "smoothest", degree))
    pair = draw_pair(rosy, card, [instance], camera, rosy.Look(shading=0.0, length=LENGTH))
    assert len(pair.gbuffer.pixel) > 0.25 * SIZE * SIZE
    assert pair.agreement >= 0.999
    # Around a sink of one direction brute force goes round in circles where the card passes through;
    # with so few pixels that is a larger part of the picture.
    assert pair.likeness >= (0.98 if degree > 1 else 0.95)


@pytest.mark.parametrize("degree", [3, 4])
@pytest.mark.parametrize("anchor", ["picture", "surface"])
def test_parity_of_ink_by_hand(rosy, card, surface_of, degree, anchor):
    """All that makes lines uneven, and an ink for each family."""
    surface = surface_of("torus")
    camera = camera_of_shape(rosy, "torus", surface, 2 * SIZE)
    instance = rosy.MeshInstance(surface, np.eye(4), rosy.generate(surface, "smoothest", degree))
    look = rosy.Look(
        ink="hatch",
        hue="families",
        anchor=anchor,
        shading=0.9,
        grain=2.5,
        length=LENGTH,
        supersampling=2,
        breaks=0.6,
        wobble=0.6,
        paper_grain=0.4,
    )
    pair = draw_pair(rosy, card, [instance], camera, look)
    assert pair.likeness >= 0.98


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_parity_of_a_scene(rosy, card, scene, suzanne, kind):
    """What a bake would read: a field on faces, a modifier, instances, a lens that is shifted."""
    bpy.ops.rosy.field_generate(kind="curvature", degree=4)
    camera = scene.camera
    camera.data.type, camera.data.ortho_scale = kind, 4.0
    camera.data.shift_x, camera.data.shift_y = 0.12, -0.05
    mirrored = bpy.data.objects.new("Mirrored", suzanne.data)
    mirrored.location, mirrored.scale = (1.6, 1.0, 0.3), (-0.7, 0.7, 0.7)
    hiding = bpy.data.objects.new("Hiding", bpy.data.meshes.new("Hiding"))
    hiding.data.from_pydata([(-1, -2, -1), (0, -2, -1), (0, -2, 0)], [], [(0, 1, 2)])
    for thing in (mirrored, hiding):
        scene.collection.objects.link(thing)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    instances = module_of(PACKAGE, "scene.scene_reader").read_instances(depsgraph)
    assert [instance.field is None for instance in instances] == [False, False, True]
    seen = module_of(PACKAGE, "scene.cameras").camera_of_object(scene, depsgraph, camera, 512, 512)
    look = rosy.Look(shading=0.0)
    pair = draw_pair(rosy, card, instances, seen, look)
    assert set(np.unique(pair.gbuffer.instance_id)) == {0, 1}
    assert pair.agreement >= 0.999
    assert pair.likeness >= 0.98
    # The fast way of numpy shares averages between neighbours, and is off from all others alike.
    fast = rosy.compose(pair.gbuffer, replace(look, method="sheets")).rgba
    assert likeness(pair.card, fast) >= likeness(pair.numpy, fast) - 0.02


def test_what_blender_draws_with_is_as_it_was(rosy, card, surface_of):
    import gpu

    state = gpu.state
    state.depth_test_set("GREATER")
    state.depth_mask_set(False)
    state.blend_set("ADDITIVE")
    try:
        surface = surface_of("sphere")
        instance = rosy.MeshInstance(surface, np.eye(4), rosy.generate(surface, "axis", 2))
        camera = camera_of_shape(rosy, "sphere", surface, 64)
        draw_on_card(rosy, card, [instance], camera, rosy.Look())
        found = state.depth_test_get(), state.depth_mask_get(), state.blend_get()
        assert found == ("GREATER", False, "ADDITIVE")
    finally:
        state.depth_test_set("NONE")
        state.blend_set("NONE")


def test_a_shader_that_the_driver_does_not_take_is_an_error_of_one_line(rosy, card, capfd):
    passes = module_of(PACKAGE, "gpu.passes")
    errors = module_of(PACKAGE, "errors")

    class Broken(passes.ComputePass):
        source = "void main() { nonsense }"

    broken = Broken("broken", (), (("picture", "RGBA32F"),), (("side", "int"),))
    image = card.device.texture(8, 8, "RGBA32F")
    with pytest.raises(errors.RosyError, match="'broken'"):
        card.device.compute(broken, (8, 8), {}, {"picture": image}, {"side": 1})
    capfd.readouterr()

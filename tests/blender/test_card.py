"""The graphics card compared with numpy, in this Blender; software OpenGL is enough.

`tests/harness/gpu_parity.py` defines what is measured. `tests/unit/gpu/` compares further looks without
Blender.
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

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.gpu_parity import (
    camera_of_shape,
    draw_on_card,
    draw_pair,
    likeness,
    module_of,
    rooms,
    surface_of_shape,
)

PACKAGE = f"{EXTENSION}.rosy_addon"
#: Half of the table's size, and half of the default length: the same share of the picture.
SIZE, LENGTH = 256, 20


@pytest.fixture(scope="module")
def rosy():
    return rooms(PACKAGE)


@pytest.fixture(scope="module")
def card(rosy):
    errors = module_of(PACKAGE, "core.errors")
    try:
        device = module_of(PACKAGE, "gpu.device").Device()
    except errors.RosyError as error:
        pytest.skip(str(error))
    return rosy.GpuRenderer(device)


@pytest.fixture(scope="module")
def surface_of(rosy):
    bpy.ops.wm.read_homefile(use_empty=True)
    return lru_cache(lambda name: surface_of_shape(rosy, name))


def test_the_requested_backend_is_used(card):
    assert gpu.platform.backend_type_get() == os.environ["ROSY_BACKEND"].upper()


@pytest.mark.parametrize(("name", "degree"), [("Suzanne", 4), ("torus", 3)])
def test_parity(rosy, card, surface_of, name, degree):
    """Without shading, which is the same in both and would raise the correlation."""
    surface = surface_of(name)
    camera = camera_of_shape(rosy, name, surface, SIZE)
    instance = rosy.MeshInstance(surface, np.eye(4), rosy.generate(surface, "smoothest", degree))
    pair = draw_pair(rosy, card, [instance], camera, rosy.Look(shading=0.0, length=LENGTH))
    assert len(pair.gbuffer.pixel) > 0.25 * SIZE * SIZE
    assert pair.agreement >= 0.999
    assert pair.likeness >= 0.98


def test_parity_of_uneven_lines(rosy, card, surface_of):
    """All settings that make lines uneven, an ink for each family, and an outline."""
    surface = surface_of("torus")
    camera = camera_of_shape(rosy, "torus", surface, 2 * SIZE)
    instance = rosy.MeshInstance(surface, np.eye(4), rosy.generate(surface, "smoothest", 4))
    uneven = {"breaks": 0.6, "wobble": 0.6, "paper_grain": 0.4, "outline": 1.5}
    lines = {"anchor": "surface", "shading": 0.9, "line_width": 2.5, "length": LENGTH, **uneven}
    look = rosy.Look(ink="hatch", hue="families", supersampling=2, **lines)
    assert draw_pair(rosy, card, [instance], camera, look).likeness >= 0.98


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_parity_of_a_scene(rosy, card, scene, suzanne, kind):
    """The input of a bake: a field on faces, a modifier, instances, and a shifted lens."""
    bpy.ops.rosy.field_generate(kind="curvature", degree=4)
    camera = scene.camera
    camera.data.type, camera.data.ortho_scale = kind, 4.0
    camera.data.shift_x, camera.data.shift_y = 0.12, -0.05
    mirrored = suzanne.copy()
    mirrored.location, mirrored.scale = (1.6, 1.0, 0.3), (-0.7, 0.7, 0.7)
    occluder = bpy.data.objects.new("Hiding", bpy.data.meshes.new("Hiding"))
    occluder.data.from_pydata([(-1, -2, -1), (0, -2, -1), (0, -2, 0)], [], [(0, 1, 2)])
    for obj in (mirrored, occluder):
        scene.collection.objects.link(obj)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    instances = module_of(PACKAGE, "scene.scene_reader").read_scene(depsgraph).instances
    assert [instance.field is None for instance in instances] == [False, False, True]
    cameras = module_of(PACKAGE, "scene.cameras")
    view = cameras.camera_of_object(scene, depsgraph, camera, (512, 512))
    look = rosy.Look(shading=0.0)
    pair = draw_pair(rosy, card, instances, view, look)
    assert set(np.unique(pair.gbuffer.instance_id)) == {0, 1}
    assert pair.agreement >= 0.999
    assert pair.likeness >= 0.98
    # The fast method of numpy shares averages between pixels: it differs from both pictures alike.
    fast = rosy.compose(pair.gbuffer, replace(look, method="sheets")).rgba
    assert likeness(pair.card, fast) >= likeness(pair.numpy, fast) - 0.02


def test_the_state_of_blender_is_restored(rosy, card, surface_of):
    import gpu

    state = gpu.state
    state.depth_test_set("GREATER")
    state.depth_mask_set(False)
    state.blend_set("ADDITIVE")
    try:
        surface = surface_of("sphere")
        instance = rosy.MeshInstance(surface, np.eye(4), rosy.generate(surface, "axis", 2))
        camera = camera_of_shape(rosy, "sphere", surface, 64)
        draw_on_card(rosy, card, rosy.ViewInput((instance,), camera, rosy.Look()))
        current = state.depth_test_get(), state.depth_mask_get(), state.blend_get()
        assert current == ("GREATER", False, "ADDITIVE")
    finally:
        state.depth_test_set("NONE")
        state.blend_set("NONE")

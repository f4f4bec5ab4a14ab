"""The graphics card compared with numpy, in this Blender; software OpenGL is enough.

`tests/harness/gpu_parity.py` defines what is measured. `tests/unit/gpu/` compares further looks without
Blender.
"""

import os
import sys
from dataclasses import replace
from pathlib import Path

import bpy
import gpu
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.gpu_parity import ViewInput, compose, draw_on_card, draw_pair, likeness
from harness.rosy_modules import rosy

generate = rosy("field.generate").generate
Look = rosy("compositor.look").Look
MeshInstance = rosy("projection.gbuffer").MeshInstance

#: Half of the default length: the same share of the picture.
LENGTH = 20


@pytest.fixture(scope="module")
def card():
    try:
        device = rosy("gpu.device").Device()
    except rosy("core.errors").RosyError as error:
        pytest.skip(str(error))
    return rosy("gpu.renderer").GpuRenderer(device)


@pytest.fixture
def torus():
    """A torus of Blender, as a surface."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_torus_add(
        major_segments=128, minor_segments=48, major_radius=1.0, minor_radius=0.4
    )
    bpy.ops.object.shade_smooth()
    return rosy("scene.meshes").mesh_surface(bpy.context.object.data, "torus")


def camera_of(surface, size):
    """Return a camera that looks at a surface from above, with a square frame."""
    orbit_camera = rosy("projection.camera").orbit_camera
    return orbit_camera(surface.vertices, 20, 40, size, size, perspective=False)


def test_the_requested_backend_is_used(card):
    assert gpu.platform.backend_type_get() == os.environ["ROSY_BACKEND"].upper()


def test_parity_of_uneven_lines(card, torus):
    """All settings that make lines uneven, an ink for each family, and an outline."""
    camera = camera_of(torus, 512)
    instance = MeshInstance(torus, np.eye(4), generate(torus, "smoothest", 4))
    uneven = {"breaks": 0.6, "wobble": 0.6, "paper_grain": 0.4, "outline": 1.5}
    lines = {"anchor": "surface", "shading": 0.9, "line_width": 2.5, "length": LENGTH, **uneven}
    look = Look(ink="hatch", hue="families", supersampling=2, **lines)
    assert draw_pair(card, [instance], camera, look).likeness >= 0.98


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_parity_of_a_scene(card, scene, suzanne, kind):
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
    instances = rosy("scene.scene_reader").read_scene(depsgraph).instances
    assert [instance.field is None for instance in instances] == [False, False, True]
    view = rosy("scene.cameras").camera_of_object(scene, depsgraph, camera, (512, 512))
    look = Look(shading=0.0)
    pair = draw_pair(card, instances, view, look)
    assert set(np.unique(pair.gbuffer.instance_id)) == {0, 1}
    assert pair.agreement >= 0.999
    assert pair.likeness >= 0.98
    # The fast method of numpy shares averages between pixels: it differs from both pictures alike.
    fast = compose(pair.gbuffer, replace(look, method="sheets")).rgba
    assert likeness(pair.card, fast) >= likeness(pair.numpy, fast) - 0.02


def test_the_state_of_blender_is_restored(card, torus):
    state = gpu.state
    state.depth_test_set("GREATER")
    state.depth_mask_set(False)
    state.blend_set("ADDITIVE")
    try:
        instance = MeshInstance(torus, np.eye(4), generate(torus, "axis", 2))
        camera = camera_of(torus, 64)
        draw_on_card(card, ViewInput((instance,), camera, Look()))
        current = state.depth_test_get(), state.depth_mask_get(), state.blend_get()
        assert current == ("GREATER", False, "ADDITIVE")
    finally:
        state.depth_test_set("NONE")
        state.blend_set("NONE")

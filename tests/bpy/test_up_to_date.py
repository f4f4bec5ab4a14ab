"""The panel's "Up to date" is true: a table of changes, each of which is baked again.

A change either changes what the next bake gives, and the panel says so, or neither.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from changes import TABLE, animated, build, obj
from rosy.rosy_addon.core.cache import BAKE_CACHE
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.gpu.select import automatic_device
from rosy.rosy_addon.jobs.animation import bake_animation
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.projection.camera import look_at, perspective_camera
from rosy.rosy_addon.scene import staleness
from rosy.rosy_addon.scene.bake_records import list_bakes
from rosy.rosy_addon.scene.cameras import VIEW_NAME
from rosy.rosy_addon.scene.pictures import OutputSettings, show_bake
from rosy.rosy_addon.worker.job import Call
from scenes import each_step, pixels


def bake_word(scene):
    """Return what the panel says about the picture, in a scene that is watched and in one that is not."""
    (watched,), (info,) = (
        list_bakes(scene, for_panel=for_panel, automatic_device=automatic_device)
        for for_panel in (True, False)
    )
    assert not info.unknown_reason
    assert watched.stale_reason == info.stale_reason
    return info.stale_reason


@pytest.fixture
def watched(monkeypatch):
    """Scenes are read again as soon as handlers have noted a change."""
    monkeypatch.setattr(staleness, "TTL_READINGS", 0.0)
    yield
    staleness.SCENE_STATES.clear()


def given(scene):
    """Return what the user has from a bake: pixels, where they are, material and projections."""
    (record,) = scene.rosy.bakes
    image, tree = record.image, record.material.node_tree
    groups = [
        [
            [
                np.round(tuple(projection.matrix), 5).tolist()
                for projection in group.rosy.projections
            ],
            sum(
                modifier.type == "NODES" and modifier.node_group == group
                for other in scene.objects
                for modifier in other.modifiers
            ),
        ]
        for group in bpy.data.node_groups
    ]
    return {
        "pixels": pixels(image).tobytes(),
        "size": tuple(image.size),
        "float": image.is_float,
        "packed": image.packed_file is not None,
        "material": [
            (
                node.bl_idname,
                [
                    np.round(socket.default_value, 5).tolist()
                    for socket in node.inputs
                    if hasattr(socket, "default_value")
                    and not isinstance(socket.default_value, str)
                ],
            )
            for node in tree.nodes
        ],
        "groups": sorted(groups),
    }


@pytest.mark.parametrize("name", TABLE)
def test_the_word_and_the_picture(name, tmp_path, watched):
    change, prepare, expected = TABLE[name]
    scene = build(tmp_path)
    if prepare is not None:
        prepare(scene)
    bake(scene)
    assert bake_word(scene) == ""
    before = given(scene)
    change(scene)
    word = bake_word(scene)
    try:
        bake(scene)
        differences = [key for key, value in given(scene).items() if value != before[key]]
    except RosyError as error:
        differences = [str(error)]
    assert bool(word) == bool(differences), (word, differences)
    if expected is not None:
        assert bool(expected) == bool(word) and expected in word


def test_frames_are_compared_with_the_present_one(tmp_path):
    scene = build(tmp_path)
    animated(scene)
    bake_animation(scene, range(2, 5), settings=OutputSettings(folder=tmp_path))

    def word(number):
        scene.frame_set(number)
        (info,) = list_bakes(scene)
        assert info.frame_range == "2 to 4"
        return info.stale_reason, info.unknown_reason

    assert [word(number) for number in (2, 3, 4)] == [("", "")] * 3
    assert word(5) == ("", "frame 5 was not drawn")
    obj("Plain").animation_data.action.name = "Lift"
    scene.name = "Shot"
    scene.rosy.placement, scene.rosy.relight = "WINDOW", True  # frames fill the frame of the camera
    assert word(3) == ("", "")
    obj("In Front").keyframe_insert("location", frame=3)
    obj("In Front").location.x += 0.1
    obj("In Front").keyframe_insert("location", frame=4)
    assert [word(number)[0] for number in (2, 3, 4)] == ["", "", "'In Front' was moved"]
    scene.rosy.look.seed = 3
    assert word(3) == ("the look was changed", "")


def test_a_renamed_camera_keeps_its_picture(tmp_path):
    scene = build(tmp_path)
    bake(scene)
    scene.camera.name = "Eye"
    assert [info.camera for info in list_bakes(scene)] == ["Eye"]
    show_bake(scene, "Eye")
    bake(scene)
    assert [info.camera for info in list_bakes(scene)] == ["Eye"]
    assert [image.name for image in bpy.data.images if image.users] == ["RoSy Eye"]


def test_a_change_during_a_bake_counts(tmp_path):
    scene = build(tmp_path)
    BAKE_CACHE.clear()
    stepping = each_step(bake.begin(scene))
    assert isinstance(next(stepping), Call)
    obj("Plain").location.x = 0.7
    for _ in stepping:
        pass
    bpy.context.view_layer.update()
    assert bake_word(scene) == "'Plain' was moved"


@pytest.mark.parametrize("state", ["", "{}", "[1]", '{"look": {}}', "not JSON"])
def test_records_of_other_versions(tmp_path, state):
    scene = build(tmp_path)
    (baked,) = bake(scene)
    scene.rosy.bakes[0].state = state
    (info,) = list_bakes(scene)
    assert (info.stale_reason, info.unknown_reason) == ("", "baked with another version of RoSy")
    scene.rosy.bakes.clear()  # as versions without a camera in their records left it
    record = scene.rosy.bakes.add()
    record.name, record.image, record.material = "Camera", baked.image, baked.material
    (info,) = list_bakes(scene)
    assert info.unknown_reason == "baked with another version of RoSy"
    bake(scene)
    assert bake_word(scene) == ""


def test_a_3d_view(tmp_path, watched):
    scene = build(tmp_path)
    view = perspective_camera(look_at((0, -5, 1), (0, 0, 0)), 30, 20, name=VIEW_NAME)
    (baked,) = bake(scene, cameras=[view])
    assert (baked.camera, tuple(baked.image.size)) == ("3D View", (30, 20))
    obj("Aside").location.x += 1.0
    scene.camera.location.x += 1.0
    bpy.context.view_layer.update()
    assert bake_word(scene) == ""
    obj("In Front").location.x += 0.1
    bpy.context.view_layer.update()
    assert bake_word(scene) == "'In Front' was moved"


def test_a_scene_is_read_again_only_after_changes(tmp_path, watched, monkeypatch):
    scene = build(tmp_path)
    bake(scene)
    reads = []
    read = staleness.SceneState.__init__
    monkeypatch.setattr(
        staleness.SceneState,
        "__init__",
        lambda self, *args: (reads.append(1), read(self, *args))[1],
    )
    for _ in range(3):
        list_bakes(scene, for_panel=True)
    assert len(reads) == 1
    handlers = len(bpy.app.handlers.depsgraph_update_post)
    monkeypatch.setattr(staleness, "TTL_READINGS", 1e6)
    for position in (2.0, 3.0):
        obj("Plain").location.x = position
        bpy.context.view_layer.update()
        (info,) = list_bakes(scene, for_panel=True)
        assert info.stale_reason == ("'Plain' was moved" if len(reads) == 2 else "")
        assert staleness.SCENE_STATES.seconds_to_wait() > 0 or len(reads) == 2
    assert len(bpy.app.handlers.depsgraph_update_post) == handlers
    staleness.SCENE_STATES.clear()
    assert len(bpy.app.handlers.depsgraph_update_post) == handlers - 1
    assert not staleness.SCENE_STATES.seconds_to_wait()

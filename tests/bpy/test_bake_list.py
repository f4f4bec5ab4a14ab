"""The list of pictures: which are compared with what, and when a scene is read again."""

from unittest.mock import Mock

import bpy
from rosy.rosy_addon.jobs.animation import bake_animation
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.scene import staleness
from rosy.rosy_addon.scene.bake_records import list_bakes
from rosy.rosy_addon.scene.pictures import OutputSettings, show_bake
from rosy.rosy_addon.worker.job import Call
from scenes import each_step
from test_up_to_date import animated, build, obj


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
    stepping = each_step(bake.begin(scene))
    assert isinstance(next(stepping), Call)
    obj("Plain").location.x = 0.7
    for _ in stepping:
        pass
    assert list_bakes(scene)[0].stale_reason == "'Plain' was moved"


def test_records_of_other_versions(tmp_path):
    scene, unknown = build(tmp_path), "baked with another version of RoSy"
    (baked,) = bake(scene)
    for state in ("", "{}", "[1]", '{"look": {}}', "not JSON"):
        scene.rosy.bakes[0].state = state
        (info,) = list_bakes(scene)
        assert (info.stale_reason, info.unknown_reason) == ("", unknown)
    scene.rosy.bakes.clear()  # as versions without a camera in their records left it
    record = scene.rosy.bakes.add()
    record.name, record.image, record.material = "Camera", baked.image, baked.material
    (info,) = list_bakes(scene)
    assert info.unknown_reason == unknown
    bake(scene)
    assert list_bakes(scene)[0].stale_reason == ""


def test_a_scene_is_read_again_only_after_changes(tmp_path, monkeypatch):
    monkeypatch.setattr(staleness, "TTL_READINGS", 0.0)
    scene = build(tmp_path)
    bake(scene)
    read = Mock(wraps=staleness.SceneState)
    monkeypatch.setattr(staleness, "SceneState", read)
    for _ in range(3):
        list_bakes(scene, for_panel=True)
    assert read.call_count == 1
    handlers = len(bpy.app.handlers.depsgraph_update_post)
    monkeypatch.setattr(staleness, "TTL_READINGS", 1e6)
    for position in (2.0, 3.0):
        obj("Plain").location.x = position
        bpy.context.view_layer.update()
        (info,) = list_bakes(scene, for_panel=True)
        assert info.stale_reason == ("'Plain' was moved" if read.call_count == 2 else "")
        assert staleness.SCENE_STATES.seconds_to_wait() > 0 or read.call_count == 2
    assert len(bpy.app.handlers.depsgraph_update_post) == handlers
    staleness.SCENE_STATES.clear()
    assert len(bpy.app.handlers.depsgraph_update_post) == handlers - 1
    assert not staleness.SCENE_STATES.seconds_to_wait()

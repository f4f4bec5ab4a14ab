"""The main job from end to end, for every version of Blender: field, picture, strokes, removal."""

import importlib
import inspect
import sys
import typing

import numpy as np
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.core.settings import settings_of
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.jobs.draw_strokes import draw_strokes
from rosy.rosy_addon.scene.bake_records import remove_bakes
from rosy.rosy_addon.scene.stroke_objects import remove_strokes
from rosy.rosy_addon.ui.look_panels import LOOK_PANELS
from scenes import contents, member_vectors, pixels


def test_field_picture_strokes_and_removal(scene, camera, monkey, tmp_path):
    before = contents()
    assert np.linalg.norm(member_vectors(monkey.data), axis=1).min() > 0
    (baked,) = bake(scene)
    assert pixels(baked.image)[..., 3].max() == 1
    svg = draw_strokes(scene, kind="FILE", path=tmp_path / "strokes.svg")
    assert svg.path.read_text().startswith("<?xml")
    drawing = draw_strokes(scene, kind="PENCIL")
    assert drawing.obj.name in scene.objects
    assert remove_strokes(scene) == 1
    remove_bakes(scene)
    assert contents() == before


def test_blender_can_read_the_properties_of_every_operator():
    classes = importlib.import_module("rosy.operators.registration").CLASSES
    for cls in classes:
        # Blender does the same when it registers a class. It prints errors and goes on.
        assert set(inspect.get_annotations(cls)) <= set(typing.get_type_hints(cls))
    assert classes


def test_every_setting_of_a_look_is_in_a_panel():
    assert {setting.panel for setting in settings_of(Look).values()} == {*LOOK_PANELS, ""}


def test_callbacks_of_properties_see_the_names_of_their_module():
    """A function that is written inside an annotation does not."""
    rooms = "operators.registration", "rosy_addon.ui.properties", "rosy_addon.ui.preferences"
    callbacks = [
        value
        for room in rooms
        for cls in importlib.import_module(f"rosy.{room}").CLASSES
        for hint in typing.get_type_hints(cls).values()
        for value in getattr(hint, "keywords", {}).values()
        if inspect.isfunction(value)
    ]
    assert len(callbacks) > 5
    for callback in callbacks:
        assert callback.__globals__ is vars(sys.modules[callback.__module__]), callback

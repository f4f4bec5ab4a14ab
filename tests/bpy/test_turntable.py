"""Turntables of objects of a scene."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.rendering.turntable import turntable_views
from rosy.rosy_addon.scene.read_view import read_lights, read_turntable
from scenes import add_monkey, link


def add_lights():
    for kind, location in (("SUN", (0.0, 0.0, 0.0)), ("POINT", (2.0, -3.0, 1.0))):
        light = link(bpy.data.objects.new(kind, bpy.data.lights.new(kind, kind)))
        light.location, light.rotation_euler = location, (0.5, 0.3, 0.1)


def test_lights_are_those_of_the_scene_in_the_space_of_each_camera(scene, monkey):
    add_lights()
    monkey.rotation_euler.z = 0.4
    add_monkey((4.0, 0.0, 0.0))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    look = Look(light="scene")
    instance, lights = read_turntable(scene, depsgraph, monkey, look)
    np.testing.assert_allclose(instance.matrix, np.array(monkey.matrix_world), atol=1e-6)
    views = list(turntable_views(instance, look, 3, (32, 24), (10.0, 20.0), lights=lights))
    assert len(views) == 3
    for view in views:
        assert view.instances == (instance,) and view.look == look
        expected = read_lights(depsgraph, view.camera.view)
        assert [light.kind for light in view.lights] == ["sun", "point"]
        for light, other in zip(view.lights, expected, strict=True):
            np.testing.assert_allclose(light.vector, other.vector, atol=1e-6)
            assert light.strength == other.strength
    assert read_turntable(scene, depsgraph, monkey, replace(look, light="lamp"))[1] == []

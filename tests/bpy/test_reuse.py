"""What has not changed is not done again, and what has changed is."""

from __future__ import annotations

import numpy as np
import pytest
from rosy.rosy_addon.bake import bake
from rosy.rosy_addon.cache import BAKE_CACHE, Cache, content_hash
from rosy.rosy_addon.compositor import stages
from rosy.rosy_addon.projection import project as projection
from scenes import add_camera, add_field, add_plane, set_vectors


@pytest.fixture(autouse=True)
def empty():
    BAKE_CACHE.clear()
    yield
    BAKE_CACHE.clear()


@pytest.fixture
def done(monkeypatch):
    """The names of the slow steps that were run, in their order."""
    names = []

    def watch(room, name):
        real = getattr(room, name)

        def watched(*arguments):
            names.append(name)
            return real(*arguments)

        monkeypatch.setattr(room, name, watched)

    watch(projection, "project_task")
    watch(stages, "surface_pixel_field")
    watch(stages, "lic_task")
    return names


def drawn(scene):
    return bake(scene)[0].picture.rgba


def drawn_anew(scene):
    BAKE_CACHE.clear()
    return drawn(scene)


def move_vertex(scene, thing):
    thing.data.vertices[100].co.z += 0.2
    thing.data.update()


def turn_field(scene, thing):
    add_field(thing, kind="axis", axis=(0.3, 1.0, 0.2))


def turn_object(scene, thing):
    thing.rotation_euler.z += 0.1


def subdivide(scene, thing):
    thing.modifiers.new("Subdivision", "SUBSURF").levels = 1


def hide_behind_a_plane(scene, thing):
    screen = add_plane("Screen", size=0.5)
    screen.location = (0.3, -2.0, 0.5)


def flatten(scene, thing):
    thing.data.shade_flat()


def move_camera(scene, thing):
    scene.camera.location.x += 0.1


def zoom(scene, thing):
    scene.camera.data.lens += 3


def show_faces(scene, thing):
    scene.rosy.look.display = "flat"


@pytest.mark.parametrize(
    "change",
    [
        move_vertex,
        turn_field,
        turn_object,
        subdivide,
        hide_behind_a_plane,
        flatten,
        move_camera,
        zoom,
        show_faces,
    ],
)
def test_a_change_is_seen(scene, camera, monkey, done, change):
    before = drawn(scene)
    change(scene, monkey)
    done.clear()
    after = drawn(scene)
    assert done == ["project_task", "surface_pixel_field", "lic_task"]
    assert not np.array_equal(before, after)
    np.testing.assert_array_equal(after, drawn_anew(scene))


@pytest.mark.parametrize(
    ("setting", "value", "again"),
    [
        ("gain", 1.0, []),
        ("shading", 0.2, []),
        ("light", "scene", []),
        ("length", 20, ["lic_task"]),
        ("seed", 3, ["lic_task"]),
        ("guiding_angle", 0.4, ["lic_task"]),
        ("noise", "colour", ["lic_task"]),
        ("magnitude", "both", ["lic_task"]),
        ("method", "members", ["lic_task"]),
        ("crease_angle", 0.05, ["surface_pixel_field", "lic_task"]),
        ("supersampling", 2, ["project_task", "surface_pixel_field", "lic_task"]),
    ],
)
def test_a_look_does_again_what_depends_on_it(scene, camera, monkey, done, setting, value, again):
    before = drawn(scene)
    setattr(scene.rosy.look, setting, value)
    done.clear()
    after = drawn(scene)
    assert done == again
    assert not np.array_equal(before, after)
    np.testing.assert_array_equal(after, drawn_anew(scene))


def test_nothing_changed_nothing_done(scene, camera, monkey, done):
    before = drawn(scene)
    done.clear()
    np.testing.assert_array_equal(drawn(scene), before)
    assert not done


def test_two_cameras_are_both_kept(scene, camera, monkey, done):
    other = add_camera("Other", location=(3, -4, 2))
    cameras = [scene.camera, other]
    bake(scene, cameras=cameras)
    done.clear()
    bake(scene, cameras=cameras)
    assert not done


def test_another_object_may_move_alone(scene, camera, monkey, done):
    """What is known of an instance does not go when another changes."""
    plane = add_field(add_plane("Other"), kind="axis")
    bake(scene)
    entries = len(BAKE_CACHE)
    plane.location.z -= 0.5
    bake(scene)
    # Its instance, a G-buffer, a pixel field, and LIC images.
    assert len(BAKE_CACHE) == entries + 4
    set_vectors(plane.data, np.zeros((len(plane.data.polygons), 3)) + (1, 0, 0.5))
    bake(scene)
    # Its field as it was given and as it is drawn, its instance, its corner field, and the same.
    assert len(BAKE_CACHE) == entries + 11


def test_what_is_over_the_limit_is_given_up_oldest_first():
    kept = Cache(max_bytes=10_000)
    for number in range(5):
        kept.put(number, np.zeros(500))
    assert kept.get(0) is not None
    kept.evict_over_limit()
    assert [kept.get(number) is not None for number in range(5)] == [
        True,
        False,
        False,
        False,
        True,
    ]


def test_a_shared_array_counts_once():
    kept = Cache(max_bytes=10_000)
    array = np.zeros(1000)
    for number in range(5):
        kept.put(number, [array, array[:10]])
    kept.evict_over_limit()
    assert len(kept) == 5


def test_digests_tell_apart_what_differs():
    array = np.arange(6.0)
    assert content_hash(array) == content_hash(array.copy())
    others = (
        array.reshape(2, 3),
        array.astype(np.float32),
        array[::-1],
        array + 1e-16 * np.arange(6) ** 2 + np.spacing(array),
    )
    assert len({content_hash(array), *map(content_hash, others)}) == 5
    assert content_hash("ab", "c") != content_hash("a", "bc")
    assert content_hash(None) != content_hash("")

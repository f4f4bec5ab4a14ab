"""Reuse of results: a change runs the stages that it affects, and no others."""

from __future__ import annotations

import weakref

import numpy as np
import pytest
from rosy.rosy_addon.compositor import stages
from rosy.rosy_addon.core.cache import BAKE_CACHE, Cache, content_hash
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.projection import project as projection
from scenes import add_camera, add_field, add_plane, set_vectors


@pytest.fixture(autouse=True)
def empty_cache():
    BAKE_CACHE.clear()
    yield
    BAKE_CACHE.clear()


@pytest.fixture
def run_stages(monkeypatch):
    """The names of the slow steps that were run, in their order."""
    names = []

    def watch(module, name):
        real = getattr(module, name)

        def watched(*arguments, **options):
            names.append(name)
            return real(*arguments, **options)

        monkeypatch.setattr(module, name, watched)

    watch(projection, "project")
    watch(stages, "surface_pixel_field")
    watch(stages, "lic_lengths")
    return names


def draw(scene):
    return bake(scene)[0].picture.rgba


def draw_uncached(scene):
    BAKE_CACHE.clear()
    return draw(scene)


def move_vertex(scene, obj):
    obj.data.vertices[100].co.z += 0.2
    obj.data.update()


def turn_field(scene, obj):
    add_field(obj, kind="axis", axis=(0.3, 1.0, 0.2))


def turn_object(scene, obj):
    obj.rotation_euler.z += 0.1


def subdivide(scene, obj):
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 1


def hide_behind_a_plane(scene, obj):
    screen = add_plane("Screen", size=0.5)
    screen.location = (0.3, -2.0, 0.5)


def flatten(scene, obj):
    obj.data.shade_flat()


def move_camera(scene, obj):
    scene.camera.location.x += 0.1


def zoom(scene, obj):
    scene.camera.data.lens += 3


def show_faces(scene, obj):
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
def test_a_change_runs_all_stages(scene, camera, monkey, run_stages, change):
    before = draw(scene)
    change(scene, monkey)
    run_stages.clear()
    after = draw(scene)
    assert run_stages == ["project", "surface_pixel_field", "lic_lengths"]
    assert not np.array_equal(before, after)
    np.testing.assert_array_equal(after, draw_uncached(scene))


@pytest.mark.parametrize(
    ("setting", "value", "stages_run"),
    [
        ("gain", 1.0, []),
        ("shading", 0.2, []),
        ("light", "scene", []),
        ("length", 20, ["lic_lengths"]),
        ("seed", 3, ["lic_lengths"]),
        ("guiding_angle", 0.4, ["lic_lengths"]),
        ("hue", "noise", ["lic_lengths"]),
        ("hue", "magnitude", []),
        ("magnitude_length", True, ["lic_lengths"]),
        ("method", "members", ["lic_lengths"]),
        ("crease_angle", 0.05, ["surface_pixel_field", "lic_lengths"]),
        ("supersampling", 2, ["project", "surface_pixel_field", "lic_lengths"]),
    ],
)
def test_a_setting_runs_the_stages_that_depend_on_it(
    scene, camera, monkey, run_stages, setting, value, stages_run
):
    before = draw(scene)
    setattr(scene.rosy.look, setting, value)
    run_stages.clear()
    after = draw(scene)
    assert run_stages == stages_run
    assert not np.array_equal(before, after)
    np.testing.assert_array_equal(after, draw_uncached(scene))


def test_no_change_runs_no_stage(scene, camera, monkey, run_stages):
    before = draw(scene)
    run_stages.clear()
    np.testing.assert_array_equal(draw(scene), before)
    assert not run_stages


def test_results_of_two_cameras_are_kept(scene, camera, monkey, run_stages):
    other = add_camera("Other", location=(3, -4, 2))
    cameras = [scene.camera, other]
    bake(scene, cameras=cameras)
    run_stages.clear()
    bake(scene, cameras=cameras)
    assert not run_stages


def test_a_change_adds_only_results_of_its_object(scene, camera, monkey, run_stages):
    """The results of other instances stay in the cache."""
    plane = add_field(add_plane("Other"), kind="axis")
    bake(scene)
    entries = len(BAKE_CACHE)
    plane.location.z -= 0.5
    bake(scene)
    # A G-buffer, a pixel field, noise, and LIC images.
    assert len(BAKE_CACHE) == entries + 4
    set_vectors(plane.data, np.zeros((len(plane.data.polygons), 3)) + (1, 0, 0.5))
    bake(scene)
    # Its field, its corner field, and those four.
    assert len(BAKE_CACHE) == entries + 10


def test_the_least_recently_used_entries_are_evicted():
    cache = Cache(max_bytes=10_000)
    for number in range(5):
        cache.put(number, np.zeros(500))
    assert cache.get(0) is not None
    cache.evict_over_limit()
    assert [cache.get(number) is not None for number in range(5)] == [
        True,
        False,
        False,
        False,
        True,
    ]


def test_evicted_entries_are_not_kept_alive():
    """Keys hold G-buffers and meshes."""

    class Mesh:
        pass

    cache, mesh = Cache(max_bytes=0), Mesh()
    cache.put(mesh, np.zeros(10))
    reference = weakref.ref(mesh)
    del mesh
    cache.evict_over_limit()
    assert not len(cache) and reference() is None


def test_a_shared_array_counts_once():
    cache = Cache(max_bytes=10_000)
    array = np.zeros(1000)
    for number in range(5):
        cache.put(number, [array, array[:10]])
    cache.evict_over_limit()
    assert len(cache) == 5


def test_hashes_of_different_contents_differ():
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

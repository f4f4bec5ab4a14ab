"""Planes in front of cameras: keys, which explain pictures, and backdrops, the paper behind them."""

import bpy
import numpy as np
import pytest
from objects import add_camera, aim, link
from rosy.rosy_addon.annotation.key_contents import PictureKey
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.core.color import from_hex, to_linear
from rosy.rosy_addon.jobs.animation import bake_animation
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.scene.bake_records import baked_objects, list_bakes, remove_bakes
from rosy.rosy_addon.scene.camera_planes import update_backdrops
from rosy.rosy_addon.scene.keys import round_length, text_triangles, update_keys
from rosy.rosy_addon.scene.look_properties import apply_look
from rosy.rosy_addon.scene.pictures import OutputSettings, show_bake
from scenes import contents, pixels, render

DOTS = {"singularity_dots": "visible", "supersampling": 2}
LOOK = Look(hue="magnitude", ink="hatch", paper_color="#c08040", **DOTS)


def planes(kind):
    return [obj for obj in bpy.data.objects if obj.get(f"rosy_{kind}")]


def keys():
    return planes("key")


def key_image(obj):
    nodes = obj.active_material.node_tree.nodes
    return next(node.image for node in nodes if node.bl_idname == "ShaderNodeTexImage")


@pytest.fixture
def colored(monkey, camera, scene):
    """A scene whose look has colors by magnitude, dots, and brown paper."""
    apply_look(scene.rosy, LOOK)
    scene.render.resolution_x, scene.render.resolution_y = 320, 240
    return scene


@pytest.fixture
def keyed(colored):
    """The same scene, with keys."""
    colored.rosy.key = True
    return colored


# --- text ----------------------------------------------------------------------------------------


def test_text_is_read_without_a_trace(scene):
    def width(text):
        return text_triangles(text)[..., 0].max(initial=0)

    before = contents()
    triangles = text_triangles("Magnitude ≥ ×10⁻⁵")
    assert len(triangles) > 500 and triangles[..., 0].min() == 0
    assert width("HH") > 2 * width("H") > 1
    assert width("") == width(" ") == 0
    assert contents() == before


# --- the plane -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "update"), [("key", update_keys), ("backdrop", update_backdrops)])
def test_the_switch_shows_and_hides_the_plane(colored, kind, update):
    before = contents()
    setattr(colored.rosy, kind, False)
    bake(colored)
    baked = contents()
    assert not planes(kind)
    setattr(colored.rosy, kind, True)
    (obj,) = planes(kind)
    assert obj.parent == colored.camera and obj.hide_select and not obj.visible_shadow
    setattr(colored.rosy, kind, False)
    assert contents() == baked
    setattr(colored.rosy, kind, True)
    bake(colored)
    assert len(planes(kind)) == 1
    remove_bakes(colored)
    update(colored)
    assert contents() == before


@pytest.mark.parametrize("kind", ["key", "backdrop"])
def test_nothing_is_left_of_a_plane_that_the_user_has_deleted(colored, kind):
    before = contents()
    setattr(colored.rosy, kind, True)
    bake(colored)
    bpy.data.objects.remove(*planes(kind))
    remove_bakes(colored)
    assert contents() == before


def test_the_image_of_a_key(keyed):
    bake(keyed)
    image = key_image(*keys())
    assert image.name == "RoSy Key Camera" and image.packed_file and tuple(image.size) == (320, 240)
    keyed.rosy.key_caption = "A head"
    assert len(keys()) == 1 and len([i for i in bpy.data.images if "Key" in i.name]) == 1


def test_a_key_is_not_listed_among_the_pictures(keyed):
    bake(keyed)
    assert [info.camera for info in list_bakes(keyed)] == ["Camera"]
    assert baked_objects(keyed) == [bpy.data.objects["Suzanne"]]
    assert remove_bakes(keyed) == (1, 1)
    assert not keys()


def test_a_panoramic_camera_has_no_key(keyed):
    bake(keyed)
    keyed.camera.data.type = "PANO"
    keyed.rosy.key_size = 12
    assert not keys()


def test_animations_have_numbers_only_with_a_range(keyed, tmp_path):
    settings = OutputSettings(folder=tmp_path)
    for top, expected in ((0.0, None), (0.5, 0.5)):
        keyed.rosy.look.color_range = 0.0, top
        bake_animation(keyed, range(1, 3), settings=settings)
        key = PictureKey.from_json(keyed.rosy.bakes[0].key)
        assert key.color_scale.high == expected
        assert key.indices and all(entry.count is None for entry in key.indices)
        (obj,) = keys()
        assert obj.parent == keyed.camera


def test_the_key_is_that_of_the_picture_that_is_shown(keyed, tmp_path):
    bake(keyed)
    bake_animation(keyed, range(1, 2), settings=OutputSettings(folder=tmp_path))
    animated = pixels(key_image(keys()[0]))
    show_bake(keyed, "Camera")
    still = pixels(key_image(keys()[0]))
    assert (still != animated).any()
    bake(keyed)
    np.testing.assert_array_equal(pixels(key_image(keys()[0])), still)
    show_bake(keyed, keyed.name)
    np.testing.assert_array_equal(pixels(key_image(keys()[0])), animated)


def test_every_camera_has_its_own(keyed):
    other = add_camera("Other", (4.0, 0.0, 0.0))
    bake(keyed, cameras=[keyed.camera, other])
    assert {obj.parent for obj in keys()} == {keyed.camera, other}
    assert len({key_image(obj) for obj in keys()}) == 2


# --- scale bars ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("system", "scale", "largest", "length", "label"),
    [
        ("NONE", 1.0, 3.7, 2.0, "2"),
        ("METRIC", 1.0, 0.7, 0.5, "50 cm"),
        ("METRIC", 0.001, 37.0, 20.0, "2 cm"),
        ("IMPERIAL", 1.0, 1.0, 2 * 0.3048, "2'"),
        ("IMPERIAL", 1.0, 0.14, 5 * 0.0254, '5"'),
    ],
)
def test_scale_bars_have_round_lengths(scene, system, scale, largest, length, label):
    scene.unit_settings.system, scene.unit_settings.scale_length = system, scale
    found = round_length(largest, scene.unit_settings)
    assert found == (pytest.approx(length), label)


def test_only_orthographic_cameras_have_a_scale_bar(keyed):
    keyed.rosy.key_bar = keyed.rosy.key_legend = False
    bake(keyed)
    assert not keys(), "a key that shows nothing is not made"
    for caption in ("A head", ""):
        keyed.rosy.key_caption = caption
        assert len(keys()) == bool(caption)
    keyed.camera.data.type, keyed.camera.data.ortho_scale = "ORTHO", 8.0
    bake(keyed)
    (obj,) = keys()
    opaque = pixels(key_image(obj))[..., 3] > 0.99
    # 1 m is 320 / 8 pixels.
    assert np.count_nonzero(opaque, axis=1).max() == pytest.approx(40, abs=1)


# --- renders -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_renders_show_the_image_in_the_frame(colored, tmp_path, kind):
    data = colored.camera.data
    data.type, data.ortho_scale, data.shift_x = kind, 6.0, 0.1
    colored.camera.scale = (2.0, 0.5, 3.0)
    aim(colored.camera, (3.0, -9.0, 5.0))
    colored.rosy.key_caption = "A head with its field"
    colored.rosy.key_size = 16.0
    colored.rosy.key = True
    bake(colored)
    (obj,) = keys()
    expected = pixels(key_image(obj))
    rendered = render(colored, tmp_path / "render.exr")
    opaque = expected[..., 3] > 0.99
    for axis in (0, 1):
        opaque &= np.roll(opaque, 1, axis) & np.roll(opaque, -1, axis)
    assert opaque.sum() > 500
    difference = np.abs(rendered[opaque][:, :3] - to_linear(expected[opaque][:, :3]))
    # Samples at the very edge of a pixel may meet the next one.
    assert np.quantile(difference, 0.995) < 2e-3 and difference.max() < 0.05
    np.testing.assert_allclose(rendered[opaque][:, 3], 1, atol=1e-3)


# --- backdrops -----------------------------------------------------------------------------------


def without_paper(scene):
    apply_look(scene.rosy, Look())


def clear_paper(scene):
    apply_look(scene.rosy, LOOK.with_settings({"paper_color": "#ffffff00"}))


def over_material(scene):
    scene.rosy.over_material = True


def transparent_renders(scene):
    scene.render.film_transparent = True


@pytest.mark.parametrize("change", [without_paper, clear_paper, over_material, transparent_renders])
def test_what_shows_through_has_no_backdrop(colored, change):
    change(colored)
    bake(colored)
    assert not planes("backdrop")


def test_a_sheared_camera_has_no_backdrop(colored):
    """Its parent was scaled after the bake. The switch of the panel ended in a traceback."""
    bake(colored)
    parent = link(bpy.data.objects.new("parent", None))
    parent.scale, colored.camera.parent = (1, 1, 3), parent
    bpy.context.view_layer.update()
    update_backdrops(colored)
    assert not planes("backdrop")


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_renders_show_paper_all_over_the_background(colored, tmp_path, kind):
    data = colored.camera.data
    data.type, data.ortho_scale, data.shift_x, data.shift_y = kind, 6.0, 0.3, 0.1
    colored.camera.scale = (2.0, 0.5, 3.0)
    (result,) = bake(colored)
    rendered = render(colored, tmp_path / "render.exr")
    background = pixels(result.image)[..., 3] == 0
    for axis in (0, 1):  # without the pixels at the edge of the object
        background &= np.roll(background, 1, axis) & np.roll(background, -1, axis)
    assert 0.3 < background.mean() < 0.95
    paper = [*to_linear(from_hex(LOOK.paper_color)), 1.0]
    np.testing.assert_allclose(rendered[background] - paper, 0, atol=1e-3)

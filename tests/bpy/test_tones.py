"""Sources of tone in Blender: attributes, images, reference renders, shadows and occlusion; and colors of numbers."""

import os
import tracemalloc

import bpy
import numpy as np
import pytest
from harness.blender_data import attribute_values
from objects import add_field, add_mesh, add_uv, set_attribute
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.core.color import to_linear
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.jobs.animation import bake_animation
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.jobs.bake_texture import bake_texture
from rosy.rosy_addon.scene.bake_records import list_bakes
from rosy.rosy_addon.scene.computed_attributes import OCCLUSION_ATTRIBUTE, store_occlusion
from rosy.rosy_addon.scene.look_inputs import ReadRequest, image_luminance, load_reference
from rosy.rosy_addon.scene.pictures import read_output_settings
from rosy.rosy_addon.scene.read_view import read_turntable
from rosy.rosy_addon.scene.scene_reader import SceneReader, read_scene
from scenes import depsgraph, expect_error, read_live
from test_bad_input import assert_refused

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def add_image(name="Board", values=((0.0, 1.0), (0.5, 0.25)), *, as_float=False, space=None):
    """Create an image of gray values, rows from the bottom."""
    values = np.asarray(values, dtype=np.float32)
    height, width = values.shape
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=as_float)
    if space is not None:
        image.colorspace_settings.name = space
    rgba = np.ones((height, width, 4), dtype=np.float32)
    rgba[..., :3] = values[..., None]
    image.pixels.foreach_set(rgba.ravel())
    return image


def save_picture(path, values):
    """Write a .png file of display values, rows from the bottom."""
    image = add_image("aside", values)
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


def tone_of(tone, attribute="", name="Plane"):
    scene_data = read_scene(depsgraph(), None, ReadRequest("error", tone, attribute))
    return scene_data.instances[[owner.name for owner in scene_data.objects].index(name)].tone


# --- attributes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("domain", ["POINT", "FACE", "CORNER"])
@pytest.mark.parametrize("kind", ["FLOAT", "INT", "FLOAT_COLOR", "BYTE_COLOR"])
def test_attributes_of_all_domains(wall, domain, kind):
    mesh = wall.data
    count = {"POINT": len(mesh.vertices), "FACE": 4, "CORNER": len(mesh.loops)}[domain]
    numbers = np.arange(count) if kind == "INT" else (np.arange(count) + 0.5) / count
    values = expected = numbers
    if "COLOR" in kind:
        values = np.stack([numbers, 1 - numbers, 0.3 + 0 * numbers, 1 + 0 * numbers], axis=1)
        expected = values[:, :3] @ LUMINANCE
    set_attribute(mesh, values, "Ink", domain, kind)
    corner = np.array([loop.vertex_index for loop in mesh.loops])
    face = np.repeat(np.arange(4), 4)
    element = {"POINT": corner, "FACE": face, "CORNER": np.arange(len(corner))}[domain]
    tone = tone_of("attribute", "Ink").values
    tolerance = 0.01 if kind == "BYTE_COLOR" else 1e-6
    np.testing.assert_allclose(tone[:, 0], expected[element], atol=tolerance)


def test_the_default_is_the_active_color_attribute(wall):
    set_attribute(wall.data, np.full((9, 4), 0.2), "Some", "POINT", "FLOAT_COLOR")
    set_attribute(wall.data, np.full((9, 4), 0.7), "Paint", "POINT", "FLOAT_COLOR")
    wall.data.color_attributes.active_color_name = "Paint"
    tone = tone_of("attribute").values
    np.testing.assert_allclose(tone, 0.7, atol=1e-6)


def test_objects_without_the_attribute_have_no_tone(wall, monkey):
    set_attribute(wall.data, np.zeros(9), "Ink", "POINT", "FLOAT")
    assert tone_of("attribute", "Ink", "Suzanne") is None


def test_missing_attributes(wall, monkey):
    set_attribute(wall.data, np.zeros(9), "Paint", "POINT", "FLOAT")
    with pytest.raises(RosyError) as caught:
        read_scene(depsgraph(), None, ReadRequest("error", "attribute", "Pain"))
    for name in ("'Pain'", "'Paint'", "'Plane'", "'Suzanne'"):
        assert name in str(caught.value)
    expect_error("no color attribute", tone_of, "attribute")


def test_unsuitable_attributes(wall):
    expect_error("object 'Plane', attribute 'rosy': expected", tone_of, "attribute", "rosy")
    set_attribute(wall.data, np.full(9, np.nan), "Ink", "POINT", "FLOAT")
    expect_error("attribute 'Ink': has values that are not finite", tone_of, "attribute", "Ink")


# --- images ---------------------------------------------------------------------------------------


def test_luminance_of_images():
    values = np.array([[0.0, 1.0], [0.5, 0.25]])
    byte_values = image_luminance(add_image(values=values))
    np.testing.assert_allclose(byte_values, to_linear(np.rint(values * 255) / 255), atol=1e-3)
    linear = image_luminance(add_image("deep", values, as_float=True))
    np.testing.assert_allclose(linear, values, atol=1e-6)
    data = add_image("data", values, space="Non-Color")
    np.testing.assert_allclose(image_luminance(data), values, atol=3e-3)
    clear = bpy.data.images.new("clear", 2, 2, alpha=True)
    clear.pixels.foreach_set(np.zeros(16, dtype=np.float32))
    np.testing.assert_allclose(image_luminance(clear), 1)


def test_memory_of_a_large_image(monkeypatch):
    """The need is estimated before pixels are read, within a factor of two of the measured one."""
    image = bpy.data.images.new("large", 2000, 1000)
    assert len(image.pixels)
    tracemalloc.start()
    image_luminance(image)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    monkeypatch.setattr("rosy.rosy_addon.core.memory.available_memory", lambda: 2 * peak)
    image_luminance(image)
    monkeypatch.setattr("rosy.rosy_addon.core.memory.available_memory", lambda: peak // 2)
    expect_error("image 'large': a tone of 2000 x 1000 pixels needs", image_luminance, image)


def test_missing_images_and_uv_maps(wall):
    expect_error("'Plane': choose an image for the tone", tone_of, "image")
    wall.rosy.tone_image = add_image()
    expect_error("object 'Plane' has no UV map: unwrap", tone_of, "image")
    add_uv(wall.data)
    tone = tone_of("image")
    expected = to_linear(np.array([[0, 1], [128 / 255, 64 / 255]]))
    np.testing.assert_allclose(tone.image, expected, atol=1e-3)
    assert tone.values.min() == 0 and tone.values.max() == 1
    wall.rosy.tone_uv_map = "Other"
    expect_error("no UV map 'Other'", tone_of, "image")


# --- pictures -------------------------------------------------------------------------------------

PICTURE = Look(ink="hatch", tone="picture", line_width=2.0)


def test_pictures_from_files(scene, wall, tmp_path):
    values = np.random.default_rng(1).random((32, 32))
    save_picture(tmp_path / "shot.png", values)
    scene.rosy.tone_picture = str(tmp_path / "shot.png")
    images = set(bpy.data.images)
    reference = load_reference(scene, depsgraph(), scene.camera)
    expected = to_linear(np.rint(values * 255) / 255)
    np.testing.assert_allclose(reference.luminance, expected, atol=2e-3)
    assert set(bpy.data.images) == images


def test_unsuitable_pictures(scene, wall, tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    os.mkfifo(tmp_path / "pipe.png")
    save_picture(tmp_path / "wide.png", np.zeros((16, 32)))
    for path, *words in (
        ("", "choose a file"),
        (tmp_path / "none.png", "none.png"),
        (tmp_path / "text.png", "text.png"),
        (tmp_path / "pipe.png", "pipe.png: cannot be read: it is not a regular file"),
        (tmp_path / "wide.png", "wide.png", "32 x 16", "128 x 128"),
    ):
        scene.rosy.tone_picture = str(path)
        assert_refused(*words, look=PICTURE, size=(64, 64))


def test_animations_take_the_picture_of_each_frame(scene, wall, tmp_path):
    for frame, value in ((1, 0.95), (2, 0.3)):
        save_picture(tmp_path / f"shot_{frame:03d}.png", np.full((16, 16), value))
    scene.rosy.tone_picture = str(tmp_path / "shot_###.png")
    scene.rosy.store, scene.rosy.directory = "SAVED", str(tmp_path / "out")
    settings = read_output_settings(scene)

    def run():
        results = bake_animation(
            scene, [1, 2], look=PICTURE, size=(128, 128), settings=settings, show=False
        )
        return results[0].rendered

    assert run() == (1, 2)
    first, second = (path.read_bytes() for path in sorted((tmp_path / "out").glob("*.png")))
    assert first != second
    # If the picture of a frame changes, only this frame is drawn again.
    assert run() == ()
    save_picture(tmp_path / "shot_002.png", np.full((16, 16), 0.6))
    assert run() == (2,)


# --- requests, shadows and occlusion --------------------------------------------------------------


@pytest.mark.parametrize("kind", ["tone", "numbers"])
def test_a_live_view_reads_values_again_when_they_change(wall, kind):
    request_for_ink = ReadRequest(color_attribute="Ink")
    if kind == "tone":
        request_for_ink = ReadRequest("error", "attribute", "Ink")

    def values_of(mesh):
        return mesh.color_values if kind == "numbers" else mesh.tone and mesh.tone.values

    set_attribute(wall.data, np.zeros(9), "Ink", "POINT", "FLOAT")
    reader = SceneReader()
    first, second = (read_live(reader, request_for_ink)[0].instance for _ in range(2))
    assert second is first and not values_of(first).any()
    wall.data.attributes["Ink"].data.foreach_set("value", np.ones(9, dtype=np.float32))
    wall.data.update()
    reader.invalidate({"Plane"})
    (changed,) = read_live(reader, request_for_ink)
    assert changed.instance is not first and values_of(changed.instance).all()
    (without,) = read_live(reader)
    assert values_of(without.instance) is None


def test_occlusion_is_stored_and_drawn(scene, wall):
    floor = add_mesh("Floor", [(-9, 0, -1), (9, 0, -1), (9, -9, -1), (-9, -9, -1)], [(3, 2, 1, 0)])
    add_field(floor, "axis", 2, (1.0, 0.0, 0.0))
    store_occlusion(depsgraph(), [wall], direction_count=64)
    attribute = wall.data.attributes[OCCLUSION_ATTRIBUTE]
    assert (attribute.domain, attribute.data_type) == ("CORNER", "FLOAT")
    assert OCCLUSION_ATTRIBUTE not in floor.data.attributes
    values = attribute_values(attribute)
    corner = np.array([loop.vertex_index for loop in wall.data.loops])
    height = np.array([wall.data.vertices[index].co.z for index in corner])
    # At the edge with the floor, which is practically infinite, half of the sky is visible.
    assert values[height == -1].mean() == pytest.approx(0.5, abs=0.05)
    assert values[height == 1].mean() > values[height == 0].mean() > 0.55
    assert tone_of("attribute", OCCLUSION_ATTRIBUTE) is not None
    # Storing it again replaces it.
    store_occlusion(depsgraph(), [wall], direction_count=16)
    assert sum(a.name.startswith(OCCLUSION_ATTRIBUTE) for a in wall.data.attributes) == 1


def test_occlusion_of_meshes_with_new_faces(scene, wall):
    wall.modifiers.new("Subdivision", "SUBSURF").subdivision_type = "SIMPLE"
    store_occlusion(depsgraph(), [wall], direction_count=16)
    assert len(wall.data.attributes[OCCLUSION_ATTRIBUTE].data) == 16
    assert len(tone_of("attribute", OCCLUSION_ATTRIBUTE).values) == 64


def test_occlusion_does_not_replace_other_attributes(scene, wall):
    set_attribute(wall.data, np.arange(9), OCCLUSION_ATTRIBUTE, "POINT", "FLOAT")
    message = "mesh 'Plane' already has an attribute 'Occlusion'"
    expect_error(message, store_occlusion, depsgraph(), [wall], direction_count=4)
    assert wall.data.attributes[OCCLUSION_ATTRIBUTE].data[3].value == 3


# --- numbers as colors ----------------------------------------------------------------------------


def set_values(mesh, values, name="Angle"):
    set_attribute(mesh, values, name, kind="FLOAT")


def values_of(name, obj):
    scene_data = read_scene(depsgraph(), None, ReadRequest(color_attribute=name))
    return scene_data.instances[scene_data.objects.index(obj)].color_values


def test_numbers_that_are_not_finite_are_none(wall, monkey):
    set_values(wall.data, [np.nan, np.inf, 2.0, 3.0])
    expected = np.repeat([np.nan, np.nan, 2.0, 3.0], 4)
    np.testing.assert_array_equal(values_of("Angle", wall), expected)
    assert values_of("Angle", monkey) is None


def test_mistakes_are_one_line_that_lists_the_attributes(wall):
    set_values(wall.data, np.zeros(4), name="Error")
    only = "'Error'$"
    expect_error(f"^'Plane': there is no attribute 'Angel' .*only {only}", values_of, "Angel", wall)
    expect_error(f"^'Plane': choose an attribute for the colors.*: {only}", values_of, "", wall)
    expect_error("object 'Plane', attribute 'rosy': expected a number", values_of, "rosy", wall)


@pytest.fixture
def colored(scene, wall):
    """The wall with a number on each face, drawn in flat colors."""
    set_values(wall.data, [0.0, 1.0, 2.0, np.nan])
    look = scene.rosy.look
    look.hue, look.gain, look.shading, scene.rosy.color_attribute = "values", 0.0, 0.0, "Angle"
    return wall


def test_turntables_have_the_numbers(scene, colored):
    instance, _ = read_turntable(scene, depsgraph(), colored, Look(hue="values"))
    assert np.isfinite(instance.color_values).sum() == 12


def test_textures(scene, colored):
    add_uv(colored.data)
    scene.rosy.texture_size, scene.rosy.texture_margin = 64, 0
    bake_texture(scene, [colored])
    (info,) = list_bakes(scene)
    assert info.stale_reason == ""
    set_values(colored.data, [0.0, 1.5, 2.0, 0.0])
    (info,) = list_bakes(scene)
    assert "'Plane' was changed" in info.stale_reason
    bake_texture(scene, [colored])
    scene.rosy.color_attribute = ""
    expect_error("choose an attribute", bake_texture, scene, [colored])
    # The thresholds of hatching have no color.
    scene.rosy.look.ink = "hatch"
    bake_texture(scene, [colored])


def test_relit_hatching_needs_no_numbers(scene, colored):
    scene.rosy.color_attribute = "none"
    scene.rosy.look.ink = "hatch"
    expect_error("no attribute 'none'", bake, scene)
    scene.rosy.relight = True
    bake(scene)

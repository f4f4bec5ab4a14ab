"""The panel's "Up to date" is true: a table of changes, each of which is baked again.

A change either changes what the next bake gives, and the panel says so, or neither.
"""

from functools import partial
from pathlib import Path

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix
from objects import (
    add_camera,
    add_field,
    add_instance,
    add_light,
    add_plane,
    animate,
    link,
    set_attribute,
)
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.gpu.select import automatic_device
from rosy.rosy_addon.image_io.png import png_bytes
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.projection.camera import look_at, perspective_camera
from rosy.rosy_addon.scene import staleness
from rosy.rosy_addon.scene.bake_records import list_bakes
from rosy.rosy_addon.scene.cameras import VIEW_NAME
from scenes import empty_scene, pixels

SIZE = 40


def build(tmp_path):
    """Build the scene of the table: what may be changed in it, by name."""
    scene = empty_scene(SIZE)
    scene.camera = add_camera("Camera", (0.0, -5.0, 0.5))
    parent = link(bpy.data.objects.new("Parent", None))
    sheet = add_field(add_plane("Sheet", size=0.9, cuts=4), kind="axis")
    sheet.parent = parent
    sheet.shape_key_add(name="Basis")
    key = sheet.shape_key_add(name="Bent")
    for point in key.data:
        point.co.y += point.co.x**2
    sheet.modifiers.new("Wave", "WAVE").show_viewport = False
    plain = add_field(add_plane("Plain", size=0.4, cuts=2), kind="axis")
    plain.location = (0.9, 0.0, 0.9)
    add_plane("In Front", size=0.25).location = (-0.4, -1.0, 0.2)
    add_plane("Behind", size=3.0).location = (0.0, 2.0, 0.0)
    add_plane("Aside", size=0.2).location = (30.0, -1.0, 0.0)
    add_light("Key", "POINT", 300.0, (2.0, -3.0, 3.0))
    scene.rosy.directory, scene.rosy.look.light = str(tmp_path), "headlight"
    return scene


def obj(name):
    return bpy.data.objects[name]


def deferred(function):
    """Decorator: called with all arguments but the first, the function returns a function of the first."""
    return lambda *others, **options: lambda first: function(first, *others, **options)


def scene_lights(scene):
    scene.rosy.look.light, scene.rosy.look.shading = "scene", 1.0


def shadows(scene):
    scene_lights(scene)
    scene.rosy.look.shadows = True


def own_look_on_a_card(scene):
    """Pictures of several looks are drawn by the processor."""
    obj("Plain").rosy.preset, scene.rosy.device = "engraving", "GPU"


def tone(scene):
    scene.rosy.look.tone, scene.rosy.tone_attribute = "attribute", "dark"
    add_tone()


def add_tone(value=0.5):
    for name in ("Sheet", "Plain"):
        mesh = obj(name).data
        set_attribute(mesh, np.full(len(mesh.vertices), value), "dark", "POINT", "FLOAT")


def colors(scene):
    look = scene.rosy.look
    look.hue, look.color_range, scene.rosy.color_attribute = "values", (0.0, 1.0), "dark"
    add_tone()


def tone_and_lights(scene):
    tone(scene)
    scene_lights(scene)


def tone_of_one_and_lights(scene):
    tone_and_lights(scene)
    mesh = obj("Plain").data
    mesh.attributes.remove(mesh.attributes["dark"])
    mesh.update()


def tone_image(scene):
    scene.rosy.look.tone = "image"
    image = bpy.data.images.new("Tone", 4, 4)
    for name in ("Sheet", "Plain"):
        obj(name).data.uv_layers.new(name="UVMap")
        obj(name).rosy.tone_image = image


@deferred
def write_reference(scene, value):
    rgba = np.ones((SIZE, SIZE, 4), dtype=np.float32)
    rgba[: SIZE // 2, :, :3] = value
    Path(scene.rosy.tone_picture).write_bytes(png_bytes(rgba))


def tone_picture(scene):
    scene.rosy.look.tone = "picture"
    scene.rosy.tone_picture = scene.rosy.directory + "/render.png"
    write_reference(0.3)(scene)


def paint_tone(scene):
    image = bpy.data.images["Tone"]
    image.pixels[:] = [0.7] * len(image.pixels)
    image.update()


def subdivided(scene):
    obj("Plain").modifiers.new("Subdivision", "SUBSURF")


def animated(scene):
    animate(obj("Plain"), "location", {1: (0.9, 0.0, 0.9), 11: (0.9, 0.0, 1.9)})
    scene.frame_set(1)


def tracked(scene):
    target = link(bpy.data.objects.new("Target", None))
    scene.camera.constraints.new("TRACK_TO").target = target


def instanced(scene):
    collection = bpy.data.collections.new("Copies")
    collection.objects.link(obj("Plain"))
    add_instance(collection, (-1.6, 0.0, 0.0)).name = "Copies"


def relit(scene):
    """Hatching by the light of the scene, whatever the light is."""
    scene.rosy.look.ink, scene.rosy.look.light, scene.rosy.relight = "hatch", "scene", True


@deferred
def move(scene, name, *offset):
    obj(name).matrix_world = Matrix.Translation(offset) @ obj(name).matrix_world


@deferred
def put(scene, path, value):
    """Set a property, given by its path from the scene or, after an object's name, from it."""
    owner, _, rest = path.partition(":")
    target = obj(owner) if rest else scene
    parent, _, name = (rest or owner).rpartition(".")
    setattr(target.path_resolve(parent) if parent else target, name, value)


bend = partial(put, 'Sheet:data.shape_keys.key_blocks["Bent"].value')
SUBDIVISION, WAVE = 'Plain:modifiers["Subdivision"]', 'Sheet:modifiers["Wave"]'
hatched = put("rosy.look.ink", "hatch")
recolor_key = put("Key:data.color", (1.0, 0.2, 0.2))


@deferred
def add_occluder(scene, x):
    add_plane("Wall", size=0.3).location = (x, -1.5, 0.1)


def glaze(scene):
    """Give the object in front a material through which one sees."""
    glass = bpy.data.materials.new("Glass")
    glass.use_nodes = True
    glass.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1.0
    obj("In Front").data.materials.append(glass)


def add_field_object(scene):
    add_field(add_plane("New", size=0.3, cuts=2), kind="axis").location = (-0.9, -0.2, -0.9)


def delete(name):
    return lambda scene: bpy.data.objects.remove(obj(name))


def add_fill(scene):
    add_light("Fill", "SUN", 2.0).rotation_euler.x = 1.0


@deferred
def edit_mode(scene, name, *, and_back=False):
    bpy.context.view_layer.objects.active = obj(name)
    bpy.ops.object.mode_set(mode="EDIT")
    if and_back:
        bpy.ops.object.mode_set(mode="OBJECT")


def move_vertex_in_edit_mode(scene):
    edit_mode("Plain")(scene)
    edited = bmesh.from_edit_mesh(obj("Plain").data)
    edited.verts.ensure_lookup_table()
    edited.verts[0].co.x -= 0.15
    bmesh.update_edit_mesh(obj("Plain").data)


def move_vertex(scene):
    obj("Plain").data.vertices[0].co.x -= 0.15


def write_field(scene):
    mesh = obj("Plain").data
    set_attribute(mesh, np.tile((1.0, 0.0, 1.0), (len(mesh.polygons), 1)))


def remove_field(scene):
    mesh = obj("Plain").data
    mesh.attributes.remove(mesh.attributes["rosy"])


def rename_attribute(scene):
    mesh = obj("Plain").data
    mesh.attributes["rosy"].name = "direction"
    mesh.rosy.attribute = "direction"
    mesh.update()


def other_attribute(scene):
    obj("Plain").data.attributes.new("rosy_weight", "FLOAT", "FACE")


@deferred
def shade_smooth(scene, name):
    mesh = obj(name).data
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    mesh.update()


@deferred
def exclude(scene, name):
    collection = bpy.data.collections.new("Away")
    scene.collection.children.link(collection)
    collection.objects.link(obj(name))
    scene.collection.objects.unlink(obj(name))
    bpy.context.view_layer.layer_collection.children["Away"].exclude = True


def there_and_back(scene):
    obj("Plain").location.x += 0.5
    bake_word(scene)
    obj("Plain").location.x -= 0.5
    obj("Plain").location.x = 0.9


#: The change, what is prepared before the first bake, and the word of the panel; "" if the picture
#: stays the same.
TABLE = {
    # objects
    "shape key": (bend(0.5), None, "'Sheet' was changed"),
    "modifier switched on": (put(f"{WAVE}.show_viewport", True), None, "'Sheet' was changed"),
    "modifier setting": (put(f"{SUBDIVISION}.levels", 2), subdivided, "'Plain' was changed"),
    "render setting of a modifier": (put(f"{SUBDIVISION}.render_levels", 4), subdivided, ""),
    "object moved": (move("Plain", 0.1, 0.0, 0.0), None, "'Plain' was moved"),
    "object moved there and back": (there_and_back, None, ""),
    "parent moved": (move("Parent", 0.1, 0.0, 0.0), None, "'Sheet' was moved"),
    "vertex moved": (move_vertex, None, "mesh or field of 'Plain'"),
    "vertex moved in edit mode": (move_vertex_in_edit_mode, None, "'Plain' was changed"),
    "edit mode": (edit_mode("Plain"), None, ""),
    "edit mode and back, shape keys": (edit_mode("Sheet", and_back=True), None, ""),
    "edit mode and back, modifier": (edit_mode("Plain", and_back=True), subdivided, ""),
    "field written": (write_field, None, "mesh or field of 'Plain'"),
    "field removed": (remove_field, None, "'Plain'"),
    "attribute renamed": (rename_attribute, None, ""),
    "another attribute": (other_attribute, None, ""),
    "degree": (put("Plain:data.rosy.degree", 2), None, "'Plain' was changed"),
    "field drawn no more": (put("Plain:rosy.include", False), None, "'Plain'"),
    "object hidden in renders": (put("Plain:hide_render", True), None, "'Plain' is not visible"),
    "object hidden in views": (put("Plain:hide_select", True), None, ""),
    "object seen by the camera no more": (put("Plain:visible_camera", False), None, "'Plain'"),
    "object deleted": (delete("Plain"), None, "'Plain' was deleted"),
    "camera deleted": (delete("Camera"), None, "'Camera' was deleted"),
    "object added": (add_field_object, None, "'New' was added"),
    "collection excluded": (exclude("Plain"), None, "'Plain' is not visible"),
    "object renamed": (put("Plain:name", "Other"), None, ""),
    "smooth shading": (shade_smooth("Sheet"), bend(1.0), "'Sheet' was changed"),
    "instances moved": (move("Copies", 0.2, 0.0, 0.0), instanced, "'Plain' was moved"),
    "instances removed": (delete("Copies"), instanced, "'Plain' was"),
    "frame of an animation": (put("frame_current", 6), animated, "'Plain' was moved"),
    # occluders
    "occluder moved": (move("In Front", 0.2, 0.0, 0.0), None, "'In Front' was moved"),
    "occluder behind moved": (move("Behind", 0.2, 0.5, 0.0), None, ""),
    "occluder aside moved": (move("Aside", 1.0, 0.0, 0.0), None, ""),
    "occluder added": (add_occluder(0.3), None, "'Wall' was added"),
    "occluder added aside": (add_occluder(9.0), None, ""),
    "occluder of glass": (glaze, None, "'In Front' is not visible any more"),
    "glass moved": (move("In Front", 0.2, 0.0, 0.0), glaze, ""),
    "occluder smooth": (shade_smooth("In Front"), None, ""),
    "occluder with shadows": (move("Behind", 0.0, -2.2, 0.0), shadows, "'Behind' was moved"),
    # lights
    "lamp color": (recolor_key, scene_lights, "light 'Key' was changed"),
    "exposure": (put("rosy.exposure", -1.0), scene_lights, "the exposure was changed"),
    "exposure with a headlight": (put("rosy.exposure", -1.0), None, ""),
    "lamp moved": (move("Key", -2.0, 0.0, 0.0), scene_lights, "light 'Key' was changed"),
    "lamp turned": (put("Key:rotation_euler", (1.0, 0.0, 0.0)), scene_lights, ""),
    "lamp renamed": (put("Key:name", "Lamp"), scene_lights, ""),
    "lamp added": (add_fill, scene_lights, "light 'Fill' was added"),
    "lamp deleted": (delete("Key"), scene_lights, "light 'Key' was deleted"),
    "lamp energy with a headlight": (put("Key:data.energy", 900.0), None, ""),
    # look
    "look": (put("rosy.look.seed", 7), None, "the look was changed"),
    "light without shading": (put("rosy.look.light", "scene"), put("rosy.look.shading", 0.0), ""),
    "gain with hatching": (put("rosy.look.gain", 1.0), hatched, ""),
    "unit": (put("rosy.look.unit", "percent"), None, "the look was changed"),
    "own look": (put("Plain:rosy.preset", "engraving"), None, "the look was changed"),
    "own look on a card": (put("frame_end", 200), own_look_on_a_card, ""),
    "shadows of a headlight": (put("rosy.look.shadows", True), None, ""),
    "tone attribute": (lambda scene: add_tone(0.2), tone, "field of 'Plain' was changed"),
    "colored attribute": (lambda scene: add_tone(0.2), colors, "field of 'Plain' was changed"),
    "name of the colored attribute": (put("rosy.color_attribute", "light"), colors, None),
    "range of colors": (put("rosy.look.color_range", (0.4, 1.0)), colors, "the look was changed"),
    "tone attribute unused": (lambda scene: add_tone(0.2), None, ""),
    "tone picture": (write_reference(0.6), tone_picture, "the picture of the tone was changed"),
    "tone picture of the same name": (write_reference(0.3), tone_picture, ""),
    "lamp with tones": (put("Key:data.energy", 900.0), tone_and_lights, ""),
    "lamp without a tone": (recolor_key, tone_of_one_and_lights, "light 'Key' was changed"),
    "tone image": (paint_tone, tone_image, "field of 'Plain' was changed"),
    # camera and output
    "camera moved": (move("Camera", 0.1, 0.0, 0.0), None, "camera 'Camera' was changed"),
    "panoramic camera": (put("Camera:data.type", "PANO"), None, "camera 'Camera' was changed"),
    "target of a constraint": (move("Target", 0.5, 0.0, 0.0), tracked, "camera 'Camera'"),
    "pixel aspect": (put("render.pixel_aspect_x", 2.0), None, "camera 'Camera' was changed"),
    "camera renamed": (put("Camera:name", "Eye"), None, ""),
    "percentage": (put("render.resolution_percentage", 50), None, "the size was changed"),
    "size": (put("rosy.percentage", 150), None, "the size was changed to 60 x 60"),
    "placement": (put("rosy.placement", "WINDOW"), None, "the placement was changed"),
    "relighting": (put("rosy.relight", True), hatched, "the relighting was changed"),
    "relighting without hatching": (put("rosy.relight", True), None, ""),
    "light of a relit picture": (move("Key", -2.0, 0.0, 0.0), relit, ""),
    "ink of a relit picture": (put("rosy.look.crispness", 0.2), relit, "the look was changed"),
    "over material": (put("rosy.over_material", True), hatched, "the look was changed"),
    "over material without ink": (put("rosy.over_material", True), None, ""),
    "emission": (put("rosy.emission", 0.5), None, "the emission was changed"),
    "store": (put("rosy.store", "SAVED"), None, "the storage was changed"),
    "format": (put("rosy.image_format", "FLOAT"), None, "the format was changed"),
    "folder without storing": (put("rosy.directory", "//elsewhere/"), None, ""),
    "automatic device": (put("rosy.device", "AUTO"), None, None),
    "graphics card": (put("rosy.device", "GPU"), None, "the device was changed"),
    # what a picture does not depend on
    "view transform": (put("view_settings.view_transform", "Filmic"), None, ""),
    "bad vectors": (put("rosy.undefined", True), None, ""),
}


def bake_word(scene):
    """Return what the panel says about the picture, in a scene that is watched and in one that is not."""
    (watched,) = list_bakes(scene, for_panel=True, automatic_device=automatic_device)
    (info,) = list_bakes(scene, automatic_device=automatic_device)
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
    image = record.image
    modifiers = [m for other in scene.objects for m in other.modifiers if m.type == "NODES"]
    groups = []
    for group in bpy.data.node_groups:
        matrices = [np.round(tuple(each.matrix), 5).tolist() for each in group.rosy.projections]
        groups.append((matrices, sum(modifier.node_group == group for modifier in modifiers)))
    material = []
    for node in record.material.node_tree.nodes:
        for socket in node.inputs:
            value = getattr(socket, "default_value", "")
            value = value if isinstance(value, str) else np.round(value, 5).tolist()
            material.append((node.bl_idname, value))
    return {
        "pixels": pixels(image).tobytes(),
        "size": tuple(image.size),
        "float": image.is_float,
        "packed": image.packed_file is not None,
        "material": material,
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


def test_a_3d_view(tmp_path, watched):
    scene = build(tmp_path)
    view = perspective_camera(look_at((0, -5, 1), (0, 0, 0)), 30, 20, name=VIEW_NAME)
    (baked,) = bake(scene, cameras=[view])
    assert (baked.camera, tuple(baked.image.size)) == ("3D View", (30, 20))
    obj("Aside").location.x += 1.0
    scene.camera.location.x += 1.0
    assert bake_word(scene) == ""
    obj("In Front").location.x += 0.1
    assert bake_word(scene) == "'In Front' was moved"

"""The panel's "Up to date" is true: a table of changes, each of which is baked again.

A change either changes what the next bake gives, and the panel says so, or neither.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from rosy.rosy_addon.core.cache import BAKE_CACHE
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.gpu.select import automatic_device
from rosy.rosy_addon.image_io.png import write_png
from rosy.rosy_addon.jobs.animation import bake_animation
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.preset_files.store import load_preset
from rosy.rosy_addon.projection.camera import look_at, perspective_camera
from rosy.rosy_addon.scene import staleness
from rosy.rosy_addon.scene.bake_records import list_bakes
from rosy.rosy_addon.scene.cameras import VIEW_NAME
from rosy.rosy_addon.scene.look_properties import apply_look
from rosy.rosy_addon.scene.pictures import OutputSettings, show_bake
from rosy.rosy_addon.worker.job import Call
from scenes import add_camera, add_field, add_plane, each_step, link, pixels, set_vectors

SIZE = 40


def build(tmp_path):
    """Build the scene of the table: what may be changed in it, by name."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
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
    in_front = add_plane("In Front", size=0.25)
    in_front.location = (-0.4, -1.0, 0.2)
    behind = add_plane("Behind", size=3.0)
    behind.location = (0.0, 2.0, 0.0)
    aside = add_plane("Aside", size=0.2)
    aside.location = (30.0, -1.0, 0.0)
    lamp = link(bpy.data.objects.new("Key", bpy.data.lights.new("Key", "POINT")))
    lamp.data.energy = 300.0
    lamp.location = (2.0, -3.0, 3.0)
    scene.rosy.directory = str(tmp_path)
    bpy.context.view_layer.update()
    return scene


def obj(name):
    return bpy.data.objects[name]


def scene_lights(scene):
    scene.rosy.look.light, scene.rosy.look.shading = "scene", 1.0


def shadows(scene):
    scene_lights(scene)
    scene.rosy.look.shadows = True


def tone(scene):
    scene.rosy.look.tone, scene.rosy.tone_attribute = "attribute", "dark"
    add_tone()


def add_tone(value=0.5):
    for name in ("Sheet", "Plain"):
        mesh = obj(name).data
        attribute = mesh.attributes.get("dark") or mesh.attributes.new("dark", "FLOAT", "POINT")
        attribute.data.foreach_set("value", np.full(len(mesh.vertices), value, dtype=np.float32))
        mesh.update()


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


def write_reference(value):
    def change(scene):
        rgba = np.ones((SIZE, SIZE, 4), dtype=np.float32)
        rgba[: SIZE // 2, :, :3] = value
        write_png(Path(scene.rosy.tone_picture), rgba)

    return change


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
    lift = obj("Plain")
    lift.keyframe_insert("location", frame=1)
    lift.location.z += 1.0
    lift.keyframe_insert("location", frame=11)
    scene.frame_set(1)


def tracked(scene):
    target = link(bpy.data.objects.new("Target", None))
    constraint = scene.camera.constraints.new("TRACK_TO")
    constraint.target = target
    bpy.context.view_layer.update()


def driven(scene):
    curve = obj("Plain").driver_add("location", 2)
    variable = curve.driver.variables.new()
    variable.name, variable.type = "x", "TRANSFORMS"
    variable.targets[0].id, variable.targets[0].transform_type = obj("Aside"), "LOC_Z"
    curve.driver.expression = "x"


def instanced(scene):
    collection = bpy.data.collections.new("Copies")
    collection.objects.link(obj("Plain"))
    copies = link(bpy.data.objects.new("Copies", None))
    copies.instance_type, copies.instance_collection = "COLLECTION", collection
    copies.location = (-1.6, 0.0, 0.0)


def hatched(scene):
    scene.rosy.look.ink = "hatch"


def relit(scene):
    """Hatching by the light of the scene, whatever the light is."""
    scene.rosy.look.ink, scene.rosy.look.light, scene.rosy.relight = "hatch", "scene", True


def move(name, *offset):
    def change(scene):
        obj(name).matrix_world = Matrix.Translation(offset) @ obj(name).matrix_world

    return change


def put(path, value):
    """Set a property, given by its path from the scene or, after an object's name, from it."""

    def change(scene):
        owner, _, rest = path.partition(":")
        target = obj(owner) if rest else scene
        *parents, name = (rest or owner).split(".")
        for parent in parents:
            target = getattr(target, parent)
        setattr(target, name, value)

    return change


def shape_key(scene):
    obj("Sheet").data.shape_keys.key_blocks["Bent"].value = 0.5


def modifier(scene):
    obj("Sheet").modifiers["Wave"].show_viewport = True


def subdivide_more(scene):
    obj("Plain").modifiers["Subdivision"].levels = 2


def modifier_of_render(scene):
    obj("Plain").modifiers["Subdivision"].render_levels = 4


def rename_modifier(scene):
    obj("Sheet").modifiers["Wave"].name = "Billow"


def add_occluder(x):
    def change(scene):
        add_plane("Wall", size=0.3).location = (x, -1.5, 0.1)

    return change


def add_field_object(scene):
    add_field(add_plane("New", size=0.3, cuts=2), kind="axis").location = (-0.9, -0.2, -0.9)


def duplicate(scene):
    copy = obj("Plain").copy()
    copy.data = copy.data.copy()
    link(copy).location.x -= 1.8


def delete(name):
    return lambda scene: bpy.data.objects.remove(obj(name))


def delete_in_view(name):
    def change(scene):
        with bpy.context.temp_override(selected_objects=[obj(name)], active_object=obj(name)):
            bpy.ops.object.delete()

    return change


def add_light(scene):
    lamp = link(bpy.data.objects.new("Fill", bpy.data.lights.new("Fill", "SUN")))
    lamp.data.energy = 2.0
    lamp.rotation_euler.x = 1.0


def edit_mode(name):
    def change(scene):
        bpy.context.view_layer.objects.active = obj(name)
        bpy.ops.object.mode_set(mode="EDIT")

    return change


def edit_and_back(name):
    def change(scene):
        edit_mode(name)(scene)
        bpy.ops.object.mode_set(mode="OBJECT")

    return change


def move_vertex_in_edit_mode(scene):
    import bmesh

    edit_mode("Plain")(scene)
    edited = bmesh.from_edit_mesh(obj("Plain").data)
    edited.verts.ensure_lookup_table()
    edited.verts[0].co.x -= 0.15
    bmesh.update_edit_mesh(obj("Plain").data)


def move_vertex(scene):
    obj("Plain").data.vertices[0].co.x -= 0.15


def write_field(scene):
    mesh = obj("Plain").data
    set_vectors(mesh, np.tile((1.0, 0.0, 1.0), (len(mesh.polygons), 1)))


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


def shade_smooth(name):
    def change(scene):
        mesh = obj(name).data
        mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
        mesh.update()

    return change


def preset(scene):
    apply_look(scene.rosy, load_preset("woodcut").look)


def exclude(name):
    def change(scene):
        collection = bpy.data.collections.new("Away")
        scene.collection.children.link(collection)
        collection.objects.link(obj(name))
        scene.collection.objects.unlink(obj(name))
        bpy.context.view_layer.layer_collection.children["Away"].exclude = True

    return change


def rename_material(scene):
    obj("Plain").data.materials.append(bpy.data.materials.new("Own"))
    bpy.data.materials["Own"].name = "Mine"


def use_world(scene):
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (1.0, 0.0, 0.0)


def select(scene):
    for other in scene.objects:
        other.select_set(True)
    bpy.context.view_layer.objects.active = obj("Behind")


def turn_lamp(scene):
    obj("Key").rotation_euler.x += 1.0


def frame(number):
    return lambda scene: scene.frame_set(number)


def there_and_back(scene):
    obj("Plain").location.x += 0.5
    bpy.context.view_layer.update()
    bake_word(scene)
    obj("Plain").location.x -= 0.5
    obj("Plain").location.x = 0.9


def reparent(scene):
    obj("Plain").parent = obj("Parent")


def bent(scene):
    obj("Sheet").data.shape_keys.key_blocks["Bent"].value = 1.0


#: The change, what is prepared before the first bake, and the word of the panel; "" if the picture
#: stays the same.
TABLE = {
    # objects
    "shape key": (shape_key, None, "'Sheet' was changed"),
    "modifier switched on": (modifier, None, "'Sheet' was changed"),
    "modifier setting": (subdivide_more, subdivided, "'Plain' was changed"),
    "render setting of a modifier": (modifier_of_render, subdivided, ""),
    "modifier renamed": (rename_modifier, None, ""),
    "object moved": (move("Plain", 0.1, 0.0, 0.0), None, "'Plain' was moved"),
    "object moved there and back": (there_and_back, None, ""),
    "parent moved": (move("Parent", 0.1, 0.0, 0.0), None, "'Sheet' was moved"),
    "another parent at the same place": (reparent, None, ""),
    "vertex moved": (move_vertex, None, "mesh or field of 'Plain'"),
    "vertex moved in edit mode": (move_vertex_in_edit_mode, None, "'Plain' was changed"),
    "edit mode": (edit_mode("Plain"), None, ""),
    "edit mode and back": (edit_and_back("Plain"), None, ""),
    "edit mode and back, shape keys": (edit_and_back("Sheet"), None, ""),
    "edit mode and back, modifier": (edit_and_back("Plain"), subdivided, ""),
    "edit mode of an occluder": (edit_mode("In Front"), None, ""),
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
    "object deleted in the view": (delete_in_view("Plain"), None, "'Plain' was deleted"),
    "object added": (add_field_object, None, "'New' was added"),
    "object duplicated": (duplicate, None, "'Plain.001' was added"),
    "collection excluded": (exclude("Plain"), None, "'Plain' is not visible"),
    "object renamed": (put("Plain:name", "Other"), None, ""),
    "mesh renamed": (put("Plain:data.name", "Other"), None, ""),
    "material renamed": (rename_material, None, ""),
    "smooth shading": (shade_smooth("Sheet"), bent, "'Sheet' was changed"),
    "drivers": (put("Aside:location", (30.0, -1.0, 0.3)), driven, "'Plain' was moved"),
    "instances moved": (move("Copies", 0.2, 0.0, 0.0), instanced, "'Plain' was moved"),
    "instances removed": (delete("Copies"), instanced, "'Plain' was"),
    "frame of an animation": (frame(6), animated, "'Plain' was moved"),
    "frame of a still scene": (frame(6), None, ""),
    # occluders
    "occluder moved": (move("In Front", 0.2, 0.0, 0.0), None, "'In Front' was moved"),
    "occluder behind moved": (move("Behind", 0.2, 0.5, 0.0), None, ""),
    "occluder aside moved": (move("Aside", 1.0, 0.0, 0.0), None, ""),
    "occluder added": (add_occluder(0.3), None, "'Wall' was added"),
    "occluder added aside": (add_occluder(9.0), None, ""),
    "occluder hidden": (put("In Front:hide_render", True), None, "'In Front' is not visible"),
    "occluder deleted": (delete("In Front"), None, "'In Front' was deleted"),
    "occluder renamed": (put("In Front:name", "Wall"), None, ""),
    "occluder smooth": (shade_smooth("In Front"), None, ""),
    "occluder with shadows": (move("Behind", 0.0, -2.2, 0.0), shadows, "'Behind' was moved"),
    # lights
    "lamp energy": (put("Key:data.energy", 900.0), scene_lights, "light 'Key' was changed"),
    "lamp color": (put("Key:data.color", (1.0, 0.2, 0.2)), scene_lights, "light 'Key'"),
    "lamp moved": (move("Key", -2.0, 0.0, 0.0), scene_lights, "light 'Key' was changed"),
    "lamp turned": (turn_lamp, scene_lights, ""),
    "lamp renamed": (put("Key:name", "Lamp"), scene_lights, ""),
    "lamp added": (add_light, scene_lights, "light 'Fill' was added"),
    "lamp deleted": (delete("Key"), scene_lights, "light 'Key' was deleted"),
    "lamp hidden": (put("Key:hide_render", True), scene_lights, "light 'Key' is not visible"),
    "lamp energy with a headlight": (put("Key:data.energy", 900.0), None, ""),
    # look
    "look": (put("rosy.look.seed", 7), None, "the look was changed"),
    "light without shading": (put("rosy.look.light", "scene"), put("rosy.look.shading", 0.0), ""),
    "ink without hatching": (put("rosy.look.ink_color", (1.0, 0.0, 0.0)), None, ""),
    "paper": (put("rosy.look.paper_color", (1.0, 0.0, 0.0, 1.0)), hatched, "the look was changed"),
    "gain": (put("rosy.look.gain", 1.0), None, "the look was changed"),
    "gain with hatching": (put("rosy.look.gain", 1.0), hatched, ""),
    "unit size": (put("rosy.look.unit_size", 0.5), None, "the look was changed"),
    "shadows of a headlight": (put("rosy.look.shadows", True), None, ""),
    "preset": (preset, None, "the look was changed"),
    "tone attribute": (lambda scene: add_tone(0.2), tone, "field of 'Plain' was changed"),
    "colored attribute": (lambda scene: add_tone(0.2), colors, "field of 'Plain' was changed"),
    "name of the colored attribute": (put("rosy.color_attribute", "light"), colors, None),
    "range of colors": (put("rosy.look.color_range", (0.4, 1.0)), colors, "the look was changed"),
    "range of colors unused": (put("rosy.look.color_range", (0.4, 1.0)), None, ""),
    "tone attribute unused": (lambda scene: add_tone(0.2), None, ""),
    "tone picture": (write_reference(0.6), tone_picture, "the picture of the tone was changed"),
    "tone picture of the same name": (write_reference(0.3), tone_picture, ""),
    "lamp with tones": (put("Key:data.energy", 900.0), tone_and_lights, ""),
    "lamp without one of the tones": (
        put("Key:data.energy", 900.0),
        tone_of_one_and_lights,
        "light 'Key' was changed",
    ),
    "tone image": (paint_tone, tone_image, "field of 'Plain' was changed"),
    # camera and output
    "camera moved": (move("Camera", 0.1, 0.0, 0.0), None, "camera 'Camera' was changed"),
    "lens": (put("Camera:data.lens", 60.0), None, "camera 'Camera' was changed"),
    "sensor": (put("Camera:data.sensor_width", 30.0), None, "camera 'Camera' was changed"),
    "shift": (put("Camera:data.shift_x", 0.1), None, "camera 'Camera' was changed"),
    "panoramic camera": (put("Camera:data.type", "PANO"), None, "camera 'Camera' was changed"),
    "target of a constraint": (move("Target", 0.5, 0.0, 0.0), tracked, "camera 'Camera'"),
    "pixel aspect": (put("render.pixel_aspect_x", 2.0), None, "camera 'Camera' was changed"),
    "camera renamed": (put("Camera:name", "Eye"), None, ""),
    "display of the camera": (put("Camera:data.passepartout_alpha", 0.1), None, ""),
    "depth of field": (put("Camera:data.dof.use_dof", True), None, ""),
    "resolution": (put("render.resolution_x", 50), None, "the size was changed to 50 x 40"),
    "percentage": (put("render.resolution_percentage", 50), None, "the size was changed"),
    "size": (put("rosy.percentage", 150), None, "the size was changed to 60 x 60"),
    "placement": (put("rosy.placement", "WINDOW"), None, "the placement was changed"),
    "relighting": (put("rosy.relight", True), hatched, "the relighting was changed"),
    "relighting without hatching": (put("rosy.relight", True), None, ""),
    "light of a relit picture": (move("Key", -2.0, 0.0, 0.0), relit, ""),
    "strength of a relit picture": (put("Key:data.energy", 900.0), relit, ""),
    "ink of a relit picture": (put("rosy.look.crispness", 0.2), relit, "the look was changed"),
    "emission": (put("rosy.emission", 0.5), None, "the emission was changed"),
    "diffuse": (put("rosy.diffuse", 0.5), None, "the diffuse was changed"),
    "store": (put("rosy.store", "SAVED"), None, "the storage was changed"),
    "format": (put("rosy.image_format", "FLOAT"), None, "the format was changed"),
    "folder without storing": (put("rosy.directory", "//elsewhere/"), None, ""),
    "automatic device": (put("rosy.device", "AUTO"), None, None),
    "graphics card": (put("rosy.device", "GPU"), None, "the device was changed"),
    # what a picture does not depend on
    "scene renamed": (put("name", "Shot"), None, ""),
    "selection": (select, None, ""),
    "world": (use_world, None, ""),
    "view transform": (put("view_settings.view_transform", "Filmic"), None, ""),
    "render engine": (put("render.engine", "CYCLES"), None, ""),
    "frame range": (put("frame_end", 77), None, ""),
    "bad vectors": (put("rosy.undefined", True), None, ""),
}


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
    scene.rosy.placement, scene.rosy.relight = (
        "WINDOW",
        True,
    )  # frames always fill the frame of the camera
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
    bake(scene, cameras=[view])
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

"""Textures baked into UV maps: what they show, when they are up to date, and how they go."""

import json

import bpy
import numpy as np
import pytest
from objects import add_field, add_light, apply_modifiers, link
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.jobs.bake_texture import bake_texture
from rosy.rosy_addon.scene.bake_records import list_bakes, remove_bakes
from rosy.rosy_addon.scene.pictures import show_bake
from rosy.rosy_addon.surface_texture import line_order
from scenes import contents, depsgraph, expect_error, render, reopen


@pytest.fixture
def torus(scene, camera, monkeypatch):
    """A torus that faces the camera, with a curvature field of degree 4 and a UV map."""
    monkeypatch.setattr(line_order, "MAX_EDGE", 0.1)  # fewer triangles than pictures need
    rotation = (1.2, 0.0, 0.0)
    bpy.ops.mesh.primitive_torus_add(rotation=rotation, major_segments=16, minor_segments=8)
    scene.rosy.texture_size = 64
    return add_field(bpy.context.object)


@pytest.fixture
def textured(scene, torus):
    """The torus, smoothed, with a texture of 64 x 64 texels."""
    torus.modifiers.new("Smooth", "SUBSURF").levels = 1
    (result,) = bake_texture(scene, [torus])
    assert result.image.size[:] == (64, 64)
    return torus


def stale_reason(scene):
    (info,) = list_bakes(scene)
    assert info.is_texture
    return info.stale_reason


def test_the_texture_is_on_the_evaluated_mesh(scene, textured):
    """In a plain material on the UV map, which the modifier sets. The user's slots stay empty."""
    evaluated = textured.evaluated_get(depsgraph())
    (material,) = evaluated.data.materials
    nodes = {node.bl_idname: node for node in material.original.node_tree.nodes}
    assert nodes["ShaderNodeUVMap"].uv_map == textured.data.uv_layers.active.name
    assert nodes["ShaderNodeTexImage"].image.name == f"RoSy {textured.name}"
    assert not textured.data.materials
    pixels = np.array(nodes["ShaderNodeTexImage"].image.pixels).reshape(64, 64, 4)
    assert pixels[..., 0].std() > 0.05 and (pixels[..., 3] == 1).all()


def test_what_makes_a_texture_out_of_date(scene, textured):
    """Its field, UV map, look and size; not where it is, how it is lit, and how it deforms."""
    assert stale_reason(scene) == ""
    textured.location.x = 3
    textured.modifiers["Smooth"].levels = 1
    bend = textured.modifiers.new("Bend", "SIMPLE_DEFORM")
    textured.modifiers.move(textured.modifiers.find(bend.name), 0)
    scene.rosy.look.shading = 0.1
    assert stale_reason(scene) == ""
    for owner, name, value, expected in (
        (scene.rosy.look, "line_width", 3.0, "look"),
        (scene.rosy, "texture_size", 32, "32 x 32"),
        (scene.rosy, "texture_margin", 3, "UV map"),
    ):
        before = getattr(owner, name)
        setattr(owner, name, value)
        assert expected in stale_reason(scene)
        setattr(owner, name, before)
        assert stale_reason(scene) == ""
    textured.data.uv_layers.active.uv[0].vector = (0.4, 0.45)
    textured.data.update_tag()
    assert "the UV map" in stale_reason(scene)
    bake_texture(scene, [textured])
    assert stale_reason(scene) == ""
    add_field(textured, kind="axis")
    assert "field" in stale_reason(scene)


def test_pictures_and_textures_take_turns(scene, textured):
    """An object shows the last of them that was baked, or the one that is chosen."""
    bake(scene)
    shown = {info.camera: info.is_shown for info in list_bakes(scene)}
    assert shown == {"Camera": True, textured.name: False}
    show_bake(scene, textured.name)
    shown = {info.camera: info.is_shown for info in list_bakes(scene)}
    assert shown == {"Camera": False, textured.name: True}


def test_baking_again_replaces_the_texture(scene, textured):
    before = len(bpy.data.images), len(bpy.data.materials), len(bpy.data.node_groups)
    bake_texture(scene, [textured])
    assert (len(bpy.data.images), len(bpy.data.materials), len(bpy.data.node_groups)) == before
    assert len(textured.modifiers) == 2


def test_a_texture_over_the_own_material(scene, textured):
    scene.rosy.look.ink, scene.rosy.over_material = "hatch", True
    bake_texture(scene, [textured])
    (ink,) = textured.children
    assert [info.camera for info in list_bakes(scene)] == [textured.name]
    assert not any(modifier.type == "NODES" for modifier in textured.modifiers)
    assert ink.evaluated_get(depsgraph()).data.uv_layers


def test_copies_share_a_texture_until_they_are_baked(scene, textured):
    """Then each has its own. The texture follows an object that is renamed."""
    copy = link(textured.copy())
    copy.data = textured.data.copy()
    textured.name = "Renamed"
    assert [info.camera for info in list_bakes(scene)] == ["Renamed"]
    copy.name = "Copy"
    add_field(copy, kind="axis")
    bake_texture(scene, [copy])
    infos = [(info.camera, info.stale_reason) for info in list_bakes(scene)]
    assert infos == [("Copy", ""), ("Renamed", "")]
    bpy.data.objects.remove(copy)
    assert len(bpy.data.objects) == 2
    info = list_bakes(scene)[0]
    assert info.camera == "Copy" and "does not show it" in info.unknown_reason


def test_remove_leaves_nothing(scene, torus):
    before = contents()
    bake_texture(scene, [torus])
    assert contents() != before
    remove_bakes(scene)
    assert contents() == before


def test_tiles_are_pictures_of_their_own(scene, textured, tmp_path):
    """Packed, in a folder, and read again from a saved file. They are lit like any material."""
    layer = textured.data.uv_layers.active
    uv = np.empty(2 * len(layer.uv), dtype=np.float32)
    layer.uv.foreach_get("vector", uv)
    layer.uv.foreach_set("vector", 0.05 + 1.9 * uv)
    scene.rosy.texture_udim = True
    assert stale_reason(scene)
    (result,) = bake_texture(scene, [textured])
    numbers = [1001, 1002, 1011, 1012]
    assert result.image.source == "TILED" and len(result.image.packed_files) == 4
    assert [tile.number for tile in result.image.tiles] == numbers
    assert stale_reason(scene) == ""
    name = textured.name
    add_light("Sun", "SUN", 5.0).rotation_euler.x = 1.2
    scene = reopen(tmp_path / "saved.blend")
    (image,) = (image for image in bpy.data.images if image.source == "TILED")
    assert all(file.filepath.startswith("//RoSy ") for file in image.packed_files)
    packed = render(scene, tmp_path / "packed.exr", samples=1)
    covered = packed[..., 3] == 1
    assert packed[covered][:, 0].std() > 0.05
    scene.rosy.store, scene.rosy.directory = "SAVED", str(tmp_path / "tiles")
    (result,) = bake_texture(scene, [scene.objects[name]])
    assert not result.image.packed_files
    files = sorted(file.name for file in (tmp_path / "tiles").iterdir())
    assert files == [f"RoSy_{name}_texture.{number}.png" for number in numbers]
    np.testing.assert_array_equal(render(scene, tmp_path / "files.exr", samples=1), packed)
    bpy.data.objects["Sun"].rotation_euler.x += np.pi
    dark = render(scene, tmp_path / "dark.exr", samples=1)
    assert dark[covered][:, 0].mean() < 0.5 * packed[covered][:, 0].mean()
    assert remove_bakes(scene).images == 1


def test_maps_of_directions(scene, textured, tmp_path):
    """Each has a file of its own. They depend on the guiding angle, and not on colors."""
    scene.rosy.store, scene.rosy.directory = "SAVED", str(tmp_path)
    for content in ("ANISOTROPY", "FLOW"):
        scene.rosy.texture_content = content
        assert stale_reason(scene) == "the content was changed"
        (result,) = bake_texture(scene, [textured])
        assert result.image.colorspace_settings.name == "Non-Color"
        scene.rosy.look.line_width += 1
        assert stale_reason(scene) == ""
        scene.rosy.look.guiding_angle += 1
        assert stale_reason(scene) == "the look was changed"
        scene.rosy.look.guiding_angle = 0
    names = sorted(file.name.removeprefix(f"RoSy_{textured.name}_") for file in tmp_path.iterdir())
    assert names == ["anisotropy.png", "flow.png"]


def test_light_can_be_baked(scene, textured):
    """The hatching is then ink, and depends on the lights and on where the object is."""
    scene.rosy.look.ink, scene.rosy.look.shading = "hatch", 1.0
    scene.rosy.texture_bake_light = True
    expect_error("'Scene' has no lights", bake_texture, scene, [textured])
    lamp, means = add_light("Lamp", "SUN", 1.0), []
    for strength in (0.3, 1.0):
        lamp.data.energy = strength * np.pi
        (result,) = bake_texture(scene, [textured])
        assert result.image.colorspace_settings.name == "sRGB"
        means.append(np.array(result.image.pixels).reshape(-1, 4)[:, 0].mean())
        assert stale_reason(scene) == ""
    assert means[0] < 0.6 * means[1]
    lamp.rotation_euler.x = 0.5
    assert stale_reason(scene) == "light 'Lamp' was changed"
    lamp.rotation_euler.x, textured.location.x = 0.0, 1.0
    assert stale_reason(scene) == f"'{textured.name}' was moved"


def exported_material(path):
    """The only material of a .glb file."""
    data = path.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    (material,) = json.loads(data[20 : 20 + length])["materials"]
    return material


def test_exporters_take_textures_along(scene, textured, tmp_path):
    """That of a look as a color, directions as the map of glTF, and thresholds for a shader."""
    for content, ink in (("LOOK", "soft"), ("LOOK", "hatch"), ("ANISOTROPY", "soft")):
        scene.rosy.texture_content, scene.rosy.look.ink = content, ink
        bake_texture(scene, [textured])
        path = tmp_path / f"{content}-{ink}.glb"
        bpy.ops.export_scene.gltf(filepath=str(path), export_apply=True)
    metallic_roughness = exported_material(tmp_path / "LOOK-soft.glb")["pbrMetallicRoughness"]
    assert "baseColorTexture" in metallic_roughness
    assert "emissiveTexture" in exported_material(tmp_path / "LOOK-hatch.glb")
    material = exported_material(tmp_path / "ANISOTROPY-soft.glb")
    anisotropy = material["extensions"]["KHR_materials_anisotropy"]
    assert anisotropy["anisotropyRotation"] == pytest.approx(np.pi / 2)
    assert anisotropy["anisotropyStrength"] == pytest.approx(0.8)
    assert "anisotropyTexture" in anisotropy
    scene.rosy.texture_content = "LOOK"
    bake_texture(scene, [textured])
    path = tmp_path / "look.fbx"
    bpy.ops.export_scene.fbx(filepath=str(path), path_mode="COPY", embed_textures=True)
    assert b"\x89PNG" in path.read_bytes()
    # The exporter of USD takes materials from slots.
    apply_modifiers(textured)
    bpy.ops.wm.usd_export(filepath=str(tmp_path / "look.usda"))
    assert "UsdUVTexture" in (tmp_path / "look.usda").read_text()
    assert [file.suffix for file in (tmp_path / "textures").iterdir()] == [".png"]

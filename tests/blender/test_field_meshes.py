"""Fields of objects whose modifiers change the faces: made for the faces that are seen, and kept with the object."""

import bpy
import numpy as np
import pytest
from conftest import contents, error_of, pixels


def add_boolean(obj):
    bpy.ops.mesh.primitive_cube_add(size=0.8, location=(0.5, -0.6, 0.4))
    cutter = bpy.context.object
    cutter.hide_render = True
    cutter.hide_set(True)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    modifier = obj.modifiers.new("Boolean", "BOOLEAN")
    modifier.object = cutter
    return modifier


def add_subdivided_mirror(obj):
    obj.modifiers.new("Mirror", "MIRROR").use_axis = (False, True, False)
    modifier = obj.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = 2
    return modifier


def picture():
    """Bake, and return the picture and the number of singularities."""
    bpy.ops.rosy.preset_apply(preset="cross-hatch")
    assert bpy.ops.rosy.bake() == {"FINISHED"}
    (image,) = (image for image in bpy.data.images if image.name == "RoSy Camera")
    assert bpy.ops.rosy.singularities(show="POINTS") == {"FINISHED"}
    (points,) = (child.data for child in bpy.context.object.children)
    return pixels(image), len(getattr(points, "points", None) or points.vertices)


def apply_modifiers(obj):
    for modifier in [each for each in obj.modifiers if each.name != "RoSy"]:
        bpy.ops.object.modifier_apply(modifier=modifier.name)


@pytest.mark.parametrize("add", [add_boolean, add_subdivided_mirror])
def test_live_modifiers_give_the_picture_of_applied_ones(suzanne, scene, add):
    suzanne.modifiers.clear()
    add(suzanne)
    assert bpy.ops.rosy.field_generate(kind="form", degree=4) == {"FINISHED"}
    assert "rosy" not in suzanne.data.attributes
    live, count = picture()
    apply_modifiers(suzanne)
    kept, count_kept = picture()  # the field is found again on the mesh that has the same faces now
    assert bpy.ops.rosy.field_generate(kind="form", degree=4) == {"FINISHED"}
    assert suzanne.rosy.field_mesh is None and "rosy" in suzanne.data.attributes
    applied, count_applied = picture()
    np.testing.assert_allclose(live, applied, atol=2 / 255)
    np.testing.assert_allclose(kept, applied, atol=2 / 255)
    assert count == count_kept == count_applied > 0
    assert not any(mesh.name.endswith("field") for mesh in bpy.data.meshes)


def test_the_field_follows_until_the_faces_change(suzanne, scene):
    suzanne.modifiers.clear()
    modifier = suzanne.modifiers.new("Subdivision", "SUBSURF")
    assert bpy.ops.rosy.field_generate(kind="form", degree=4) == {"FINISHED"}
    holder = suzanne.rosy.field_mesh
    _, count = picture()
    twist = suzanne.modifiers.new("Twist", "SIMPLE_DEFORM")
    twist.deform_method, twist.angle = "TWIST", 0.5
    for vertex in suzanne.data.vertices:
        vertex.co.x *= 1.5
    suzanne.data.update()
    assert picture()[1] == count and suzanne.rosy.field_mesh == holder
    assert bpy.ops.rosy.field_convert(new_degree="DEGREE_2") == {"FINISHED"}
    assert bpy.ops.rosy.bake() == {"FINISHED"}
    modifier.levels = 2
    before = contents()
    message = "Object 'Suzanne': its modifiers make other faces now than when its field was made"
    assert message in error_of(bpy.ops.rosy.bake)
    assert contents() == before
    assert bpy.ops.rosy.field_generate(kind="form", degree=4) == {"FINISHED"}
    assert bpy.ops.rosy.bake() == {"FINISHED"}
    others = ("singularities", "Backdrop")
    used = [mesh for mesh in bpy.data.meshes if mesh.users]
    used = [mesh for mesh in used if not any(word in mesh.name for word in others)]
    assert used == [suzanne.data, suzanne.rosy.field_mesh]


def test_files_fit_the_mesh_or_what_is_seen(suzanne, tmp_path):
    suzanne.modifiers.clear()
    assert bpy.ops.rosy.field_generate(kind="smoothest", degree=4) == {"FINISHED"}
    own, seen = str(tmp_path / "own.rosy"), str(tmp_path / "seen.rosy")
    assert bpy.ops.rosy.field_export(filepath=own) == {"FINISHED"}
    suzanne.modifiers.new("Solidify", "SOLIDIFY")
    assert bpy.ops.rosy.field_generate(kind="smoothest", degree=4) == {"FINISHED"}
    assert bpy.ops.rosy.field_export(filepath=seen) == {"FINISHED"}
    meshes = len(bpy.data.meshes)
    for path, has_holder in ((own, False), (seen, True)):
        assert bpy.ops.rosy.field_import(filepath=path, skip_browser=True) == {"FINISHED"}
        assert (suzanne.rosy.field_mesh is not None) == has_holder
        assert bpy.ops.rosy.bake() == {"FINISHED"}
    assert len(bpy.data.meshes) == meshes


def test_an_error_leaves_no_mesh(suzanne):
    suzanne.modifiers.clear()
    suzanne.modifiers.new("Solidify", "SOLIDIFY")
    before = contents()
    assert "no guides" in error_of(bpy.ops.rosy.field_generate, kind="guided")
    assert contents() == before

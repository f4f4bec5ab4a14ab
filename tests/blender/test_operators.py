"""Each operator with a real mesh, its errors, and why its button is disabled."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from conftest import contents, error_of


def member_vectors(mesh, name="rosy"):
    values = np.empty(3 * len(mesh.polygons), dtype=np.float32)
    mesh.attributes[name].data.foreach_get("vector", values)
    return values.reshape(-1, 3)


@pytest.mark.parametrize(
    ("kind", "degree"),
    [
        ("curvature", 2),
        ("curvature", 4),
        ("axis", 1),
        ("axis", 6),
        ("axis", 12),
        ("smoothest", 1),
        ("smoothest", 4),
        ("smoothest", 7),
        ("features", 4),
    ],
)
def test_generate(suzanne, kind, degree):
    assert bpy.ops.rosy.field_generate(kind=kind, degree=degree) == {"FINISHED"}
    mesh = suzanne.data
    attribute = mesh.attributes["rosy"]
    assert (attribute.domain, attribute.data_type) == ("FACE", "FLOAT_VECTOR")
    assert mesh.rosy.degree == degree
    vectors = member_vectors(mesh)
    normal = np.array([face.normal for face in mesh.polygons])
    assert np.abs(np.sum(vectors * normal, axis=1)).max() < 1e-5
    assert np.linalg.norm(vectors, axis=1).max() > 0.5


def test_generate_on_all_selected(suzanne):
    bpy.ops.mesh.primitive_torus_add(location=(3, 0, 0))
    suzanne.select_set(True)
    assert bpy.ops.rosy.field_generate(kind="axis", degree=3, axis=(1, 0, 0)) == {"FINISHED"}
    for thing in bpy.context.selected_objects:
        assert thing.data.rosy.degree == 3
        assert "rosy" in thing.data.attributes


def test_generate_refuses(suzanne):
    before = contents()
    assert "curvature" in error_of(bpy.ops.rosy.field_generate, kind="curvature", degree=3)
    assert "axis" in error_of(bpy.ops.rosy.field_generate, kind="axis", axis=(0, 0, 0))
    assert contents() == before


def test_generate_on_an_empty_mesh_names_it(scene):
    nothing = bpy.data.objects.new("Nothing", bpy.data.meshes.new("Nothing"))
    scene.collection.objects.link(nothing)
    bpy.context.view_layer.objects.active = nothing
    nothing.select_set(True)
    assert "Nothing" in error_of(bpy.ops.rosy.field_generate, kind="axis")
    assert not nothing.data.attributes.get("rosy")


def test_generate_undo(suzanne):
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.rosy.field_generate(kind="axis", degree=5)
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert "rosy" not in bpy.context.object.data.attributes
    bpy.ops.ed.redo()
    assert bpy.context.object.data.rosy.degree == 5
    assert "rosy" in bpy.context.object.data.attributes


@pytest.mark.parametrize("ending", [".rosy", ".rawfield"])
def test_export_then_import(with_field, tmp_path, ending):
    path = tmp_path / ("suzanne" + ending)
    before = member_vectors(with_field.data)
    assert bpy.ops.rosy.field_export(filepath=str(path)) == {"FINISHED"}
    with_field.data.attributes.remove(with_field.data.attributes["rosy"])
    with_field.data.rosy.degree = 1
    assert bpy.ops.rosy.field_import(filepath=str(path)) == {"FINISHED"}
    assert with_field.data.rosy.degree == 4
    np.testing.assert_allclose(member_vectors(with_field.data), before, atol=1e-5)


def test_import_refuses(suzanne, tmp_path):
    before = contents()
    missing = tmp_path / "missing.rosy"
    assert "missing.rosy" in error_of(bpy.ops.rosy.field_import, filepath=str(missing))
    broken = tmp_path / "broken.rosy"
    broken.write_text("3\n4\n1 0 0\n0 1\n")
    assert "broken.rosy" in error_of(bpy.ops.rosy.field_import, filepath=str(broken))
    assert contents() == before


def test_export_refuses(with_field, tmp_path):
    path = tmp_path / "no" / "folder" / "field.rosy"
    assert "field.rosy" in error_of(bpy.ops.rosy.field_export, filepath=str(path))


def test_why_buttons_are_disabled(scene):
    assert not bpy.ops.rosy.bake.poll()
    assert "Select a mesh" in error_of(bpy.ops.rosy.field_generate)
    assert "field" in error_of(bpy.ops.rosy.bake)
    assert "baked" in error_of(bpy.ops.rosy.remove)
    bpy.ops.mesh.primitive_cube_add()
    assert "no field" in error_of(bpy.ops.rosy.field_export, filepath="/tmp/never.rosy")
    bpy.ops.object.mode_set(mode="EDIT")
    assert "Tab" in error_of(bpy.ops.rosy.field_generate)
    bpy.ops.object.mode_set(mode="OBJECT")


def test_presets(scene):
    from bl_ext.user_default.rosy.rosy_addon.compositor.presets import preset_names

    for name in preset_names():
        assert bpy.ops.rosy.preset_apply(preset=name) == {"FINISHED"}
    assert "nonsense" in error_of(bpy.ops.rosy.preset_apply, preset="nonsense")


def test_every_setting_of_a_look_is_shown_once():
    from dataclasses import fields

    from bl_ext.user_default.rosy.rosy_addon.compositor.look import Look
    from bl_ext.user_default.rosy.rosy_addon.ui.panels import GROUPS, OTHERS

    shown = [name for group in GROUPS.values() for name in group] + list(OTHERS)
    assert sorted(shown) == sorted(entry.name for entry in fields(Look))

"""Reading for the live view: what is left out is named, and nothing is read again without need."""

from unittest.mock import Mock

import bpy
import numpy as np
import pytest
from objects import add_field, add_nodes, add_plane, link, set_attribute
from rosy.rosy_addon.scene import scene_reader
from rosy.rosy_addon.scene.scene_reader import SceneReader
from scenes import contents, depsgraph, member_vectors, read_instances, read_live


def read(reader):
    """Read as the live view does, and return the names of the drawn objects."""
    return names_with_field(read_live(reader))


def names_with_field(entries):
    return [entry.owner.name for entry in entries if entry.instance.field is not None]


def remesh(obj):
    modifier = obj.modifiers.new("Rebuild", "REMESH")
    modifier.mode, modifier.voxel_size = "VOXEL", 0.2


def removed_attribute(obj):
    group = add_nodes(obj, "GeometryNodeRemoveAttribute")
    name = group.nodes["Remove Named Attribute"].inputs["Name"]
    name.default_value = "rosy"
    return name


def points_only(obj):
    add_nodes(obj, "GeometryNodeMeshToPoints")


def masked(obj):
    obj.vertex_groups.new(name="None")
    obj.modifiers.new("Hide All", "MASK").vertex_group = "None"


LOSSES = {
    "remesh": (remesh, ["(Rebuild)", "no attribute 'rosy'"]),
    "removed attribute": (removed_attribute, ["(Nodes)", "no attribute 'rosy'"]),
    "points only": (points_only, ["(Nodes)", "no faces"]),
    "masked": (masked, ["(Hide All)", "no faces"]),
}


@pytest.mark.parametrize("loss", LOSSES)
def test_a_field_lost_in_modifiers_is_named(monkey, loss):
    """The error stays, and is gone with the modifier."""
    lose, words = LOSSES[loss]
    lose(monkey)
    before, reader = contents(), SceneReader()
    assert read(reader) == []
    message = str(reader.errors["Suzanne"])
    assert all(word in message for word in ("'Suzanne'", *words)), message
    assert contents() == before
    assert read(reader) == [] and str(reader.errors["Suzanne"]) == message
    monkey.modifiers.clear()
    reader.invalidate({"Suzanne"})
    assert read(reader) == ["Suzanne"] and not reader.errors


def test_an_attribute_that_is_kept_again(monkey):
    """The modifiers keep the faces, but no longer lose the attribute."""
    monkey.modifiers.new("Subdivision", "SUBSURF")
    name = removed_attribute(monkey)
    reader = SceneReader()
    assert read(reader) == []
    name.default_value = "other"
    reader.invalidate({"Suzanne"})
    assert read(reader) == ["Suzanne"]


def test_a_field_that_nodes_change_is_that_of_a_bake(monkey):
    """Geometry nodes that turn the vectors of a field, and keep the faces."""
    group = add_nodes(monkey, "GeometryNodeStoreNamedAttribute")
    store = group.nodes["Store Named Attribute"]
    store.data_type, store.domain = "FLOAT_VECTOR", "FACE"
    store.inputs["Name"].default_value = "rosy"
    named = group.nodes.new("GeometryNodeInputNamedAttribute")
    normal = group.nodes.new("GeometryNodeInputNormal")
    named.data_type = "FLOAT_VECTOR"
    named.inputs["Name"].default_value = "rosy"
    cross = group.nodes.new("ShaderNodeVectorMath")
    cross.operation = "CROSS_PRODUCT"
    group.links.new(named.outputs[0], cross.inputs[0])
    group.links.new(normal.outputs[0], cross.inputs[1])
    value = next(socket for socket in store.inputs if socket.name == "Value" and socket.enabled)
    group.links.new(cross.outputs[0], value)
    reader = SceneReader()
    assert read(reader) == ["Suzanne"]
    (entry,) = read_live(reader)
    (instance,) = read_instances(depsgraph())
    np.testing.assert_array_equal(entry.instance.field.vectors, instance.field.vectors)
    turned = np.abs((entry.instance.field.vectors * member_vectors(monkey.data)).sum(axis=1))
    assert np.median(turned) < 0.05


def test_instances_with_other_faces_than_their_owner(monkey):
    """Geometry nodes show a mesh and a subdivided instance of it: one object, two topologies."""
    group = add_nodes(monkey)
    nodes, links = group.nodes, group.links
    join = nodes.new("GeometryNodeJoinGeometry")
    to_instance = nodes.new("GeometryNodeGeometryToInstance")
    subdivide = nodes.new("GeometryNodeSubdivideMesh")
    source = nodes["Group Input"].outputs[0]
    links.new(source, subdivide.inputs[0])
    links.new(subdivide.outputs[0], to_instance.inputs[0])
    links.new(source, join.inputs[0])
    links.new(to_instance.outputs[0], join.inputs[0])
    links.new(join.outputs[0], nodes["Group Output"].inputs[0])
    reader = SceneReader()
    assert read(reader) == ["Suzanne", "Suzanne"] and not reader.errors
    counts = [len(entry.instance.surface.face_start) - 1 for entry in read_live(reader)]
    assert sorted(counts) == [len(monkey.data.polygons), len(monkey.data.loops)]


def test_reading_in_slices_ends(scene):
    """With a deadline that has passed, each call does one step, also if it cannot be drawn."""
    reader, calls = SceneReader(), 0
    for index in range(6):
        plane = add_plane(f"Plane {index}")
        add_field(plane, kind="axis")
        if index % 3 == 0:
            removed_attribute(plane)
        elif index % 3 == 1:
            masked(plane)
    entries = read_live(reader, deadline=0.0)
    while not reader.is_complete:
        calls += 1
        assert calls < 200
        entries = read_live(reader, deadline=0.0)
    assert names_with_field(entries) == ["Plane 2", "Plane 5"]
    assert sorted(reader.errors) == [f"Plane {index}" for index in (0, 1, 3, 4)]


def test_an_object_that_is_deleted_between_two_steps(monkey):
    add_field(add_plane("Plane"), kind="axis")
    monkey.modifiers.new("Subdivision", "SUBSURF")
    for steps in range(1, 6):
        obj = monkey.copy()
        obj.name, obj.data = "Copy", monkey.data.copy()
        link(obj)
        reader = SceneReader()
        for step in range(10):
            if step == steps:
                bpy.data.objects.remove(bpy.data.objects["Copy"])
                reader.invalidate({"Copy"})
            entries = read_live(reader, deadline=0.0)
        names = sorted(names_with_field(entries))
        assert names == ["Plane", "Suzanne"] and not reader.errors, steps


def test_too_little_memory_is_a_message(monkey, monkeypatch):
    monkeypatch.setattr(scene_reader, "read_mesh_field", Mock(side_effect=MemoryError))
    reader = SceneReader()
    assert read(reader) == [] and isinstance(reader.errors["Suzanne"], MemoryError)


@pytest.mark.parametrize(
    "form, domain, count",
    [("vectors", "FACE", 4), ("vectors", "POINT", 9), ("vectors", "CORNER", 16)]
    + [("directions", "FACE", 4), ("directions", "POINT", 9), ("angles", "FACE", 4)],
)
def test_fields_are_read_in_edit_mode(scene, form, domain, count):
    plane = add_plane(cuts=2)
    vectors = np.random.default_rng(1).normal(size=(count, 3)) * (1, 0, 1)
    if form == "directions":
        for index, sign in enumerate((1, -1)):
            set_attribute(plane.data, sign * vectors, f"dir{index}", domain=domain)
    elif form == "angles":
        set_attribute(plane.data, vectors[:, 0], kind="FLOAT", domain=domain)
    else:
        set_attribute(plane.data, vectors, domain=domain)
    reader = SceneReader()
    (expected,) = (entry.instance.field for entry in read_live(reader))
    bpy.context.view_layer.objects.active = plane
    bpy.ops.object.mode_set(mode="EDIT")
    reader.invalidate({"Plane"})
    (field,) = (entry.instance.field for entry in read_live(reader))
    assert field.degree == expected.degree
    np.testing.assert_allclose(field.vectors, expected.vectors, atol=1e-6)

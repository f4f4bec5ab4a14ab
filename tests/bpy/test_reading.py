"""Reading scenes as arrays, and reading and writing fields."""

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix
from objects import (
    add_field,
    add_instance,
    add_light,
    add_mesh,
    add_nodes,
    add_plane,
    aim,
    set_attribute,
)
from rosy.rosy_addon.core.errors import RosyWarning
from rosy.rosy_addon.field.directional_field import field_directions, field_from_directions
from rosy.rosy_addon.field.generate import axis_field
from rosy.rosy_addon.field.representation import face_representation
from rosy.rosy_addon.field.rosy_field import RosyField
from rosy.rosy_addon.scene.field_attributes import has_field
from rosy.rosy_addon.scene.guides import (
    FIELD_CHECK_ATTRIBUTE,
    read_combed_guides,
    store_combed_guides,
)
from rosy.rosy_addon.scene.mesh_fields import read_mesh_field, write_mesh_field
from rosy.rosy_addon.scene.meshes import (
    EDGE_MARKS,
    is_shaded_flat,
    mark_sharp,
    marked_edges,
    mesh_surface,
)
from rosy.rosy_addon.scene.read_view import read_lights
from rosy.rosy_addon.scene.scene_reader import read_scene
from rosy.rosy_addon.scene.visible_objects import drawn_objects, field_objects
from scenes import (
    assert_same_directions,
    contents,
    depsgraph,
    expect_error,
    member_vectors,
    projected,
    read_instances,
)
from test_up_to_date import exclude


def representation(mesh, field):
    return face_representation(mesh_surface(mesh), field)


# --- attributes ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("form", "degree"),
    [*(("VECTOR", degree) for degree in (1, 2, 5, 12)), ("DIRECTIONS", 4), ("ANGLE", 4)],
)
def test_fields_are_written_and_read(monkey, form, degree):
    mesh = monkey.data
    mesh.attributes.remove(mesh.attributes["rosy"])
    length = 1 if form == "ANGLE" else 3
    field = RosyField(degree, length * mesh_surface(mesh).face_frames[0])
    write_mesh_field(mesh, field, "other", form)
    assert mesh.attributes["dir3" if form == "DIRECTIONS" else "other"].domain == "FACE"
    again = read_mesh_field(mesh)
    assert again.degree == mesh.rosy.degree == degree
    z, expected = representation(mesh, again), representation(mesh, field)
    np.testing.assert_allclose(z, expected, atol=1e-4)


def test_surface_agrees_with_blender(monkey):
    mesh = monkey.data
    mesh.polygons[3].use_smooth = False
    surface = mesh_surface(mesh)
    assert surface.face_count == len(mesh.polygons)
    normal = np.array([face.normal for face in mesh.polygons])
    np.testing.assert_allclose(surface.face_normal, normal, atol=1e-5)
    corner = np.array([corner.vector for corner in mesh.corner_normals])
    np.testing.assert_allclose(surface.corner_normal, corner, atol=1e-5)
    flat_fans = surface.corner_fan[surface.corner_face == 3]
    other_fans = surface.corner_fan[surface.corner_face != 3]
    assert not np.isin(flat_fans, other_fans).any()


def test_sharp_edges_separate_fans(scene):
    mesh = add_plane(cuts=2).data
    mesh.shade_smooth()
    assert len(np.unique(mesh_surface(mesh).corner_fan)) == 9
    for edge in mesh.edges:
        along = [mesh.vertices[vertex].co.x for vertex in edge.vertices]
        edge.use_edge_sharp = along == [0.0, 0.0]
    assert len(np.unique(mesh_surface(mesh).corner_fan)) == 12


@pytest.mark.parametrize("domain", ["POINT", "CORNER"])
def test_vectors_on_points_and_corners(scene, domain):
    mesh = add_plane(cuts=3).data
    count = {"POINT": len(mesh.vertices), "CORNER": len(mesh.loops)}[domain]
    set_attribute(mesh, np.tile([0.6, 0.0, 0.8], (count, 1)), domain=domain)
    mesh.rosy.degree = 3
    fields = read_mesh_field(mesh), RosyField(3, np.tile([0.6, 0.0, 0.8], (9, 1)))
    np.testing.assert_allclose(*(representation(mesh, field) for field in fields), atol=1e-5)


def test_angles(scene):
    """About the face's normal, counter-clockwise from its first edge."""
    plane = add_plane(cuts=1)
    set_attribute(plane.data, [np.pi / 6], kind="FLOAT")
    plane.data.rosy.degree = 5
    field = read_mesh_field(plane.data)
    # The face points to -y. Seen from there, x points to the right and z up.
    np.testing.assert_allclose(field.vectors, [[np.cos(np.pi / 6), 0, 0.5]], atol=1e-6)
    assert not read_combed_guides(plane.data, mesh_surface(plane.data)).any()


def test_guides_without_their_checks_are_ignored(scene):
    """The user has converted the checks to another domain."""
    plane = add_field(add_plane(cuts=3), kind="axis")
    store_combed_guides(plane.data, read_mesh_field(plane.data).vectors)
    surface = mesh_surface(plane.data)
    assert read_combed_guides(plane.data, surface).any()
    plane.data.attributes.remove(plane.data.attributes[FIELD_CHECK_ATTRIBUTE])
    set_attribute(plane.data, np.zeros(16), FIELD_CHECK_ATTRIBUTE, "POINT", "FLOAT")
    assert not read_combed_guides(plane.data, surface).any()


def add_directions(mesh, degree, angle_offset=0.0, length_factor=1.0):
    x, y = mesh_surface(mesh).face_frames
    for index in range(degree):
        angle = 2 * np.pi * index / degree + 0.2 + (angle_offset if index == 1 else 0.0)
        vectors = np.cos(angle) * x + np.sin(angle) * y
        set_attribute(mesh, vectors * (length_factor if index == 1 else 1.0), f"dir{index}")


@pytest.mark.parametrize(
    ("angle_offset", "length_factor"), [(0.0, 1.0), (0.1, 1.0), (0.0, 1.1), (0.3, 2.0)]
)
def test_directions_that_may_not_be_a_rosy(scene, angle_offset, length_factor):
    plane = add_plane(cuts=2)
    add_directions(plane.data, 3, angle_offset, length_factor)
    field = read_mesh_field(plane.data)
    is_rosy = (angle_offset, length_factor) == (0.0, 1.0)
    assert has_field(plane) and field.degree == 3
    assert (field.direction_ratios is None) == is_rosy
    directions = field_directions(mesh_surface(plane.data), field)
    for index in range(3):
        expected = member_vectors(plane.data, f"dir{index}")
        np.testing.assert_allclose(directions[:, index], expected, atol=1e-6)


def test_directions_are_kept_by_modifiers(scene):
    """Angles and lengths are kept when the mesh is subdivided, or bent."""
    plane = add_plane(cuts=2)
    add_directions(plane.data, 3, 0.3, 2.0)
    original = read_instances(depsgraph())[0].field.direction_ratios
    names = sorted(attribute.name for attribute in plane.data.attributes)
    subdivision = plane.modifiers.new("Subdivision", "SUBSURF")
    (instance,) = read_instances(depsgraph())
    assert instance.surface.face_count == 4 * len(plane.data.polygons)
    np.testing.assert_allclose(instance.field.direction_ratios[::4], original, atol=1e-6)
    plane.modifiers.remove(subdivision)
    bend = plane.modifiers.new("Bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.angle = "BEND", 1.0
    (instance,) = read_instances(depsgraph())
    np.testing.assert_allclose(instance.field.direction_ratios, original, atol=1e-6)
    assert sorted(attribute.name for attribute in plane.data.attributes) == names


def test_directions_replace_an_earlier_field(scene):
    plane = add_plane(cuts=2)
    surface = mesh_surface(plane.data)
    write_mesh_field(plane.data, axis_field(surface, 4, (1, 0, 0)))
    add_directions(plane.data, 6)
    phasor = np.exp(1j * np.array([0.0, 0.5, 3.0]))[None, :, None]
    x, y = (axis[:, None] for axis in surface.face_frames)
    field = field_from_directions(surface, phasor.real * x + phasor.imag * y)
    write_mesh_field(plane.data, field)
    names = {attribute.name for attribute in plane.data.attributes}
    assert {"dir0", "dir1", "dir2"} <= names and not {"rosy", "dir3", "dir5"} & names
    again = read_mesh_field(plane.data)
    np.testing.assert_allclose(again.direction_ratios, field.direction_ratios, atol=1e-6)
    assert plane.data.rosy.degree == 3


def test_two_directions_are_the_lines_of_a_cross(scene):
    mesh = add_plane(cuts=2).data
    for name, axis in zip(("dir0", "dir1"), mesh_surface(mesh).face_frames, strict=True):
        set_attribute(mesh, axis, name)
    with pytest.warns(RosyWarning, match="dir0 to dir1: rows have two directions that are nowhere"):
        assert read_mesh_field(mesh).degree == 4
    assert read_mesh_field(mesh, degree=2).degree == 2


# --- scenes ----------------------------------------------------------------------------------


def test_one_surface_for_all_instances(scene, monkey):
    collection = bpy.data.collections.new("Monkeys")
    scene.collection.objects.unlink(monkey)
    collection.objects.link(monkey)
    for x in range(3):
        add_instance(collection, (3.0 * x, 0.0, 0.0))
    instances = read_instances(depsgraph())
    assert len(instances) == 3
    assert len({id(instance.surface) for instance in instances}) == 1
    assert sorted(instance.matrix[0, 3] for instance in instances) == [0, 3, 6]
    assert field_objects(bpy.context.view_layer) == [monkey]


@pytest.mark.parametrize("is_excluded", [False, True])
def test_instances_of_geometry_nodes_show_objects_that_are_hidden(scene, monkey, is_excluded):
    if is_excluded:
        exclude("Suzanne")(scene)
    else:
        monkey.hide_render = True
        monkey.hide_set(True)
    assert field_objects(bpy.context.view_layer) == drawn_objects(depsgraph()) == []
    points = add_mesh("Points", [(2.0, 0, 0), (5.0, 0, 0), (9.0, 0, 0)], [])
    group = add_nodes(points, "GeometryNodeInstanceOnPoints")
    source = group.nodes.new("GeometryNodeObjectInfo")
    source.inputs["Object"].default_value = monkey
    source.inputs["As Instance"].default_value = True
    instance_socket = group.nodes["Instance on Points"].inputs["Instance"]
    group.links.new(source.outputs["Geometry"], instance_socket)
    assert drawn_objects(depsgraph()) == [monkey]
    instances = read_instances(depsgraph())
    assert [instance.matrix[0, 3] for instance in instances if instance.field] == [2, 5, 9]
    points.hide_render = True
    assert drawn_objects(depsgraph()) == []


def test_all_kinds_of_surfaces_occlude(scene, monkey):
    bpy.ops.mesh.primitive_cube_add(location=(4, 0, 0))
    bpy.ops.object.text_add(location=(5, 0, 0))
    bpy.context.object.data.extrude = 0.1
    bpy.ops.curve.primitive_bezier_circle_add(location=(6, 0, 0))
    bpy.context.object.data.bevel_depth = 0.1
    bpy.ops.object.metaball_add(location=(7, 0, 0))
    bpy.ops.surface.primitive_nurbs_surface_sphere_add(location=(8, 0, 0))
    bpy.ops.object.light_add(location=(9, 0, 0))
    bpy.ops.mesh.primitive_cube_add(location=(10, 0, 0))
    bpy.context.object.hide_render = True
    bpy.ops.mesh.primitive_cube_add(location=(11, 0, 0))
    bpy.context.object.visible_camera = False
    instances = read_instances(depsgraph())
    assert instances[0].field is not None
    assert sorted(instance.matrix[0, 3] for instance in instances) == [0, 4, 5, 6, 7, 8]


def test_an_occluder_hides_pixels(scene, camera):
    far = add_field(add_plane("Far"), kind="axis")
    near = add_plane("Near", size=0.4)
    near.location.y = -1.0
    with_field = [instance for instance in read_instances(depsgraph()) if instance.field]
    visible_pixels = len(projected(camera).pixel)
    assert 0 < visible_pixels < len(projected(camera, with_field).pixel)
    add_field(near, kind="axis").rosy.include = False
    assert field_objects(bpy.context.view_layer) == [far]
    assert len(projected(camera).pixel) == visible_pixels


def shader_material(kind, **inputs):
    """A material whose surface is a shader node of a type, with some values of its inputs."""
    material = bpy.data.materials.new(kind)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    node = nodes.new(f"ShaderNode{kind}")
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    links.new(node.outputs[0], nodes["Material Output"].inputs["Surface"])
    return material


def test_transparent_faces_hide_nothing(scene, camera):
    add_field(add_plane("Far", size=2.0), kind="axis")
    near = add_plane("Near", size=1.0, cuts=2)
    near.location.y = -1.0

    def visible():
        """Return the number of visible pixels of the field."""
        return len(projected(camera).pixel)

    opaque, glass = shader_material("BsdfDiffuse"), shader_material("BsdfGlass")
    near.data.materials.append(opaque)
    nothing = visible()
    near.data.materials.append(glass)
    near.data.polygons[0].material_index = 1
    a_quarter = visible()
    near.data.materials[0] = shader_material("BsdfPrincipled", Alpha=0.3)
    everything = visible()
    assert 0.2 < (a_quarter - nothing) / (everything - nothing) < 0.3
    near.material_slots[0].link = "OBJECT"
    near.material_slots[0].material = opaque
    assert visible() == a_quarter
    near.material_slots[0].material = None
    assert visible() == a_quarter
    glass.node_tree.links.clear()
    assert visible() == a_quarter


def test_users_may_name_attributes_like_those_of_blender(scene, monkey):
    """Blender 5 lets them have other types."""
    wall = add_plane("Wall", cuts=2)
    wall.data.materials.append(None)
    expected = read_instances(depsgraph())
    for mesh in (monkey.data, wall.data):
        mesh.attributes.new("material_index", "FLOAT_VECTOR", "FACE")
        mesh.attributes.new("sharp_face", "FLOAT", "FACE")
        mesh.attributes.new("sharp_edge", "BOOLEAN", "FACE")
    found = read_instances(depsgraph())
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.surface.corner_fan, other.surface.corner_fan)
        np.testing.assert_array_equal(one.surface.triangles, other.surface.triangles)


def test_reading_changes_nothing(scene, monkey):
    monkey.modifiers.new("Subdivision", "SUBSURF")
    before = contents()
    read_instances(depsgraph())
    assert contents() == before


def test_the_field_has_no_preferred_member(scene, camera, monkey):
    """Whichever member is stored on a face, the picture is the same."""
    first, mesh = projected(camera), monkey.data
    surface = mesh_surface(mesh)
    vectors = member_vectors(mesh).astype(np.float64)
    across = np.cross(surface.face_normal, vectors)
    angle = (np.arange(len(vectors)) % 4 * np.pi / 2)[:, None]
    set_attribute(mesh, np.cos(angle) * vectors + np.sin(angle) * across)
    second = projected(camera)
    np.testing.assert_array_equal(first.pixel, second.pixel)
    scale = np.abs(first.representation).max()
    assert np.abs(first.representation - second.representation).max() < 1e-4 * scale


def turn_by_shape_key(obj, matrix):
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Turned")
    shape = np.empty(3 * len(key.data), dtype=np.float32)
    key.data.foreach_get("co", shape)
    key.data.foreach_set("co", (shape.reshape(-1, 3) @ np.array(matrix).T).astype("f4").ravel())
    key.value = 1.0


def turn_by_armature(obj, matrix):
    bpy.ops.object.armature_add()
    rig = bpy.context.object
    obj.vertex_groups.new(name="Bone").add(range(len(obj.data.vertices)), 1.0, "REPLACE")
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    rig.pose.bones["Bone"].matrix = Matrix(matrix).to_4x4() @ rig.pose.bones["Bone"].matrix
    bpy.context.view_layer.update()


@pytest.mark.parametrize("deform", [turn_by_shape_key, turn_by_armature])
def test_the_field_follows_a_deformation(scene, camera, monkey, deform):
    """Rotated by a shape key or an armature, a mesh looks as if the object were rotated."""
    rotation = Matrix.Rotation(0.7, 3, (0.3, 0.5, 0.8))
    monkey.rotation_mode = "QUATERNION"
    monkey.rotation_quaternion = rotation.to_quaternion()
    bpy.context.view_layer.update()
    expected = projected(camera)
    monkey.rotation_quaternion = (1, 0, 0, 0)
    deform(monkey, rotation)
    assert_same_directions(expected, projected(camera), degrees=0.1, percentile=98)


def test_mirrored_and_moved_copies(scene, camera):
    """Modifiers that copy faces copy the field: mirrored, it is the mirror image."""
    plane = add_field(add_plane(cuts=2), kind="axis", degree=1, axis=(1.0, 0.0, 0.5))
    for vertex in plane.data.vertices:
        vertex.co.x += 1.5
    plane.modifiers.new("Mirror", "MIRROR")
    aim(camera, (0.0, -12.0, 0.0))
    buffer = projected(camera, display="flat")
    left = buffer.position[:, 0] < 0
    expected = np.where(left, np.pi, 0) + np.where(left, -1, 1) * np.arctan2(0.5, 1.0)
    angle = np.angle(buffer.representation * np.exp(-1j * expected))
    assert np.abs(angle).max() < 0.05


def test_a_field_that_was_made_for_other_faces_is_said(scene, monkey):
    """It is drawn, with a note. Angles have no meaning on faces that a modifier creates."""
    mesh = monkey.data
    modifier = monkey.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = 1
    data = read_scene(depsgraph())
    (instance,) = data.instances
    assert instance.surface.face_count == len(instance.field.vectors) > len(mesh.polygons)
    assert "made for the faces without modifiers: make it again" in data.warnings[0]
    z = representation(mesh, read_mesh_field(mesh))
    set_attribute(mesh, np.where(np.abs(z) > 0, np.angle(z) / 4, 0.0), kind="FLOAT")
    expect_error("stored as angles: make the field again", read_scene, depsgraph())
    modifier.levels = 0
    assert not read_scene(depsgraph()).warnings


def test_flat_shading_is_seen(scene, monkey):
    """Few faces may be meant so."""
    monkey.data.shade_flat()
    assert is_shaded_flat(monkey.data) and not is_shaded_flat(add_plane(cuts=2).data)
    monkey.data.shade_smooth()
    assert not is_shaded_flat(monkey.data)


def test_lights(scene):
    for kind, energy in (("SUN", np.pi), ("POINT", 4 * np.pi**2), ("AREA", 1.0), ("SPOT", 1.0)):
        add_light(kind, kind, energy, (0, 0, 3)).data.color = (1.0, 0.5, 0.25)
    lights = sorted(read_lights(depsgraph()), key=lambda one: (round(one.strength, 4), one.kind))
    assert [light.kind for light in lights] == ["point", "point", "point", "sun"]
    np.testing.assert_allclose([light.strength for light in lights[2:]], 1.0, rtol=1e-6)
    vectors = [light.vector for light in lights[2:]]
    np.testing.assert_allclose(vectors, [(0, 0, 3), (0, 0, 1)], atol=1e-6)
    np.testing.assert_allclose(lights[2].color, (1, 0.5, 0.25))


@pytest.mark.parametrize("shape", ["mixed", "triangles"])
def test_triangles_are_those_of_blender(monkey, shape):
    mesh = monkey.data
    if shape == "triangles":
        edited = bmesh.new()
        edited.from_mesh(mesh)
        bmesh.ops.triangulate(edited, faces=edited.faces)
        edited.to_mesh(mesh)
        edited.free()
    else:
        assert {len(face.vertices) for face in mesh.polygons} == {3, 4}
    surface = mesh_surface(mesh)
    mesh.calc_loop_triangles()
    np.testing.assert_array_equal(surface.triangles, [list(t.loops) for t in mesh.loop_triangles])
    face = [triangle.polygon_index for triangle in mesh.loop_triangles]
    np.testing.assert_array_equal(surface.triangle_face, face)


@pytest.mark.parametrize("mark", ["SELECTED", "SHARP", "SEAM"])
def test_marked_edges(scene, mark):
    # Not a mesh from `from_pydata`: Blender 5.0 crashes when the selection of its edges is written.
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=4)
    mesh = bpy.context.object.data
    for edge in mesh.edges:
        edge.select = edge.use_edge_sharp = edge.use_seam = False
    expect_error("has no edges of this kind", marked_edges, mesh, mark)
    for index in (3, 7):
        setattr(mesh.edges[index], EDGE_MARKS[mark][0], True)
    edges = marked_edges(mesh, mark)
    np.testing.assert_array_equal(edges, [list(mesh.edges[index].vertices) for index in (3, 7)])
    if mark == "SHARP":
        assert mark_sharp(mesh, np.array([*edges[:1, ::-1], mesh.edges[5].vertices])) == 2
        assert len(marked_edges(mesh, mark)) == 3


@pytest.mark.parametrize("repeated", [False, True])
def test_selected_edges_of_a_mesh_made_by_a_script(scene, repeated):
    """Blender selects the edges that it adds to a mesh, and no others."""
    mesh = add_plane(cuts=4).data
    count = len(mesh.edges)
    if repeated:
        edges = [tuple(edge.vertices) for edge in mesh.edges]
        vertices = [tuple(vertex.co) for vertex in mesh.vertices]
        faces = [tuple(face.vertices) for face in mesh.polygons]
        mesh = add_mesh("Repeated", vertices, faces, edges * 2).data
        assert len(mesh.edges) == count
        expect_error("has no edges of this kind", marked_edges, mesh, "SELECTED")
    else:
        assert len(marked_edges(mesh, "SELECTED")) == count

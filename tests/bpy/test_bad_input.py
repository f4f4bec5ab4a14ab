"""Errors of input that cannot be drawn: one line that names it, and an unchanged file."""

import bpy
import numpy as np
import pytest
from objects import (
    add_camera,
    add_field,
    add_instance,
    add_mesh,
    add_plane,
    aim,
    link,
    load,
    set_attribute,
)
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.core import memory
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.field.generate import generate
from rosy.rosy_addon.field.rosy_field import RosyField
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.scene.cameras import camera_of_object, scene_cameras
from rosy.rosy_addon.scene.face_values import read_face_scalars
from rosy.rosy_addon.scene.guides import (
    annotation_strokes,
    guide_strokes_and_empties,
    guide_vectors,
)
from rosy.rosy_addon.scene.mesh_fields import assign_fields, read_mesh_field, write_mesh_field
from rosy.rosy_addon.scene.meshes import marked_edges, mesh_surface
from rosy.rosy_addon.scene.visible_objects import field_objects
from scenes import contents, depsgraph, empty_scene, expect_error, member_vectors
from test_live_reading import LOSSES
from test_reading import add_directions
from test_up_to_date import put


def assert_refused(*words, act=bake, **options):
    """Bake, or act, and expect an error of one line with these words that leaves the file as it was."""
    before = contents()
    with pytest.raises(RosyError) as caught:
        act(bpy.context.scene, **options)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message
    assert contents() == before


def test_no_field(scene, camera):
    plane = add_plane()
    assert_refused("no visible object has a RoSy field")
    layer = bpy.context.view_layer
    expect_error("object 'Plane' has no attribute 'rosy'", field_objects, layer, ["Plane"])
    expect_error("there is no object 'Plain'", field_objects, layer, ["Plain"])
    expect_error("'Camera' is not a mesh, but of type Camera", field_objects, layer, ["Camera"])
    add_field(plane, kind="axis").hide_render = True
    expect_error(r"'Plane' is hidden in renders .*: show it", field_objects, layer, ["Plane"])


def test_more_memory_than_there_is(scene, camera, monkey, monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 10**9)
    assert_refused("a picture of 9000 x 9000 pixels", "1.0 GB are free", size=(9000, 9000))


@pytest.mark.parametrize(
    ("domain", "kind"),
    [("FACE", "INT"), ("FACE", "FLOAT_COLOR"), ("POINT", "FLOAT"), ("EDGE", "FLOAT_VECTOR")],
)
def test_wrong_type_or_domain(scene, camera, domain, kind):
    add_plane().data.attributes.new("rosy", kind, domain)
    words = "object 'Plane', attribute 'rosy'", "expected FLOAT_VECTOR on FACE"
    assert_refused(*words, f"found {kind} on {domain}")


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("domain", ["FACE", "POINT", "CORNER", "ANGLE"])
def test_not_finite(scene, camera, value, domain):
    plane = add_plane(cuts=3)
    size = {"FACE": 9, "POINT": 16, "CORNER": 36, "ANGLE": 9}[domain]
    values = np.zeros((size, 1)) if domain == "ANGLE" else np.tile([1.0, 0.0, 0.0], (size, 1))
    values[1, -1] = value
    form = {"kind": "FLOAT"} if domain == "ANGLE" else {"domain": domain}
    set_attribute(plane.data, values, **form)
    assert_refused("'Plane', attribute 'rosy'", f"1 of {size}", "not finite", "undefined")
    scene.rosy.undefined = True
    (baked,) = bake(scene)
    assert baked.picture.rgba[..., 3].max() == 1
    field = read_mesh_field(plane.data, nonfinite="zero")
    assert np.isfinite(field.vectors).all()
    if domain in ("FACE", "ANGLE"):
        np.testing.assert_array_equal(field.magnitude > 0, np.arange(9) != 1)


@pytest.mark.parametrize(
    ("vertices", "edges", "reason"),
    [
        ([], [], "it is empty"),
        ([(0, 0, 0), (1, 0, 0), (0, 0, 1)], [(0, 1), (1, 2)], "only vertices and loose edges"),
    ],
)
def test_no_faces(scene, camera, vertices, edges, reason):
    obj = add_mesh("Bare", vertices, [], edges)
    obj.data.attributes.new("rosy", "FLOAT_VECTOR", "FACE")
    assert_refused("object 'Bare'", "no faces", reason)
    expect_error("object 'Bare': the mesh has no faces", mesh_surface, obj.data)


def test_messages_name_the_object_and_not_its_mesh(scene):
    """A selected object, if several have the mesh; the mesh itself if no object has it."""
    first, second = add_plane(), add_plane()
    first.name, second.name, second.data, mesh = "First", "Second", first.data, first.data
    mesh.name = "Data"
    for obj, name in ((first, "object 'First'"), (second, "object 'Second'")):
        first.select_set(obj == first)
        second.select_set(obj == second)
        for read in (
            lambda: read_mesh_field(mesh),
            lambda: guide_vectors(mesh, "wind", mesh_surface(mesh)),
            lambda: read_face_scalars(mesh, "weight"),
            lambda: marked_edges(mesh, "SHARP"),
        ):
            expect_error(f"^{name}", read)
    for obj in (first, second):
        bpy.data.objects.remove(obj)
    expect_error(r"^mesh 'Data' has no attribute 'rosy'", read_mesh_field, mesh)


FIN = [(0, 0, -1), (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0)]


@pytest.mark.parametrize(
    ("vertices", "faces", "edges"),
    [
        ([(-1, 0, -1), (1, 0, -1), (0, 0, 1), (2, 0, 2)], [(0, 1, 2)], [(2, 3)]),
        (FIN, [(0, 2, 1), (0, 3, 1), (0, 4, 1)], []),
    ],
    ids=["loose edge", "three faces at an edge"],
)
def test_odd_meshes_are_drawn(scene, camera, vertices, faces, edges):
    add_field(add_mesh("Odd", vertices, faces, edges), kind="axis")
    assert bake(scene)


def roll_vectors(monkey):
    set_attribute(monkey.data, member_vectors(monkey.data)[:, [1, 2, 0]])


def store_too_many_directions(monkey):
    monkey.data.attributes.remove(monkey.data.attributes["rosy"])
    add_directions(monkey.data, 13)


def put_a_wall_in_front(monkey):
    add_plane("Wall", size=3.0).location.y = -3.0


def lose_the_camera(monkey):
    bpy.context.scene.camera = None


def use_an_odd_name(monkey):
    monkey.name = "line\nbreak\t\x1b[31m"
    monkey.data.attributes.remove(monkey.data.attributes["rosy"])
    monkey.data.attributes.new("rosy", "INT", "EDGE")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        *((lose, ("'Suzanne'", *words)) for lose, words in LOSSES.values()),
        (lose_the_camera, ("scene 'Scene' has no active camera",)),
        (put("Suzanne:hide_viewport", True), ("'Suzanne'", "hidden in the viewport")),
        (roll_vectors, ("'Suzanne', attribute 'rosy'", "not tangent to the surface", "off, face")),
        (store_too_many_directions, ("'Suzanne'", "13 attributes", "at most 12")),
        (put("Suzanne:location", (100.0, 0.0, 0.0)), ("'Camera'", "Suzanne", "outside the frame")),
        (put_a_wall_in_front, ("'Camera'", "Suzanne", "hidden behind")),
        (put("Camera:data.type", "PANO"), ("camera 'Camera' is panoramic",)),
        (use_an_odd_name, (r"line\nbreak\t\x1b[31m",)),
    ],
)
def test_what_cannot_be_drawn_is_refused(scene, camera, monkey, change, words):
    change(monkey)
    assert_refused(*words)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"cameras": ["Suzanne"]}, ("'Suzanne'", "not a camera")),
        *(({"size": size}, (f"size {size[0]}x{size[1]}",)) for size in ((0, 10), (100_000, 10))),
        ({"size": (10_000, 10), "look": Look(supersampling=4)}, ("size 40000x40",)),
    ],
    ids=str,
)
def test_impossible_options_are_refused(scene, camera, monkey, options, words):
    if "cameras" in options:
        options = {"cameras": [monkey]}
    assert_refused(*words, **options)


@pytest.mark.parametrize("degree", [0, -1, 1000])
def test_degree(scene, monkey, degree):
    expect_error(f"degree {degree} is not", read_mesh_field, monkey.data, degree=degree)
    monkey.data.rosy.degree = degree
    assert 1 <= monkey.data.rosy.degree <= 12


def test_a_mesh_around_the_camera_is_drawn(scene, camera):
    bpy.ops.mesh.primitive_uv_sphere_add()
    sphere = add_field(bpy.context.object, kind="axis")
    aim(camera, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    (baked,) = bake(scene)
    assert baked.picture.rgba[..., 3].min() == 1
    assert baked.objects == (sphere,)


def test_writing(scene, monkey):
    mesh = monkey.data
    field = generate(mesh_surface(mesh), "axis", 4)
    before, short = contents(), RosyField(4, field.vectors[1:])
    expect_error("'Suzanne' has 500 faces, but the field has 499", write_mesh_field, mesh, short)
    for name, words in (("UVMap", r"type \(FLOAT2 on CORNER"), ("position", "type")):
        expect_error(f"'{name}' of another {words}", write_mesh_field, mesh, field, name)
    bpy.context.view_layer.objects.active = monkey
    bpy.ops.object.mode_set(mode="EDIT")
    expect_error("'Suzanne' is in edit mode", write_mesh_field, monkey.data, field)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert contents() == before


def test_guide_objects(scene, monkey):
    mesh, message = monkey.data, "has no attribute 'flow' to follow: choose a vector"
    expect_error(message, guide_vectors, mesh, "flow", mesh_surface(mesh))
    spline = bpy.data.curves.new("Line", "CURVE").splines.new("POLY")
    line = link(bpy.data.objects.new("Line", bpy.data.curves["Line"]))
    spline.points.add(1)
    spline.points[0].co.x = np.nan
    message = "object 'Line' has a point that is not finite"
    expect_error(message, guide_strokes_and_empties, [line], monkey)
    monkey.scale.x = 0.0
    bpy.context.view_layer.update()
    expect_error("object 'Suzanne' has a scale of zero", guide_strokes_and_empties, [line], monkey)


def test_a_scene_without_annotations(scene, monkey):
    message = "has no annotation to follow: draw one on the mesh"
    expect_error(message, annotation_strokes, scene, monkey)


@pytest.mark.skipif(hasattr(bpy.types, "Annotation"), reason="scripts cannot make annotations")
def test_annotations_that_are_followed(scene, monkey):
    """Only strokes on visible layers, of the current frame, in the space of the scene."""
    data = scene.grease_pencil = bpy.data.grease_pencils.new("Notes")
    for name, frame, mode in (
        ("Shown", 1, "3DSPACE"),
        ("Hidden", 1, "3DSPACE"),
        ("Later", 9, "3DSPACE"),
        ("On View", 1, "SCREEN"),
    ):
        layer = data.layers.new(name)
        layer.annotation_hide = name == "Hidden"
        stroke = layer.frames.new(frame).strokes.new()
        stroke.display_mode = mode
        stroke.points.add(2)
        stroke.points.foreach_set("co", [1.0, 0.0, 0.0, 3.0, 0.0, 0.0])
    monkey.location.x, monkey.scale = 1.0, (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    (stroke,) = annotation_strokes(scene, monkey)
    np.testing.assert_allclose(stroke, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], atol=1e-6)


@pytest.mark.parametrize("form", ["VECTOR", "DIRECTIONS", "ANGLE"])
def test_fields_are_stored_on_all_meshes_or_none(scene, monkey, form):
    other = add_plane("Other")
    name = {"VECTOR": "taken", "DIRECTIONS": "dir0", "ANGLE": "taken"}[form]
    other.data.attributes.new(name, "BOOLEAN", "POINT")
    meshes = [obj.data for obj in (add_plane(), monkey, other)]
    fields = {mesh: generate(mesh_surface(mesh), "axis", 4) for mesh in meshes}
    before = contents()
    message = f"mesh 'Other' already has an attribute '{name}'"
    expect_error(message, assign_fields, fields, "taken", form)
    assert contents() == before
    # Blender would rename this one if it failed to create an attribute.
    meshes[0].attributes.new("Float3", "FLOAT_VECTOR", "EDGE")
    before, first = contents(), {meshes[0]: fields[meshes[0]]}
    message = r"mesh 'Plane': 'x+' cannot be the name of an attribute"
    expect_error(message, assign_fields, first, "x" * 300)
    assert contents() == before


@pytest.fixture
def library(scene, monkey, tmp_path):
    """A .blend file with Suzanne, her field and an empty file to link it into."""
    collection = bpy.data.collections.new("Monkeys")
    scene.collection.children.link(collection)
    collection.objects.link(monkey)
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    scene = empty_scene(64)
    scene.camera = add_camera()
    return path


@pytest.mark.parametrize(
    ("kind", "name", "show"),
    [("objects", "Suzanne", link), ("collections", "Monkeys", add_instance)],
)
def test_linked_objects_are_refused(library, kind, name, show):
    show(load(library, name, kind, link=True))
    assert_refused("object 'Suzanne' is linked from", "library.blend")


def test_linked_mesh_can_be_drawn_but_not_written(library):
    mesh = load(library, "Suzanne", "meshes", link=True)
    obj = link(bpy.data.objects.new("Local", mesh))
    (baked,) = bake(bpy.context.scene)
    assert baked.objects == (obj,)
    field = read_mesh_field(mesh)
    expect_error(r"mesh 'Suzanne' is linked from .*library\.blend", write_mesh_field, mesh, field)


def test_cameras_of_one_name(library):
    """A linked camera may have the name of a local one."""
    bpy.ops.wm.open_mainfile(filepath=str(library))
    add_camera()
    bpy.ops.wm.save_mainfile()
    scene = empty_scene(64)
    link(load(library, "Camera", link=True))
    add_camera()
    assert_refused("several cameras have the name 'Camera'", cameras=scene_cameras(scene))


def test_missing_libraries_are_named(library):
    link(load(library, "Suzanne", link=True))
    link(bpy.data.objects.new("Local", load(library, "Suzanne", "meshes", link=True)))
    path = library.with_name("scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    library.rename(library.with_name("moved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene, layer = bpy.context.scene, bpy.context.view_layer
    suzanne = scene.objects["Suzanne"]
    missing = "library .*library.blend is missing: relink it"
    for name in ("Suzanne", "Local"):
        expect_error(f"object '{name}': its {missing}", field_objects, layer, [name])
    expect_error(f"object 'Suzanne': its {missing}", camera_of_object, scene, depsgraph(), suzanne)
    local, message = scene.objects["Local"], f"object 'Suzanne': its {missing}"
    expect_error(message, guide_strokes_and_empties, [suzanne], local)
    assert_refused("visible object has a RoSy field: relink the missing library", "library.blend")
    expect_error("no object 'Head': relink the missing library", field_objects, layer, ["Head"])


def test_an_override_of_a_mesh_cannot_be_written(library):
    """Blender would ignore the values without a word."""
    local = link(load(library, "Suzanne", link=True)).override_create(remap_local_usages=True)
    mesh = local.data.override_create(remap_local_usages=True)
    field = read_mesh_field(mesh)
    expect_error("'Suzanne' is linked from its library", write_mesh_field, mesh, field)
    (baked,) = bake(bpy.context.scene)
    assert baked.objects == (local,) and mesh == local.data


@pytest.mark.parametrize("as_float", [False, True])
def test_unwritable_folder(scene, camera, monkey, tmp_path, as_float):
    scene.rosy.store = "SAVED"
    scene.rosy.image_format = "FLOAT" if as_float else "BYTE"
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    scene.rosy.directory = str(blocked)
    assert_refused(str(blocked))
    scene.rosy.directory = " "
    assert_refused("scene 'Scene' has no folder for pictures")
    scene.rosy.directory = str(blocked / "below")
    assert_refused(str(blocked))
    scene.rosy.directory = "//pictures"
    assert_refused("save the .blend file first")


def test_the_smallest_camera_has_one_pixel(scene, camera):
    scene.render.resolution_percentage = 1
    scene.render.resolution_x = scene.render.resolution_y = 10
    view = camera_of_object(scene, depsgraph(), camera)
    assert (view.width, view.height) == (1, 1)

"""Stroke objects of a scene: their data, what renders show, and that nothing else changes."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from harness.blender_data import attribute_values
from objects import add_field, add_nodes, add_plane, link
from rosy.rosy_addon.jobs.draw_strokes import draw_strokes
from rosy.rosy_addon.line_drawing.outline import OUTLINE_KINDS
from rosy.rosy_addon.line_drawing.style import StrokeStyle
from rosy.rosy_addon.line_drawing.svg import Pen
from rosy.rosy_addon.line_drawing.visibility import pixel_size, project_to_pixels
from rosy.rosy_addon.scene.cameras import camera_of_object
from rosy.rosy_addon.scene.scene_reader import read_scene
from rosy.rosy_addon.scene.stroke_data import has_grease_pencil_drawings
from rosy.rosy_addon.scene.stroke_objects import edited_strokes, remove_strokes, stroke_objects
from rosy.rosy_addon.worker.job import Step
from scenes import contents, depsgraph, each_step, render, reopen
from test_bad_input import assert_refused
from test_up_to_date import put

PLAIN = StrokeStyle(spacing=12, outline=1.0)
WIDE = StrokeStyle(spacing=20)
BLACK = Pen(width=1.5)

#: Type of a Grease Pencil object, which is another one since Blender 4.3.
PENCIL = "GREASEPENCIL" if has_grease_pencil_drawings() else "GPENCIL"


def view(scene):
    return camera_of_object(scene, depsgraph(), scene.camera)


def pencil_strokes(layer):
    """Return the points (n, 3), widths (n,) and material index of each stroke, in world units."""
    (frame,) = layer.frames
    has_drawings, lines = has_grease_pencil_drawings(), []
    for stroke in frame.drawing.strokes if has_drawings else frame.strokes:
        points = np.array([p.position if has_drawings else p.co for p in stroke.points])
        if has_drawings:
            width = 2 * np.array([point.radius for point in stroke.points])
        else:
            width = np.array([p.pressure for p in stroke.points]) * stroke.line_width / 1000
        lines.append((points, width, stroke.material_index))
    return lines


def test_grease_pencil_holds_the_strokes(monkey, camera, scene):
    result = draw_strokes(scene, kind="PENCIL", style=PLAIN, pen=BLACK)
    data, strokes = result.obj.data, result.drawing.strokes
    assert result.obj.type == PENCIL
    titles = [layer.name if has_grease_pencil_drawings() else layer.info for layer in data.layers]
    assert titles == ["Family 1", "Family 2", "Outline"]
    assert not any(material.grease_pencil.show_fill for material in data.materials)
    camera_view = view(scene)
    for index, layer in enumerate(data.layers):
        lines = pencil_strokes(layer)
        in_layer = np.array([strokes.names[family] in OUTLINE_KINDS for family in strokes.family])
        in_layer = in_layer if index == 2 else strokes.family == index
        assert len(lines) == in_layer.sum() and not layer.use_lights
        assert {material for _, _, material in lines} == {index}
        for (points, width, _), stroke in zip(lines, np.flatnonzero(in_layer), strict=True):
            part = slice(*strokes.start[stroke : stroke + 2])
            positions, _ = project_to_pixels(points, camera_view)
            expected, _ = project_to_pixels(strokes.points[part], camera_view)
            np.testing.assert_allclose(positions[[0, -1]], expected[[0, -1]], atol=0.01)
            width = width / pixel_size(points, camera_view)
            assert np.isclose(width.max(), 1.5 * strokes.width[part].max(), rtol=0.03)


def test_curves_hold_the_strokes_and_their_attributes(monkey, camera, scene):
    result = draw_strokes(scene, kind="CURVES", style=replace(PLAIN, spacing=6), pen=BLACK)
    data, strokes = result.obj.data, result.drawing.strokes
    assert result.obj.type == "CURVES" and len(data.curves) == len(strokes)
    attributes = {name: data.attributes[name] for name in data.attributes.keys()}  # noqa: SIM118
    for domain, kind, names in (
        ("POINT", "FLOAT", ("radius", "opacity", "spacing")),
        ("POINT", "FLOAT_VECTOR", ("member", "surface_normal")),
        ("POINT", "INT", ("face_index",)),
        ("CURVE", "INT", ("family", "object")),
        ("CURVE", "FLOAT_COLOR", ("ink",)),
    ):
        found = {(attributes[name].domain, attributes[name].data_type) for name in names}
        assert found == {(domain, kind)}
    np.testing.assert_array_equal(attribute_values(attributes["family"]), strokes.family)
    member = attribute_values(attributes["member"], "vector", 3)
    normal = attribute_values(attributes["surface_normal"], "vector", 3)
    has_member = member.any(axis=1)
    assert np.allclose(np.linalg.norm(member[has_member], axis=1), 1, atol=1e-4)
    camera_view = view(scene)
    first = np.array([curve.first_point_index for curve in data.curves])
    begins = strokes.start[:-1]
    np.testing.assert_allclose(member[first], strokes.member[begins], atol=1e-4)
    np.testing.assert_allclose(normal[first], strokes.normal[begins], atol=1e-4)
    face = attribute_values(attributes["face_index"])
    np.testing.assert_array_equal(face[first], strokes.face[begins])
    points = attribute_values(attributes["position"], "vector", 3)[first].astype(float)
    positions, _ = project_to_pixels(points, camera_view)
    expected, _ = project_to_pixels(strokes.points[begins], camera_view)
    np.testing.assert_allclose(positions, expected, atol=0.01)
    width = 2 * attribute_values(attributes["radius"])[first] / pixel_size(points, camera_view)
    np.testing.assert_allclose(width, BLACK.width * strokes.width[begins], rtol=0.03)


def test_renders_do_not_show_hidden_curves(monkey, camera, scene, tmp_path):
    wall = add_plane("Wall", size=0.5)
    wall.location = (0.5, -2.0, 0.3)
    corners = np.array([[x, 0, z] for x in (-0.5, 0.5) for z in (-0.5, 0.5)]) + wall.location
    corners, _ = project_to_pixels(corners, view(scene))
    low, high = corners.min(axis=0), corners.max(axis=0)
    # The round end of a stroke reaches 1 pixel behind the wall, and the filter of the render 1.5 more.
    covered = (slice(int(low[1]) + 3, int(high[1]) - 3), slice(int(low[0]) + 3, int(high[0]) - 3))
    for hidden in (False, True):
        wall.hide_render = monkey.hide_render = False
        style = StrokeStyle(spacing=10, hidden=hidden)
        draw_strokes(scene, kind="CURVES", style=style, pen=Pen(width=2.0))
        # Strokes behind the wall are left out, so nothing appears there without the wall.
        wall.hide_render = monkey.hide_render = True
        alpha = render(scene, tmp_path / "curves.exr", samples=8)[..., 3]
        assert alpha.max() > 0.9 and alpha[covered].size > 300
        assert alpha[covered].any() == hidden


def pencil_modifiers(obj):
    """The modifiers of a Grease Pencil object."""
    return obj.modifiers if has_grease_pencil_drawings() else obj.grease_pencil_modifiers


@pytest.mark.parametrize("kind", ["PENCIL", "CURVES"])
def test_strokes_are_replaced_and_removed(wall, camera, scene, kind):
    before = contents()
    first = draw_strokes(scene, kind=kind, style=PLAIN).obj
    drawn_once = contents()
    first.name = "Mine"
    if kind == "PENCIL":
        noise = "GREASE_PENCIL_NOISE" if has_grease_pencil_drawings() else "GP_NOISE"
        pencil_modifiers(first).new("Noise", noise)
    first.location.x = 5.0
    again = draw_strokes(scene, kind=kind, style=StrokeStyle(spacing=16, outline=1.0)).obj
    assert again == first and again.name == "Mine"
    assert kind == "CURVES" or pencil_modifiers(again)[0].name == "Noise"
    assert np.allclose(again.matrix_basis, np.eye(4))
    again.name = f"RoSy Strokes {camera.name}"
    drawn_twice = contents()
    assert drawn_twice.keys() == drawn_once.keys()
    assert all(drawn_twice[key] == drawn_once[key] for key in ("objects", "materials"))
    assert remove_strokes(scene) == 1
    assert contents() == before
    assert remove_strokes(scene) == 0


def test_copies_belong_to_the_user(wall, camera, scene):
    first = draw_strokes(scene, kind="CURVES", style=PLAIN).obj
    copy = link(first.copy())
    copy.data = first.data.copy()
    count = len(copy.data.curves)
    linked = link(first.copy())  # on the same data
    assert draw_strokes(scene, kind="CURVES", style=StrokeStyle(spacing=14)).obj == first
    assert len(copy.data.curves) == len(linked.data.curves) == count > len(first.data.curves)
    assert stroke_objects(scene) == [first]
    remove_strokes(scene)
    assert {copy.name, linked.name} <= set(scene.objects.keys())


def test_a_deleted_object_is_created_again(wall, camera, scene):
    first = draw_strokes(scene, kind="PENCIL", style=PLAIN).obj
    bpy.data.objects.remove(first)
    assert not stroke_objects(scene)
    draw_strokes(scene, kind="PENCIL", style=PLAIN)
    scene.collection.objects.unlink(stroke_objects(scene)[0])  # as Delete does
    assert not stroke_objects(scene)
    second = draw_strokes(scene, kind="PENCIL", style=PLAIN).obj
    assert stroke_objects(scene) == [second]
    assert [obj.name for obj in bpy.data.objects if obj.type == PENCIL] == [second.name]


def test_strokes_of_one_mesh_move_with_it(wall, camera, scene):
    wall.location, wall.scale = (0.2, 0.0, 0.1), (1.2, 1.0, 0.9)
    obj = draw_strokes(scene, kind="CURVES", style=PLAIN).obj
    bpy.context.view_layer.update()
    assert np.allclose(obj.matrix_world, np.eye(4), atol=1e-6)
    wall.location.x += 1.0
    bpy.context.view_layer.update()
    assert np.allclose(obj.matrix_world.translation, (1, 0, 0), atol=1e-6)
    add_field(add_plane("Other", cuts=4), "axis")
    assert draw_strokes(scene, kind="CURVES", style=PLAIN).obj.parent is None


def test_chosen_objects_are_drawn_and_others_occlude(monkey, camera, scene):
    wall = add_field(add_plane("Wall", size=0.6, cuts=3), "axis")
    wall.location.y = -2.0
    instances = read_scene(depsgraph()).instances
    assert len(instances) == 2
    result = draw_strokes(scene, kind="FILE", path="/tmp/unused.svg", objects=[wall], style=WIDE)
    assert np.allclose(result.drawing.strokes.points[:, 1], -2.0)
    behind = draw_strokes(scene, kind="CURVES", objects=[monkey], style=WIDE).drawing.strokes
    wall.hide_render = True
    assert len(draw_strokes(scene, kind="CURVES", style=WIDE).drawing.strokes) > len(behind)


def test_meshes_from_strokes_do_not_occlude(wall, camera, scene):
    """Geometry Nodes may turn stroke objects into meshes; these are not read as occluders."""
    first = draw_strokes(scene, kind="CURVES", style=WIDE)
    group = add_nodes(first.obj, "GeometryNodeCurveToMesh")
    circle = group.nodes.new("GeometryNodeCurvePrimitiveCircle")
    circle.inputs["Radius"].default_value = 0.3
    profile = group.nodes["Curve to Mesh"].inputs["Profile Curve"]
    group.links.new(circle.outputs["Curve"], profile)
    again = draw_strokes(scene, kind="CURVES", style=WIDE)
    np.testing.assert_array_equal(again.drawing.strokes.points, first.drawing.strokes.points)


def test_settings_of_the_scene_are_those_of_the_function(wall, camera, scene, tmp_path):
    settings = scene.rosy.strokes
    settings.kind, settings.filepath = "FILE", str(tmp_path / "a.svg")
    settings.spacing, settings.taper, settings.width = 9.3, 0.4, 0.7
    settings.light, settings.outline = "lamp", True
    settings.inks, settings.outline_color = "FAMILIES", (1.0, 0.0, 0.0)
    assert draw_strokes(scene).path == tmp_path / "a.svg"
    style = StrokeStyle(spacing=9.3, taper=0.4, light="lamp", outline=1.0)
    pen = Pen(width=0.7, colors=["#db8021", "#4594eb"], outline="#ff0000")
    draw_strokes(scene, kind="FILE", path=tmp_path / "b.svg", style=style, pen=pen)
    text = (tmp_path / "a.svg").read_text()
    assert text == (tmp_path / "b.svg").read_text() and 'stroke="#ff0000"' in text


@pytest.mark.parametrize("suffix", [".ply", ".obj"])
def test_polylines_lie_on_the_object_when_imported(monkey, camera, scene, tmp_path, suffix):
    """Blender's importers read the files that RoSy writes."""
    path = tmp_path / f"lines{suffix}"
    style = StrokeStyle(spacing=12, hidden=True, outline=1.0)
    strokes = draw_strokes(scene, kind="FILE", path=path, style=style, pen=BLACK).drawing.strokes
    assert strokes.closed.any()
    importer = bpy.ops.wm.ply_import if suffix == ".ply" else bpy.ops.wm.obj_import
    assert importer(filepath=str(path)) == {"FINISHED"}
    obj = bpy.context.object
    mesh, matrix = obj.data, np.array(obj.matrix_world)
    points = np.array([vertex.co for vertex in mesh.vertices]) @ matrix[:3, :3].T + matrix[:3, 3]
    is_near = [np.linalg.norm(strokes.points - point, axis=1).min() < 1e-5 for point in points]
    assert all(is_near)
    # Every line is a chain or a loop.
    degree = np.bincount(np.array([edge.vertices for edge in mesh.edges]).ravel())
    open_count = int((~strokes.closed).sum())
    assert np.bincount(degree).tolist() == [0, 2 * open_count, len(degree) - 2 * open_count]
    ends = strokes.points[strokes.start[1:] - 1][~strokes.closed]
    assert np.isclose(np.sort(points[degree == 1], axis=0)[-1], np.sort(ends, axis=0)[-1]).any()


def test_cancelling_leaves_nothing(wall, camera, scene):
    before = contents()
    stepping = each_step(draw_strokes.begin(scene, kind="PENCIL", style=PLAIN))
    for step in stepping:
        if isinstance(step, Step):
            stepping.close()
    assert contents() == before


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (put("camera", None), "scene 'Scene' has no active camera"),
        (put("Suzanne:data.rosy.attribute", "none"), "no visible object has a RoSy field"),
        (put("Suzanne:location", (0.0, -50.0, 0.0)), "camera 'Camera': no stroke is visible"),
    ],
)
def test_nothing_to_draw_is_an_error(monkey, camera, scene, change, text):
    change(scene)
    assert_refused(text, act=draw_strokes, kind="PENCIL")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"kind": "FILE", "path": "//a.svg"}, "//a.svg: save the .blend file first"),
        ({"kind": "FILE", "path": "/tmp/a.png"}, "a.png: the name of the file must end in .svg"),
        ({"kind": "FILE", "path": "/nowhere/a.svg"}, "the folder /nowhere does not exist"),
        ({"style": StrokeStyle(unit="world", distance=1e-6)}, "increase their distance"),
    ],
)
def test_wrong_input_is_one_line_and_changes_nothing(monkey, camera, scene, options, text):
    assert_refused(text, act=draw_strokes, **{"kind": "PENCIL", **options})


def move_a_point(data):
    if data.id_type == "CURVES":
        data.attributes["position"].data[0].vector.x += 0.1
    elif has_grease_pencil_drawings():
        drawings = [layer.frames[0].drawing for layer in data.layers]
        drawing = next(drawing for drawing in drawings if len(drawing.strokes))
        drawing.attributes["position"].data[0].vector.x += 0.1
    else:
        frame = next(layer.frames[0] for layer in data.layers if len(layer.frames[0].strokes))
        frame.strokes[0].points[0].co.x += 0.1


def recolor(data):
    if data.id_type == "CURVES":
        data.attributes["ink"].data[0].color = (1.0, 0.0, 0.0, 1.0)
    else:
        data.materials[0].grease_pencil.color = (1.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("edit", [move_a_point, recolor])
@pytest.mark.parametrize("kind", ["PENCIL", "CURVES"])
def test_edited_strokes_are_recognized_and_kept(wall, camera, scene, tmp_path, kind, edit):
    name = draw_strokes(scene, kind=kind, style=WIDE).obj.name
    assert edited_strokes(scene, kind, "Camera") is None
    scene = reopen(tmp_path / "strokes.blend")
    obj = bpy.data.objects[name]
    assert edited_strokes(scene, kind, "Camera") is None
    obj.location.x += 1
    assert edited_strokes(scene, kind, "Camera") is None
    edit(obj.data)
    assert edited_strokes(scene, kind, "Camera") == obj
    assert edited_strokes(scene, kind, "Other") is None
    kept = contents()
    result = draw_strokes(scene, kind=kind, style=WIDE)
    assert result.obj != obj and obj.name in scene.objects
    assert f"'{obj.name}' was edited and stays" in result.notes[-1]
    assert not any(block.get("rosy_made") for block in (obj.data, *obj.data.materials))
    assert edited_strokes(scene, kind, "Camera") is None
    assert remove_strokes(scene) == 1
    assert contents() == kept


def test_new_strokes_are_put_into_a_collection(wall, camera, scene):
    """Strokes that are drawn again stay where they are."""
    first, second = (bpy.data.collections.new(name) for name in ("First", "Second"))
    for collection in (first, second):
        scene.collection.children.link(collection)
    obj = draw_strokes(scene, kind="CURVES", style=WIDE, collection=first).obj
    assert obj.users_collection == (first,)
    draw_strokes(scene, kind="CURVES", style=WIDE, collection=second)
    assert obj.users_collection == (first,)

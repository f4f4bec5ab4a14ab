"""Each operator with a real mesh, its errors, and why its button is disabled."""

from unittest.mock import patch

import bpy
import numpy as np
import pytest
from conftest import contents, error_of, member_vectors
from extension import rosy
from harness.blender_data import attribute_values


@pytest.mark.parametrize(("kind", "degree"), [("curvature", 4), ("axis", 12), ("uv", 4)])
def test_generate_on_all_selected(suzanne, kind, degree):
    bpy.ops.mesh.primitive_torus_add(location=(3, 0, 0))
    suzanne.select_set(True)
    assert bpy.ops.rosy.field_generate(kind=kind, degree=degree) == {"FINISHED"}
    for obj in bpy.context.selected_objects:
        mesh = obj.rosy.field_mesh or obj.data  # of the subdivided faces
        vectors = member_vectors(mesh)
        normal = np.array([face.normal for face in mesh.polygons])
        assert mesh.rosy.degree == degree
        assert np.abs(np.sum(vectors * normal, axis=1)).max() < 1e-5
        assert np.linalg.norm(vectors, axis=1).max() > 0.5


def test_an_object_without_features_does_not_stop_the_others(suzanne, capfd):
    suzanne.select_set(False)
    bpy.ops.mesh.primitive_uv_sphere_add()
    bpy.ops.object.shade_smooth()
    ball = bpy.context.object
    ball.name, ball.data.name = "Ball", "Data"
    settings = {"kind": "features", "sharp_angle": 1.0}
    before = contents()
    message = error_of(bpy.ops.rosy.field_generate, **settings)
    assert "Object 'Ball': has no border or sharp edge" in message
    assert contents() == before
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    ball.select_set(True)
    assert bpy.ops.rosy.field_generate(**settings) == {"FINISHED"}
    assert "rosy" in cube.data.attributes and "rosy" not in ball.data.attributes
    output = capfd.readouterr().out
    assert "Warning: Object 'Ball': has no border or sharp edge" in output
    assert "on 'Cube'" in output


def test_lack_of_memory_is_reported(with_field):
    before = contents()
    with patch.object(rosy("rosy_addon.core.memory"), "available_memory", side_effect=MemoryError):
        for operator in (bpy.ops.rosy.bake, bpy.ops.rosy.field_generate):
            assert "There is not enough memory" in error_of(operator)
    assert contents() == before


#: What each operator says to wrong settings, with a cube whose field is of degree 4.
ERRORS = [
    ("field_generate", {"kind": "curvature", "degree": 3}, "curvature"),
    ("field_generate", {"kind": "curvature"}, "'Cube': Curvature gives no direction on any face"),
    ("field_generate", {"kind": "axis", "axis": (0, 0, 0)}, "Axis"),
    ("field_generate", {"kind": "guided"}, "There are no guides"),
    ("field_generate", {"kind": "guided", "guide": "Nobody"}, "'Nobody'"),
    ("field_generate", {"kind": "uv", "uv_map": "none"}, "UV map 'none'"),
    ("field_generate", {"kind": "prescribed"}, "has no points: press Singularities"),
    ("field_convert", {"degree": 3}, "neither a multiple"),
    ("field_convert", {"magnitude": "values", "values": "nothing"}, "'nothing'"),
    ("field_store", {"form": "TANGENT", "attribute": "rosy"}, "'rosy'"),
    ("field_import", {"filepath": "/none/missing.rosy"}, "missing.rosy"),
    ("field_export", {"filepath": "/none/field.rosy"}, "field.rosy"),
    ("field_comb", {}, "The stroke has no points"),
    ("field_compare", {"other": "missing"}, "no attribute 'missing'"),
    ("bake", {"camera": "VIEW"}, "view"),
    ("strokes", {"camera": "VIEW"}, "view"),
    ("strokes", {"kind": "FILE", "filepath": "/none/a.png"}, ".svg"),
    ("show", {"camera": "Nobody"}, "baked"),
    ("remove", {}, "baked"),
    ("preset_apply", {"preset": "nonsense"}, "nonsense"),
]


@pytest.mark.parametrize(("operator", "settings", "message"), ERRORS)
def test_errors_change_nothing(scene, operator, settings, message):
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.rosy.field_generate(kind="axis", degree=4)
    before = contents()
    assert message in error_of(getattr(bpy.ops.rosy, operator), **settings)
    assert contents() == before


def test_reasons_of_disabled_buttons(scene):
    assert "Select a mesh" in error_of(bpy.ops.rosy.field_generate)
    assert "field" in error_of(bpy.ops.rosy.bake)
    bpy.ops.mesh.primitive_cube_add()
    assert "no field" in error_of(bpy.ops.rosy.field_export, filepath="/none/never.rosy")
    bpy.ops.object.mode_set(mode="EDIT")
    assert "Tab" in error_of(bpy.ops.rosy.field_generate)


# --- guides ----------------------------------------------------------------------------------


#: Types of objects that guide fields. Blender 4.3 converts each into the next one alone.
KINDS = ("CURVE", "CURVES", "GREASEPENCIL")


def add_ball_and_guide(kind):
    """Add a sphere, and an arc on it of a type of objects. The sphere is active; both are selected."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5, location=(1.0, 2.0, 0.5))
    ball = bpy.context.object
    ball.rotation_euler = (0.3, 0.2, 0.1)
    ball.scale = (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    curve = bpy.data.curves.new("Curve", "CURVE")
    curve.dimensions = "3D"
    spline = curve.splines.new("POLY")
    angle = np.linspace(0, 1.2, 25)
    arc = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    spline.points.add(24)
    spline.points.foreach_set("co", np.c_[arc, np.ones(25)].ravel())
    guide = bpy.data.objects.new("Curve", curve)
    guide.matrix_world = ball.matrix_world
    bpy.context.scene.collection.objects.link(guide)
    ball.select_set(False)
    guide.select_set(True)
    bpy.context.view_layer.objects.active = guide
    for target in KINDS[1 : KINDS.index(kind) + 1]:
        bpy.ops.object.convert(target=target)
    guide = bpy.context.object
    assert guide.type == kind
    ball.select_set(True)
    bpy.context.view_layer.objects.active = ball
    return ball, guide


@pytest.mark.parametrize("kind", KINDS)
def test_strokes_are_followed(scene, kind):
    ball, guide = add_ball_and_guide(kind)
    named = guide.name if kind == "CURVE" else ""
    assert bpy.ops.rosy.field_generate(kind="guided", degree=2, guide=named) == {"FINISHED"}
    vectors = member_vectors(ball.data)
    center = np.array([face.center for face in ball.data.polygons])
    near_arc = (np.abs(center[:, 1]) < 0.04) & (center[:, 0] > 0.4) & (center[:, 2] > 0.1)
    assert near_arc.sum() > 10
    tangent = np.stack([-center[:, 2], 0 * center[:, 1], center[:, 0]], axis=1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    cosine = np.abs(np.sum(vectors * tangent, axis=1))[near_arc]
    assert np.degrees(np.arccos(cosine.clip(0, 1))).max() < 5


# --- conversions -----------------------------------------------------------------------------


def test_convert(suzanne):
    bpy.ops.rosy.field_generate(kind="smoothest", degree=4)
    group = suzanne.vertex_groups.new(name="Weights")
    group.add(list(range(100)), 0.5, "REPLACE")
    converted = bpy.ops.rosy.field_convert(
        degree=8, angle=0.1, smooth=0.01, magnitude="values", values="Weights"
    )
    assert converted == {"FINISHED"}
    assert suzanne.rosy.field_mesh.rosy.degree == 8
    length = np.linalg.norm(member_vectors(suzanne.rosy.field_mesh), axis=1)
    assert 0.4 < length.max() <= 0.5 + 1e-6 and length.min() == 0
    bpy.ops.rosy.field_convert(degree=4)
    assert suzanne.rosy.field_mesh.rosy.degree == 4


# --- combing ---------------------------------------------------------------------------------


def stroke(start, stop):
    """A stroke along the equator of a unit sphere."""
    at_rest = {"name": "", "pressure": 1.0, "is_start": False}
    angles = np.linspace(start, stop, 40)
    return [{**at_rest, "location": (np.cos(angle), np.sin(angle), 0.0)} for angle in angles]


def face_centers(mesh):
    """The centers of faces, and the azimuths of these."""
    center = np.array([face.center for face in mesh.polygons])
    return center, np.arctan2(center[:, 1], center[:, 0])


def test_combed_field_runs_along_the_stroke_and_is_made_again_from_its_guides(scene):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5)
    mesh = bpy.context.object.data
    bpy.ops.rosy.field_generate(kind="axis", axis=(1.0, 1.0, 1.0), degree=2)
    comb = {"stroke": stroke(0.0, 1.0), "radius": 0.15}
    assert bpy.ops.rosy.field_comb(**comb) == {"FINISHED"}
    center, azimuth = face_centers(mesh)
    is_near = (np.abs(center[:, 2]) < 0.03) & (azimuth > 0.1) & (azimuth < 0.9)
    along = np.stack([-np.sin(azimuth), np.cos(azimuth), 0 * azimuth], axis=1)

    def deviation():
        vectors = member_vectors(mesh)
        cosine = np.abs((vectors * along).sum(axis=1)) / np.linalg.norm(vectors, axis=1)
        return np.degrees(np.arccos(np.clip(cosine, 0, 1)))[is_near].max()

    assert deviation() < 3.0
    combed = member_vectors(mesh)
    guides = np.linalg.norm(member_vectors(mesh, "rosy_guides"), axis=1)
    assert guides[is_near].min() > 0.9 and guides.max() <= 1.0
    # The guides make the same field again, but for its magnitude.
    generate = bpy.ops.rosy.field_generate
    assert generate(kind="guided", guides={"ATTRIBUTE"}, degree=2) == {"FINISHED"}
    again = member_vectors(mesh)
    scale = np.linalg.norm(combed, axis=1)
    cosine = np.abs((combed * again).sum(axis=1))[scale > 0.1] / scale[scale > 0.1]
    assert cosine.min() > 0.9999
    assert bpy.ops.rosy.field_comb(**comb, exact=True) == {"FINISHED"}
    assert deviation() < 0.5


def test_combing_goes_on_where_something_else_has_changed_the_field(scene):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4)
    mesh = bpy.context.object.data
    bpy.ops.rosy.field_generate(kind="axis", degree=2)
    bpy.ops.rosy.field_comb(stroke=stroke(0.0, 1.0), radius=0.3)
    bpy.ops.rosy.field_generate(kind="axis", degree=2)
    new = member_vectors(mesh)
    # Far from the first stroke: its guides are of a field that was replaced.
    bpy.ops.rosy.field_comb(stroke=stroke(3.0, 4.0), radius=0.1, reach=0.02)
    center, azimuth = face_centers(mesh)
    is_first = (np.abs(center[:, 2]) < 0.1) & (np.abs(azimuth - 0.5) < 0.3)
    assert is_first.any()
    cosine = np.abs((new * member_vectors(mesh)).sum(axis=1)) / np.linalg.norm(new, axis=1) ** 2
    assert cosine[is_first].min() > 0.999


# --- singularities ---------------------------------------------------------------------------


def sphere_with_field(**options):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4, **options)
    assert bpy.ops.rosy.field_generate(kind="smoothest", degree=4) == {"FINISHED"}
    return bpy.context.object


def test_singularities_as_points(scene):
    ball = sphere_with_field()
    assert bpy.ops.rosy.singularities(show="BOTH") == {"FINISHED"}
    name = "Icosphere singularities"
    points = bpy.data.objects[name]
    assert points.parent == ball
    values = points.data.attributes["index"].data
    assert sum(value.value for value in values) == 8
    positions = points.data.attributes["position"].data
    assert all(abs(point.vector.length - 1) < 0.02 for point in positions)
    overlay = rosy("rosy_addon.ui.overlay")
    assert overlay.shown(ball)
    # They replace the earlier ones.
    assert bpy.ops.rosy.singularities(show="POINTS") == {"FINISHED"}
    assert [obj.name for obj in bpy.data.objects if "singularities" in obj.name] == [name]
    assert bpy.ops.rosy.singularities(show="NONE") == {"FINISHED"}
    assert name not in bpy.data.objects
    assert not bpy.data.pointclouds and list(bpy.data.meshes) == [ball.data]


def test_singularities_are_where_their_points_are_moved(scene):
    """The points of a field, moved and changed, make a field with these singularities alone."""
    read_singularities = rosy("rosy_addon.scene.singularity_points").read_singularities
    sphere = sphere_with_field(location=(1.0, 2.0, 0.0))
    bpy.ops.rosy.singularities(show="POINTS")
    points = bpy.data.objects["Icosphere singularities"]
    count = len(points.data.attributes["index"].data)
    assert count == 8
    vertices = np.array([vertex.co for vertex in sphere.data.vertices])
    chosen = np.argsort(vertices[:, 2])[:: len(vertices) // count][:count]
    position = points.data.attributes["position"].data
    position.foreach_set("vector", (vertices[chosen] * 1.2).astype(np.float32).ravel())
    index = np.ones(count, dtype=np.int32)
    index[0] = 2
    points.data.attributes["index"].data.foreach_set("value", index)
    message = error_of(bpy.ops.rosy.field_generate, kind="prescribed")
    assert "add up to 9/4, but this closed surface needs 8/4" in message
    assert bpy.ops.rosy.field_generate(kind="prescribed", add_missing=True) == {"FINISHED"}
    completed = read_singularities(sphere, bpy.context.evaluated_depsgraph_get())
    assert completed.index.sum() == 8 and completed.index.max() == 2
    index[1] = 0
    points.data.attributes["index"].data.foreach_set("value", index)
    assert bpy.ops.rosy.field_generate(kind="prescribed") == {"FINISHED"}
    found = read_singularities(sphere, bpy.context.evaluated_depsgraph_get())
    order = np.lexsort(found.points.T)
    kept = np.flatnonzero(index)
    expected = vertices[chosen[kept]]
    expected_order = np.lexsort(expected.T)
    np.testing.assert_allclose(found.points[order], expected[expected_order], atol=1e-6)
    np.testing.assert_array_equal(found.index[order], index[kept][expected_order])


def editable_singularities(obj):
    read = rosy("rosy_addon.scene.singularity_points").read_editable_singularities
    found = read(obj, bpy.context.evaluated_depsgraph_get())
    return dict(zip(found.vertex.tolist(), found.index.tolist(), strict=True)), found


def test_a_singularity_is_moved(scene):
    """On the object's own mesh; its place is on the evaluated mesh."""
    sphere = sphere_with_field()
    sphere.modifiers.new("Subdivision", "SUBSURF").levels = 1
    cast = sphere.modifiers.new("Cast", "CAST")
    cast.factor, cast.use_radius_as_size, cast.size = 1.0, False, 3.0
    before, found = editable_singularities(sphere)
    assert len(before) == 8
    np.testing.assert_allclose(np.linalg.norm(found.points, axis=1), 3.0, rtol=1e-5)
    source = min(before)
    target = next(vertex for vertex in range(500, 600) if vertex not in before)
    bpy.ops.ed.undo_push(message="before")
    move = bpy.ops.rosy.field_singularities
    assert move(source=source, target=target) == {"FINISHED"}
    after, _ = editable_singularities(sphere)
    assert after == {**{v: i for v, i in before.items() if v != source}, target: before[source]}
    vectors = member_vectors(sphere.data)
    for settings, message in (
        ({"source": source, "target": target}, f"vertex {source} is not singular"),
        ({"source": target, "target": target}, "both source and target"),
        ({"source": target, "target": 10**6}, "has no vertex 1000000"),
        ({"source": target}, "this closed surface needs 0/4"),
    ):
        assert message in error_of(move, **settings)
    np.testing.assert_array_equal(member_vectors(sphere.data), vectors)


def test_opening_a_file_hides_singularities(scene):
    overlay = rosy("rosy_addon.ui.overlay")
    handlers = len(bpy.app.handlers.load_pre)
    sphere_with_field()
    bpy.ops.rosy.singularities(show="OVERLAY")
    assert overlay.shown(bpy.context.object)
    assert len(bpy.app.handlers.load_pre) == handlers + 1
    bpy.ops.wm.read_homefile(use_empty=True)
    assert len(bpy.app.handlers.load_pre) == handlers


def test_dots_stay_with_renamed_objects_and_go_without_a_field(scene):
    overlay = rosy("rosy_addon.ui.overlay")
    handlers = len(bpy.app.handlers.load_pre)
    sphere = sphere_with_field()
    bpy.ops.rosy.singularities(show="OVERLAY")
    sphere.name = "Ball"
    assert overlay.shown(sphere)
    sphere.data.attributes.remove(sphere.data.attributes["rosy"])
    bpy.ops.rosy.singularities(show="NONE")
    assert not overlay.shown(sphere) and len(bpy.app.handlers.load_pre) == handlers
    assert not bpy.ops.rosy.singularities.poll()


def test_exports_and_imports(suzanne, tmp_path):
    bpy.ops.rosy.field_generate(kind="smoothest", degree=4)
    before = member_vectors(suzanne.rosy.field_mesh)
    for kind in (".rosy", ".rawfield", ".txt", ".npy", ".obj", ".sings"):
        path = str(tmp_path / f"a{kind}")
        assert bpy.ops.rosy.field_export(filepath=path, file_format=kind) == {"FINISHED"}
        if kind == ".sings":
            continue
        assert bpy.ops.rosy.field_import(filepath=path) == {"FINISHED"}
        if kind != ".obj":
            np.testing.assert_array_equal(member_vectors(suzanne.rosy.field_mesh), before)


def test_no_operator_replaces_the_open_file(suzanne, tmp_path):
    """Not through a link either."""
    path = tmp_path / "saved.blend"
    bpy.ops.rosy.field_generate(kind="axis", degree=4)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    before = path.read_bytes()
    for operator, suffix, settings in (
        (bpy.ops.rosy.field_export, ".rosy", {}),
        (bpy.ops.rosy.strokes, ".svg", {"kind": "FILE"}),
        (bpy.ops.rosy.turntable, ".gif", {"pictures": 2, "width": 16, "height": 16}),
        (bpy.ops.rosy.preset_export, ".json", {"preset": "plaid"}),
    ):
        link = tmp_path / f"link{suffix}"
        link.symlink_to(path)
        assert "is also an input" in error_of(operator, filepath=str(link), **settings)
        assert link.is_symlink() and path.read_bytes() == before


def test_what_is_imported_from_other_programs(suzanne, tmp_path):
    """A cross in two files, with vectors off the surface; and feature edges."""
    suzanne.modifiers.clear()
    mesh = suzanne.data
    normals = np.array([polygon.normal for polygon in mesh.polygons])
    axis = np.cross(normals, (0.1, 0.2, 1.0))
    other = np.cross(normals, axis)
    axis[:50] = normals[:50]
    paths = [str(tmp_path / name) for name in ("a.csv", "b.csv")]
    for path, rows in zip(paths, (axis, other), strict=True):
        np.savetxt(path, rows, delimiter=",")
    files = {"filepath": paths[0], "second_file": paths[1], "undefined": "zero"}
    with pytest.raises(RuntimeError, match="vectors are not tangent"):
        bpy.ops.rosy.field_import(**files)
    assert bpy.ops.rosy.field_import(**files, off_surface="undefined") == {"FINISHED"}
    assert mesh.rosy.degree == 4
    assert np.flatnonzero(~member_vectors(mesh).any(axis=1)).tolist() == list(range(50))
    (tmp_path / "a.feature").write_text("2\n0,0\n7,1\n")
    assert bpy.ops.rosy.field_import(filepath=str(tmp_path / "a.feature")) == {"FINISHED"}
    assert sum(edge.use_edge_sharp for edge in mesh.edges) == 2


def test_a_file_of_the_mesh_before_it_was_triangulated(suzanne, tmp_path):
    suzanne.modifiers.clear()
    bpy.ops.rosy.field_generate(kind="axis", degree=4, axis=(0.2, 0.3, 1.0))
    path = tmp_path / "a.rosy"
    assert bpy.ops.rosy.field_export(filepath=str(path)) == {"FINISHED"}
    rows = [f"v {v.co.x} {v.co.y} {v.co.z}" for v in suzanne.data.vertices]
    rows += ["f " + " ".join(str(v + 1) for v in f.vertices) for f in suzanne.data.polygons]
    (tmp_path / "a.obj").write_text("\n".join(rows))
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.quads_convert_to_tris()
    bpy.ops.object.mode_set(mode="OBJECT")
    suzanne.data.attributes.remove(suzanne.data.attributes["rosy"])
    assert bpy.ops.rosy.field_import(filepath=str(path)) == {"FINISHED"}
    vectors = member_vectors(suzanne.data)
    assert np.linalg.norm(vectors, axis=1).mean() > 0.5
    axis = np.array((0.2, 0.3, 1.0)) / np.linalg.norm((0.2, 0.3, 1.0))
    assert np.median(vectors @ axis) > 0.4


# --- comparison ----------------------------------------------------------------------------------


def test_fields_are_compared(suzanne):
    """A field that is turned by 0.2 under another name: the angle is an attribute and the color."""
    settings = bpy.context.scene.rosy
    bpy.ops.rosy.field_generate(kind="axis", degree=2)
    mesh = suzanne.rosy.field_mesh
    message = error_of(bpy.ops.rosy.field_compare)
    assert "make one with another name of the attribute" in message
    bpy.ops.rosy.field_generate(kind="axis", degree=2, attribute="turned")
    bpy.ops.rosy.field_convert(angle=0.2)
    assert bpy.ops.rosy.field_compare(other="rosy", use_as_color=False) == {"FINISHED"}
    assert settings.look.hue == "one"
    assert bpy.ops.rosy.field_compare() == {"FINISHED"}  # with the only other one
    attribute = mesh.attributes["Difference"]
    assert (attribute.domain, attribute.data_type) == ("FACE", "FLOAT")
    values = attribute_values(attribute)
    defined = np.isfinite(values)
    assert defined.mean() > 0.9 and np.allclose(values[defined], np.degrees(0.2), atol=0.01)
    assert (settings.color_attribute, settings.look.hue) == ("Difference", "values")
    assert tuple(settings.look.color_range) == (90, 0)
    assert bpy.ops.rosy.bake() == {"FINISHED"}
    assert "choose 'rosy'" in error_of(bpy.ops.rosy.field_compare, other="turned")
    mesh.attributes.remove(mesh.attributes["Difference"])
    mesh.attributes.new("Difference", "INT", "POINT")
    assert "another type" in error_of(bpy.ops.rosy.field_compare, other="rosy")


# --- occlusion ------------------------------------------------------------------------------------


def test_occlusion_becomes_the_tone(suzanne):
    bpy.ops.rosy.field_generate(kind="axis", degree=2)
    assert bpy.ops.rosy.occlusion(directions=24) == {"FINISHED"}
    assert "Occlusion" in suzanne.data.attributes
    settings = bpy.context.scene.rosy
    assert (settings.look.tone, settings.tone_attribute) == ("attribute", "Occlusion")

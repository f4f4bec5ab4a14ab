"""The functions for scripts and notebooks: what they take, what they return, and what they refuse."""

import inspect
import io
import pickle

import awkward
import numpy as np
import pytest
from command_helpers import write_obj
from PIL import Image
from shapes import icosphere, torus

import rosy_addon as rf
from rosy_addon.api.pictures import _named_tone as named_tone
from rosy_addon.api.pictures import corner_numbers
from rosy_addon.cli.parser import main
from rosy_addon.compositor.look import Look
from rosy_addon.core.settings import settings_of
from rosy_addon.field import mesh_arrays
from rosy_addon.field.formats.polygons import offsets_from_sizes

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


SPHERE = icosphere(2).with_parts(name="sphere")
FIELD = rf.smoothest(SPHERE)


@pytest.mark.parametrize("draw", [rf.render, rf.texture, rf.turntable])
def test_parameters_do_not_hide_settings(draw):
    """Functions that draw pictures take the settings of the look as keywords, too."""
    assert not settings_of(Look).keys() & inspect.signature(draw).parameters.keys()


@pytest.mark.parametrize(
    ("faces", "sizes"),
    [
        ([[0, 1, 2, 3]], [4]),
        (np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint64), [3, 3]),
        ([(0, 1, 2), [0, 2, 3]], [3, 3]),
        ([[0, 1, 2, 3], [0, 1, 4]], [4, 3]),
    ],
)
def test_faces_of_any_kind(faces, sizes):
    surface = rf.Surface([*SQUARE, [0.5, -1, 0]], faces)
    assert np.array_equal(surface.face_start, offsets_from_sizes(sizes))
    assert [list(face) for face in surface.faces] == [list(map(int, face)) for face in faces]


def test_a_flat_mesh_needs_no_z():
    surface = rf.Surface(np.array(SQUARE)[:, :2], [[0, 1, 2, 3]])
    assert np.array_equal(surface.vertices, SQUARE)


def test_texture_coordinates_of_vertices_and_corners():
    faces, uv = [[0, 1, 2], [0, 2, 3]], np.array(SQUARE)[:, :2]
    corners = [0, 1, 2, 0, 2, 3]
    for given in (uv, uv[corners]):
        assert np.array_equal(rf.Surface(SQUARE, faces, uv=given).uv, uv[corners])
    assert rf.Surface(SQUARE, faces).uv is None


@pytest.mark.parametrize(
    ("arguments", "options", "expected"),
    [
        ((SQUARE, [[0, 1, 9]]), {}, "surface: "),
        ((SQUARE, [[0, 1, 2.5]]), {}, "whole numbers"),
        ((SQUARE, [[0, 1, 2], [3]]), {}, "surface: "),
        (([[0, 0, 0, 0]], [[0, 0, 0]]), {}, "(V, 3), not (1, 4)"),
        ((["a"], [[0, 0, 0]]), {}, "must be numbers"),
        ((SQUARE, [[0, 1, 2]]), {"up": "x"}, "choose 'y' or 'z'"),
        ((SQUARE, [[0, 1, 2]]), {"uv": [[0, 0]]}, "uv needs a row of 2 numbers"),
        ((SQUARE, [[0, 1, 2]]), {"uv": [[0, np.nan]] * 4}, "not finite"),
        ((SQUARE,), {}, "expected vertices and faces"),
        ((object(),), {}, "not object"),
        (("a.obj",), {"step": 1}, "a.obj: step applies only to files of simulations"),
        ((SQUARE, [[0, 1, 2]]), {"step": 1}, "step applies only to files of simulations"),
    ],
)
def test_meshes_that_are_refused(arguments, options, expected, error_of):
    assert expected in error_of(rf.Surface, *arguments, **options)


def test_the_extension_reads_no_simulations(error_of, monkeypatch):
    """The readers are not in it."""
    monkeypatch.setattr(mesh_arrays, "SIMULATION_READERS", {})
    expected = "a.vtu: is not a mesh file: its name must end in .obj, .off, .ply, .stl or .om"
    assert error_of(rf.Surface, "a.vtu") == expected


def test_angles_are_those_of_the_frames():
    angle = np.linspace(-3.1, 3.1, SPHERE.face_count)
    field = rf.from_angles(SPHERE, angle, degree=3)
    assert np.allclose(field.angles, angle)
    x, _ = SPHERE.face_frames
    first_edge = SPHERE.vertices[SPHERE.faces[:, 1]] - SPHERE.vertices[SPHERE.faces[:, 0]]
    assert np.allclose(x, first_edge / np.linalg.norm(first_edge, axis=1, keepdims=True))
    assert field.degree == 3 and np.allclose(field.magnitude, 1)
    assert np.allclose(rf.from_angles(SPHERE, angle, 4, magnitude=angle**2).magnitude, angle**2)


def test_the_representation_is_that_of_any_member():
    again = rf.from_representation(SPHERE, FIELD.representation, 4)
    assert np.allclose(again.representation, FIELD.representation)
    other_member = rf.from_vectors(SPHERE, FIELD.directions[:, 1], 4)
    assert np.allclose(other_member.representation, FIELD.representation)


def test_fields_from_directions_and_tensors():
    again = rf.from_directions(SPHERE, FIELD.directions)
    assert again.is_rosy and again.difference(FIELD).max < 1e-6
    # The larger eigenvalue belongs to the member.
    unit = FIELD.vectors / FIELD.magnitude[:, None]
    tensors = 2 * unit[:, :, None] * unit[:, None] - 0.5 * np.eye(3)
    tensor_field = rf.from_tensors(SPHERE, tensors)
    assert tensor_field.degree == 4 and tensor_field.difference(FIELD).max < 1e-6


def test_fields_from_arrays_of_a_surface(error_of):
    """Vectors of faces give the same field; the array is found by its name, or as the only one."""
    mesh = SPHERE.vertices, SPHERE.corner_vertex, SPHERE.face_start
    data = {"vertex_data": {"p": SPHERE.vertices[:, 2]}, "face_data": {"U": FIELD.vectors}}
    surface = rf.Surface(mesh_arrays.MeshArrays(*mesh, **data), name="flow")
    for again in (rf.from_array(surface, degree=4), rf.from_array(surface, "cell:U", 4)):
        assert np.array_equal(again.vectors, FIELD.vectors) and again.surface is surface
    assert rf.from_array(surface).degree == 1
    assert "flow: array 'p' has scalars" in error_of(rf.from_array, surface, "p")
    assert "sphere: has no array of vectors" in error_of(rf.from_array, SPHERE)


def test_guides_may_be_a_field(error_of):
    vectors = np.where(np.arange(SPHERE.face_count)[:, None] < 40, FIELD.vectors, 0)
    guided = rf.guided(SPHERE, vectors=rf.from_vectors(SPHERE, vectors, 4))
    assert np.nanmax(guided.difference(FIELD).angle[:40]) < 1e-3
    assert "to_degree" in error_of(rf.guided, SPHERE, 2, vectors=FIELD)


def test_lengths_of_guides_may_be_their_firmness():
    """A weak guide hardly turns the field away from firm ones that surround it."""
    is_weak = np.arange(SPHERE.face_count) == 40
    turned = np.where(is_weak[:, None], FIELD.rotated(np.pi / 4).vectors, FIELD.vectors)
    vectors = turned / np.linalg.norm(turned, axis=1)[:, None]
    vectors[is_weak] *= 1e-3
    exact = rf.guided(SPHERE, vectors=vectors)
    firm = rf.guided(SPHERE, vectors=vectors, vectors_have_firmness=True)
    assert exact.difference(FIELD).angle[is_weak] == pytest.approx(np.pi / 4, abs=1e-3)
    assert firm.difference(FIELD).angle[is_weak] < 0.3


def test_a_surface_is_its_content(error_of):
    """A mesh that is read twice, or sent to another process and back, is the same surface."""
    again = rf.Surface(SPHERE.vertices.copy(), SPHERE.faces, name="again")
    for other in (again, pickle.loads(pickle.dumps(SPHERE))):
        copied = rf.from_vectors(other, FIELD.vectors, FIELD.degree)
        mean = rf.compare([FIELD, copied.rotated(0.2)]).rows[1]["mean"]
        assert mean == pytest.approx(np.degrees(0.2))
        assert copied.difference(FIELD).max < 1e-12
        size = {"size": (32, 32)}
        assert np.array_equal(rf.render(SPHERE, copied, **size), rf.render(SPHERE, FIELD, **size))
    moved = rf.form(again.with_vertices(SPHERE.vertices + (0, 0, 1e-9)))
    assert "another surface" in error_of(FIELD.difference, moved)
    with pytest.warns(rf.RosyWarning, match="field 2: is on other vertices or faces than field 1"):
        assert not rf.compare([FIELD, moved]).differences


def test_a_field_of_another_surface_is_refused(error_of):
    other = icosphere(2, radius=2.0).with_parts(name="other")
    for function in (rf.render, rf.strokes):
        assert error_of(function, other, FIELD).startswith("other: the field is on another surface")


def test_warnings_name_the_surface():
    square = rf.Surface(SQUARE, [[0, 1, 2, 3]], name="square")
    with pytest.warns(rf.RosyWarning, match="square: axis gives no direction on any face") as told:
        rf.along_axis(square)
    assert told[0].filename == __file__


def test_a_picture_is_an_array_and_a_png(tmp_path, error_of):
    picture = rf.render(SPHERE, FIELD, view=(0, 0), size=(60, 40))
    array = np.asarray(picture)
    assert array.shape == (40, 60, 4) and array.dtype == np.uint8
    assert np.array_equal(array, np.asarray(Image.open(io.BytesIO(picture._repr_png_()))))
    picture.save(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes() == picture._repr_png_()
    assert "must end in .png" in error_of(picture.save, tmp_path / "a.jpg")


def test_the_command_draws_the_same_picture(tmp_path, capsys):
    path = write_obj(tmp_path / "torus.obj", torus(24, 12).vertices, torus(24, 12).faces)
    out = tmp_path / "command.png"
    words = ["--generate", "smoothest", "--size", "64x48", "--view", "-120,-30", "--ortho"]
    look = ["--preset", "plaid", "--set", "seed=3", "--set", "view_plane=off"]
    assert main(["render", str(path), "-o", str(out), *words, *look]) == 0
    assert capsys.readouterr().err == ""
    surface, options = rf.Surface(path), {"preset": "plaid", "seed": 3, "view_plane": False}
    options |= {"size": (64, 48), "view": (-120, -30), "orthographic": True}
    for same in (surface, rf.Surface(surface.vertices, surface.faces, up="y")):
        picture = rf.render(same, rf.smoothest(same), **options)
        assert picture._repr_png_() == out.read_bytes()


def test_numbers_as_colors(error_of):
    """Of faces, vertices and corners; those of faces if there are as many of both."""
    quad = rf.Surface(SQUARE, [[0, 1, 2], [0, 2, 3]])
    tetrahedron = rf.Surface(np.eye(4)[:, :3], [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    for surface, numbers, expected in (
        (quad, [1, 2], [1, 1, 1, 2, 2, 2]),
        (quad, [1, 2, np.nan, np.inf], [1, 2, np.nan, 1, np.nan, np.nan]),
        (quad, range(6), range(6)),
        (tetrahedron, range(4), np.repeat(range(4), 3)),
    ):
        np.testing.assert_array_equal(corner_numbers(surface, numbers), expected)
    for wrong, expected in (
        ({"color_values": [1, 2, 3]}, "surface: color_values must be 2 numbers"),
        ({"color_values": "angle"}, "surface: has no attributes of faces or vertices"),
        ({"color_values": ["a", "b"]}, "surface: color_values must be numbers"),
        ({"hue": "values"}, "hue 'values' needs numbers"),
    ):
        assert expected in error_of(rf.render, quad, **wrong)


def test_sources_of_the_tone(error_of):
    """Light on the right, unlike the lamp: from values of vertices and corners, a picture and an array."""
    look = {"view": (0, 0), "size": (64, 64), "orthographic": True, "preset": "pen-and-ink"}
    values = (SPHERE.vertices[:, 0] > 0).astype(float)
    by_vertex, by_corner = (
        np.asarray(rf.render(SPHERE, FIELD, tone_values=each, **look))[..., :3]
        for each in (values, values[SPHERE.corner_vertex])
    )
    assert np.array_equal(by_vertex, by_corner)
    assert by_vertex[:, -24:].mean() > by_vertex[:, :24].mean() + 50
    tone = np.zeros((64, 64, 3), dtype=np.uint8)
    tone[:, 32:] = 255
    by_array = rf.render(SPHERE, FIELD, tone_picture=tone, **look)
    rgba = np.dstack([tone / 255, np.ones((64, 64))]).astype(np.float32)
    by_picture = rf.render(SPHERE, FIELD, tone_picture=rf.Picture(rgba), **look)
    assert np.array_equal(np.asarray(by_array), np.asarray(by_picture))
    for keywords, expected in (
        ({"tone_values": values[1:]}, "162 numbers, one for each vertex, or 960 numbers, one for"),
        ({"tone_values": values * np.nan}, "not finite"),
        ({"tone_values": "ink"}, "sphere: has no vertex attributes"),
        ({"tone_image": tone}, "sphere: has no UV map"),
        ({"lenght": 3}, "lenght"),
    ):
        assert expected in error_of(rf.render, SPHERE, FIELD, **keywords)


def test_colors_of_vertices_as_a_tone():
    """The tone "Color" is their linear luminance; sRGB as IEC 61966 defines it."""
    display = np.array([[60, 60, 60], [230, 230, 230], [255, 0, 0], [0, 0, 255]]) / 255
    colors = dict(zip(("red", "green", "blue"), display.T, strict=True))
    mesh = np.array(SQUARE, dtype=float), np.arange(4), np.array([0, 4])
    arrays = mesh_arrays.MeshArrays(*mesh, vertex_data=colors)
    linear = ((display + 0.055) / 1.055) ** 2.4 * (display > 0)
    expected = linear @ (0.2126, 0.7152, 0.0722)
    assert np.allclose(named_tone(rf.Surface(arrays), "Color"), expected, atol=1e-3)


def test_an_image_on_the_uv_map(error_of):
    """The left half is dark."""
    square = rf.Surface(SQUARE, [[0, 1, 2, 3]], uv=np.array(SQUARE)[:, :2])
    field = rf.along_uv(square)
    image = np.array([[0, 255]], dtype=np.uint8)
    look = {"preset": "pen-and-ink", "tone_image": image}
    picture = rf.render(square, field, view=(0, 90), size=(64, 64), **look)
    gray = np.asarray(picture)[..., :3].mean(axis=2)
    assert gray[16:48, 8:24].mean() < gray[16:48, 40:56].mean() - 50


def test_a_drawing_is_svg(tmp_path, error_of):
    drawing = rf.strokes(SPHERE, FIELD, view=(0, 0), size=(100, 100), spacing=12, colors=["navy"])
    drawing.save(tmp_path / "a.svg")
    assert (tmp_path / "a.svg").read_text() == drawing.svg == drawing._repr_svg_()
    assert 'stroke="navy"' in drawing.svg
    assert len(drawing.polylines) == len(drawing) == len(drawing.family_names)
    assert np.allclose(np.linalg.norm(drawing.polylines[0], axis=1), 1, atol=0.05)
    dense = rf.strokes(SPHERE, FIELD, view=(0, 0), size=(100, 100), distance=0.1)
    assert len(dense) > len(drawing)
    assert "unknown setting 'spacng'" in error_of(rf.strokes, SPHERE, FIELD, spacng=3)


def test_lines_in_space_are_in_the_space_of_the_mesh(tmp_path, error_of):
    """An ellipsoid whose y points up in its file, unlike in pictures of it."""
    axes = (1.0, 2.0, 0.5)
    mesh = icosphere(3)
    surface = rf.Surface(mesh.vertices * axes, mesh.corner_vertex.reshape(-1, 3), up="y")
    arguments = {"size": (200, 200), "width": 3.0, "hidden": True, "orthographic": True}
    drawing = rf.strokes(surface, spacing=8, taper=0.0, **arguments)
    drawing.save(tmp_path / "a.csv")
    rows = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True, dtype=None, encoding=None)
    points = np.stack([rows[name] for name in ("x", "y", "z")], 1)
    normals = np.stack([rows[name] for name in ("nx", "ny", "nz")], 1)
    assert len(np.unique(rows["stroke"])) == len(drawing)
    assert set(rows["family"]) == set(drawing.family_names)
    assert np.abs(np.linalg.norm(points / axes, axis=1) - 1).max() < 0.02
    expected = points / np.square(axes)
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    agreement = (normals * expected).sum(axis=1)
    # At the pointed ends, the normals at both ends of an edge differ by up to 29 degrees.
    assert agreement.min() > 0.98 and np.median(agreement) > 0.999
    # The frame holds the longest axis in 200 pixels with a margin.
    assert np.ptp(rows["width"]) == 0 and 3 * 4 / 200 < rows["width"][0] < 3 * 5 / 200
    assert "must end in .svg, .ply, .obj or .csv" in error_of(drawing.save, tmp_path / "a.png")


def test_a_turntable_counts_its_pictures(tmp_path, error_of):
    numbers = []
    options = {"pictures": 3, "size": (32, 32), "on_picture": numbers.append}
    path = rf.turntable(SPHERE, FIELD, path=tmp_path / "a.gif", **options)
    assert numbers == [1, 2, 3] and Image.open(path).n_frames == 3
    assert "2 or more" in error_of(rf.turntable, SPHERE, FIELD, path=tmp_path / "b.gif", pictures=1)


def test_indices_are_fractions_or_units(error_of):
    surface = rf.Surface(*awkward.cube())
    units = rf.prescribed(surface, dict.fromkeys(range(8), 1), 4)
    fractions = rf.prescribed(surface, dict.fromkeys(range(8), 0.25), 4)
    assert (units.vectors == fractions.vectors).all() and (fractions.singularities.index == 1).all()
    message = error_of(rf.prescribed, surface, {0: 0.3, 1: 1.7}, 4)
    assert "0.3 at vertex 0 is not a multiple of 1/4" in message
    for index in (float("nan"), float("inf"), 10**30):
        message = error_of(rf.prescribed, surface, {0: index}, 4)
        assert f"the index {index} at vertex 0 is not a multiple of 1/4, or too large" in message
    for vertex in (0.5, 10**30, "a"):
        assert f"has no vertex {vertex}: " in error_of(rf.prescribed, surface, {vertex: 1}, 4)

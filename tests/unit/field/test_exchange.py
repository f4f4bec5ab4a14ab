"""Fields in the formats of other programs: round trips, and transfer to another mesh."""

import numpy as np
import pytest
from field_helpers import angle_differences, directions_at_angles, read_field, write_off
from shapes import from_triangles, icosphere, plane, rebuilt, torus

from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.directional_field import field_directions
from rosy_addon.field.field_io import load_field, write_field
from rosy_addon.field.formats.sings import read_sings
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import axis_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.surface import Surface
from rosy_addon.field.validate import VectorPolicy

BALL = icosphere(2)
CROSS = field_directions(BALL, axis_field(BALL, 4, (0.3, -0.2, 1.0)))


def free_directions(degree, seed=0):
    """(F, N, 3) directions on the ball that are not a RoSy."""
    random = np.random.default_rng(seed)
    angle = np.sort(random.random(degree)) * 2 * np.pi
    return directions_at_angles(BALL, angle, 0.5 + random.random((BALL.face_count, degree)))


# --- there and back --------------------------------------------------------------------------


@pytest.mark.parametrize("ending", [".rawfield", ".txt", ".npy"])
@pytest.mark.parametrize("degree", [2, 5])
def test_free_directions_round_trip_exactly(ending, degree, tmp_path, error_of):
    stored = free_directions(degree)
    np.save(tmp_path / "first.npy", stored)
    field = read_field(tmp_path / "first.npy", BALL, degree)
    assert field.degree == degree and field.direction_ratios is not None
    write_field(tmp_path / f"a{ending}", field, BALL)
    message = error_of(write_field, tmp_path / "a.rosy", field, BALL)
    assert "the directions of this field do not form a RoSy" in message
    again = read_field(tmp_path / f"a{ending}", BALL, degree)
    assert np.array_equal(again.source_directions, stored)
    assert np.array_equal(again.vectors, field.vectors)
    assert np.array_equal(again.direction_ratios, field.direction_ratios)


@pytest.mark.parametrize("degree", [1, 2, 4, 6])
def test_fieldgen_files_hold_the_mesh_and_a_field_on_vertices(degree, tmp_path):
    surface = icosphere(4)
    field = axis_field(surface, degree, (0.0, 0.0, 1.0))
    field = RosyField(degree, normalize(field.vectors))
    path = tmp_path / "a.obj"
    write_field(path, field, surface)
    mesh = Surface(path)
    assert np.array_equal(mesh.vertices, surface.vertices)
    assert np.array_equal(mesh.corner_vertex, surface.corner_vertex)
    again = read_field(path, mesh)
    assert again.degree == degree
    error = angle_differences(surface, again.vectors, field.vectors, degree)
    away_from_poles = np.abs(surface.face_center[:, 2]) < 0.9  # where the field is singular
    assert np.degrees(error[away_from_poles]).max() < 1


def test_the_comment_header_of_fieldgen_is_ignored(tmp_path, error_of):
    path = tmp_path / "a.obj"
    write_field(path, axis_field(BALL, 2), BALL)
    head = "# written as\n#    degree n\n#    field i x y z\n#    singularity i s\n"
    path.write_text(head + path.read_text() + "# singularity 3 0.5\n")
    assert read_field(path, BALL).degree == 2
    path.write_text("\n".join(x for x in path.read_text().splitlines() if " field 7 " not in x))
    assert "expected one '# field' line for each" in error_of(read_field, path, BALL)
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert "has no field" in error_of(read_field, path, BALL)


def test_singularities_round_trip(tmp_path, error_of):
    field = curvature_field(BALL, 4)
    write_field(tmp_path / "a.sings", field, BALL)
    degree, *found = read_sings(tmp_path / "a.sings")
    assert degree == 4 and np.array_equal(found, find_singularities(BALL, field))
    assert "contains singularities" in error_of(read_field, tmp_path / "a.sings", BALL)
    (tmp_path / "b.sings").write_text("4 3\n1 1\n2 1\n")
    assert "declares 3 singularities, but contains 2" in error_of(read_sings, tmp_path / "b.sings")
    (tmp_path / "c.sings").write_text(f"4 {2**62} 1 1\n")
    assert "singularities, but contains 1" in error_of(read_sings, tmp_path / "c.sings")


@pytest.mark.parametrize("degree", [2, 4])
@pytest.mark.parametrize("rosy", [True, False])
def test_faces_that_are_not_finite_are_written_as_zero(degree, rosy, tmp_path):
    field = axis_field(BALL, degree, (0.3, -0.2, 1.0))
    stored = field_directions(BALL, field) if rosy else free_directions(degree)
    stored[3, 1, 2] = np.nan
    stored[5] = -np.inf
    np.save(tmp_path / "first.npy", stored)
    field = read_field(tmp_path / "first.npy", BALL, degree, VectorPolicy("zero"))
    write_field(tmp_path / "a.rawfield", field, BALL)
    again = read_field(tmp_path / "a.rawfield", BALL)
    stored[[3, 5]] = 0
    assert np.array_equal(again.source_directions, stored)


@pytest.mark.parametrize("kind", ["plain", "numbered", "counted", "headed", "centered"])
@pytest.mark.parametrize("ending", [".txt", ".vec"])
def test_two_directions_that_are_nowhere_opposite_are_a_cross(kind, ending, tmp_path):
    """Rows as programs for quad meshes write them: one direction for each line of the cross."""
    rows = CROSS[:, :2].reshape(-1, 6)
    if kind == "numbered":
        rows = np.column_stack([np.arange(len(rows)), rows])
    elif kind == "centered":
        rows = np.column_stack([BALL.face_center, rows, -rows])
    header = {"counted": f"{len(rows)}", "headed": "ax,ay,az,bx,by,bz"}.get(kind, "")
    path = tmp_path / f"a{ending}"
    np.savetxt(path, rows, header=header, comments="", delimiter=",")
    loaded = load_field(path, BALL)
    assert np.allclose(field_directions(BALL, loaded.field)[:, 0], CROSS[:, 0])
    assert loaded.field.degree == 4 and loaded.field.direction_ratios is None
    assert ("nowhere opposite" in loaded.note) == (kind != "centered")
    assert load_field(path, BALL, 4).note == ""
    if kind != "centered":
        assert load_field(path, BALL, 2).field.degree == 2


def test_the_directions_of_a_cross_in_two_files(tmp_path, error_of):
    paths = [tmp_path / "alpha.csv", tmp_path / "beta.csv"]
    for path, rows in zip(paths, CROSS.swapaxes(0, 1), strict=False):
        np.savetxt(path, rows, delimiter=",", header="x,y,z", comments="")
    loaded = load_field(paths, BALL)
    assert np.allclose(field_directions(BALL, loaded.field), CROSS, atol=1e-12)
    assert "alpha.csv: rows have two directions that are nowhere opposite" in loaded.note
    paths[1].write_text("1 0 0\n")
    message = error_of(load_field, paths, BALL)
    assert "beta.csv: has 1 row of 3 numbers, but files" in message


def test_rows_that_fit_the_faces_and_the_vertices(tmp_path):
    surface = torus(8, 6)
    np.savetxt(tmp_path / "a.txt", surface.face_frames[0])
    assert "as many vertices as faces" in load_field(tmp_path / "a.txt", surface, 4).note


def test_two_numbers_on_a_flat_mesh_are_x_and_y(tmp_path):
    flat = plane(3, 3)
    np.savetxt(tmp_path / "a.txt", np.tile((0.6, 0.8), (flat.face_count, 1)))
    field, note = load_field(tmp_path / "a.txt", flat, 1)
    assert np.allclose(field.vectors, (0.6, 0.8, 0.0)) and "because the mesh is flat" in note


def test_opposite_directions_are_a_field_of_degree_2(tmp_path):
    np.save(tmp_path / "a.npy", CROSS[:, ::2])
    assert read_field(tmp_path / "a.npy", BALL).degree == 2


@pytest.mark.parametrize("degree", [None, 6])
def test_rosy_files_without_a_degree(degree, tmp_path):
    vectors = CROSS[:, 0]
    np.savetxt(tmp_path / "a.rosy", vectors, header=str(len(vectors)), comments="")
    field, note = load_field(tmp_path / "a.rosy", BALL, degree)
    assert field.degree == (degree or 4) and np.allclose(field.vectors, vectors)
    assert ("no degree is stated" in note) == (degree is None)


def test_tensors_are_distinguished_from_three_directions(tmp_path):
    matrices = np.random.default_rng(0).standard_normal((BALL.face_count, 3, 3))
    matrices += matrices.swapaxes(1, 2)
    np.save(tmp_path / "a.npy", matrices)
    field = read_field(tmp_path / "a.npy", BALL)
    assert (field.degree, field.family_count) == (4, 2)
    np.savetxt(tmp_path / "a.txt", matrices.reshape(-1, 9), delimiter=",")
    assert np.allclose(read_field(tmp_path / "a.txt", BALL).vectors, field.vectors)
    matrices[3] = np.inf
    np.save(tmp_path / "a.npy", matrices)
    holed = read_field(tmp_path / "a.npy", BALL, policy=VectorPolicy("zero"))
    assert holed.family_count == 2 and np.flatnonzero(holed.magnitude == 0).tolist() == [3]
    np.save(tmp_path / "b.npy", free_directions(3))
    assert read_field(tmp_path / "b.npy", BALL).degree == 3


def test_a_signalling_nan_in_an_array_is_named(tmp_path, error_of):
    values = np.ones((BALL.face_count, 3), dtype="<f4")
    values.view("<u4")[2, 0] = 0x7F800001
    np.save(tmp_path / "a.npy", values)
    assert "not finite, the first on face 2" in error_of(read_field, tmp_path / "a.npy", BALL)


# --- by position -----------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [1, 4, 6])
def test_a_field_is_transferred_by_position_with_a_note(degree, tmp_path):
    """From quads to triangles, with other numbers of the vertices and faces."""
    quads, random = torus(48, 24), np.random.default_rng(5)
    old = random.permutation(len(quads.vertices))
    corners = random.permutation(np.argsort(old)[quads.triangle_vertex])
    triangles = from_triangles(quads.vertices[old], corners)
    field = axis_field(quads, degree, (0.0, 0.0, 1.0))
    write_off(tmp_path / "a.off", quads)
    write_field(tmp_path / "a.rosy", field, quads)
    again, note = load_field(tmp_path / "a.rosy", triangles)
    assert "transferred by position from a.off" in note and "1,152" in note and "2,304" in note
    expected = axis_field(triangles, degree, (0.0, 0.0, 1.0))
    certain = expected.magnitude > 0.3  # elsewhere small tilts of a face rotate the projected axis
    error = np.degrees(angle_differences(triangles, again.vectors, expected.vectors, degree))
    assert error[certain].max() < 8 and np.median(error[certain]) < 1
    assert np.abs(dot(again.vectors, triangles.face_normal)).max() < 1e-12


@pytest.mark.parametrize("degree", [3, 4])
def test_reordered_faces_are_transferred_from_a_given_mesh(degree, tmp_path):
    """Also directions that are not a RoSy, and to fewer faces."""
    order = np.random.default_rng(1).permutation(BALL.face_count)[:-2]
    mixed = from_triangles(BALL.vertices, BALL.triangle_vertex[order])
    np.save(tmp_path / "a.npy", free_directions(degree))
    write_off(tmp_path / "own.off", BALL)
    again = read_field(tmp_path / "a.npy", mixed, mesh=tmp_path / "own.off")
    expected = field_directions(BALL, read_field(tmp_path / "a.npy", BALL))[order]
    assert np.allclose(field_directions(mixed, again), expected, atol=1e-9)


def test_another_shape_is_refused(tmp_path, error_of):
    write_off(tmp_path / "a.off", BALL)
    write_field(tmp_path / "a.rosy", axis_field(BALL, 4), BALL)
    far = rebuilt(plane(5, 5), plane(5, 5).vertices + 3)
    assert "must have the same shape and position" in error_of(read_field, tmp_path / "a.rosy", far)

"""Files of a mesh with its field: read again by RoSy, and by numpy."""

import warnings

import numpy as np
import pytest
from field_helpers import angle_differences, ply_header, random_field, read_field
from shapes import from_triangles, icosphere

import rosy_addon as rf
from rosy_addon.core.errors import RosyWarning
from rosy_addon.extras.command_line import main
from rosy_addon.field.directional_field import field_directions
from rosy_addon.field.field_io import write_field
from rosy_addon.field.generate import axis_field
from rosy_addon.field.singularities import find_singularities

BALL = icosphere(2)


def mixed():
    """Two triangles and a quad."""
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]]
    return rf.Surface(points, [[0, 1, 4, 3], [1, 2, 5], [1, 5, 4]])


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("surface", [BALL, mixed()], ids=["ball", "mixed"])
@pytest.mark.parametrize("ending", [".ply", ".npz"])
def test_round_trip(ending, surface, degree, tmp_path):
    field = axis_field(surface, degree, (0.3, 0.2, 1.0))
    path = tmp_path / f"a{ending}"
    write_field(path, field, surface)
    first = path.read_bytes()
    write_field(path, field, surface)
    assert path.read_bytes() == first
    if ending == ".npz":
        again = read_field(path, surface)
    else:
        read = rf.Surface(path)
        assert np.array_equal(read.vertices, surface.vertices)
        assert np.array_equal(read.corner_vertex, surface.corner_vertex)
        assert np.array_equal(read.face_start, surface.face_start)
        again = rf.from_array(read)
        assert np.array_equal(read.face_data["magnitude"], field.magnitude)
        index = np.zeros(len(surface.vertices))
        vertices, indices = find_singularities(surface, field)
        index[vertices] = indices / degree
        assert np.array_equal(read.vertex_data["singularity"], index)
    assert again.degree == degree
    difference = field_directions(surface, again) - field_directions(surface, field)
    assert np.abs(difference).max() < 1e-12


def test_the_numbers_in_an_archive(tmp_path):
    write_field(tmp_path / "a.npz", axis_field(BALL, 2, (0.0, 0.0, 1.0)), BALL)
    with np.load(tmp_path / "a.npz") as arrays:
        assert arrays["directions"].shape == (BALL.face_count, 2, 3) and arrays["degree"] == 2
        assert np.array_equal(arrays["faces"], BALL.faces) and arrays["singular_indices"].sum() == 4


def test_vectors_of_a_ply_file(tmp_path, capfd):
    """Three properties are a vector, of vertices too."""
    wind = (f"float {name}" for name in ("x", "y", "z", "wind_x", "wind_y", "wind_z"))
    face = "face", 1, "list uchar int vertex_indices", "float u_x"
    rows = "0 0 0 1 2 0\n1 0 0 1 2 0\n0 1 0 1 2 0\n3 0 1 2 5\n"
    (tmp_path / "a.ply").write_text(ply_header("ascii", ("vertex", 3, *wind), face) + rows)
    surface = rf.Surface(tmp_path / "a.ply")
    assert surface.face_data == {"u_x": [5]}
    assert main(["info", str(tmp_path / "a.ply"), "--array", "wind", "--degree", "2"]) == 0
    assert capfd.readouterr().out.startswith("degree 2\n")
    field = rf.from_array(surface, "wind")
    assert field.degree == 1 and field.vectors == pytest.approx(np.array([[1.0, 2.0, 0.0]]))


def test_what_an_obj_file_loses_is_said(tmp_path):
    """With random directions a lot, and on a plane with a constant field nothing."""
    field = random_field(BALL, 1)
    with pytest.warns(RosyWarning, match="off by up to [0-9]+ degrees") as caught:
        write_field(tmp_path / "a.obj", field, BALL)
    again = read_field(tmp_path / "a.obj", BALL)
    lost = angle_differences(BALL, field.vectors, again.vectors, 1)
    assert f"up to {np.degrees(lost.max()):.0f} degrees" in str(caught[0].message)
    flat = from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_field(tmp_path / "b.obj", axis_field(flat, 2, (1.0, 0.0, 0.0)), flat)

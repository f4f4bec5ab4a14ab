"""Two-sided sheets: faces that lie on others are said, and removed on request."""

import numpy as np
import pytest
from command_helpers import write_obj
from shapes import from_triangles, icosphere, plane

import rosy_addon as rf
from rosy_addon.field.copied_faces import copied_faces

SHEET = plane(4, 3)


def two_sided(*, apart: bool = False, turn: int = 0):
    """Return the arrays of a sheet with a second side, whose vertices may be its own."""
    back = np.roll(SHEET.faces[:, ::-1], turn, axis=1) + apart * len(SHEET.vertices)
    return np.concatenate([SHEET.vertices] * (1 + apart)), np.concatenate([SHEET.faces, back])


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("turn", [0, 1, 3])
def test_a_two_sided_sheet_becomes_one_sheet(apart, turn):
    vertices, faces = two_sided(apart=apart, turn=turn)
    with pytest.warns(rf.RosyWarning, match="sheet: 12 faces of 24 lie on others .* --join keeps"):
        assert rf.Surface(vertices, faces, name="sheet").euler_characteristic != 1
    with pytest.warns(rf.RosyWarning, match="sheet: 12 faces with the same corners as others were"):
        joined = rf.Surface(vertices, faces, name="sheet", join=True)
    assert joined.euler_characteristic == 1 and np.array_equal(joined.faces, SHEET.faces)
    assert not len(rf.smoothest(joined).singularities.index)


def test_texture_coordinates_of_a_file_stay_with_their_faces(tmp_path):
    points, uv = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 0), (1, 0), (1, 1), (0, 1)]
    path = write_obj(tmp_path / "sheet.obj", points, [(0, 1, 2), (2, 1, 0), (0, 2, 3)], uv)
    with pytest.warns(rf.RosyWarning, match="1 face with"):
        surface = rf.Surface(path, join=True)
    assert surface.uv.tolist() == [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]
    assert surface.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_only_equal_faces_are_copies():
    """Faces of a regular grid, whose sums of coordinates are often equal, and negative zeros."""
    ball, grid = icosphere(3), plane(30, 30)
    for surface in (ball, grid):
        assert not copied_faces(surface.vertices, surface.corner_vertex, surface.face_start).any()
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, -0.0, 0]]
    zeros = from_triangles(points, [[0, 1, 2], [3, 2, 1]])
    copies = copied_faces(zeros.vertices, zeros.corner_vertex, zeros.face_start)
    assert copies.tolist() == [False, True]

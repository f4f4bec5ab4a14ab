"""Files of feature edges."""

import numpy as np
import pytest
from command_helpers import finished, refusal, write_obj
from field_helpers import assert_damaged
from shapes import plane

import rosy_addon as rf
from rosy_addon.field.formats.feature_edges import read_edges

SQUARES = plane(3, 2)
FILES = {"a.sharp": "2\n1,0,0\n0,4,2\n", "a.feature": "2\n0,0\n4,2\n", "b.feature": "2\n0 0\n4 2\n"}


@pytest.mark.parametrize("name", FILES)
def test_edges_of_faces(name, tmp_path):
    (tmp_path / name).write_text(FILES[name])
    first, second = SQUARES.faces[0], SQUARES.faces[4]
    expected = [[first[0], first[1]], [second[2], second[3]]]
    assert read_edges(tmp_path / name, SQUARES).tolist() == expected


def degrees_of(vectors):
    return np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0]))


def diagonal():
    """A square of 2 x 2 squares of 2 triangles, and the (face, edge) of its rising diagonals."""
    points = [[x, y, 0.0] for y in range(3) for x in range(3)]
    corner = np.array([0, 1, 3, 4])[:, None]
    faces = np.stack([corner + (0, 1, 4), corner + (0, 4, 3)], axis=1).reshape(-1, 3)
    return rf.Surface(points, faces, name="square"), [(face, 0) for face in (1, 3, 5, 7)]


def test_features_follow_the_file(tmp_path):
    surface, rows = diagonal()
    lines = [f"1,{face},{edge}\n" for face, edge in rows]
    (tmp_path / "a.sharp").write_text(f"{len(rows)}\n" + "".join(lines))
    field = rf.features(surface, edges=tmp_path / "a.sharp")
    assert degrees_of(field.vectors) % 90 == pytest.approx(45)
    field = rf.guided(surface, 2, edges=tmp_path / "a.sharp")
    assert degrees_of(field.vectors) % 180 == pytest.approx(45)


def test_the_command_line(tmp_path):
    surface, rows = diagonal()
    mesh = write_obj(tmp_path / "a.obj", surface.vertices, surface.faces)
    edges, out = tmp_path / "a.feature", tmp_path / "a.npy"
    edges.write_text(f"{len(rows)}\n" + "".join(f"{face},{edge}\n" for face, edge in rows))
    words = "field", mesh, "-o", out, "--edges", edges
    finished(*words)
    assert degrees_of(np.load(out)) % 90 == pytest.approx(45)
    message = refusal(*words, "--generate", "form")
    assert "--edges applies only to --generate features, guided" in message


DAMAGED = {
    "a.sharp": (b"", "expected the number of edges"),
    "b.sharp": (b"2\n0,0,0\n", "declares 2 edges, but contains 1"),
    "c.sharp": (b"1\n0,0\n", "c.sharp:2: a row has 2 numbers, expected 3"),
    "d.sharp": (b"1\n0,6,0\n", "d.sharp:2: plane has no edge 0 of face 6"),
    "e.feature": (b"1\n0,4\n", "has no edge 4 of face 0"),
    "f.feature": (b"1\n-1,0\n", "has no edge 0 of face -1"),
    "g.feature": (b"1\nx,0\n", "expected a whole number"),
    "h.txt": (b"1\n", "its name must end in .sharp or .feature"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_raise_one_line_errors(name, tmp_path, error_of):
    assert_damaged(error_of, tmp_path / name, *DAMAGED[name], read_edges, SQUARES)

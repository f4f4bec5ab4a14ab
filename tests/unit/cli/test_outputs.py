"""Outputs are compared with all inputs, and links are followed only where the user has named them."""

from __future__ import annotations

import shutil

import pytest
from command_helpers import write_obj

from rosy_addon.cli.parser import main

#: Two squares side by side, and the same with one square cut into triangles.
POINTS = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
SQUARES = [(0, 1, 4, 3), (1, 2, 5, 4)]
CUT = [(0, 1, 4), (0, 4, 3), (1, 2, 5, 4)]


@pytest.fixture
def tiled(tmp_path):
    """The two squares, each on its own UDIM tile."""
    rows = [f"v {x} {y} {z}\nvt {x} {y}\n" for x, y, z in POINTS]
    faces = [" ".join(f"{i + 1}/{i + 1}" for i in square) for square in SQUARES]
    path = tmp_path / "tiled.obj"
    path.write_text("".join(rows) + "".join(f"f {face}\n" for face in faces))
    return path


def texture(tiled, folder) -> int:
    return main(["texture", str(tiled), "-o", str(folder / "a.<UDIM>.png"), "--size", "32"])


def test_tiles_do_not_follow_links(tiled, tmp_path):
    before, folder = tiled.read_bytes(), tmp_path / "tiles"
    folder.mkdir()
    (folder / "a.1002.png").symlink_to(tiled)
    assert texture(tiled, folder) == 0
    assert tiled.read_bytes() == before
    tiles = [folder / f"a.{number}.png" for number in (1001, 1002)]
    assert [tile.read_bytes()[1:4] for tile in tiles] == [b"PNG", b"PNG"]
    assert sorted(folder.iterdir()) == tiles and not tiles[1].is_symlink()


def test_all_tiles_are_checked_before_one_is_replaced(tiled, tmp_path, capsys):
    (tmp_path / "a.1001.png").write_bytes(b"old tile")
    (tmp_path / "a.1002.png").mkdir()
    assert texture(tiled, tmp_path) == 2
    assert "a.1002.png: cannot be written: it is a folder" in capsys.readouterr().err
    assert (tmp_path / "a.1001.png").read_bytes() == b"old tile"
    assert not list(tmp_path.glob(".*"))


def assert_is_input(words, output, capsys) -> None:
    """Check that a command refuses to write to `output`, which it reads."""
    before = output.read_bytes()
    assert main([*map(str, words), "-o", str(output)]) == 2
    *_, error = capsys.readouterr().err.splitlines()
    assert error == f"rosy: {output}: is also an input: choose another output file"
    assert output.read_bytes() == before


def test_inputs_that_no_option_names(tmp_path, capsys):
    """A field that does not fit the mesh is transferred from a mesh of the same name."""
    cut = write_obj(tmp_path / "cut.obj", POINTS, CUT)
    squares = write_obj(tmp_path / "field.obj", POINTS, SQUARES)
    field = tmp_path / "field.rosy"
    assert main(["field", str(squares), "--generate", "axis", "-o", str(field)]) == 0
    assert_is_input(["field", cut, field], squares, capsys)
    assert main(["field", str(cut), str(field), "-o", str(tmp_path / "new.obj")]) == 0


def test_inputs_that_have_a_title(tmp_path, capsys):
    mesh = write_obj(tmp_path / "mesh.obj", POINTS, SQUARES)
    field, link = tmp_path / "field.rosy", tmp_path / "figure.svg"
    assert main(["field", str(mesh), "--generate", "axis", "-o", str(field)]) == 0
    link.symlink_to(field)
    assert_is_input(["compare", mesh, f"Axis={field}", "smoothest"], link, capsys)


def test_inputs_below_another_name(tmp_path, capsys):
    mesh = write_obj(tmp_path / "mesh.obj", POINTS, SQUARES)
    (tmp_path / "folder").symlink_to(tmp_path)
    (tmp_path / "hard.obj").hardlink_to(mesh)
    for output in (tmp_path / "folder" / "mesh.obj", tmp_path / "hard.obj"):
        assert_is_input(["field", mesh, "--generate", "axis"], output, capsys)
    shutil.copy(mesh, tmp_path / "copy.obj")
    words = ["field", mesh, "--generate", "axis", "-o", tmp_path / "copy.obj"]
    assert main(list(map(str, words))) == 0

"""Outputs are compared with all inputs, and links are followed only where the user has named them."""

import numpy as np
import pytest
from command_helpers import finished, refusal, rosy, write_obj

#: Two squares side by side, and the same with one square cut into triangles.
POINTS = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
SQUARES = [(0, 1, 4, 3), (1, 2, 5, 4)]
CUT = [(0, 1, 4), (0, 4, 3), (1, 2, 5, 4)]


@pytest.fixture
def tiled(tmp_path):
    """The two squares, each on its own UDIM tile."""
    return write_obj(tmp_path / "tiled.obj", POINTS, SQUARES, np.array(POINTS)[:, :2])


def texture(tiled, folder):
    return "texture", tiled, "-o", folder / "a.<UDIM>.png", "--size", 32


def test_tiles_do_not_follow_links(tiled, tmp_path):
    before, folder = tiled.read_bytes(), tmp_path / "tiles"
    folder.mkdir()
    (folder / "a.1002.png").symlink_to(tiled)
    finished(*texture(tiled, folder))
    assert tiled.read_bytes() == before
    tiles = [folder / f"a.{number}.png" for number in (1001, 1002)]
    assert [tile.read_bytes()[1:4] for tile in tiles] == [b"PNG", b"PNG"]
    assert sorted(folder.iterdir()) == tiles and not tiles[1].is_symlink()


def test_all_tiles_are_checked_before_one_is_replaced(tiled, tmp_path):
    (tmp_path / "a.1001.png").write_bytes(b"old tile")
    (tmp_path / "a.1002.png").mkdir()
    message = refusal(*texture(tiled, tmp_path))
    assert "a.1002.png: cannot be written: it is a folder" in message
    assert (tmp_path / "a.1001.png").read_bytes() == b"old tile"
    assert not list(tmp_path.glob(".*"))


def assert_is_input(words, output) -> None:
    """Check that a command refuses to write to `output`, which it reads."""
    before = output.read_bytes()
    *_, error = rosy(*words, "-o", output).stderr.splitlines()
    assert error == f"rosy: {output}: is also an input: choose another output file"
    assert output.read_bytes() == before


def test_inputs_that_no_option_names(tmp_path):
    """A field that does not fit the mesh is transferred from a mesh of the same name."""
    cut = write_obj(tmp_path / "cut.obj", POINTS, CUT)
    squares = write_obj(tmp_path / "field.obj", POINTS, SQUARES)
    field = tmp_path / "field.rosy"
    finished("field", squares, "--generate", "axis", "-o", field)
    assert_is_input(["field", cut, field], squares)
    finished("field", cut, field, "-o", tmp_path / "new.obj")


def test_inputs_that_have_a_title(tmp_path):
    mesh = write_obj(tmp_path / "mesh.obj", POINTS, SQUARES)
    field, link = tmp_path / "field.rosy", tmp_path / "figure.svg"
    finished("field", mesh, "--generate", "axis", "-o", field)
    link.symlink_to(field)
    assert_is_input(["compare", mesh, f"Axis={field}", "smoothest"], link)

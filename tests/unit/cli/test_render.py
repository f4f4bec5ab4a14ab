"""Pictures of mesh files by the command line."""

import numpy as np
import pytest
from command_helpers import finished, pixels_of, refusal, write_cube, write_obj
from field_helpers import ply_header, write_off
from shapes import icosphere, torus

import rosy_addon as rf
from rosy_addon.extras.command_line import main
from rosy_addon.image_io.png import write_png


def test_y_is_up_in_off_files_by_default(tmp_path):
    path = write_off(tmp_path / "a.off", torus(24, 12))  # around z
    covered = {}
    for up in ("y", "z"):
        picture = tmp_path / f"{up}.png"
        options = ["--size", "64x64", "--up", up, "--view", "0,0", "--ortho"]
        assert main(["render", str(path), "-o", str(picture), *options]) == 0
        covered[up] = pixels_of(picture)[..., 3] > 0
    # From the front, a ring around the upward axis is seen edge on. A ring around y shows its hole.
    assert covered["z"].any(axis=1).mean() < 0.5
    assert covered["y"].any(axis=1).mean() > 0.8 and not covered["y"][32, 32]


@pytest.mark.slow
def test_a_transferred_field_is_reported(sphere, tmp_path):
    made, cut = tmp_path / "sphere.rosy", write_off(tmp_path / "cut.off", icosphere(4))
    finished("field", sphere, "-o", made)
    done = finished("field", cut, made, "-o", tmp_path / "cut.rosy", "--field-mesh", sphere)
    assert "transferred by position from sphere.off" in done.stderr


@pytest.mark.slow
def test_unused_vertices_change_nothing(tmp_path):
    """Neither the frame nor what is relative to the size of the mesh."""
    (tmp_path / "stray").mkdir()
    obj = write_cube(tmp_path / "cube.obj").read_text()
    (tmp_path / "stray" / "cube.obj").write_text(obj + "v 1e6 0 0\n")
    for verb, suffix, *words in (
        ("render", "png", "--generate", "curvature", "--size", "48x48"),
        ("strokes", "svg", "--generate", "smoothest", "--size", "200x200"),
        ("turntable", "gif", "--generate", "axis", "--size", "32x32", "--pictures", "2"),
    ):
        outputs = [folder / f"out.{suffix}" for folder in (tmp_path, tmp_path / "stray")]
        for out in outputs:
            words = ["--degree", "4", *words]
            assert main([verb, str(out.with_name("cube.obj")), "-o", str(out), *words]) == 0
        assert outputs[0].read_bytes() == outputs[1].read_bytes(), verb


# --- tones ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def painted(tmp_path_factory):
    """A ball that is dark on the left and light on the right, in its colors and in a number."""
    ball = icosphere(4)
    properties = [f"float {name}" for name in ("x", "y", "z", "cavity")]
    properties += [f"uchar {name}" for name in ("red", "green", "blue")]
    face = "face", ball.face_count, "list uchar int vertex_indices"
    paint = [(0.8, 230, 230, 230) if x > 0 else (0.1, 60, 60, 60) for x in ball.vertices[:, 0]]
    rows = [(*point, *values) for point, values in zip(ball.vertices.tolist(), paint, strict=True)]
    rows += [(3, *corners) for corners in ball.corner_vertex.reshape(-1, 3).tolist()]
    path = tmp_path_factory.mktemp("painted") / "ball.ply"
    header = ply_header("ascii", ("vertex", len(ball.vertices), *properties), face)
    path.write_text(header + "".join(" ".join(map(str, row)) + "\n" for row in rows))
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("--preset cross-hatch --tone-attribute cavity", "tone_values"),
        ("--preset cross-hatch --tone-picture shot.png", "tone_picture"),
        ("--preset cross-hatch --tone-image shot.png", "tone_image"),
        ("--set color_map=gray --color-values cavity", "color_values"),
    ],
)
def test_sources_of_tones_and_colors(words, name, painted, tmp_path, monkeypatch):
    """The command draws what the function does, which is another picture than without the source."""
    monkeypatch.chdir(tmp_path)
    write_png("shot.png", np.linspace(0.2, 0.9, 64 * 64 * 4, dtype=np.float32).reshape(64, 64, 4))
    mesh = painted
    if name == "tone_image":
        points = [(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]
        uv = [(0, 0), (1, 0), (1, 1), (0, 1)]
        mesh = write_obj(tmp_path / "square.obj", points, [range(4)], uv)
    view = "--generate smoothest --size 64x64 --view 0,0 --up z --ortho"
    pictures = []
    for options in (words.rsplit(" ", 2)[0], words):
        assert main(["render", str(mesh), "-o", "a.png", *view.split(), *options.split()]) == 0
        pictures.append(pixels_of("a.png"))
    before, drawn = pictures
    _, look, _, source = words.split()
    keywords = {"preset": look} if "=" not in look else dict([look.split("=")])
    surface = rf.Surface(mesh, up="z")
    frame = {"size": (64, 64), "view": (0, 0), "orthographic": True}
    expected = rf.render(surface, rf.smoothest(surface), **frame, **keywords, **{name: source})
    assert np.array_equal(drawn, np.asarray(expected)) and not np.array_equal(drawn, before)


@pytest.mark.slow
def test_tones_that_are_not_there(painted, sphere, tmp_path):
    write_png(tmp_path / "wide.png", np.ones((16, 64, 4), dtype=np.float32))
    for mesh, words, expected in (
        (painted, ("--tone-attribute", "ink"), ("'ink'", "'cavity'", "ball.ply")),
        (painted, ("--color-values", "Cavity"), ("'Cavity'", "'cavity'", "ball.ply")),
        (painted, ("--tone-attribute", "red", "--tone-image", "x.png"), ("choose one source",)),
        (sphere, ("--tone-attribute", "ink"), ("sphere.off", ".ply")),
        (sphere, ("--tone-image", "x.png"), ("sphere.off", "UV map")),
        (sphere, ("--tone-picture", tmp_path / "none.png"), ("none.png", "no such file")),
        (sphere, ("--tone-picture", tmp_path / "wide.png"), ("wide.png", "64 x 16")),
        (sphere, ("--set", "tone=picture"), ("picture", "none is given")),
    ):
        message = refusal("render", mesh, "-o", tmp_path / "a.png", "--size", "64x64", *words)
        assert all(text in message for text in expected) and not (tmp_path / "a.png").exists()

"""The commands of the Python package with files of simulations, and without the libraries."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageSequence

from rosy_addon import api as rf
from rosy_addon.api.films import Film
from rosy_addon.cli.parser import main as cli_main
from rosy_addon.compositor.look import Look
from rosy_addon.external.simulation_files import list_steps, read_simulation
from rosy_addon.extras.film import FieldSeries, StepReader
from rosy_addon.field.array_field import SurfaceArrays, array_field
from rosy_addon.field.mesh_arrays import SIMULATION_READERS, MeshArrays
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.mesh_view import mesh_instance
from rosy_addon.rendering.view_input import ViewInput

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def files(tmp_path, sphere):
    """A folder with the sphere and its rotation in several files."""
    sphere.save(tmp_path / "a.vtp")
    sphere.save(tmp_path / "a.ply")
    np.save(tmp_path / "rotation.npy", sphere["rotation"])
    sphere["height"] = (1 + np.asarray(sphere.points)[:, 2]) / 2
    sphere["velocity"] = np.asarray(sphere.points)
    sphere.save(tmp_path / "b.vtp")
    return tmp_path


def test_render(rosy, files):
    """The picture of an array is that of the mesh and the field in other files, to the last byte."""
    view = ("--size", "90x80", "--degree", 2, "-o")
    commands = {
        "array": ("a.vtp",),
        "named": ("b.vtp", "--array", "rotation"),
        "field": ("b.vtp", files / "rotation.npy"),
        "other files": ("a.ply", files / "rotation.npy"),
    }
    pictures = set()
    for name, (mesh, *words) in commands.items():
        output = files / f"{name}.png"
        assert rosy("render", files / mesh, *words, *view, output) == (0, "", "")
        pictures.add(output.read_bytes())
    assert len(pictures) == 1
    rosy("render", files / "b.vtp", "--generate", "form", *view, files / "form.png")
    assert (files / "form.png").read_bytes() not in pictures


def test_other_commands(rosy, files):
    status, output, _ = rosy("info", files / "b.vtp", "--array", "rotation")
    assert status == 0 and "degree 1\n1,280 faces, 642 vertices, Euler" in output
    field = ("field", files / "b.vtp", "--array", "rotation", "-o", files / "out.rosy")
    assert rosy(*field) == (0, "", "")
    strokes = ("strokes", files / "a.vtp", "-o", files / "a.svg", "--size", "60x60")
    strokes += ("--set", "spacing=12")
    assert rosy(*strokes) == (0, "", "")
    assert "<path" in (files / "a.svg").read_text()


def test_tone_from_an_array(rosy, files):
    words = ("render", files / "b.vtp", "--array", "rotation", "--preset", "engraving")
    words += ("--size", "90x90", "-o", files / "tone.png")
    assert rosy(*words, "--tone-attribute", "height") == (0, "", "")
    with Image.open(files / "tone.png") as picture:
        tone = np.asarray(picture.convert("LA"), dtype=float)
    ink = (255 - tone[..., 0]) * (tone[..., 1] > 0)
    assert ink[:30].sum() < 0.5 * ink[-30:].sum(), "the sphere is light at the top"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("b.vtp",), "b.vtp: 2 arrays can be a field: choose one by its name, with --array"),
        (("b.vtp", "--array", "U"), "b.vtp: there is no array 'U', only '"),
        (("b.vtp", "--array", "height"), "b.vtp: array 'height' has scalars, a field needs vectors"),
        (("b.vtp", "rotation.npy", "--array", "rotation"), "give either --array, or a field file"),
        (("a.obj", "--array", "rotation"), "a.obj: --array applies only to .ply files and files"),
        (("a.vtp", "--step", 2), "a.vtp: has no step 2, only 1 step"),
    ],
)  # fmt: skip
def test_errors(rosy, files, words, message, monkeypatch):
    monkeypatch.chdir(files)
    status, output, errors = rosy("render", *words, "-o", "out.png")
    assert (status, output) == (2, "")
    assert message in errors and errors.count("\n") == 1


def test_the_extension_has_none_of_it(files, capfd, monkeypatch):
    """Without the extras, --array and film are unknown, and the files are no mesh files."""
    for suffix in list(SIMULATION_READERS):
        monkeypatch.delitem(SIMULATION_READERS, suffix)
    for words, message in (
        (("render", "a.ply", "--array", "x", "-o", "a.png"), "unrecognized arguments: --array"),
        (("film", "a.vtu", "-o", "a.gif"), "invalid choice: 'film'"),
        (("render", "a.vtu", "-o", "a.png"), "must end in .obj, .off, .ply, .stl or .om\n"),
    ):
        assert cli_main([str(word) for word in words]) == 2
        assert message in capfd.readouterr().err


@pytest.mark.parametrize("library", ["pyvista", "meshio", "h5py"])
def test_missing_libraries(library, tmp_path):
    """One line that says what to install; other files need no library."""
    (tmp_path / f"{library}.py").write_text(f"raise ModuleNotFoundError(name={library!r})")
    suffix = {"pyvista": "vtu", "meshio": "msh", "h5py": "med"}[library]
    (tmp_path / f"a.{suffix}").write_text("x")
    words = ("render", f"a.{suffix}", "-o", "a.png")
    command = [sys.executable, "-m", "rosy_addon", *words]
    environment = {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)]), "PATH": ""}
    streams = {"capture_output": True, "text": True}
    run = subprocess.run(command, cwd=tmp_path, env=environment, check=False, **streams)
    message = f"rosy: a.{suffix}: needs {library}: pip install rosyfields[io]\n"
    assert (run.returncode, run.stdout, run.stderr) == (2, "", message)


@pytest.fixture
def growing(tmp_path, sphere):
    """20 steps of a sphere that grows and rotates faster."""
    points, vectors = np.array(sphere.points), np.array(sphere["rotation"])
    for number in range(1, 21):
        sphere.points = points * (1 + number / 20)
        sphere["rotation"] = vectors * number
        sphere.save(tmp_path / f"step{number}.vtp")
    return sorted(tmp_path.glob("step*.vtp"))


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_film(suffix, rosy, growing, tmp_path):
    """20 frames in the order of the numbers: the sphere grows in the fixed frame."""
    output = tmp_path / f"film{suffix}"
    words = ("--size", "64x64", "--rate", 10, "--workers", 1)
    status, lines, errors = rosy("film", *growing, "-o", output, *words)
    assert (status, errors) == (0, "")
    assert lines.splitlines() == [f"step {number} of 20" for number in range(1, 21)]
    if suffix == ".gif":
        with Image.open(output) as gif:
            assert gif.n_frames == 20 and gif.info["duration"] == 100
            frames = [np.asarray(each.convert("RGB")) for each in ImageSequence.Iterator(gif)]
    else:
        reader = imageio_ffmpeg.read_frames(str(output))
        assert next(reader)["size"] == (64, 64)
        frames = [np.frombuffer(data, np.uint8).reshape(64, 64, 3) for data in reader]
    covered = [np.count_nonzero(frame.min(axis=2) < 230) for frame in frames]
    assert len(covered) == 20 and (np.diff(covered) > 0).all()


def test_film_has_one_camera_and_one_range(growing):
    """The largest step fills the frame. The range is the largest magnitude of all steps."""
    look = Look(length=8, hue="magnitude")
    steps = list_steps(growing)[::-1]
    views = list(Film(FieldSeries(steps, StepReader()), look, (30.0, 20.0, 60, 50)).views())
    assert len({id(view.camera) for view in views}) == 1
    fields = [view.instances[0].field for view in views]
    assert {view.look.color_range for view in views} == {(0.0, fields[0].magnitude.max())}
    mesh = read_simulation(steps[0].paths[0])
    surface = rf.Surface(mesh, name=steps[0].name)
    arrays = SurfaceArrays(surface.name, surface, mesh.vertex_data, mesh.face_data)
    instance = mesh_instance(surface, array_field(arrays))
    look = views[0].look
    camera = orbit_camera(instance.face_points(), 30.0, 20.0, 60, 50)
    expected = ViewInput((instance,), camera, look)
    assert views[0].camera.view == pytest.approx(expected.camera.view, abs=1e-12)
    pictures = [(draw_picture(v)) for v in (views[0], expected)]
    assert pictures[0].rgba == pytest.approx(pictures[1].rgba, abs=1e-4)
    given = Look(magnitude_length=True, color_range=(0.0, 3.0))
    film = Film(FieldSeries(steps[:2], StepReader()), given, (0.0, 0.0, 60, 50))
    assert {view.look.color_range for view in film.views()} == {(0.0, 3.0)}


def test_film_keeps_one_step_in_memory(growing):
    fields = FieldSeries(list_steps(growing), StepReader())
    for _ in Film(fields, Look(), (0.0, 0.0, 60, 50)).views():
        meshes = [found for found in gc.get_objects() if isinstance(found, MeshArrays)]
        assert sum(bool(mesh.vertex_data) for mesh in meshes) <= 1


def test_film_errors(rosy, growing, tmp_path):
    status, _, errors = rosy("film", growing[0], "-o", tmp_path / "a.gif")
    assert status == 2 and "has one step only: draw it with the command render" in errors
    status, output, errors = rosy("film", *growing, "-o", tmp_path / "a.gif", "--array", "U")
    assert (status, output) == (2, "") and "step1.vtp: there is no array 'U'" in errors


@pytest.fixture
def turning(tmp_path):
    """A square and 12 fields on it, each in a file of its own."""
    mesh = tmp_path / "square.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 1 0 -1\nv 0 0 -1\nf 1 2 3 4\n", encoding="utf-8")
    field = rf.along_axis(rf.Surface(mesh), (1, 0, 0), 1)
    for number in range(1, 13):
        field.rotated(np.radians(number)).save(tmp_path / f"field{number}.rosy")
    return tmp_path


def test_film_of_fields(rosy, turning):
    """The mesh, then a field for each step, in the order of the numbers; the last one leads to the first."""
    files = sorted(turning.glob("field*.rosy"))
    words = ("film", turning / "square.obj", *files, "--view", "0,90", "--size", "48x48")
    words += ("--set", "length=8", "--set", "flow=1", "-o", turning / "a.gif", "--workers", 1)
    status, lines, errors = rosy(*words)
    assert (status, errors) == (0, "")
    expected = [f"step {number} of 12, field{number}.rosy" for number in range(1, 13)]
    assert lines.splitlines() == expected
    status, lines, errors = rosy(*words, "--between", 1, "--loop")
    assert status == 0 and lines.splitlines()[-1] == "picture 24 of 24"
    assert "the field turns by up to 5.5 degrees from picture to picture" in errors
    with Image.open(turning / "a.gif") as gif:
        assert gif.n_frames == 24


def test_film_of_fields_errors(rosy, turning, monkeypatch):
    monkeypatch.chdir(turning)
    Path("short.rosy").write_text("3 1\n1 0 0\n1 0 0\n1 0 0\n", encoding="utf-8")
    for files, message in (
        ("square.obj field1.rosy", "square.obj: a film needs 2 or more field files after"),
        ("square.obj field1.rosy short.rosy", "short.rosy: contains 3 rows, but square.obj"),
        ("square.obj field1.rosy none.rosy", "none.rosy: cannot be read: no such file"),
        ("field1.rosy field2.rosy", "field1.rosy: is not a mesh file: name the mesh first"),
        ("square.obj field1.rosy field2.rosy --array U", "applies only to files of simulations"),
    ):
        status, output, errors = rosy("film", *files.split(), "-o", "a.gif")
        assert (status, output) == (2, "") and message in errors and errors.count("\n") == 1

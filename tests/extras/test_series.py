"""Steps of series, one by one."""

import contextlib
import json

import meshio
import numpy as np
import pytest
import pyvista as pv
from extras.simulation_files import collection_text, write_exodus

import rosy_addon as rf
from rosy_addon.external.simulation_files import list_steps, read_simulation

#: The times of the steps. The rotation has the speed 1 + time.
TIMES = [0.0, 0.5, 10.0]


def steps_with_meshes(paths):
    return [(step, step.read()) for step in list_steps(paths)]


def write_files(folder, mesh, suffix="vtu"):
    mesh = mesh.cast_to_unstructured_grid()
    vectors = mesh["rotation"]
    for number, time in enumerate(TIMES):
        mesh["rotation"] = (1 + time) * vectors
        mesh.save(folder / f"step_{5 * number}.{suffix}")


def write_collection(path, *steps):
    """Write a .pvd file that lists files, given by their times and names, and return its path."""
    path.write_text(collection_text(*steps))
    return path


def write_pvd(folder, mesh):
    write_files(folder, mesh)
    steps = [(time, f"step_{5 * number}.vtu") for number, time in enumerate(TIMES)]
    return [write_collection(folder / "a.pvd", *steps)]


def write_series(folder, mesh):
    write_files(folder, mesh, "vtk")
    files = [{"name": f"step_{5 * k}.vtk", "time": time} for k, time in enumerate(TIMES)]
    text = json.dumps({"file-series-version": "1.0", "files": files})
    (folder / "a.vtk.series").write_text(text)
    return [folder / "a.vtk.series"]


def write_xdmf(folder, mesh, **options):
    path = folder / "a.xdmf"
    # The writer puts the HDF5 file into the current folder.
    with contextlib.chdir(folder), meshio.xdmf.TimeSeriesWriter(path, **options) as writer:
        writer.write_points_cells(np.asarray(mesh.points), [("triangle", mesh.regular_faces)])
        for time in TIMES:
            writer.write_data(time, point_data={"rotation": (1 + time) * mesh["rotation"]})
    return [path]


def write_text_xdmf(folder, mesh):
    return write_xdmf(folder, mesh, data_format="XML")


def write_numbered(folder, mesh):
    """As a shell sorts the names: step_10 before step_5."""
    write_files(folder, mesh)
    return sorted(folder.glob("step_*.vtu"))


WRITERS = write_pvd, write_series, write_xdmf, write_text_xdmf, write_numbered


@pytest.mark.parametrize("write", WRITERS)
def test_series(write, tmp_path, sphere):
    paths = write(tmp_path, sphere)
    times = [None] * 3 if write is write_numbered else TIMES
    steps = list_steps(paths)
    assert [step.time for step in steps] == times
    for (_, mesh), time in zip(steps_with_meshes(paths), TIMES, strict=True):
        speed = mesh.vertex_data["rotation"] / (1 + time)
        assert speed == pytest.approx(np.cross((0, 0, 1), mesh.vertices), abs=1e-5)


def test_hdf5_file_of_a_series(tmp_path, sphere, error_of):
    """VTK would crash without it."""
    (path,) = write_xdmf(tmp_path, sphere)
    (tmp_path / "a.h5").write_bytes(b"hello")
    assert "a.h5: is not an HDF5 file" in error_of(list_steps, [path])
    (tmp_path / "a.h5").unlink()
    assert "a.h5: cannot be read: no such file" in error_of(read_simulation, path)


def test_exodus_series(tmp_path, box):
    points = np.asarray(box.points, dtype=np.float64)
    velocity = np.stack([(1 + time) * points for time in TIMES])
    tetrahedra = box.cells_dict[pv.CellType.TETRA]
    write_exodus(tmp_path / "a.exo", points, tetrahedra, TIMES, velocity)
    for (step, mesh), time in zip(steps_with_meshes([tmp_path / "a.exo"]), TIMES, strict=True):
        assert step.time == time and len(mesh.face_start) - 1 == 108
        expected = (1 + time) * mesh.vertices
        assert mesh.vertex_data["velocity_"] == pytest.approx(expected, abs=1e-5)


def test_steps_in_parts(tmp_path, sphere):
    """Files of a .pvd file with the same time are one step."""
    halves = [sphere.clip("z", invert=invert) for invert in (True, False)]
    for part, half in enumerate(halves):
        half.cast_to_unstructured_grid().save(tmp_path / f"{part}.vtu")
    (step,) = list_steps([write_collection(tmp_path / "a.pvd", (1, "0.vtu"), (1, "1.vtu"))])
    mesh = step.read()
    assert len(mesh.face_start) - 1 == sum(half.n_cells for half in halves)
    assert len(mesh.vertices) < sum(half.n_points for half in halves), "the rims are joined"


def test_order_of_files(tmp_path):
    """Numbers sort names that differ in nothing else; other names stay in the given order."""
    names = ["b_2.vtu", "b_10.vtu", "a_1.vtu"]
    for name in names:
        (tmp_path / name).touch()

    def order(*names):
        return [step.paths[0].name for step in list_steps([tmp_path / name for name in names])]

    assert order("b_10.vtu", "b_2.vtu") == ["b_2.vtu", "b_10.vtu"]
    assert order(*names) == names


def test_series_without_files(tmp_path, error_of):
    collection, series = write_collection(tmp_path / "a.pvd"), tmp_path / "a.vtu.series"
    series.write_text('{"files": []}')
    for path in (collection, series):
        assert error_of(list_steps, [path]).endswith(f"{path.name}: lists no files")
    for time in ("9" * 400, "1e999", "NaN"):
        series.write_text(f'{{"files": [{{"name": "a.vtu", "time": {time}}}]}}')
        assert "a.vtu.series: is damaged" in error_of(list_steps, [series])
    series.write_text('{"files": [{"name": "none.vtu", "time": 0}]}')
    assert "none.vtu: cannot be read" in error_of(list_steps, [series])


def test_the_step_of_a_series(sphere, tmp_path, recwarn, error_of):
    """The last one, with a warning in the caller's file; or the given one, without."""
    for number in range(1, 4):
        sphere.point_data["rotation"] = np.asarray(sphere["rotation"]) * number
        sphere.save(tmp_path / f"{number}.vtp")
    path = write_collection(tmp_path / "a.pvd", *((k, f"{k}.vtp") for k in range(1, 4)))
    last = rf.from_array(rf.Surface(path))
    (warning,) = recwarn.list
    assert warning.category is rf.RosyWarning and warning.filename == __file__
    assert str(warning.message) == f"{path}: the last of 3 steps was read, time 3"
    recwarn.clear()
    surface = rf.Surface(path, name="ball", up="y", step=1)
    assert (surface.name, surface.up) == ("ball", "y")
    first = rf.from_array(surface)
    assert last.magnitude == pytest.approx(6 * first.magnitude, rel=1e-5)
    assert "has no step 4, only 3 steps" in error_of(rf.Surface, path, step=4)
    assert not recwarn.list

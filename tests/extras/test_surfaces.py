"""`Surface` and `from_array` with files of simulations, and with the objects of pyvista."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import rosy_addon as rf


@pytest.mark.parametrize("kind", ["file", "object"])
def test_arrays_at_the_boundary_of_a_volume(kind, box, tmp_path):
    """Velocities at points and cells give their tangential components on every face of a cube."""
    velocity = np.array([1.0, 2.0, 3.0])
    box.point_data["U"] = np.tile(velocity, (box.n_points, 1))
    box.cell_data["V"] = np.tile(velocity, (box.n_cells, 1))
    box.save(tmp_path / "box.vtu")
    path = tmp_path / "box.vtu"
    surface = rf.Surface(path if kind == "file" else pv.read(path))
    assert surface.up == "z" and surface.name == (str(path) if kind == "file" else "surface")
    assert surface.face_count == 108 and len(surface.vertices) == 4**3 - 2**3
    normal = surface.face_normal
    tangential = velocity - (normal @ velocity)[:, None] * normal
    for name in ("U", "V"):
        field = rf.from_array(surface, name)
        assert field.degree == 1 and field.surface is surface
        assert field.vectors == pytest.approx(tangential, abs=1e-6)
    assert rf.from_array(surface, "U", 4).degree == 4


def test_the_step_of_a_series(sphere, tmp_path, recwarn, error_of):
    """The last one, with a warning in the caller's file; or the given one, without."""
    entries = ""
    for number in range(1, 4):
        sphere.point_data["rotation"] = np.asarray(sphere["rotation"]) * number
        sphere.save(tmp_path / f"{number}.vtp")
        entries += f'<DataSet timestep="{number}" file="{number}.vtp"/>'
    path = tmp_path / "a.pvd"
    path.write_text(f'<VTKFile type="Collection"><Collection>{entries}</Collection></VTKFile>')
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

"""Fields that RoSy writes, read by the libraries that own the formats; and theirs, read by RoSy."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import rosy_addon as rf

meshio = pytest.importorskip("meshio")
trimesh = pytest.importorskip("trimesh")
igl = pytest.importorskip("igl")


@pytest.fixture
def surface(sphere):
    return rf.Surface(sphere)


@pytest.mark.parametrize("degree", [1, 2, 4])
@pytest.mark.parametrize("suffix", [".vtp", ".vtu", ".ply"])
def test_a_mesh_with_its_field(suffix, degree, surface, tmp_path):
    field = rf.along_axis(surface, axis=(0.1, 0.2, 1.0), degree=degree)
    path = tmp_path / f"a{suffix}"
    field.save(path)
    again = rf.from_array(rf.Surface(path))
    assert again.degree == degree
    assert again.directions == pytest.approx(field.directions, abs=1e-12)
    if suffix == ".ply":
        mesh = trimesh.load(path, process=False)
        assert np.array_equal(mesh.faces, surface.faces)
        data = mesh.metadata["_ply_raw"]["face"]["data"]
        assert data["direction_1_x"].ravel() == pytest.approx(field.directions[:, 0, 0])
        return
    read = pv.read(path)
    assert read.cell_data["direction_1"] == pytest.approx(field.directions[:, 0])
    assert read.cell_data["magnitude"] == pytest.approx(field.magnitude)
    assert read.point_data["singularity"].sum() == pytest.approx(2)
    if suffix == ".vtu":
        other = meshio.read(path)
        assert np.array_equal(other.cells_dict["triangle"], surface.faces)
        assert other.cell_data["magnitude"][0] == pytest.approx(field.magnitude)


@pytest.mark.parametrize("suffix", [".vtp", ".vtu", ".ply"])
def test_polygons(suffix, tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [1, 2, 0]]
    surface = rf.Surface(points, [[0, 1, 4, 3], [1, 2, 5, 6, 4]])
    rf.along_axis(surface, axis=(1.0, 0.3, 0.0), degree=4).save(tmp_path / f"a{suffix}")
    mesh = pv.read(tmp_path / f"a{suffix}")
    sizes = [mesh.get_cell(k).n_points for k in range(mesh.n_cells)]
    assert sizes == [4, 5] or (suffix == ".ply" and mesh.n_cells == 2)
    assert rf.from_array(rf.Surface(tmp_path / f"a{suffix}")).degree == 4


@pytest.mark.parametrize("ascii_", [True, False])
def test_matrices_of_libigl(ascii_, surface, tmp_path):
    """Two directions of each cross, as igl::comb_cross_field returns them."""
    cross = rf.along_axis(surface, axis=(0.1, 0.2, 1.0), degree=4).directions
    matrix = np.asfortranarray(cross[:, :2].reshape(-1, 6))
    igl.writeDMAT(str(tmp_path / "a.dmat"), matrix, ascii_)
    with pytest.warns(rf.RosyWarning, match="nowhere opposite"):
        field = rf.read_field(tmp_path / "a.dmat", surface)
    assert field.degree == 4
    assert field.directions == pytest.approx(cross, abs=1e-6)

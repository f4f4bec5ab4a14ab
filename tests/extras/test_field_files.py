"""Fields that RoSy writes, read by the libraries that own the formats; and theirs, read by RoSy."""

import numpy as np
import pytest
import pyvista as pv

import rosy_addon as rf

meshio = pytest.importorskip("meshio")
trimesh = pytest.importorskip("trimesh")
igl = pytest.importorskip("igl")
potpourri3d = pytest.importorskip("potpourri3d")


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


@pytest.mark.parametrize("is_open", [False, True])
def test_vectors_of_geometry_central_at_vertices(is_open, sphere, tmp_path):
    """Two numbers in a frame that depends on the order of faces, given by potpourri3d in space as well."""
    faces = np.roll(np.random.default_rng(0).permutation(sphere.regular_faces), 1, axis=1)
    if is_open:
        faces = faces[sphere.points[faces][:, :, 2].mean(axis=1) > -0.1]
    vertices, faces = np.unique(faces, return_inverse=True)
    surface = rf.Surface(sphere.points[vertices] * [1.0, 1.4, 0.7], faces.reshape(-1, 3))
    solver = potpourri3d.MeshVectorHeatSolver(surface.vertices, surface.faces)
    rows = solver.transport_tangent_vectors([0, 90], [[1.0, 0.0], [0.3, 0.5]])
    x, y, _ = solver.get_tangent_frames()
    expected = rf.from_vectors(surface, rows[:, :1] * x + rows[:, 1:] * y, 1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",")
    with pytest.warns(rf.RosyWarning, match="in the frames of geometry-central"):
        fields = rf.from_vectors(surface, rows, 1), rf.read_field(tmp_path / "a.csv", surface, 1)
    for field in fields:
        assert field.vectors == pytest.approx(expected.vectors, abs=1e-9)


def test_frames_need_one_fan_of_faces(error_of):
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 1], [-1, 0, 0], [0, -1, 1]]
    bow_tie = rf.Surface(points, [[0, 1, 2], [0, 3, 4]])
    assert "are not one fan" in error_of(rf.from_vectors, bow_tie, np.ones((5, 2)), 1)

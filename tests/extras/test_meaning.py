"""What files of other programs mean: tensors by the names of their components, and grids that close."""

import h5py
import meshio
import numpy as np
import pytest
import pyvista as pv

import rosy_addon as rf
from rosy_addon.core.errors import RosyWarning

#: A symmetric tensor in a plane that is not one of the coordinate planes.
TENSOR = np.array([[3.0, 1.1, -0.7], [1.1, -1.0, 0.4], [-0.7, 0.4, 0.5]])
POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [1.0, 1.0, 0.7], [0.0, 1.0, 0.4]])
ORDERS = {
    "tensor.vtu": ("XX", "XY", "XZ", "YY", "YZ", "ZZ"),
    "stress.vtu": ("S33", "S22", "S11", "S12", "S13", "S23"),
    "salome.med": ("SIXX", "SIYY", "SIZZ", "SIXY", "SIXZ", "SIYZ"),
}


def with_tensor(mesh, values, names):
    """A mesh with one face, and a tensor on it whose components have names."""
    mesh.cell_data["s"] = np.array([values])
    for index, name in enumerate(names):
        mesh.cell_data.VTKObject.GetArray("s").SetComponentName(index, name)
    return mesh


def components(names):
    digits = str.maketrans("123", "XYZ")
    axes = [["XYZ".index(c) for c in name.translate(digits)[-2:]] for name in names]
    return np.array([TENSOR[i, j] for i, j in axes])


def off_axis(surface, field):
    """The angle in degrees from the eigenvectors of the tensor in the plane of the face."""
    frame = np.stack(surface.face_frames, axis=1)
    _, vectors = np.linalg.eigh(np.einsum("fai,ij,fbj->fab", frame, TENSOR, frame))
    major = np.einsum("fa,fai->fi", vectors[:, :, 1], frame)
    direction = field.directions[:, 0] / np.linalg.norm(field.directions[:, 0], axis=1)[:, None]
    return np.degrees(np.arcsin(np.linalg.norm(np.cross(major, direction), axis=1))).max()


@pytest.mark.parametrize("name", ORDERS)
def test_names_of_components_decide(name, tmp_path, recwarn):
    path, names = tmp_path / name, ORDERS[name]
    rows = components(names)[None]
    if name.endswith(".med"):
        meshio.write(path, meshio.Mesh(POINTS, [("quad", [[0, 1, 2, 3]])], cell_data={"s": [rows]}))
        with h5py.File(path, "a") as file:
            file["CHA/s"].attrs["NOM"] = np.bytes_("".join(f"{n:16}" for n in names))
    else:
        mesh = pv.PolyData(POINTS, [4, 0, 1, 2, 3]).cast_to_unstructured_grid()
        with_tensor(mesh, rows[0], names).save(path)
    surface = rf.Surface(path)
    assert off_axis(surface, rf.from_array(surface)) < 1e-4
    assert not [w for w in recwarn if issubclass(w.category, RosyWarning)]


def test_components_without_names_are_in_the_order_of_vtk():
    mesh = pv.PolyData(POINTS, [4, 0, 1, 2, 3])
    surface = rf.Surface(with_tensor(mesh, components(("XX", "YY", "ZZ", "XY", "YZ", "XZ")), ()))
    with pytest.warns(RosyWarning, match="have no names"):
        field = rf.from_array(surface)
    assert off_axis(surface, field) < 1e-4


def test_a_tensor_in_the_plane():
    """[[3, 1], [1, -1]] has its major line at atan(1/2) / 2, in memory as in a file."""
    mesh = pv.PolyData([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]], [3, 0, 1, 2])
    with_tensor(mesh, (3.0, 1.0, -1.0), ("XX", "XY", "YY"))
    surface = rf.Surface(mesh.cast_to_unstructured_grid())
    x, y, _ = rf.from_array(surface).directions[0, 0]
    assert np.isclose(np.tan(2 * np.arctan2(y, x)), 0.5)


def ball_of_longitudes(rounding=0.0):
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 33), np.linspace(0, np.pi, 17), indexing="ij")
    points = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1)
    points[-1] += rounding * np.random.default_rng(0).standard_normal(points[-1].shape)
    return pv.StructuredGrid(*(points[..., k][..., None] for k in range(3)))


@pytest.mark.parametrize("rounding", [0.0, 1e-8])
@pytest.mark.parametrize("where", ["memory", "ball.vts", "ball.stl"])
def test_grids_that_close_onto_themselves(where, rounding, tmp_path):
    grid = ball_of_longitudes(rounding)
    if where == "ball.stl":
        grid.extract_surface(algorithm="dataset_surface").triangulate().save(tmp_path / where)
        surface = rf.Surface(tmp_path / where)
    else:
        if where != "memory":
            grid.save(tmp_path / where)
        with pytest.warns(RosyWarning, match="were joined"):
            surface = rf.Surface(grid if where == "memory" else tmp_path / where)
        assert rf.Surface(grid, join=False).euler_characteristic == 1
    assert surface.euler_characteristic == 2
    assert rf.smoothest(surface, 4).singularities.index.sum() == 8


def test_a_ball_of_strips_with_texture_coordinates(tmp_path):
    """Its seam and poles are closed: also in an .stl file, which has triangles without area at the poles."""
    ball = pv.Superquadric()
    ball.triangulate().save(tmp_path / "a.stl")
    for source in (ball, tmp_path / "a.stl"):
        with pytest.warns(RosyWarning, match="32 faces with fewer than three different corners"):
            assert rf.Surface(source).euler_characteristic == 2


def test_borders_with_other_data_stay_apart():
    """An angle that is 0 on one side of a seam and 360 on the other."""
    grid = ball_of_longitudes()
    grid.point_data["angle"] = np.repeat(np.linspace(0, 360, 33)[None], 17, axis=0).ravel()
    assert rf.Surface(grid).euler_characteristic == 1


def test_bodies_that_touch_stay_apart():
    both = pv.Box().merge(pv.Box().translate((2.0, 0.0, 0.0)), merge_points=False)
    assert rf.Surface(both).euler_characteristic == 4

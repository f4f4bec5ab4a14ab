"""Surfaces and arrays in the files that pyvista and meshio write."""

import meshio
import numpy as np
import pytest
import pyvista as pv
from extras.simulation_files import parts_text

import rosy_addon as rf
from rosy_addon.external.simulation_files import read_simulation
from rosy_addon.field.polygon_arrays import face_area_vectors
from rosy_addon.field.surface import Surface


def triangles_of(mesh):
    assert set(np.diff(mesh.face_start)) == {3}
    return mesh.corner_vertex.reshape(-1, 3)


def total_area(mesh):
    return np.linalg.norm(face_area_vectors(*mesh.polygons), axis=1).sum()


def write_meshio(path, mesh, write=meshio.write, **options):
    points = np.asarray(mesh.points, dtype=np.float64)
    cells = [("triangle", mesh.regular_faces)]
    arrays = {name: mesh.point_data[name] for name in mesh.point_data}
    write(path, meshio.Mesh(points, cells, point_data=arrays), **options)


WRITERS = {
    "polydata.vtp": lambda path, mesh: mesh.save(path),
    "polydata.vtk": lambda path, mesh: mesh.save(path),
    "text.vtk": lambda path, mesh: mesh.save(path, binary=False),
    "grid.vtk": lambda path, mesh: mesh.cast_to_unstructured_grid().save(path),
    "grid.vtu": lambda path, mesh: mesh.cast_to_unstructured_grid().save(path),
    "block.vtm": lambda path, mesh: pv.MultiBlock([mesh, None]).save(path),
    "old.msh": lambda path, mesh: write_meshio(path, mesh, file_format="gmsh22"),
    "older.msh": lambda path, mesh: write_meshio(path, mesh, meshio.gmsh.write, fmt_version="4.0"),
    "new.msh": lambda path, mesh: write_meshio(path, mesh, file_format="gmsh"),
    "salome.med": write_meshio,
    "hdf.xdmf": write_meshio,
    "xml.xdmf": lambda path, mesh: write_meshio(path, mesh, data_format="XML"),
    "meshio.vtu": write_meshio,
}


@pytest.mark.parametrize("name", WRITERS)
def test_surfaces(name, tmp_path, sphere):
    """Vertices, faces and vectors are those that were written, in the same order."""
    WRITERS[name](tmp_path / name, sphere)
    mesh = read_simulation(tmp_path / name)
    tolerance = 1e-5 if name == "text.vtk" else 0.0
    assert np.allclose(mesh.vertices, sphere.points, rtol=0, atol=tolerance)
    assert np.array_equal(triangles_of(mesh), sphere.regular_faces)
    assert np.allclose(mesh.vertex_data["rotation"], sphere["rotation"], rtol=0, atol=tolerance)
    assert not mesh.note


def test_boundary_of_a_volume(tmp_path, box):
    """The boundary of a cube: faces outward, each with the array of its tetrahedron."""
    corners = np.asarray(box.points)[box.cells_dict[pv.CellType.TETRA]]
    assert (np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0).all(), "the cells are inside out"
    box.save(tmp_path / "box.vtu")
    mesh = read_simulation(tmp_path / "box.vtu")
    surface = Surface(mesh)
    assert surface.face_count == 6 * 9 * 2 and len(surface.vertices) == 4**3 - 2**3
    assert total_area(mesh) == pytest.approx(6)
    of_object, of_file = rf.Surface(box), rf.Surface(tmp_path / "box.vtu")
    assert of_object.content_key == of_file.content_key == surface.content_key
    assert of_object.name == "surface" and of_file.name == str(tmp_path / "box.vtu")
    assert np.array_equal(of_object.face_data["number"], mesh.face_data["number"])
    assert ((surface.face_center - 0.5) * surface.face_normal).sum(axis=1) == pytest.approx(0.5)
    tetrahedra = box.cells_dict[pv.CellType.TETRA][mesh.face_data["number"]]
    of_face = mesh.vertices[triangles_of(mesh)]
    of_cell = np.asarray(box.points)[tetrahedra]
    assert (of_face[:, :, None] == of_cell[:, None]).all(axis=3).any(axis=2).all()


def second_order(points, tetrahedra):
    """Points and (n, 10) corners of tetrahedra with a point in the middle of each edge."""
    edges = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])
    pairs = np.sort(tetrahedra[:, edges], axis=2)
    unique, index = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    middles = points[unique].mean(axis=1)
    index = index.reshape(-1, 6) + len(points)
    return np.concatenate([points, middles]), np.concatenate([tetrahedra, index], axis=1)


def test_second_order_volume(tmp_path, box):
    """Tetrahedra of second order have the boundary of those of first order."""
    points, cells = second_order(np.asarray(box.points), box.cells_dict[pv.CellType.TETRA])
    numbers = [np.arange(len(cells))]
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(points, [("tetra10", cells)], cell_data={"number": numbers}))  # fmt: skip
    box.save(tmp_path / "b.vtu")
    second, first = (read_simulation(tmp_path / name) for name in ("a.vtu", "b.vtu"))
    assert all(map(np.array_equal, second.polygons, first.polygons))
    assert np.array_equal(second.face_data["number"], first.face_data["number"])


def test_second_order_surface(tmp_path):
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 1, 0]], dtype=float)  # fmt: skip
    cells = [("triangle6", [[0, 1, 2, 4, 5, 6]]), ("quad8", [[0, 1, 2, 3, 4, 5, 7, 8]])]
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(points, cells, point_data={"x": points[:, 0]}))
    mesh = read_simulation(tmp_path / "a.vtu")
    assert mesh.face_start.tolist() == [0, 3, 7]
    assert mesh.corner_vertex.tolist() == [0, 1, 2, 0, 1, 2, 3]
    assert mesh.vertex_data["x"].tolist() == [0, 2, 2, 0]


def test_polygons_and_strips(tmp_path):
    """Polygons stay whole; strips become triangles with the orientation of the strip."""
    hexagon = pv.Polygon(n_sides=6, fill=True)
    hexagon.clear_data()
    hexagon.save(tmp_path / "hexagon.vtp")
    assert np.diff(read_simulation(tmp_path / "hexagon.vtp").polygons.face_start).tolist() == [6]
    sphere = pv.Icosphere(nsub=2)
    strips = sphere.strip()
    assert strips.n_strips
    strips.clear_data()
    strips.save(tmp_path / "strips.vtp")
    mesh = read_simulation(tmp_path / "strips.vtp")
    surface = Surface(mesh)
    assert len(triangles_of(mesh)) == sphere.n_cells
    assert ((surface.face_center * surface.face_normal).sum(axis=1) > 0.9).all()
    assert total_area(mesh) == pytest.approx(sphere.area, rel=1e-5)


def test_images_and_structured_grids(tmp_path):
    """The pixels of an image have their points in rows."""
    image = pv.ImageData(dimensions=(4, 3, 1))
    image.save(tmp_path / "image.vti")
    image.cast_to_structured_grid().save(tmp_path / "grid.vts")
    for name in ("image.vti", "grid.vts"):
        surface = Surface(read_simulation(tmp_path / name))
        assert surface.face_count == 6 and (surface.face_normal == [0, 0, 1]).all()


def test_surface_cells_go_before_volume_cells(tmp_path, box):
    """Lines and volume cells are left out, and so are the points that only they use."""
    points = np.asarray(box.points, dtype=float)
    tetra = box.cells_dict[pv.CellType.TETRA]
    cells = [("line", [[0, 1]]), ("tetra", tetra), ("triangle", [[5, 6, 7], [7, 9, 8]])]
    data = {"part": [np.full(len(block), k) for k, (_, block) in enumerate(cells)]}
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(points, cells, cell_data=data))
    mesh = read_simulation(tmp_path / "a.vtu")
    assert triangles_of(mesh).tolist() == [[0, 1, 2], [2, 4, 3]]
    assert np.array_equal(mesh.vertices, points[5:10])
    assert mesh.face_data["part"].tolist() == [2, 2]


@pytest.mark.parametrize("name", ["parts.vtm", "parts.pvtu"])
def test_parts_are_joined(name, tmp_path):
    """There is no boundary between two parts of a volume."""
    left = pv.ImageData(dimensions=(5, 5, 5), spacing=(0.25,) * 3).cast_to_unstructured_grid()
    parts = [left, left.translate((1, 0, 0), inplace=False)]
    for number, part in enumerate(parts):
        part.point_data["U"] = np.cross((0, 0, 1), part.points).astype(np.float32)
        part.save(tmp_path / f"{number}.vtu")
    pv.MultiBlock(parts).save(tmp_path / "parts.vtm")
    (tmp_path / "parts.pvtu").write_text(parts_text('type="Float32" Name="U"'))
    mesh = read_simulation(tmp_path / name)
    assert mesh.polygons.face_count == 2 * 16 + 4 * 32
    assert total_area(mesh) == pytest.approx(2 + 8)
    assert np.array_equal(mesh.vertex_data["U"], np.cross((0, 0, 1), mesh.vertices))


def test_abaqus(tmp_path, box):
    cells = [("tetra", box.cells_dict[pv.CellType.TETRA])]
    meshio.write(tmp_path / "a.inp", meshio.Mesh(np.asarray(box.points, dtype=float), cells))
    assert read_simulation(tmp_path / "a.inp").polygons.face_count == 108


def test_normals_and_texture_coordinates_are_no_arrays(tmp_path):
    pv.Sphere().save(tmp_path / "a.vtp")
    assert pv.read(tmp_path / "a.vtp").array_names == ["Normals"]
    assert not read_simulation(tmp_path / "a.vtp").vertex_data


SUFFIXES = ("vtk", "vtu", "vtp", "vtm", "pvtu", "xdmf", "exo", "msh", "med", "inp", "pvd", "vtu.series")  # fmt: skip


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_damaged_files(suffix, tmp_path, error_of, capfd):
    """One line that names the file, and nothing else is printed."""
    path = tmp_path / f"a.{suffix}"
    path.write_text("hello\n")
    assert error_of(read_simulation, path).startswith(f"{path}: ")
    assert tuple(capfd.readouterr()) == ("", "")


def test_truncated_file(tmp_path, sphere, error_of):
    path = tmp_path / "a.vtu"
    sphere.cast_to_unstructured_grid().save(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert error_of(read_simulation, path).startswith(f"{path}: cannot be read: ")


def test_a_file_that_crashes_vtk(tmp_path, sphere, error_of, capfd):
    """The helper process that reads it ends, and another one reads the next file."""
    path = tmp_path / "a.vtp"
    sphere.save(path)
    good = path.read_bytes()
    path.write_bytes(good.replace(b'NumberOfComponents="3"', b'NumberOfComponents="-9"'))
    assert error_of(read_simulation, path).startswith(f"{path}: cannot be read: its reader crashed")
    path.write_bytes(good)
    assert read_simulation(path).polygons.face_count == sphere.n_cells
    assert tuple(capfd.readouterr()) == ("", "")


def test_files_without_a_surface(tmp_path, error_of):
    pv.Line().save(tmp_path / "line.vtp")
    message = error_of(read_simulation, tmp_path / "line.vtp")
    assert "none of its 1 cell is a face or a volume" in message
    assert "no such file" in error_of(read_simulation, tmp_path / "none.vtu")
    assert "its name must end in .vtk, " in error_of(read_simulation, tmp_path / "a.txt")


def test_gltf_with_two_nodes_and_a_uv_map(tmp_path):
    """Nodes are where their matrices put them, and texture seams are no borders."""
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.uv_sphere(count=[8, 16])
    ball.unmerge_vertices()
    uv = np.arctan2(ball.vertices[:, 1], ball.vertices[:, 0])[:, None] * [0.1, 0.2]
    ball.visual = trimesh.visual.TextureVisuals(uv=uv)
    scene = trimesh.Scene()
    for x in (0.0, 5.0):
        scene.add_geometry(ball, transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    scene.export(tmp_path / "a.glb")
    surface = rf.Surface(tmp_path / "a.glb")
    assert surface.up == "y" and surface.euler_characteristic == 4
    assert np.ptp(surface.vertices, axis=0) == pytest.approx(ball.extents + [5, 0, 0])


def test_medit(tmp_path, sphere):
    write_meshio(tmp_path / "a.mesh", sphere)
    assert rf.Surface(tmp_path / "a.mesh").vertices == pytest.approx(np.asarray(sphere.points))

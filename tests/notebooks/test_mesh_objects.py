"""Meshes of other libraries as surfaces, and the arrays that come with them."""

import numpy as np
import pytest
import rosyfields as rf

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
COLORS = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]], dtype=np.uint8)
LUMINANCE = [0.2126, 0.7152, 0.0722, 1.0]


def picture_difference(surface, tones):
    """Largest difference of the picture with the colors of the mesh from the one with given tones."""
    options = {"view": (0, 90), "size": (48, 48), "preset": "engraving"}
    by_name = rf.render(surface, tone_values="Color", **options)
    by_values = rf.render(surface, tone_values=tones, **options)
    return np.abs(np.asarray(by_name, dtype=int) - np.asarray(by_values, dtype=int)).max()


def test_trimesh_keeps_colors_and_attributes():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(SQUARE, TRIANGLES, vertex_colors=COLORS, process=False)
    mesh.face_attributes["part"] = np.array([7, 8])
    surface = rf.Surface(mesh)
    np.testing.assert_array_equal(surface.vertices, SQUARE)
    np.testing.assert_array_equal(surface.faces, TRIANGLES)
    np.testing.assert_array_equal(surface.face_data["part"], [7, 8])
    assert picture_difference(surface, LUMINANCE) <= 1


def test_trimesh_textures_and_scenes():
    trimesh = pytest.importorskip("trimesh")
    uv = SQUARE[:, :2] * 0.5
    visual = trimesh.visual.TextureVisuals(uv=uv)
    mesh = trimesh.Trimesh(SQUARE, TRIANGLES, visual=visual, process=False)
    np.testing.assert_array_equal(rf.Surface(mesh).uv, uv[TRIANGLES.ravel()])
    scene = trimesh.Scene()
    scene.add_geometry(mesh)
    scene.add_geometry(mesh, transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    surface = rf.Surface(scene)
    assert surface.face_count == 4 and surface.vertices[:, 0].max() == 6


def test_pyvista_keeps_polygons_of_any_size_and_leaves_lines_out():
    pyvista = pytest.importorskip("pyvista")
    points = np.vstack([SQUARE, [[2, 0, 0], [2, 1, 0], [1.5, 2, 0]]])
    faces = [[0, 1, 2, 3], [1, 4, 5, 6, 2], [2, 6, 3]]
    flat = np.concatenate([[len(face), *face] for face in faces])
    mesh = pyvista.PolyData(points, faces=flat, lines=[2, 0, 4])
    mesh.cell_data["number"] = np.arange(4)  # VTK has lines before polygons
    mesh.point_data["height"] = points[:, 1]
    surface = rf.Surface(mesh)
    assert [face.tolist() for face in surface.faces] == faces
    np.testing.assert_array_equal(surface.face_data["number"], [1, 2, 3])
    np.testing.assert_array_equal(surface.vertex_data["height"], surface.vertices[:, 1])


def test_pyvista_strips_grids_and_texture_coordinates():
    pyvista = pytest.importorskip("pyvista")
    plane = pyvista.Plane(i_resolution=3, j_resolution=2)
    surface = rf.Surface(plane)
    assert surface.face_count == 6
    expected = plane.active_texture_coordinates[surface.corner_vertex]
    np.testing.assert_array_equal(surface.uv, expected)
    strips = plane.triangulate().strip()
    assert strips.n_strips and rf.Surface(strips).face_count == 12
    grid = plane.cast_to_unstructured_grid()
    grid.cell_data["number"] = np.arange(6)
    surface = rf.Surface(grid)
    np.testing.assert_array_equal(surface.face_data["number"], np.arange(6))
    with pytest.raises(rf.RosyError, match="has no surface"):
        rf.Surface(pyvista.Line())


def test_meshio_concatenates_cells_and_their_data():
    meshio = pytest.importorskip("meshio")
    cells = [("line", [[0, 1]]), ("triangle", TRIANGLES[:1]), ("triangle6", [[0, 2, 3, 0, 2, 3]])]
    mesh = meshio.Mesh(SQUARE, cells, cell_data={"number": [[1], [2], [3]]})
    surface = rf.Surface(mesh)
    np.testing.assert_array_equal(surface.faces, TRIANGLES)
    np.testing.assert_array_equal(surface.face_data["number"], [2, 3])
    with pytest.raises(rf.RosyError, match="has no surface"):
        rf.Surface(meshio.Mesh(SQUARE, [("line", [[0, 1]])]))


def test_open3d_meshes():
    open3d = pytest.importorskip("open3d")
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(SQUARE), open3d.utility.Vector3iVector(TRIANGLES)
    )
    mesh.vertex_colors = open3d.utility.Vector3dVector(COLORS / 255)
    uv = SQUARE[TRIANGLES.ravel(), :2]
    mesh.triangle_uvs = open3d.utility.Vector2dVector(uv)
    for given in (mesh, open3d.t.geometry.TriangleMesh.from_legacy(mesh)):
        surface = rf.Surface(given)
        np.testing.assert_array_equal(surface.faces, TRIANGLES)
        np.testing.assert_allclose(surface.uv, uv)
        assert picture_difference(surface, LUMINANCE) <= 1


def test_what_is_no_mesh_is_refused():
    with pytest.raises(rf.RosyError, match="not dict"):
        rf.Surface({"vertices": SQUARE})

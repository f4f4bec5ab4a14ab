"""Files as Gmsh itself writes them, against the positions and values that were given to Gmsh."""

import numpy as np
import pytest

import rosy_addon as rf
from rosy_addon.external.gmsh_file import _CELLS

gmsh = pytest.importorskip("gmsh")


#: Formats of files, and whether they have the parameters of the nodes.
FORMATS = [(2.2, 0), (2.2, 1), (4.0, 0), (4.0, 1), (4.1, 0), (4.1, 1)]


def set_format(version, parameters):
    """Choose the format of the files to write. Gmsh writes 4.0 as text alone."""
    if version == 4.0 and gmsh.option.getNumber("Mesh.Binary"):
        pytest.skip("Gmsh writes no binary files of this format")
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.SaveParametric", parameters)


@pytest.fixture(params=[0, 1], ids=["text", "binary"])
def model(request):
    """A session of Gmsh with a mesh of the unit sphere, which writes texts or binary files."""
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("Mesh.Binary", request.param)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addSphere(0, 0, 0, 1)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
    gmsh.model.mesh.generate(2)
    yield gmsh.model
    gmsh.finalize()


def triangles(model):
    """The tags of the triangles, and their normals."""
    (tags,), (nodes,) = model.mesh.getElements(2)[1:]
    node_tags, points, _ = model.mesh.getNodes()
    order = np.argsort(node_tags)
    points = points.reshape(-1, 3)[order[np.searchsorted(node_tags[order], nodes)]]
    a, b, c = points.reshape(len(tags), -1, 3)[:, :3].swapaxes(0, 1)
    return tags, np.cross(b - a, c - a)


def write_view(path, kind, tags, values):
    """Add values to the mesh, and write both to a file."""
    view = gmsh.view.add("wind")
    model = gmsh.model.getCurrent()
    size = {"numComponents": values.shape[1]}
    gmsh.view.addHomogeneousModelData(view, 0, model, kind, tags, values.ravel(), **size)
    gmsh.view.write(view, str(path))


@pytest.mark.parametrize("version, parameters", FORMATS)
@pytest.mark.parametrize("order", [1, 2])
def test_data_of_some_elements(version, parameters, order, model, tmp_path, recwarn):
    """Rows in any order and on a part of the elements: each vector is on its own triangle."""
    set_format(version, parameters)
    model.mesh.setOrder(order)
    tags, normals = triangles(model)
    chosen = np.random.default_rng(0).permutation(len(tags))[:-7]
    wind = np.cross((0.0, 0.0, 1.0), normals)
    write_view(tmp_path / "a.msh", "ElementData", tags[chosen], wind[chosen])
    surface = rf.Surface(tmp_path / "a.msh")
    assert surface.euler_characteristic == 2 and surface.face_count == len(tags)
    (warning,) = recwarn.list
    assert f"'wind' has no data at 7 of {len(tags)} elements: undefined" in str(warning.message)
    vectors = rf.from_array(surface).vectors
    assert np.count_nonzero(~vectors.any(axis=1)) == 7
    expected = np.cross((0.0, 0.0, 1.0), surface.face_normal)
    cosine = (vectors * expected).sum(axis=1) / np.linalg.norm(expected, axis=1)
    length = np.linalg.norm(vectors, axis=1)
    assert cosine[length > 0] == pytest.approx(length[length > 0], rel=1e-6)


def test_numbers_of_some_nodes(model, tmp_path):
    node_tags, points, _ = model.mesh.getNodes()
    chosen = np.random.default_rng(0).permutation(len(node_tags))[:100]
    heights = points.reshape(-1, 3)[chosen, 2:]
    write_view(tmp_path / "a.msh", "NodeData", node_tags[chosen], heights)
    surface = rf.Surface(tmp_path / "a.msh")
    read = surface.vertex_data["wind"].ravel()
    assert np.count_nonzero(np.isfinite(read)) == 100
    assert np.nanmax(np.abs(read - surface.vertices[:, 2])) < 1e-12


def test_shapes_of_elements(model):
    """The table of numbers of nodes is Gmsh's own, for all shapes up to order 4."""
    shapes = {"Triangle": 5, "Quadrilateral": 9, "Tetrahedron": 10}
    shapes |= {"Hexahedron": 12, "Prism": 13, "Pyramid": 14}
    found = 0
    for kind in range(1, 141):
        try:
            name, dimension, order, nodes, _, corners = model.mesh.getElementProperties(kind)
        except Exception:  # Gmsh has no such type
            continue
        if dimension >= 2 and 1 <= order <= 4 and nodes:
            assert _CELLS[kind] == (shapes[name.split()[0]], corners, nodes)
            found += 1
    assert found > 30


@pytest.mark.parametrize("version, parameters", FORMATS)
def test_boundary_of_a_volume_with_sparse_tags(version, parameters, model, tmp_path):
    set_format(version, parameters)
    model.mesh.generate(3)
    model.addPhysicalGroup(3, [1])  # only the tetrahedra are saved
    gmsh.write(str(tmp_path / "a.msh"))
    surface = rf.Surface(tmp_path / "a.msh")
    assert surface.euler_characteristic == 2
    assert surface.face_count == len(triangles(model)[0])
    outward = (surface.face_normal * surface.face_center).sum(axis=1)
    assert outward.min() > 0.9

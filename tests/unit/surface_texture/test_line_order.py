"""The order of lines on surfaces: the first line continues as far as the field allows."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import cube, cylinder, icosphere, instance_of, placed, torus

from rosy_addon.line_drawing.tangent_mesh import TangentMesh, build_tangent_mesh, nearest_member
from rosy_addon.surface_texture.line_order import first_line_weights, line_order


def first_lines(mesh: TangentMesh, angle: float = 0.0, blend: float = 0.02):
    """(T, 3) unit vectors along the first line at the centers of triangles, and (T,) their weights."""
    order = line_order(mesh, angle, blend)
    triangle = np.arange(len(mesh.area))
    weights = np.full((len(triangle), 3), 1 / 3, dtype=np.float32)
    first = order.first_at(triangle, weights)
    z = mesh.z.mean(axis=1)
    member = nearest_member(np.exp(1j * np.angle(first) / order.degree), z, mesh.degree)
    members = [member * np.exp(2j * np.pi * k / mesh.degree) for k in range(mesh.family_count)]
    share = first_line_weights(first, np.array(members), order.degree)
    np.testing.assert_allclose(share.sum(axis=0), 1, atol=1e-5)
    return mesh.to_world(triangle, member), share[0]


def share_of(mesh: TangentMesh, is_so: np.ndarray) -> float:
    """The fraction of the area that is so."""
    return float(mesh.area[is_so].sum() / mesh.area.sum())


def test_the_first_line_is_horizontal_on_a_cylinder():
    """At an angle of 90 degrees, it is vertical; nowhere do two lines swap."""
    mesh = build_tangent_mesh(instance_of(cylinder(), 4, "curvature"))
    is_side = np.abs(mesh.normal[:, 2]) < 0.1
    for angle, steepness in ((0.0, 0.0), (np.pi / 2, 1.0)):
        line, share = first_lines(mesh, angle)
        np.testing.assert_allclose(np.abs(line[is_side, 2]), steepness, atol=0.02)
        np.testing.assert_allclose(share[is_side], 1, atol=0.01)


@pytest.mark.slow
def test_lines_continue_where_the_field_turns():
    """A torus at a slant has a field without singularities: the first line goes round it everywhere.

    In some places, the other line is nearer to the horizontal direction.
    """
    matrix = placed(Rotation.from_euler("x", 30, degrees=True).as_matrix())
    mesh = build_tangent_mesh(instance_of(torus(), 4, "curvature", matrix))
    line, share = first_lines(mesh)
    assert share_of(mesh, share > 0.99) > 0.999
    around = np.cross(matrix[:3, 2], mesh.points.mean(axis=1))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    is_around = np.abs((line * around).sum(axis=1)) > 0.7
    assert share_of(mesh, is_around) > 0.999
    across = np.cross(mesh.normal, around)
    assert share_of(mesh, np.abs(across[:, 2]) < 0.8 * np.abs(around[:, 2])) > 0.05


@pytest.mark.slow
def test_lines_swap_only_between_singularities():
    """On a sphere they must, but on a small part of it."""
    mesh = build_tangent_mesh(instance_of(icosphere(4), 4))
    _, share = first_lines(mesh)
    assert share_of(mesh, share < 0.9) < 0.12 and share.min() < 0.9


@pytest.mark.slow
def test_the_order_does_not_depend_on_the_size_of_triangles_or_of_the_mesh():
    """A cube of twelve triangles has one first line on each face, at any scale."""
    for scale in (1e-6, 1e6):
        mesh = build_tangent_mesh(instance_of(cube(), 4, "axis", placed(scale)))
        line, share = first_lines(mesh, blend=0.02 * scale)
        is_side = np.abs(mesh.normal[:, 2]) < 0.1
        assert share[is_side].min() > 0.99 and np.ptp(np.abs(line[is_side, 2])) < 0.01

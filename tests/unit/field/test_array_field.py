"""Fields from named arrays, against closed forms and against the same numbers in .npy files."""

import numpy as np
import pytest
from field_helpers import angle_differences, read_field
from shapes import cube, icosphere, plane

from rosy_addon.core.errors import RosyWarning
from rosy_addon.field.array_field import SurfaceArrays, array_field, find_array
from rosy_addon.field.validate import VectorPolicy, vertex_normals

SPHERE, BOX = icosphere(3), cube()


def arrays_of(surface, points=(), cells=()):
    return SurfaceArrays("flow.vtu", surface, dict(points), dict(cells))


def rotation(points):
    """(n, 3) velocities of the rotation about z, tangent to every surface of revolution about z."""
    return np.stack([-points[:, 1], points[:, 0], np.zeros(len(points))], axis=1)


def constant(surface, domain, row):
    """The arrays of a surface with the same numbers at all points, or at all cells."""
    count = len(surface.vertices) if domain == "points" else surface.face_count
    return arrays_of(surface, **{domain: {"a": np.tile(row, (count, 1))}})


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_rotation_at_points_and_cells(degree):
    """Circles around the axis, with the distance from it as magnitude."""
    circles = rotation(SPHERE.face_center)
    arrays = arrays_of(SPHERE, {"p": rotation(SPHERE.vertices)}, {"c": circles})
    far_from_poles = np.abs(SPHERE.face_center[:, 2]) < 0.9
    for name, tolerance in (("p", 3.0), ("c", 1.0)):
        field = array_field(arrays, name, degree)
        assert field.degree == degree
        off = angle_differences(SPHERE, field.vectors, circles, max(degree, 2))
        assert np.degrees(off)[far_from_poles].max() < tolerance
        if degree == 1:
            radius = np.linalg.norm(circles, axis=1)[far_from_poles]
            assert field.magnitude[far_from_poles] == pytest.approx(radius, rel=0.02)


@pytest.mark.parametrize(
    ("domain", "columns"),
    [("points", 3), ("points", 12), ("cells", 3), ("cells", 6), ("cells", 9), ("cells", 12)],
)
def test_the_same_as_npy(columns, domain, tmp_path):
    """Arrays give the fields of .npy files, which have no tensors at points, to the last bit."""
    at_points = domain == "points"
    rows = vectors = rotation(SPHERE.vertices if at_points else SPHERE.face_center)
    if columns == 12:
        other = np.cross(vertex_normals(SPHERE) if at_points else SPHERE.face_normal, vectors)
        rows = np.concatenate([vectors, other, -vectors, -other], axis=1)
    if columns in (6, 9):
        tensors = vectors[:, :, None] * vectors[:, None] + 0.3 * np.eye(3)
        rows = tensors.reshape(-1, 9)
    array = rows[:, [0, 4, 8, 1, 5, 2]] if columns == 6 else rows
    field = array_field(arrays_of(SPHERE, **{domain: {"a": array}}))
    np.save(tmp_path / "rows.npy", rows)
    expected = read_field(tmp_path / "rows.npy", SPHERE, 1 if columns == 3 else None)
    assert np.array_equal(field.vectors, expected.vectors)
    for name in ("degree", "family_count"):
        assert getattr(field, name) == getattr(expected, name)
    if expected.direction_ratios is not None:
        assert np.array_equal(field.direction_ratios, expected.direction_ratios)


@pytest.mark.parametrize("domain", ["points", "cells"])
def test_velocity_across_a_surface(domain):
    """The tangential component on every face of a cube; degree 1, as these are vectors."""
    velocity = np.array([1.0, 2.0, 3.0])
    with pytest.warns(RosyWarning, match="off the surface; their tangential parts are read"):
        field = array_field(constant(BOX, domain, velocity))
    normal = BOX.face_normal
    assert field.degree == 1
    assert field.vectors == pytest.approx(velocity - (normal @ velocity)[:, None] * normal)


def test_velocity_normal_to_the_surface_is_undefined():
    """Also where the tangential component is only a rounding error, as on a sphere."""
    assert not array_field(arrays_of(SPHERE, cells={"U": SPHERE.face_normal})).vectors.any()
    field = array_field(constant(BOX, "points", [0.0, 0.0, 1.0]))
    is_cap = np.abs(BOX.face_normal[:, 2]) > 0.5
    assert not field.vectors[is_cap].any() and field.magnitude[~is_cap] == pytest.approx(1)


@pytest.mark.parametrize("domain", ["points", "cells"])
@pytest.mark.parametrize("columns", [6, 9])
def test_stress(domain, columns):
    """Principal directions in each face: the axis of the larger stress is the major one."""
    row = np.diag([3.0, 2.0, 1.0]).ravel() if columns == 9 else [3.0, 2.0, 1.0, 0.0, 0.0, 0.0]
    field = array_field(constant(BOX, domain, row))
    major = np.where(np.abs(BOX.face_normal[:, :1]) > 0.5, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    assert field.family_count == 2
    assert angle_differences(BOX, field.vectors, major, 2).max() < 1e-6


@pytest.mark.parametrize(
    ("number", "axis", "direction"), [(3, 2, [1, 1, 0]), (4, 0, [0, 1, 1]), (5, 1, [1, 0, 1])]
)
def test_order_of_the_numbers_of_a_symmetric_tensor(number, axis, direction):
    """XX, YY, ZZ, XY, YZ, XZ: each shear has its principal directions in the faces of one kind."""
    field = array_field(constant(BOX, "cells", np.eye(6)[number]))
    is_sheared = np.abs(BOX.face_normal[:, axis]) > 0.5
    lines = np.tile(np.array(direction, dtype=float), (BOX.face_count, 1))
    assert angle_differences(BOX, field.vectors, lines, 2)[is_sheared].max() < 1e-6
    assert not field.vectors[~is_sheared].any()


def test_two_components_on_a_flat_mesh(error_of):
    field = array_field(constant(plane(), "points", [3.0, 4.0]))
    assert field.vectors == pytest.approx(np.tile([3.0, 4.0, 0.0], (16, 1)))
    assert "'a' has 2 numbers" in error_of(array_field, constant(BOX, "points", [3.0, 4.0]), "a")


def test_values_that_are_not_finite(error_of):
    velocity = np.tile([1.0, 2.0, 3.0], (BOX.face_count, 1))
    velocity[2] = np.nan
    arrays = arrays_of(BOX, cells={"U": velocity})
    assert "flow.vtu: array 'U': 1 of 6 vectors are not finite" in error_of(array_field, arrays)
    field = array_field(arrays, policy=VectorPolicy("zero"))
    assert np.flatnonzero(~field.vectors.any(axis=1)).tolist() == [2]
    assert np.isnan(velocity[2]).all(), "the array stays as it is"


def test_choice_of_an_array(error_of):
    """Without a name there must be one array of vectors or tensors; names may be anything."""
    others = {
        "rgb": np.zeros((8, 3), dtype=np.uint8),
        "p": np.zeros(8),
        "Normals": BOX.vertices - 0.5,
        "words": np.array(["a"] * 8),
        "short": np.zeros((5, 3)),
    }
    arrays = arrays_of(BOX, {"U": np.ones((8, 3)), **others})
    assert find_array(arrays).name == "U" and find_array(arrays, "rgb").columns == 3
    message = error_of(find_array, arrays, "velocity")
    assert message.startswith(
        "flow.vtu: there is no array 'velocity', only 'U' (8 points x 3), 'rgb' (8 points x 3), "
    )
    assert "'p' has scalars" in error_of(array_field, arrays, "p")
    both = arrays_of(BOX, {"U": np.ones((8, 3))}, {"U": np.ones((6, 3)), "a\u202eb": np.ones((6, 6))})  # fmt: skip
    message = error_of(find_array, both)
    assert "3 arrays can be a field" in message and "'a\\u202eb' (6 cells x 6)" in message
    assert "'point:U' or 'cell:U'" in error_of(find_array, both, "U")
    assert find_array(both, "cell:U").domain == "face"
    assert "degree 4, but degree 2" in error_of(array_field, both, "a\u202eb", degree=2)
    message = error_of(array_field, arrays_of(BOX, others))
    assert "no array of vectors or tensors, only 'rgb'" in message
    assert "only the mesh" in error_of(array_field, arrays_of(BOX))


def test_tensors_must_be_symmetric(error_of):
    message = error_of(array_field, constant(BOX, "cells", np.arange(9.0)))
    assert "'a' has tensors that are not symmetric" in message

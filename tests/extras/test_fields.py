"""Fields from arrays, against closed forms and against the same numbers in .npy files."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from extras.rotations import angle_between_lines, rotation

from rosy_addon.external.simulation_files import (
    build_surface,
    find_array,
    make_field,
    read_simulation,
)
from rosy_addon.field.field_io import read_field


@pytest.fixture
def loaded(tmp_path):
    """A function that writes a mesh with arrays and returns what is read again."""

    def write_and_read(mesh, points=(), cells=()):
        mesh.point_data.update(dict(points))
        mesh.cell_data.update(dict(cells))
        mesh.save(tmp_path / ("a.vtp" if isinstance(mesh, pv.PolyData) else "a.vtu"))
        read = read_simulation(tmp_path / ("a.vtp" if isinstance(mesh, pv.PolyData) else "a.vtu"))
        return read, build_surface(read)

    return write_and_read


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_rotation_at_points_and_cells(degree, loaded, sphere):
    """Circles around the axis, with the distance from it as magnitude."""
    centers = np.asarray(sphere.cell_centers().points, dtype=np.float64)
    mesh, surface = loaded(sphere, cells={"at cells": rotation(centers)})
    far_from_poles = np.abs(surface.face_center[:, 2]) < 0.9
    for name, tolerance in (("rotation", 3.0), ("at cells", 1.0)):
        field = make_field(mesh, surface, name, degree)
        assert field.degree == degree
        members = [field.vectors]
        if degree == 4:
            members.append(np.cross(surface.face_normal, field.vectors))
        circles = rotation(surface.face_center)
        off = np.minimum.reduce([angle_between_lines(m, circles) for m in members])
        assert off[far_from_poles].max() < tolerance
        if degree == 1:
            radius = np.linalg.norm(circles, axis=1)[far_from_poles]
            assert field.magnitude[far_from_poles] == pytest.approx(radius, rel=0.02)


@pytest.mark.parametrize("columns", [3, 6, 9, 12])
@pytest.mark.parametrize("domain", ["points", "cells"])
def test_the_same_as_npy(columns, domain, loaded, sphere, tmp_path):
    """Arrays give the fields of .npy files with the same rows, to the last bit."""
    place = sphere if domain == "points" else sphere.cell_centers()
    normal = np.asarray(sphere.points if domain == "points" else sphere.compute_normals().cell_data["Normals"])  # fmt: skip
    vectors = rotation(np.asarray(place.points))
    rows = vectors
    if columns == 12:
        other = np.cross(normal, vectors)
        rows = np.concatenate([vectors, other, -vectors, -other], axis=1)
    if columns in (6, 9):
        tensors = vectors[:, :, None] * vectors[:, None] + 0.3 * np.eye(3)
        rows = tensors.reshape(-1, 9)
    np.save(tmp_path / "rows.npy", rows)
    array = rows[:, [0, 4, 8, 1, 5, 2]] if columns == 6 else rows
    mesh, surface = loaded(sphere, **{domain: {"a": array}})
    field = make_field(mesh, surface, "a")
    if columns in (6, 9) and domain == "points":
        # .npy files have no tensors at points.
        circles = rotation(surface.face_center)
        away = np.abs(surface.face_center[:, 2]) < 0.9
        assert angle_between_lines(field.vectors, circles)[away].max() < 3
        return
    expected = read_field(tmp_path / "rows.npy", surface)
    assert np.array_equal(field.vectors, expected.vectors)
    for name in ("degree", "family_count"):
        assert getattr(field, name) == getattr(expected, name)
    if expected.direction_ratios is not None:
        assert np.array_equal(field.direction_ratios, expected.direction_ratios)


@pytest.mark.parametrize("domain", ["points", "cells"])
def test_velocity_at_the_boundary_of_a_volume(domain, loaded, box):
    """The tangential component on every face of a cube, also beside the edges."""
    velocity = np.array([1.0, 2.0, 3.0])
    count = box.n_points if domain == "points" else box.n_cells
    mesh, surface = loaded(box, **{domain: {"U": np.tile(velocity, (count, 1))}})
    normal = surface.face_normal
    tangential = velocity - (normal @ velocity)[:, None] * normal
    assert make_field(mesh, surface, "U", degree=1).vectors == pytest.approx(tangential, abs=1e-12)


def test_velocity_normal_to_the_surface_is_undefined(loaded, box):
    points = np.asarray(box.points, dtype=np.float64)
    mesh, surface = loaded(box, points={"U": np.tile([0.0, 0.0, 1.0], (len(points), 1))})
    field = make_field(mesh, surface, "U", degree=1)
    is_cap = np.abs(surface.face_normal[:, 2]) > 0.5
    assert not field.vectors[is_cap].any()
    assert field.magnitude[~is_cap] == pytest.approx(1)


@pytest.mark.parametrize("domain", ["points", "cells"])
@pytest.mark.parametrize("columns", [6, 9])
def test_stress_at_the_boundary_of_a_volume(domain, columns, loaded, box):
    """Principal directions in each face: the axis of the larger stress is the major one."""
    stress = np.diag([3.0, 2.0, 1.0])
    row = stress.ravel() if columns == 9 else np.array([3.0, 2.0, 1.0, 0.0, 0.0, 0.0])
    count = box.n_points if domain == "points" else box.n_cells
    mesh, surface = loaded(box, **{domain: {"S": np.tile(row, (count, 1))}})
    field = make_field(mesh, surface, "S")
    major = np.where(np.abs(surface.face_normal[:, :1]) > 0.5, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    assert field.family_count == 2
    assert angle_between_lines(field.vectors, major).max() < 1e-4


def test_order_of_the_numbers_of_a_symmetric_tensor(loaded):
    """XX, YY, ZZ, XY, YZ, XZ: each shear has its principal directions in the faces of one kind."""
    for number, (axis, direction) in enumerate(
        [(2, [1, 1, 0]), (0, [0, 1, 1]), (1, [1, 0, 1])], start=3
    ):
        cube = pv.Cube().triangulate()
        cube.clear_data()
        row = np.zeros(6)
        row[number] = 1.0
        mesh, surface = loaded(cube, cells={"S": np.tile(row, (cube.n_cells, 1))})
        field = make_field(mesh, surface, "S")
        is_sheared = np.abs(surface.face_normal[:, axis]) > 0.5
        lines = np.tile(np.array(direction, dtype=float), (is_sheared.sum(), 1))
        assert angle_between_lines(field.vectors[is_sheared], lines).max() < 1e-4
        assert not field.vectors[~is_sheared].any()


def test_two_components_on_a_flat_mesh(loaded, error_of, sphere):
    plane = pv.Plane(i_resolution=4, j_resolution=4)
    plane.clear_data()
    mesh, surface = loaded(plane, points={"v": np.tile([3.0, 4.0], (plane.n_points, 1))})
    field = make_field(mesh, surface, degree=1)
    assert field.vectors == pytest.approx(np.tile([3.0, 4.0, 0.0], (16, 1)))
    mesh, surface = loaded(sphere, points={"v": np.zeros((sphere.n_points, 2))})
    assert "'v' has 2 numbers" in error_of(make_field, mesh, surface, "v")


def test_values_that_are_not_finite(loaded, box, error_of):
    velocity = np.tile([1.0, 2.0, 3.0], (box.n_cells, 1))
    velocity[0] = np.nan
    mesh, surface = loaded(box, cells={"U": velocity})
    message = error_of(make_field, mesh, surface, "U")
    assert "array 'U': " in message and "not finite" in message
    field = make_field(mesh, surface, "U", nonfinite="zero")
    is_undefined = mesh.cell_arrays["number"] == 0
    assert is_undefined.any()
    assert np.array_equal(~field.vectors.any(axis=1), is_undefined)


def test_choice_of_an_array(loaded, sphere, error_of):
    """Without a name there must be one array of vectors or tensors; names may be anything."""
    colors = {"rgb": np.zeros((sphere.n_points, 3), dtype=np.uint8), "p": np.zeros(sphere.n_points)}
    mesh, surface = loaded(sphere, points=colors)
    assert find_array(mesh).name == "rotation"
    assert find_array(mesh, "rgb").columns == 3
    message = error_of(find_array, mesh, "velocity")
    assert "there is no array 'velocity', only " in message
    assert all(f"'{name}'" in message for name in ("rotation", "rgb", "p"))
    assert "'p' has scalars" in error_of(make_field, mesh, surface, "p")
    tensors = {"rotation": rotation(np.asarray(sphere.cell_centers().points)), "a\u202eb": np.zeros((sphere.n_cells, 6))}  # fmt: skip
    mesh, surface = loaded(sphere, cells=tensors)
    message = error_of(find_array, mesh)
    assert "3 arrays can be a field" in message and "'a\\u202eb' (1,280 cells x 6)" in message
    assert "'point:rotation' or 'cell:rotation'" in error_of(find_array, mesh, "rotation")
    assert find_array(mesh, "cell:rotation").domain == "face"
    assert "degree 4, but degree 2" in error_of(make_field, mesh, surface, "a\u202eb", degree=2)
    sphere.clear_data()
    mesh, surface = loaded(sphere, points={"p": np.zeros(sphere.n_points)})
    assert "no array of vectors or tensors, only 'p'" in error_of(make_field, mesh, surface)


def test_tensors_must_be_symmetric(loaded, box, error_of):
    gradient = np.tile(np.arange(9.0), (box.n_cells, 1))
    mesh, surface = loaded(box, cells={"grad U": gradient})
    assert "'grad U' has tensors that are not symmetric" in error_of(make_field, mesh, surface)

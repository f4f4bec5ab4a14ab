"""The input of the graphics card: buffers of meshes, kinds of fields, and boxes on screen."""

import numpy as np
import pytest
from harness.gpu_scenes import (
    AXIS,
    FREE,
    MIRROR,
    SHEAR,
    perturbed_field,
    rotation,
    shown,
    smooth_field,
)
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapes import from_triangles, icosphere, placed

from rosy_addon.compositor.pixel_field import surface_pixel_field
from rosy_addon.field.generate import axis_field
from rosy_addon.gpu import mesh_buffers
from rosy_addon.gpu.frame import is_empty, screen_box, union_box
from rosy_addon.gpu.mesh_buffers import ROW_TEXELS, field_kinds, split_matrix
from rosy_addon.gpu.mesh_buffers import mesh_buffers as build_mesh_buffers
from rosy_addon.gpu.resources import DrawItem, GpuMesh
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.face_values import relative_channels
from rosy_addon.projection.project import project

ANGLES = st.floats(-3.2, 3.2)
DISTORTIONS = [None, SHEAR, MIRROR, np.diag([1.0, 1.0, 2.0]), np.diag([1.0, 1.0, 0])]


@given(ANGLES, ANGLES, ANGLES, st.floats(1e-3, 1e3), st.tuples(*[st.floats(-1e4, 1e4)] * 3))
@pytest.mark.parametrize("distortion", DISTORTIONS)
def test_matrices_are_split(distortion, x, y, z, scale, shift):
    """Similarities keep the shape. Other matrices change it; then the rest may only translate."""
    distorts = distortion is not None
    matrix = placed(scale * rotation(x, y, z) @ (distortion if distorts else np.eye(3)), shift)
    linear, model_matrix = split_matrix(matrix)
    np.testing.assert_array_equal(linear, matrix[:3, :3] if distorts else np.eye(3))
    np.testing.assert_allclose(model_matrix @ placed(linear), matrix)
    if distorts:  # the shaders transform vectors and normals by it
        np.testing.assert_array_equal(model_matrix[:3, :3], np.eye(3))


def test_rotations_in_single_precision_are_similarities():
    matrix = placed(7.3 * rotation(0.3, -1.2, 2.9), (1, 2, 3)).astype(np.float32)
    np.testing.assert_array_equal(split_matrix(matrix)[0], np.eye(3))


@st.composite
def surfaces(draw):
    """Return a few random triangles, with an unused vertex far away."""
    seed, count = draw(st.integers(0, 10**6)), draw(st.integers(1, 12))
    random = np.random.default_rng(seed)
    points = random.normal(size=(count + 2, 3)) * draw(st.sampled_from([0.01, 1.0, 100.0]))
    points += draw(st.sampled_from([0.0, 1e5])) * random.normal(size=3)
    triangles = [random.permutation(count + 2)[:3] for _ in range(count)]
    return from_triangles(np.concatenate([points, [[1e9, 0, 0]]]), triangles, name="some")


def records_of(buffers, texels):
    """Return the (T, texels, 4) records; what follows them in the texture is 0."""
    assert buffers.texels_per_record == texels
    assert buffers.triangle_records.shape[1:] == (ROW_TEXELS, 4)
    flat, end = buffers.triangle_records.reshape(-1, 4), texels * buffers.triangle_count
    assert not flat[end:].any()
    return flat[:end].reshape(buffers.triangle_count, texels, 4)


@given(surfaces(), st.sampled_from([1, 2, 5]), st.sampled_from(["smooth", "flat"]))
@settings(max_examples=60)
def test_records_hold_the_values_of_numpy_at_the_corners(surface, degree, display):
    field = axis_field(surface, degree, AXIS)
    assume(np.abs(surface.vertices[:-1]).max() < 1e7)
    buffers = build_mesh_buffers(shown(surface, field), display)
    count = len(surface.triangles)
    corners = buffers.corners.reshape(count, 3, 4)
    np.testing.assert_array_equal(corners[..., 3], np.arange(count)[:, None] + np.zeros(3))
    points = surface.vertices[surface.triangle_vertex]
    extent = np.ptp(points.reshape(-1, 3), axis=0).max()
    actual = corners[..., :3] + buffers.center
    np.testing.assert_allclose(actual, points, atol=1e-6 * extent, rtol=1e-12)
    # The unused vertex does not change the bounds.
    low, high = buffers.bounds.min(axis=0), buffers.bounds.max(axis=0)
    np.testing.assert_allclose(high, -low, atol=1e-9 * extent)
    assert np.abs(buffers.bounds).max() <= extent
    records = records_of(buffers, 10)
    rest = [records[:, 0:3, 3], records[:, 3:6, 3], records[:, 9, :3]]
    # Equal to the vertices, but for one translation of meshes that are far from the origin.
    offset = np.stack(rest, axis=2) - points
    if np.abs(points).max() < 900 * extent:
        assert np.abs(offset).max() <= 1e-6 * np.abs(points).max()
    assert np.ptp(offset.reshape(-1, 3), axis=0).max() <= 2e-3 * extent
    np.testing.assert_array_equal(records[:, :3, :3], corners[..., :3])
    np.testing.assert_allclose(np.linalg.norm(records[:, 3:6, :3], axis=2), 1, atol=1e-5)
    if display == "flat":
        z = records[:, 7:9].reshape(count, 4, 2)[:, :3]
        expected = field.magnitude[surface.triangle_face][:, None] + np.zeros(3)
        np.testing.assert_allclose(np.linalg.norm(z, axis=2), expected, atol=1e-5)
        np.testing.assert_allclose(records[:, 6, :3], expected, atol=1e-5)
    assert (records[:, 8, 2] == degree).all() and (records[:, 8, 3] == 0).all()


def test_channels_are_in_their_layers():
    surface = icosphere(1)
    field = perturbed_field(surface, 3, (1.0, 1.3, 0.8))
    (kind,) = field_kinds([field]).values()
    assert kind.channels == (("deviation", -1), ("deviation", 0), ("deviation", 1), ("family", 3))
    buffers = build_mesh_buffers(shown(surface, field), "smooth", kind.channels)
    assert buffers.channel_count == 4
    records = records_of(buffers, 10 + 2 * 4)
    np.testing.assert_array_equal(records[0, 8:17:2, 2], [3, 1, 0, -1, 1])
    np.testing.assert_array_equal(records[0, 8:17:2, 3], [0, 0, 1, 2, 3])
    # A RoSy with the same channels has the constant harmonic 1, and no families.
    rosy = axis_field(surface, 3)
    records = records_of(build_mesh_buffers(shown(surface, rosy), "smooth", kind.channels), 18)
    for texel, value in ((9, 0), (11, 1), (15, 0)):
        assert (records[:, texel] == [value, 0, value, 0]).all()


def test_records_that_are_written_in_blocks(monkeypatch):
    surface = icosphere(1)
    arguments = shown(surface, smooth_field(surface, 4)), "smooth"
    at_once = build_mesh_buffers(*arguments)
    monkeypatch.setattr(mesh_buffers, "RECORDS_PER_BLOCK", 7)
    assert np.array_equal(build_mesh_buffers(*arguments).triangle_records, at_once.triangle_records)


def test_only_meshes_with_a_field_have_records_and_a_limit(error_of, monkeypatch):
    monkeypatch.setattr(mesh_buffers, "MAX_TRIANGLES", 79)
    surface = icosphere(1)
    buffers = build_mesh_buffers(shown(surface), "smooth")
    assert buffers.triangle_records is None and buffers.texels_per_record == 0
    message = error_of(build_mesh_buffers, shown(surface, axis_field(surface, 2)), "smooth")
    assert "sphere" in message and "80" in message


FIELDS = {**{f"RoSy {n}": lambda surface, n=n: axis_field(surface, n) for n in range(1, 7)}, **FREE}


@pytest.mark.parametrize("name", FIELDS)
def test_kinds_agree_with_the_pixel_field_of_numpy(name):
    surface = icosphere(2)
    field = FIELDS[name](surface)
    camera = perspective_camera(look_at((0, -4, 1), (0, 0, 0)), 40, 40)
    gbuffer = project([shown(surface, field)], camera)
    pixel_field = surface_pixel_field(gbuffer, field.degree, 0.7)
    (kind,) = field_kinds([field]).values()
    assert kind.line_count == pixel_field.line_count
    assert kind.symmetry.sheets_per_turn == pixel_field.symmetry.sheets_per_turn
    assert set(pixel_field.channels) == set(relative_channels(field)) <= set(kind.channels)
    orders = kind.harmonic_orders
    assert not orders or orders == list(range(orders[0], orders[-1] + 1))


def test_kinds_of_several_fields():
    surface = icosphere(1)
    two, free, other = axis_field(surface, 2), perturbed_field(surface, 3), axis_field(surface, 3)
    kinds = field_kinds([other, two, free])
    assert list(kinds) == [2, 3] and kinds[2].channels == () and kinds[2].family_count == 1
    assert kinds[3].channels == field_kinds([free])[3].channels


# --- boxes on screen -----------------------------------------------------------------------------


def box_of(surface, shift, camera):
    buffers = build_mesh_buffers(shown(surface), "smooth")
    instance = shown(surface, shift=shift)
    model_matrix = instance.matrix @ mesh_buffers.translation_matrix(buffers.center)
    mesh = GpuMesh(buffers, None, None, None, instance)
    return screen_box(DrawItem(instance, mesh, model_matrix, None), camera)


@pytest.mark.parametrize("make_camera", [perspective_camera, orthographic_camera])
def test_boxes_contain_all_pixels_of_a_mesh(make_camera):
    """Those of meshes beside the frame, above it, and behind the camera are empty."""
    camera = make_camera(look_at((0, -5, 0), (0, 0, 0)), 64, 48, clip=(0.1, 100.0))
    surface = icosphere(3)
    field = axis_field(surface, 2)
    for shift in ((0, 0, 0), (1.5, 0, -0.5), (0, -4.5, 0.2), (0.3, -5, 0)):
        left, bottom, right, top = box_of(surface, shift, camera)
        pixel = project([shown(surface, field, shift=shift)], camera).pixel
        row, column = np.divmod(pixel, camera.width)
        assert left <= column.min() and column.max() < right <= camera.width
        assert bottom <= row.min() and row.max() < top <= camera.height
    for shift in ((40, 0, 0), (-40, 0, 0), (0, 0, 40), (0, -40, 0)):
        assert is_empty(box_of(surface, shift, camera))


def test_union_of_boxes():
    assert union_box([(1, 2, 5, 6), (0, 0, 0, 0), (9, 3, 9, 8), (3, 1, 8, 4)]) == (1, 1, 8, 6)
    assert is_empty(union_box([])) and is_empty(union_box([(0, 0, 0, 0)]))

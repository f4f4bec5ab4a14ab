"""The GPU renderer: its input data and, where there is an OpenGL context, its pictures.

Every picture is compared with numpy's picture of the same pixels, by brute force. These tests are
skipped without moderngl or without a context (EGL; software OpenGL is enough).
"""

from __future__ import annotations

import pickle
import re
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from awkward import moebius
from conftest import long, mainly
from harness.gpu_parity import draw_pair, read_gbuffer, rooms
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from lenses import shifted
from shapes import cube, cylinder, from_triangles, icosphere, plane, torus

from rosy_addon.compositor.flow import NO_DRIFT, Drift
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.pixel_field import surface_pixel_field
from rosy_addon.compositor.shading import Light
from rosy_addon.compositor.target_tone import ReferenceRender
from rosy_addon.field.directional_field import field_from_directions, tensor_field
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.representation import face_frames
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import build_surface
from rosy_addon.gpu import lic_stage, mesh_buffers, passes, preparation, resources, uniforms
from rosy_addon.gpu.device import UNIFORM_WORDS, _pack_uniforms, _std140_order
from rosy_addon.gpu.frame import is_empty, screen_box, union_box
from rosy_addon.gpu.mesh_buffers import ROW_TEXELS, field_channels, field_kinds, split_matrix
from rosy_addon.gpu.mesh_buffers import mesh_buffers as build_mesh_buffers
from rosy_addon.gpu.preparation import prepare_steps
from rosy_addon.gpu.renderer import GpuRenderer
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import Camera, look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.surface_tone import SurfaceTone
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.worker.job import Call, Step, run

AXIS = (0.3, 0.2, 1.0)


def draw(renderer, view_input):
    """Draw a picture on a card, or with numpy if it is None."""
    return draw_picture(view_input) if renderer is None else run(renderer.picture_steps(view_input))


# --- input data ----------------------------------------------------------------------------------


def rotation(x, y, z):
    """Return the rotation about the three axes, one after the other."""
    rotations = []
    for axis, angle in enumerate((x, y, z)):
        matrix = np.eye(3)
        a, b = [(1, 2), (2, 0), (0, 1)][axis]
        matrix[[a, a, b, b], [a, b, a, b]] = (
            np.cos(angle),
            -np.sin(angle),
            np.sin(angle),
            np.cos(angle),
        )
        rotations.append(matrix)
    return rotations[2] @ rotations[1] @ rotations[0]


def smooth_field(surface, degree, families=1):
    """Return a field with singularities of index 1 / N and a magnitude that varies.

    An axis field is not suitable, because all N members run into the ends of the axis. There, brute
    force follows the N directions and the covering the lines through a pixel, and streamlines that
    differ in the last digit diverge.
    """
    field = generate(surface, "smoothest", degree)
    center = surface.vertices[surface.corner_vertex[surface.face_start[:-1]]]
    magnitude = 0.8 + 0.4 * np.sin(3 * center @ np.array(AXIS) + 1)
    return RosyField(degree, field.vectors * magnitude[:, None], family_count=families)


def placed(linear=None, shift=(0, 0, 0)):
    """Return the (4, 4) matrix with a linear part and a translation."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) if linear is None else linear
    matrix[:3, 3] = shift
    return matrix


ANGLES = st.floats(-3.2, 3.2)
SHEAR = np.array([[1.0, 0.4, 0.0], [0.0, 0.8, 0.3], [0.0, 0.0, 1.2]])
MIRROR = np.diag([-1.0, 1.0, 1.0])


@given(ANGLES, ANGLES, ANGLES, st.floats(1e-3, 1e3), st.tuples(*[st.floats(-1e4, 1e4)] * 3))
def test_similarities_keep_the_shape(x, y, z, scale, shift):
    matrix = placed(scale * rotation(x, y, z), shift)
    linear, model_matrix = split_matrix(matrix)
    np.testing.assert_array_equal(linear, np.eye(3))
    np.testing.assert_array_equal(model_matrix, matrix)


@given(ANGLES, ANGLES, ANGLES, st.floats(1e-3, 1e3), st.tuples(*[st.floats(-1e4, 1e4)] * 3))
@pytest.mark.parametrize(
    "distortion", [SHEAR, MIRROR, np.diag([1.0, 1.0, 2.0]), np.diag([1.0, 1.0, 0])]
)
def test_other_matrices_change_the_shape(distortion, x, y, z, scale, shift):
    matrix = placed(scale * rotation(x, y, z) @ distortion, shift)
    linear, model_matrix = split_matrix(matrix)
    np.testing.assert_array_equal(linear, matrix[:3, :3])
    np.testing.assert_allclose(model_matrix @ placed(linear), matrix)
    # The rest may only translate: the shaders transform vectors and normals by it.
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
    points = np.concatenate([points, [[1e9, 0, 0]]])
    return from_triangles(points, triangles, name="some")


def perturbed_field(surface, degree, lengths=None, seed=0):
    """Return N directions on each face, each up to 0.3 radians from those of a RoSy."""
    x, y = face_frames(surface)
    base = axis_field(surface, degree, AXIS).vectors
    first_angle = np.arctan2((base * y).sum(axis=1), (base * x).sum(axis=1))[:, None]
    step = np.arange(degree) * 2 * np.pi / degree
    offsets = 0.3 * np.sin(np.arange(degree) * 2.1 + seed)
    angles = (first_angle + step + offsets)[..., None]
    lengths = np.ones(degree) if lengths is None else np.asarray(lengths)
    return field_from_directions(
        surface, lengths[:, None] * (np.cos(angles) * x[:, None] + np.sin(angles) * y[:, None])
    )


def conjugate_field(surface):
    """Return four directions on two lines, at 1.2 radians to each other."""
    x, y = face_frames(surface)
    base = axis_field(surface, 4, AXIS).vectors
    first_angle = np.arctan2((base * y).sum(axis=1), (base * x).sum(axis=1))[:, None]
    angles = (first_angle + np.array([0, 1.2, np.pi, np.pi + 1.2]))[..., None]
    return field_from_directions(surface, np.cos(angles) * x[:, None] + np.sin(angles) * y[:, None])


@given(surfaces(), st.sampled_from([1, 2, 5]), st.sampled_from(["smooth", "flat"]))
@settings(max_examples=60)
def test_records_hold_the_values_of_numpy_at_the_corners(surface, degree, display):
    field = axis_field(surface, degree, AXIS)
    assume(np.abs(surface.vertices[:-1]).max() < 1e7)
    buffers = build_mesh_buffers(surface, np.eye(3), field, display)
    count = len(surface.triangles)
    assert buffers.corners.shape == (3 * count, 4)
    assert buffers.triangle_records.shape[1:] == (ROW_TEXELS, 4)
    assert buffers.texels_per_record == 9 and buffers.channel_count == 0
    corners = buffers.corners.reshape(count, 3, 4)
    np.testing.assert_array_equal(corners[..., 3], np.arange(count)[:, None] + np.zeros(3))
    corner_points = surface.vertices[surface.triangle_vertex]
    extent = np.ptp(corner_points.reshape(-1, 3), axis=0).max()
    np.testing.assert_allclose(
        corners[..., :3] + buffers.center, corner_points, atol=1e-6 * extent, rtol=1e-12
    )
    # The unused vertex does not change the bounds.
    np.testing.assert_allclose(
        buffers.bounds.max(axis=0), -buffers.bounds.min(axis=0), atol=1e-9 * extent
    )
    assert np.abs(buffers.bounds).max() <= extent
    records = buffers.triangle_records.reshape(-1, 4)[: 9 * count].reshape(count, 9, 4)
    assert not buffers.triangle_records.reshape(-1, 4)[9 * count :].any()
    rest = [records[:, 0:3, 3], records[:, 3:6, 3], records[:, 8, :3]]
    # Equal to the vertices, but for one translation of meshes that are far from the origin.
    offset = np.stack(rest, axis=2) - corner_points
    if np.abs(corner_points).max() < 900 * extent:
        assert np.abs(offset).max() <= 1e-6 * np.abs(corner_points).max()
    assert np.ptp(offset.reshape(-1, 3), axis=0).max() <= 2e-3 * extent
    np.testing.assert_array_equal(records[:, :3, :3], corners[..., :3])
    np.testing.assert_allclose(np.linalg.norm(records[:, 3:6, :3], axis=2), 1, atol=1e-5)
    z = records[:, 6:8].reshape(count, 4, 2)[:, :3]
    magnitude = np.linalg.norm(z, axis=2)
    if display == "flat":
        expected = field.magnitude[surface.triangle_face]
        np.testing.assert_allclose(magnitude, expected[:, None] + np.zeros(3), atol=1e-5)
    assert (records[:, 7, 2] == degree).all() and (records[:, 7, 3] == 0).all()


def test_channels_are_in_their_layers():
    surface = icosphere(1)
    field = perturbed_field(surface, 3, (1.0, 1.3, 0.8))
    kind = field_kinds([field])[3]
    assert kind.channels == (("deviation", -1), ("deviation", 0), ("deviation", 1), ("family", 3))
    buffers = build_mesh_buffers(surface, np.eye(3), field, "smooth", kind.channels)
    assert buffers.texels_per_record == 9 + 2 * 4 and buffers.channel_count == 4
    count = len(surface.triangles)
    records = buffers.triangle_records.reshape(-1, 4)[: 17 * count].reshape(count, 17, 4)
    np.testing.assert_array_equal(records[0, 7:16:2, 2], [3, 1, 0, -1, 1])
    np.testing.assert_array_equal(records[0, 7:16:2, 3], [0, 0, 1, 2, 3])
    # A RoSy with the same channels has the constant harmonic 1, and no families.
    rosy_buffers = build_mesh_buffers(
        surface, np.eye(3), axis_field(surface, 3), "smooth", kind.channels
    )
    records = rosy_buffers.triangle_records.reshape(-1, 4)[: 17 * count].reshape(count, 17, 4)
    np.testing.assert_array_equal(records[:, 8], np.tile([0, 0, 0, 0], (count, 1)))
    np.testing.assert_array_equal(records[:, 10], np.tile([1, 0, 1, 0], (count, 1)))
    np.testing.assert_array_equal(records[:, 14], np.tile([0, 0, 0, 0], (count, 1)))


def test_records_that_are_written_in_blocks(monkeypatch):
    surface = icosphere(1)
    arguments = surface, np.eye(3), smooth_field(surface, 4), "smooth"
    at_once = build_mesh_buffers(*arguments)
    monkeypatch.setattr(mesh_buffers, "RECORDS_PER_BLOCK", 7)
    assert np.array_equal(build_mesh_buffers(*arguments).triangle_records, at_once.triangle_records)


def test_occluders_have_no_records(error_of, monkeypatch):
    monkeypatch.setattr(mesh_buffers, "MAX_TRIANGLES", 79)
    surface = icosphere(1)
    buffers = build_mesh_buffers(surface, np.eye(3), None, "smooth")
    assert buffers.triangle_records is None and buffers.texels_per_record == 0
    message = error_of(build_mesh_buffers, surface, np.eye(3), axis_field(surface, 2), "smooth")
    assert "sphere" in message and "80" in message


def test_triangle_ids_are_exact_in_single_precision():
    limit = np.float32(mesh_buffers.MAX_TRIANGLES)
    assert int(limit) == mesh_buffers.MAX_TRIANGLES
    assert int(limit - np.float32(1)) == mesh_buffers.MAX_TRIANGLES - 1


def test_kinds_agree_with_the_pixel_field_of_numpy():
    surface = icosphere(2)
    camera = perspective_camera(look_at((0, -4, 1), (0, 0, 0)), 40, 40)
    for field in (
        *(axis_field(surface, degree) for degree in (1, 2, 3, 4, 5, 6)),
        perturbed_field(surface, 2),
        perturbed_field(surface, 3),
        perturbed_field(surface, 4),
        perturbed_field(surface, 5),
        perturbed_field(surface, 6),
        conjugate_field(surface),
        sign_changing_tensors(surface),
    ):
        gbuffer = rooms().project([MeshInstance(surface, np.eye(4), field)], camera)
        pixel_field = surface_pixel_field(gbuffer, field.degree, 0.7)
        (kind,) = field_kinds([field]).values()
        assert (kind.line_count, kind.sheets_per_turn) == (
            pixel_field.line_count,
            pixel_field.symmetry.sheets_per_turn,
        )
        assert set(pixel_field.channels) == set(field_channels(field)) <= set(kind.channels)
        orders = kind.harmonic_orders
        assert orders == list(range(orders[0], orders[-1] + 1)) if orders else True


def test_kinds_of_several_fields():
    surface = icosphere(1)
    two, free, other = axis_field(surface, 2), perturbed_field(surface, 3), axis_field(surface, 3)
    kinds = field_kinds([other, two, free])
    assert list(kinds) == [2, 3]
    assert kinds[2].channels == () and kinds[2].family_count == 1
    assert kinds[3].channels == field_kinds([free])[3].channels


def sign_changing_tensors(surface):
    """Return the field of symmetric tensors whose eigenvalues change sign."""
    x, y, z = surface.vertices[surface.corner_vertex[surface.face_start[:-1]]].T
    tensor = np.zeros((surface.face_count, 3, 3))
    tensor[:, 0, 0], tensor[:, 1, 1], tensor[:, 2, 2] = 1 + x, 0.3 - y, 2 * z
    tensor[:, 0, 2] = tensor[:, 2, 0] = 0.5
    return tensor_field(surface, tensor)


# --- uniforms and sources ------------------------------------------------------------------------


@pytest.mark.parametrize("shader", passes.all_passes(), ids=lambda shader: shader.name)
def test_uniforms_are_aligned_as_in_std140(shader):
    """Each is at a multiple of its own size, without gaps, in whole rows of 16 bytes."""
    aligned = _std140_order(shader.uniforms)
    assert sorted(aligned) == sorted(shader.uniforms)
    offset, slices = 0, {}
    for name, kind in aligned:
        assert offset % UNIFORM_WORDS[kind] == 0
        slices[name] = slice(offset, offset + UNIFORM_WORDS[kind])
        offset += UNIFORM_WORDS[kind]
    values = {
        name: tuple(range(100 * index, 100 * index + UNIFORM_WORDS[kind]))
        for index, (name, kind) in enumerate(shader.uniforms)
    }
    packed = _pack_uniforms(shader.uniforms, values)
    assert len(packed) % 4 == 0 and 0 <= len(packed) - offset < 4
    for name, kind in shader.uniforms:
        words = packed[slices[name]]
        words = words.view(np.int32) if kind in ("int", "ivec2") else words
        np.testing.assert_array_equal(words, values[name])


def without_comments(source):
    """Return GLSL without comments."""
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", source, flags=re.S)


def names_in(source):
    """Return the names in a source, except those after a dot, which are members."""
    return set(re.findall(r"(?<![.\w])[A-Za-z_]\w*", without_comments(source)))


def own_source(shader):
    """Return the source of a pass without the file that is common to all."""
    kinds = ("comp",) if isinstance(shader, passes.ComputePass) else ("vert", "frag")
    return passes.read_source(*(f"{shader.name}.{kind}.glsl" for kind in kinds)).code


def base_names(names):
    """Return names without the mark of arrays."""
    return {name.removesuffix("[]") for name in names}


@pytest.mark.parametrize("shader", passes.all_passes(), ids=lambda shader: shader.name)
def test_all_declarations_are_read(shader):
    left = r"^\s*(?:uniform|in|out|layout|#include|#pragma)\b.*"
    assert not re.findall(left, own_source(shader), flags=re.M)


@pytest.mark.parametrize("shader", passes.all_passes(), ids=lambda shader: shader.name)
def test_sources_use_all_listed_names(shader):
    words = names_in(own_source(shader))
    listed = base_names(shader.textures) | {name for name, _ in shader.uniforms}
    if isinstance(shader, passes.ComputePass):
        listed |= base_names(name for name, _ in shader.images)
    else:
        listed |= {shader.output, *(name for name, _ in shader.varyings)}
    assert listed <= words, f"not used: {sorted(listed - words)}"


@pytest.mark.parametrize("shader", passes.all_passes(), ids=lambda shader: shader.name)
def test_sources_use_no_other_names_of_passes(shader):
    """A pass that uses a uniform, texture or image of another pass has to list it, too."""
    known = set()
    for other in passes.all_passes():
        known |= base_names(other.textures) | {name for name, _ in other.uniforms}
        if isinstance(other, passes.ComputePass):
            known |= base_names(name for name, _ in other.images)
    code = without_comments(own_source(shader))
    listed = base_names(shader.textures) | {name for name, _ in shader.uniforms}
    if isinstance(shader, passes.ComputePass):
        listed |= base_names(name for name, _ in shader.images)
        listed |= {name for name, _ in shader.constants}
    else:
        # `vertex_data` is the attribute of the vertices.
        listed |= {shader.output, "vertex_data"}
    # Parameters and variables that are declared in the source may have any name.
    kinds = r"(?:float|int|uint|bool|[iu]?vec[234])"
    declared = set(re.findall(rf"\b{kinds}\s+([A-Za-z_]\w*)", code))
    declared |= {
        name for line in re.findall(rf"\b{kinds}\s+[^;()]*;", code) for name in names_in(line)
    }
    used = (names_in(own_source(shader)) & known) - declared
    assert used <= listed, f"not listed: {sorted(used - listed)}"


@pytest.mark.parametrize("shader", passes.all_passes(), ids=lambda shader: shader.name)
def test_no_member_of_a_struct_is_called_length(shader):
    """With Vulkan, the compiler takes it for the length of an array."""
    assert not re.search(r"\.length\b", without_comments(own_source(shader)))


@pytest.mark.parametrize("shader", passes.all_passes(), ids=lambda shader: shader.name)
def test_arrays_are_read_and_written_as_arrays(shader):
    code = without_comments(own_source(shader))
    names = list(shader.textures)
    if isinstance(shader, passes.ComputePass):
        names += [name for name, _ in shader.images]
    for name in names:
        base_name = name.removesuffix("[]")
        for call in re.findall(rf"(?:texelFetch|imageStore)\({base_name},\s*(\w+)\(", code):
            if call in ("ivec2", "ivec3"):
                assert (call == "ivec3") == name.endswith("[]"), (name, call)


def test_common_code_uses_no_uniforms():
    """The common code is part of every pass: it gets uniforms only as parameters of functions."""
    known = {name for shader in passes.all_passes() for name, _ in shader.uniforms}
    known |= {name for shader in passes.all_passes() for name in base_names(shader.textures)}
    assert not names_in(passes.read_source("common.glsl").code) & known


@pytest.mark.parametrize("shader", passes.all_passes(), ids=lambda shader: shader.name)
def test_no_variable_has_the_name_of_a_uniform(shader):
    """In Blender uniforms are macros without scope: no variable or member may have their names."""
    source = without_comments(own_source(shader))
    kinds = "float|int|bool|vec[234]|ivec[234]|mat[34]"
    declared = set(re.findall(rf"\b(?:{kinds})\s+(\w+)", source))
    declared |= set(re.findall(rf"\b(?:{kinds})\s[^;(]*?,\s*(\w+)\s*[=;,]", source))
    declared |= set(re.findall(r"(?<=[A-Za-z_\])])\.([A-Za-z_]\w*)", source))
    assert not declared & {name for name, _ in shader.uniforms}


# --- screen boxes --------------------------------------------------------------------------------


def draw_item(surface, matrix=None):
    matrix = np.eye(4) if matrix is None else matrix
    buffers = build_mesh_buffers(surface, np.eye(3), None, "smooth")
    mesh = resources.GpuMesh(buffers, None, None, ())
    model_matrix = matrix @ mesh_buffers.translation_matrix(buffers.center)
    return resources.DrawItem(MeshInstance(surface, matrix, None), mesh, model_matrix, None)


def camera_at(eye=(0, -5, 0), size=(64, 48), perspective=True, clip=(0.1, 100.0)):
    view = look_at(eye, np.add(eye, (0, 5, 0)), (0, 0, 1))
    if perspective:
        return perspective_camera(view, *size, clip=clip)
    return orthographic_camera(view, *size, clip=clip)


@pytest.mark.parametrize("perspective", [True, False])
def test_screen_boxes_contain_all_pixels_of_a_mesh(perspective):
    surface = icosphere(3)
    camera = camera_at(perspective=perspective)
    field = axis_field(surface, 2)
    for shift in ((0, 0, 0), (1.5, 0, -0.5), (0, -4.5, 0.2), (0.3, -5, 0)):
        matrix = placed(shift=shift)
        left, bottom, right, top = screen_box(draw_item(surface, matrix), camera)
        row, column = np.divmod(
            rooms().project([MeshInstance(surface, matrix, field)], camera).pixel, camera.width
        )
        assert left <= column.min() and column.max() < right <= camera.width
        assert bottom <= row.min() and row.max() < top <= camera.height


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("shift", [(40, 0, 0), (-40, 0, 0), (0, 0, 40), (0, -40, 0)])
def test_screen_boxes_out_of_view_are_empty(perspective, shift):
    """Beside the frame, above it, and behind the camera."""
    box = screen_box(
        draw_item(icosphere(1), placed(shift=shift)), camera_at(perspective=perspective)
    )
    assert is_empty(box)


def test_union_of_boxes():
    assert union_box([(1, 2, 5, 6), (0, 0, 0, 0), (9, 3, 9, 8), (3, 1, 8, 4)]) == (1, 1, 8, 6)
    assert is_empty(union_box([]))
    assert is_empty(union_box([(0, 0, 0, 0)]))


# --- pictures, compared with numpy's -------------------------------------------------------------


@pytest.fixture(scope="module")
def card(device):
    return GpuRenderer(device)


ROSY = rooms()
SIZE = 160, 144
LOOK = Look(shading=0.0, length=30)
BALL = icosphere(3)


def view(size=SIZE, azimuth=0.4, perspective=True, distance=4.0, supersampling=1):
    """Return a camera that looks at the origin, with a shifted lens."""
    eye = distance * np.array([np.sin(azimuth), -np.cos(azimuth), 0.5])
    size = [side * supersampling for side in size]
    view_matrix = look_at(eye, (0, 0, 0), (0, 0, 1))
    if perspective:
        return shifted(perspective_camera(view_matrix, *size, fov=0.65), (0.06, -0.04))
    return shifted(orthographic_camera(view_matrix, *size, scale=2.6), (0.06, -0.04))


def assert_parity(
    card,
    instances,
    camera,
    look=LOOK,
    lights=(),
    agreement=0.998,
    likeness=0.98,
    reference=None,
    drift=NO_DRIFT,
):
    """Compare the picture of the card with numpy's, and return both."""
    pair = draw_pair(ROSY, card, instances, camera, look, lights, reference, drift)
    assert np.isfinite(pair.card).all()
    both = (pair.card[..., 3] == 1) & (pair.numpy[..., 3] == 1)
    assert both.sum() > 500
    assert pair.agreement >= agreement
    assert pair.likeness >= likeness
    brightness = pair.card[both].mean(axis=0) - pair.numpy[both].mean(axis=0)
    assert np.abs(brightness).max() < 0.01
    contrast = pair.card[both][:, :3].std(axis=0) / pair.numpy[both][:, :3].std(axis=0)
    assert np.abs(contrast - 1).max() < 0.02
    np.testing.assert_allclose(pair.card[..., 3], pair.numpy[..., 3], atol=1)
    assert (np.abs(pair.card[..., 3] - pair.numpy[..., 3]) > 1e-6).mean() < 1e-3
    return pair


def render_texture(card, items, camera, look, lights=(), clip_planes=None):
    """Render a picture, and return its texture on the card."""
    view_input = ViewInput((), camera, look, tuple(lights), None, clip_planes)
    return run(card.texture_steps(items, view_input))


@lru_cache(maxsize=64)
def field_of(surface, degree):
    return smooth_field(surface, degree)


def ball(degree=4, matrix=None, surface=BALL):
    return MeshInstance(surface, np.eye(4) if matrix is None else matrix, field_of(surface, degree))


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("degree", [1, 3, 4, 12, *long(2, 5, 6, 7)])
def test_all_degrees(card, degree, perspective):
    assert_parity(card, [ball(degree)], view(perspective=perspective))


LOOKS = {
    "default": {},
    "color noise": {"hue": "noise"},
    "color noise, three directions": {"hue": "noise", "degree": 3},
    "magnitude as color": {"hue": "magnitude"},
    "magnitude as color, with a range": {"hue": "magnitude", "color_range": (0.0, 0.8)},
    "magnitude as both, with an inverted range": {
        "hue": "magnitude",
        "magnitude_length": True,
        "color_range": (1.1, 0.6),
    },
    "magnitude as gray": {"hue": "magnitude", "color_map": "gray"},
    "magnitude as length": {"magnitude_length": True},
    "magnitude as length, with a range": {"magnitude_length": True, "color_range": (0.0, 1.5)},
    "magnitude as both": {"hue": "magnitude", "magnitude_length": True, "color_map": "magma"},
    "magnitude as both, with a range": {
        "hue": "magnitude",
        "magnitude_length": True,
        "color_range": (0.0, 0.9),
        "degree": 2,
    },
    "families, of a field without families": {"hue": "families"},
    "oriented, three directions": {"fade": "tail", "degree": 3, "density": 0.03},
    "oriented, of lines without a direction": {"fade": "tail"},
    "supersampled": {"supersampling": 2},
    "supersampled color noise": {"supersampling": 2, "hue": "noise", "degree": 3},
    "guided": {"guiding_angle": 0.7},
    "guided, five directions": {"guiding_angle": -2.5, "degree": 5},
    "flat": {"display": "flat"},
    "flat, across creases": {"display": "flat", "crease_angle": 3.1416},
    "shaded": {"shading": 0.7},
    "white noise": {"density": 0.5, "high_pass": 0.0, "gain": 1.0},
    "coarse noise": {"line_width": 5.0, "seed": 7},
    "long": {"length": 200},
    "on the surface": {"anchor": "surface"},
    "on the surface, color noise": {"anchor": "surface", "hue": "noise", "high_pass": 0.0},
    "on the surface, supersampled": {"anchor": "surface", "supersampling": 2, "seed": 3},
    "hatched": {"ink": "hatch", "shading": 1.0, "line_width": 3.0},
    "hatched, oriented": {
        "ink": "hatch",
        "shading": 1.0,
        "fade": "tail",
        "degree": 5,
        "breaks": 0.4,
    },
    "hatched, three directions": {"ink": "hatch", "shading": 0.8, "degree": 3, "layers": 2},
    "hatched in color, guided": {
        "ink": "hatch",
        "ink_color": "#203080",
        "paper_color": "#f0e8d0",
        "guiding_angle": 0.4,
        "crispness": 0.2,
        "shading": 1.0,
    },
    "hatched, light on dark": {
        "ink": "hatch",
        "ink_color": "#fff0d0",
        "paper_color": "#101020",
        "shading": 0.9,
    },
    "hatched, with breaks": {
        "ink": "hatch",
        "breaks": 1.0,
        "shading": 1.0,
        "line_width": 2.5,
        "length": 60,
    },
    "hatched, breaks and length by magnitude": {
        "ink": "hatch",
        "breaks": 0.8,
        "shading": 0.9,
        "hue": "magnitude",
        "magnitude_length": True,
        "degree": 3,
    },
    "hatched, wobbling": {"ink": "hatch", "wobble": 1.0, "shading": 0.9, "line_width": 2.5},
    "hatched, wobbling with the surface": {
        "ink": "hatch",
        "wobble": 1.0,
        "anchor": "surface",
        "shading": 0.9,
        "line_width": 2.5,
        "supersampling": 2,
        "degree": 3,
    },
    "hatched on paper grain": {"ink": "hatch", "paper_grain": 1.0, "shading": 1.0},
    "hatched on paper grain, supersampled": {
        "ink": "hatch",
        "paper_grain": 0.6,
        "supersampling": 2,
        "line_width": 4.0,
        "crispness": 0.3,
        "seed": 5,
        "shading": 0.9,
    },
    "hatched, an ink per family": {
        "ink": "hatch",
        "hue": "families",
        "degree": 6,
        "layering": 0.1,
        "shading": 1.0,
    },
    "hatched, an ink per family, light on dark": {
        "ink": "hatch",
        "hue": "families",
        "ink_color": "#ffd060",
        "paper_color": "#101020",
        "degree": 4,
        "shading": 0.9,
    },
    "hatched, ink ramp": {
        "ink": "hatch",
        "hue": "tone",
        "ink_color": "#101848",
        "ink_color_light": "#e08050",
        "shading": 1.0,
    },
    "hatched, ink ramp, light on dark": {
        "ink": "hatch",
        "hue": "tone",
        "ink_color": "#ffd060",
        "ink_color_light": "#fff0f0",
        "paper_color": "#101020",
        "shading": 0.9,
    },
    "in Blender units": {"anchor": "surface", "unit_size": 0.007},
    "in Blender units, anchored to the picture": {
        "unit_size": 0.03,
        "supersampling": 2,
    },
    "hatched in Blender units, uneven": {
        "anchor": "surface",
        "unit_size": 0.012,
        "ink": "hatch",
        "wobble": 0.7,
        "breaks": 0.4,
        "paper_grain": 0.5,
        "shading": 0.9,
        "overshoot": 5.0,
    },
    "hatched, with an outline": {"ink": "hatch", "shading": 0.9, "outline": 2.3},
    "hatched by families, with an outline": {
        "ink": "hatch",
        "hue": "families",
        "shading": 0.9,
        "outline": 1.5,
        "supersampling": 2,
        "ink_color": "#ffe0b0",
        "paper_color": "#102030",
    },
    "hatched, overshoot": {
        "ink": "hatch",
        "light": "lamp",
        "shadows": True,
        "shading": 1.0,
        "overshoot": 9.0,
        "length": 7,
    },
    "hatched light on dark, overshoot by magnitude": {
        "ink": "hatch",
        "ink_color": "#ffd060",
        "paper_color": "#101020",
        "shading": 1.0,
        "overshoot": 20.0,
        "magnitude_length": True,
    },
    "hatched, all effects": {
        "ink": "hatch",
        "hue": "families",
        "shading": 0.9,
        "breaks": 0.6,
        "wobble": 0.6,
        "paper_grain": 0.4,
        "anchor": "surface",
        "degree": 5,
        "guiding_angle": 0.5,
        "supersampling": 2,
    },
    "fine on small features": {"anchor": "surface", "detail": 0.7, "line_width": 2.5, "degree": 4},
    "hatched, six directions": {"ink": "hatch", "degree": 6, "layering": 0.1, "shading": 1.0},
    "even lines": {"ink": "even", "shading": 0.9, "line_distance": 6.0},
    "even lines, supersampled": {
        "ink": "even",
        "shading": 0.9,
        "light": "lamp",
        "line_distance": 5.6,
        "supersampling": 2,
        "degree": 6,
        "layers": 2,
        "guiding_angle": 0.5,
    },
    "even lines of an odd degree, soft": {
        "ink": "even",
        "shading": 0.8,
        "line_distance": 8.0,
        "degree": 3,
        "crispness": 0.3,
        "hue": "families",
    },
    "even lines in Blender units, uneven": {
        "ink": "even",
        "anchor": "surface",
        "unit_size": 0.012,
        "shading": 0.9,
        "wobble": 0.7,
        "breaks": 0.4,
        "paper_grain": 0.5,
        "overshoot": 5.0,
    },
    "the method members": {"method": "members", "weights": "none", "view_plane": False},
    "the method brute": {"method": "brute"},
}

#: Streaks that drift, at a phase at which no kernel is where it is at rest.
DRIFTING = {"flow": 2.0, "drift": Drift(0.2)}
DRIFTING_LOOKS = {
    "drifting": DRIFTING,
    "drifting, oriented": DRIFTING | {"fade": "tail", "degree": 1, "density": 0.03},
    "drifting, two directions, guided": DRIFTING | {"degree": 2, "guiding_angle": 0.9},
    "drifting, three directions": DRIFTING
    | {"fade": "ends", "degree": 3, "drift": Drift(0.2, 0.4)},
    "drifting on the surface": DRIFTING | {"anchor": "surface"},
    "drifting, magnitude as both": DRIFTING | {"hue": "magnitude", "magnitude_length": True},
    "drifting, short streaks": DRIFTING
    | {"length": 9, "drift": Drift(0.2, 4.4), "supersampling": 2},
    "drifting, hatched, with breaks": DRIFTING
    | {"ink": "hatch", "breaks": 1.0, "shading": 1.0, "line_width": 2.5, "length": 60},
    "drifting, hatched, breaks and length by magnitude": DRIFTING
    | {"ink": "hatch", "breaks": 0.8, "shading": 0.9, "magnitude_length": True, "degree": 3}
    | {"overshoot": 15.0},
    "drifting breaks of even lines": DRIFTING
    | {"ink": "even", "breaks": 0.7, "shading": 0.9, "degree": 2}
    | {"line_width": 3.0, "line_distance": 6.0},
    "color noise, which does not drift": DRIFTING | {"hue": "noise"},
}
ALL_LOOKS = LOOKS | DRIFTING_LOOKS
#: Looks that take long, and of which others have every part.
RARE_LOOKS = {
    "hatched on paper grain, supersampled",
    "hatched, wobbling with the surface",
    "supersampled",
    "drifting, hatched, with breaks",
    "drifting, short streaks",
    "drifting, magnitude as both",
    "drifting, two directions, guided",
}


@pytest.mark.parametrize(
    "name",
    mainly(
        set(list(LOOKS)[1::2] + list(DRIFTING_LOOKS)) - RARE_LOOKS,
        ALL_LOOKS,
    ),
)
def test_looks(card, name):
    look_settings = {"degree": 4, **ALL_LOOKS[name]}
    degree, drift = look_settings.pop("degree"), look_settings.pop("drift", NO_DRIFT)
    look = LOOK.with_settings(look_settings)
    camera = view(supersampling=look.supersampling)
    assert_parity(card, [ball(degree)], camera, look, drift=drift)


@pytest.mark.parametrize("side", [3, *long(2)])
def test_subpixels(card, side):
    """Borders have the color of their covered part."""
    look = replace(LOOK, supersampling=side, line_width=3.0)
    pair = assert_parity(card, [ball(2)], view(supersampling=side), look)
    border = (pair.numpy[..., 3] > 0) & (pair.numpy[..., 3] < 1) & (pair.card[..., 3] > 0)
    assert border.sum() > 100
    np.testing.assert_allclose(
        pair.card[border][:, :3].mean(), pair.numpy[border][:, :3].mean(), atol=0.01
    )


@pytest.mark.parametrize("preset", ["default", "plaid", "cross-hatch", "charcoal"])
def test_samples_show_what_numpy_draws(card, preset):
    """Tone and contrast of the default method, whose streaks are smooth in another way."""
    look = replace(load_preset(preset).look, supersampling=2)
    view_input = ViewInput((ball(),), view((240, 216)), look)
    drawn = [draw(renderer, view_input).rgba for renderer in (card, None)]
    inside = np.logical_and(*(rgba[..., 3] == 1 for rgba in drawn))
    of_card, of_numpy = (rgba[inside][:, :3] for rgba in drawn)
    assert inside.sum() > 10_000
    np.testing.assert_allclose(of_card.mean(), of_numpy.mean(), rtol=0.01)
    np.testing.assert_allclose(of_card.std(), of_numpy.std(), rtol=0.03)
    assert np.corrcoef(of_card.ravel(), of_numpy.ravel())[0, 1] > 0.94


@pytest.mark.parametrize("ink", ["soft", "hatch"])
def test_samples_of_neighbors(card, ink):
    """Samples at edges have the colors of the surfaces that they show, and their outlines."""
    plate = MeshInstance(boxes(), placed(1.5 * np.eye(3)), axis_field(boxes(), 2, AXIS))
    small = MeshInstance(BALL, placed(0.5 * np.eye(3), (0.4, -0.8, 0.3)), field_of(BALL, 2))
    look = replace(
        LOOK, ink=ink, shading=1.0, supersampling=2, line_width=3.0, outline=1.0, breaks=0.5
    )
    pair = assert_parity(card, [plate, small], view(supersampling=2), look)
    assert pair.likeness > 0.999
    assert (pair.card[..., 3] != pair.numpy[..., 3]).sum() < 5


@pytest.mark.parametrize("samples", [1, 2])
def test_triangles_smaller_than_pixels(card, samples):
    """OpenGL rounds corners: it may see a triangle just beside the center of a pixel."""
    fine = icosphere(6)
    instance = MeshInstance(fine, np.eye(4), axis_field(fine, 4, AXIS))
    look = replace(LOOK, supersampling=samples)
    assert_parity(card, [instance], view(supersampling=samples), look, agreement=0.9995)


def test_streamlines_end_where_another_mesh_begins(card):
    """Even if the other mesh continues in the same plane, with the same field."""
    surface = plane(2, 2)
    field = RosyField(2, np.tile([1.0, 0.2, 0.0], (surface.face_count, 1)))
    instances = [
        MeshInstance(surface, placed(0.5 * np.eye(3), (0.5 * side, 0, 0)), field)
        for side in (-1, 1)
    ]
    camera = perspective_camera(look_at((0.2, -1.0, 3.0), (0, 0, 0)), *SIZE, fov=0.6)
    assert_parity(card, instances, camera, likeness=0.99)


@pytest.mark.parametrize("perspective", [True, False])
def test_a_one_sided_surface(card, perspective):
    """On a Möbius strip, front and back meet where the picture shows no border."""
    points, triangles = moebius(96)
    surface = from_triangles(points, triangles)
    instance = MeshInstance(surface, placed(rotation(0.9, 0.2, 0)), axis_field(surface, 4, AXIS))
    assert_parity(card, [instance], view(perspective=perspective))


SUN = Light("sun", np.array([0.6, 0.0, 0.8]), np.array([1.0, 0.6, 0.3]), 0.9)
POINT = Light("point", np.array([-1.0, 0.5, -2.0]), np.array([0.2, 0.5, 1.0]), 3.0)


@pytest.mark.parametrize("lights", [[], [SUN], [POINT], [SUN, POINT]])
@pytest.mark.parametrize("perspective", [True, False])
def test_lights_of_the_scene(card, lights, perspective):
    look = replace(LOOK, shading=0.8, light="scene")
    assert_parity(card, [ball()], view(perspective=perspective), look, lights)


def test_a_headlight_ignores_lights(card):
    look, camera = replace(LOOK, shading=0.8), view()
    items = card.upload([ball()], "smooth")
    dark, lit = (
        card.read(render_texture(card, items, camera, look, lights), *SIZE).copy()
        for lights in ((), [SUN])
    )
    np.testing.assert_array_equal(dark, lit)


# --- tones ---------------------------------------------------------------------------------------

TONED = {
    "unchanged": {},
    "lit": {"tone_lit": True, "light": "lamp", "shading": 0.8},
    "tone curve": {"tone_levels": (0.2, 0.7, 1.8)},
    "inverted": {"tone_levels": (1.0, 0.0, 1.0)},
    "hatched": {"ink": "hatch", "line_width": 3.0},
}


def toned(tone, surface=BALL, matrix=None):
    """Return a ball with a surface tone."""
    return MeshInstance(
        surface, np.eye(4) if matrix is None else matrix, field_of(surface, 4), tone
    )


def waves(surface=BALL):
    """Return a tone of waves, as numbers at corners."""
    values = 0.5 + 0.4 * np.sin(3 * surface.vertices[surface.corner_vertex] @ (1.0, 0.3, 0.5))
    return SurfaceTone(values[:, None].astype(np.float32))


def checkerboard(side=200, repeat=2.0):
    """Return a checkerboard image and a UV map of the ball, on which some texels are very small."""
    x, y, z = BALL.vertices[BALL.corner_vertex].T
    uv = np.stack([0.5 + 0.5 * x + 0.1 * z, 0.5 + 0.5 * z - 0.1 * y], axis=1) * repeat
    row, column = np.indices((side, side + 30))
    board = 0.2 + 0.6 * ((row // 11 + column // 13) % 2)
    return SurfaceTone(uv.astype(np.float32), board.astype(np.float32))


@pytest.mark.parametrize("name", TONED)
@pytest.mark.parametrize("perspective", [True, False])
def test_tones_of_attributes(card, name, perspective):
    look = replace(LOOK, tone="attribute", **TONED[name])
    assert_parity(card, [toned(waves())], view(perspective=perspective), look)


@pytest.mark.parametrize("name", TONED)
@pytest.mark.parametrize("repeat", [0.5, 3.0])
def test_tones_of_images(card, name, repeat):
    look = replace(LOOK, tone="image", **TONED[name])
    assert_parity(card, [toned(checkerboard(repeat=repeat))], view(), look)


@pytest.mark.parametrize("name", TONED)
@pytest.mark.parametrize("resolution", [1, 3])
def test_tones_of_pictures(card, name, resolution):
    look = replace(LOOK, tone="picture", **TONED[name])
    reference_camera = view(azimuth=0.5)
    luminance = (
        np.random.default_rng(1).random((18 * resolution, 20 * resolution)).astype(np.float32)
    )
    assert_parity(
        card, [ball()], view(), look, reference=ReferenceRender(luminance, reference_camera)
    )


def test_meshes_without_a_tone_use_the_light(card):
    instances = [toned(waves(), matrix=placed(0.5 * np.eye(3), (-0.6, 0, 0)))]
    instances.append(ball(4, placed(0.5 * np.eye(3), (0.6, 0, 0))))
    look = replace(LOOK, tone="attribute", tone_levels=(0.0, 1.0, 1.5), shading=0.8)
    assert_parity(card, instances, view(), look)


def test_tones_with_free_directions(card):
    """The records then contain channels as well."""
    surface = icosphere(3)
    instance = MeshInstance(surface, np.eye(4), conjugate_field(surface), waves(surface))
    look = replace(LOOK, tone="attribute", anchor="surface")
    assert_parity(card, [instance], view(), look)


# --- colors of numbers ---------------------------------------------------------------------------

COLORED = {
    "soft": {},
    "hatched": {"ink": "hatch", "line_width": 3.0, "outline": 2.0},
    "light ink": {"ink": "hatch", "ink_color": "#f0f0e0", "paper_color": "#101018", "layers": 1},
    "inks that are nearly paper": {
        "ink": "hatch",
        "shading": 0.95,
        "light": "lamp",
        "line_width": 3.0,
        "color_range": (-1.0, 1.0),
        "color_map": "gray",
    },
    "a range, inverted": {"color_range": (0.8, 0.2), "color_map": "magma"},
    "with tones": {"tone": "attribute", "tone_levels": (0.0, 1.0, 1.5)},
}


def numbered(surface=BALL, matrix=None, tone=None, field=None):
    """Return a ball with numbers of waves, and without some of them on one side."""
    x = surface.vertices[surface.corner_vertex, 0]
    values = np.where(x > 0.3, np.nan, waves(surface).values[:, 0])
    instance = toned(tone, surface, matrix)
    field = instance.field if field is None else field
    return replace(instance, field=field, color_values=values.astype(np.float32))


@pytest.mark.parametrize("name", COLORED)
def test_colors_of_numbers(card, name):
    look = replace(LOOK, hue="values", **COLORED[name])
    tone = waves() if look.tone == "attribute" else None
    assert_parity(card, [numbered(tone=tone)], view(), look)


def test_numbers_beside_meshes_without_them(card):
    """The numbers that are out of view count for the range."""
    half = 0.5 * np.eye(3)
    instances = [numbered(matrix=placed(half, (-0.6, 0, 0))), ball(4, placed(half, (0.6, 0, 0)))]
    hidden = numbered(matrix=placed(half, (0, 0, 90)))
    instances.append(replace(hidden, color_values=3 * hidden.color_values))
    assert_parity(card, instances, view(), replace(LOOK, hue="values"))


def test_numbers_with_free_directions(card):
    """The records then contain channels as well."""
    surface = icosphere(3)
    instance = numbered(surface, tone=waves(surface), field=conjugate_field(surface))
    look = replace(LOOK, tone="attribute", hue="values")
    assert_parity(card, [instance], view(), look)


@pytest.mark.parametrize(
    "lights",
    [[SUN, POINT], *long([SUN], [POINT], [replace(POINT, vector=np.array([0.1, 1.3, -4.0]))])],
)
@pytest.mark.parametrize("ink", ["soft", "hatch"])
def test_shadows(card, lights, ink):
    """On the ground, on each other, and of an occluder; with one shadow map of a light or six."""
    ground = plane(4, 4)
    instances = [
        MeshInstance(ground, placed(2 * np.eye(3), (0, 0, -0.6)), field_of(ground, 4)),
        ball(4, placed(0.5 * np.eye(3), (-0.5, 0.2, 0))),
        MeshInstance(BALL, placed(0.3 * np.eye(3), (0.6, -0.3, 0.1)), None),
    ]
    look = replace(LOOK, light="scene", shading=0.9, shadows=True, ink=ink)
    shaded = assert_parity(card, instances, view(), look, lights, agreement=0.995)
    bare = draw_pair(ROSY, card, instances, view(), replace(look, shadows=False), lights)
    assert shaded.card[..., :3].mean() < 0.98 * bare.card[..., :3].mean()


@pytest.mark.parametrize(
    ("crossing", "degree"), [(True, 4), (False, 3), (False, 4), *long((False, 1), (False, 2))]
)
@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_creases_of_a_cube(card, crossing, degree, display):
    """Axis-aligned walls, whose normals have zeros of either sign.

    Low degrees are not tested across creases: the directions on one wall lie between those on the
    next.
    """
    smooth_cube = cube()
    surface = build_surface(
        smooth_cube.vertices, smooth_cube.corner_vertex, smooth_cube.face_start, sharp_angle=1.0
    )
    field = axis_field(surface, degree, (0.9, 0.4, 0.1))
    instance = MeshInstance(surface, placed(2 * np.eye(3), (-1, -1, -1)), field)
    look = replace(LOOK, crease_angle=np.pi if crossing else 0.7, display=display)
    for perspective in (True, False):
        assert_parity(card, [instance], view(perspective=perspective, distance=8.0), look)
        outlined = replace(look, ink="hatch", outline=3.0)
        assert_parity(card, [instance], view(perspective=perspective, distance=8.0), outlined)


def boxes():
    """A plate, and a block that intersects it, as one mesh with sharp edges."""
    box = cube()
    block = (box.vertices - (0.5, 0.5, 0.0)) * (0.5, 0.3, 0.8)
    plate = (box.vertices - 0.5) * (2.0, 2.0, 0.2)
    corners = np.concatenate([box.corner_vertex, box.corner_vertex + 8])
    start = np.arange(0, len(corners) + 1, 4)
    return build_surface(np.concatenate([plate, block]), corners, start, sharp_angle=0.5)


def noisy_ball():
    """A dense ball with bumps, which hide each other at grazing angles."""
    surface = icosphere(4)
    noise = 1 + 0.012 * np.random.default_rng(2).standard_normal((len(surface.vertices), 1))
    return build_surface(surface.vertices * noise, surface.corner_vertex, surface.face_start)


#: White paper with an outline only.
OUTLINE_ONLY = Look(ink="hatch", light="scene", shading=0.0, length=4, outline=1.5)


@pytest.mark.parametrize(
    ("supersampling", "perspective"), [(1, True), (2, False), *long((1, False), (3, True))]
)
@pytest.mark.parametrize("name", ["boxes", "noise", "degrees"])
def test_outlines_alone(card, name, supersampling, perspective):
    """Creases, parts and short marks, without hatching: nearly all pixels of the lines agree."""
    plate = MeshInstance(boxes(), placed(1.5 * np.eye(3)), axis_field(boxes(), 4, AXIS))
    bumps = noisy_ball()
    instances = {
        "boxes": [plate],
        "noise": [MeshInstance(bumps, np.eye(4), axis_field(bumps, 4, AXIS))],
        # The second instance has another degree, and a matrix that changes its shape.
        "degrees": [plate, MeshInstance(boxes(), placed(SHEAR, (0.4, 0, 0.4)), None)],
    }[name]
    if name == "degrees":
        instances[1] = replace(instances[1], field=axis_field(boxes(), 2, AXIS))
    camera = view(perspective=perspective, distance=5.0)
    camera = camera.resized(camera.width * supersampling, camera.height * supersampling)
    pair = assert_parity(
        card, instances, camera, replace(OUTLINE_ONLY, supersampling=supersampling)
    )
    both = (pair.card[..., 3] == 1) & (pair.numpy[..., 3] == 1)
    lines = both & (pair.numpy[..., 0] < 0.5)
    differs = both & (np.abs(pair.card - pair.numpy).max(axis=2) > 0.1)
    assert lines.sum() > 200 and differs.sum() < 0.03 * lines.sum()


def test_creases_on_the_device_are_found_again_for_another_angle(card):
    """The creases of a mesh stay on the device until the crease angle changes."""
    instance = MeshInstance(boxes(), np.eye(4), axis_field(boxes(), 4, AXIS))
    item = card.upload([instance], "smooth")[0]

    def textures(crease_angle):
        (found,) = run(prepare_steps([lambda: card.resources.outline_textures(item, crease_angle)]))
        return found

    first = textures(0.7)
    assert first.crease_count == 24 and first.triangle_parts is not None
    assert textures(0.7) is first and textures(1.7).crease_count == 0
    assert textures(None).crease_count == 0


@pytest.mark.parametrize("degree", [1, 3, 4])
def test_normals_with_zeros_of_either_sign(card, degree):
    """The frame of a normal depends on the sign of its z, also if z is 0."""
    for turn in range(4):
        surface = cylinder(24, 8)
        matrix = placed(rotation(0, 0, turn * np.pi / 2))
        field = axis_field(surface, degree, (0.4, 0.5, 0.6))
        assert_parity(
            card, [MeshInstance(surface, matrix, field)], view(distance=6.0, perspective=False)
        )
        walls = from_triangles(
            np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]) * (1.0, -0.0, 1.0),
            [(0, 1, 2), (0, 2, 3)] if turn % 2 else [(0, 2, 1), (0, 3, 2)],
        )
        field = axis_field(walls, degree, (0.4, 0.5, 0.6))
        assert_parity(
            card, [MeshInstance(walls, np.eye(4), field)], view(distance=6.0, perspective=turn < 2)
        )


FREE = {
    "two": lambda surface: perturbed_field(surface, 2),
    "three": lambda surface: perturbed_field(surface, 3, (1.0, 1.5, 0.7)),
    "four": lambda surface: perturbed_field(surface, 4),
    "five": lambda surface: perturbed_field(surface, 5, seed=3),
    "six": lambda surface: perturbed_field(surface, 6),
    "two lines": conjugate_field,
    "tensors": sign_changing_tensors,
}


@pytest.mark.parametrize("hue", ["families", *long("one")])
@pytest.mark.parametrize("name", FREE)
def test_free_directions(card, name, hue):
    field = FREE[name](BALL)
    assert field.direction_ratios is not None
    if hue == "families":
        assert field.family_count > 1
    look = replace(LOOK, hue=hue)
    assert_parity(card, [MeshInstance(BALL, np.eye(4), field)], view(), look)
    assert_parity(
        card,
        [MeshInstance(BALL, np.eye(4), field)],
        view(azimuth=2.0),
        replace(look, guiding_angle=1.1),
    )


@pytest.mark.parametrize("name", ["two", "three", "two lines"])
def test_streaks_of_free_directions_drift(card, name):
    """Along the directions; those of lines toward the guiding angle."""
    look = replace(LOOK, hue="families", guiding_angle=0.6, flow=DRIFTING["flow"])
    instance = MeshInstance(BALL, np.eye(4), FREE[name](BALL))
    assert_parity(card, [instance], view(), look, drift=DRIFTING["drift"])


@pytest.mark.parametrize("degree", [3, 4, *long(2, 5, 6)])
def test_families_of_rosys(card, degree):
    lines = degree if degree % 2 else degree // 2
    field = smooth_field(BALL, degree, lines)
    # Where streamlines diverge near a singularity, pixels differ in hue as well as in brightness.
    # Degree 5 has the most singularities in view: its pictures correlate by 0.9785.
    likeness = 0.975 if degree == 5 else 0.98
    for angle in (0.0, 0.9):
        look = replace(LOOK, hue="families", guiding_angle=angle)
        assert_parity(card, [MeshInstance(BALL, np.eye(4), field)], view(), look, likeness=likeness)


@pytest.mark.parametrize("name", ["three", "two lines", "tensors"])
def test_free_directions_with_uneven_lines(card, name):
    """Each family has its ink, and all lines wobble together, whatever the angles between them."""
    look = replace(
        LOOK, ink="hatch", shading=0.9, line_width=2.5, hue="families", wobble=1.0, breaks=0.5
    )
    assert_parity(card, [MeshInstance(BALL, np.eye(4), FREE[name](BALL))], view(), look)


@pytest.mark.parametrize("paper", ["#ffffff00", "#e0c08080"])
@pytest.mark.parametrize("hue", ["one", "families"])
def test_ink_on_paper_that_is_not_opaque(card, hue, paper):
    look = replace(LOOK, ink="hatch", shading=1.0, paper_color=paper, hue=hue, line_width=3.0)
    pair = draw_pair(ROSY, card, [ball(4)], view(), look)
    card_alpha, numpy_alpha = (picture[..., 3] for picture in (pair.card, pair.numpy))
    assert 0.2 < numpy_alpha[numpy_alpha > 0].mean() < 0.8
    assert np.corrcoef(card_alpha.ravel(), numpy_alpha.ravel())[0, 1] > 0.98
    both = (card_alpha > 0.2) & (numpy_alpha > 0.2)
    np.testing.assert_allclose(
        np.median(pair.card[both], axis=0), np.median(pair.numpy[both], axis=0), atol=0.01
    )


def test_families_with_a_field_without_families(card):
    """In one degree: a field without families has the hue of the first family."""
    labeled = smooth_field(BALL, 4, 2)
    instances = [
        MeshInstance(BALL, placed(0.6 * np.eye(3), (0.5, 0, 0.5)), labeled),
        ball(4, placed(0.6 * np.eye(3), (-0.5, 0, -0.5))),
    ]
    for order in (instances, instances[::-1]):
        assert_parity(card, order, view(), replace(LOOK, hue="families"))


def grid_position(index):
    """Return positions side by side."""
    return (0.75 * (index % 2) - 0.4, 0.2 * index, 0.9 * (index // 2) - 0.45)


@pytest.mark.parametrize("settings", [{}, {"hue": "magnitude", "magnitude_length": True}], ids=str)
def test_several_meshes_of_several_degrees(card, settings):
    """Some are occluded, and some are instances of one mesh."""
    instances = [
        ball(degree, placed((0.3 + 0.05 * index) * rotation(index, 0, 1), grid_position(index)))
        for index, degree in enumerate((1, 4, 3, 4))
    ]
    instances.append(ball(6, placed(0.9 * np.eye(3), (0, 2, 0))))
    assert_parity(card, instances, view(), replace(LOOK, **settings))


def test_free_directions_and_a_rosy_of_one_degree(card):
    instances = [
        MeshInstance(BALL, placed(0.5 * np.eye(3), (0.4, 0, 0.4)), perturbed_field(BALL, 4)),
        ball(4, placed(0.5 * np.eye(3), (-0.4, 0, -0.4))),
    ]
    assert_parity(card, instances, view())


MIXED = {
    "families": lambda: (smooth_field(BALL, 4, 2), smooth_field(BALL, 3, 3)),
    "families and none": lambda: (smooth_field(BALL, 6, 3), smooth_field(BALL, 5)),
    "free directions and a RoSy": lambda: (perturbed_field(BALL, 3), smooth_field(BALL, 4)),
    "free directions, both": lambda: (perturbed_field(BALL, 3), conjugate_field(BALL)),
}


@pytest.mark.parametrize("hue", ["families", *long("one")])
@pytest.mark.parametrize("name", MIXED)
def test_fields_of_different_degrees_are_independent(card, name, hue):
    instances = [
        MeshInstance(BALL, placed(0.5 * np.eye(3), (shift, 0, shift)), field)
        for field, shift in zip(MIXED[name](), (0.4, -0.4), strict=True)
    ]
    assert_parity(card, instances, view(), replace(LOOK, hue=hue, length=15))


@pytest.mark.parametrize("samples", [1, 2])
def test_meshes_without_a_field_occlude(card, samples):
    occluder = MeshInstance(BALL, placed(0.4 * np.eye(3), (0.3, -0.9, 0.2)), None)
    ring = torus(48, 24)
    ring_instance = MeshInstance(ring, placed(rotation(1, 0.3, 0)), None)
    look, camera = replace(LOOK, supersampling=samples), view(supersampling=samples)
    unoccluded = assert_parity(card, [ball()], camera, look)
    pair = assert_parity(card, [occluder, ball(), ring_instance], camera, look)
    assert (pair.card[..., 3] != pair.numpy[..., 3]).sum() < 5
    assert (pair.card[..., 3] > 0).sum() < 0.8 * (unoccluded.card[..., 3] > 0).sum()


UNDEFINED_LOOKS = {
    "soft": {},
    "families": {"hue": "families"},
    "magnitude": {"hue": "magnitude", "magnitude_length": True},
    "hatched": {"ink": "hatch", "shading": 1.0},
    "hatched, in color": {"ink": "hatch", "shading": 1.0, "hue": "families"},
    "hatched, even lines": {"ink": "even", "shading": 1.0, "line_distance": 4.4},
    "hatched, all effects": LOOKS["hatched, all effects"] | {"line_width": 2.2},
    "drifting": DRIFTING,
    "drifting, hatched": DRIFTING | {"ink": "hatch", "shading": 1.0, "fade": "ends"},
}


@pytest.mark.parametrize(
    "name",
    mainly(["soft", "hatched", "hatched, all effects", "drifting, hatched"], UNDEFINED_LOOKS),
)
@pytest.mark.parametrize("degree", [3, *long(4)])
def test_where_the_field_is_undefined(card, degree, name):
    settings = dict(UNDEFINED_LOOKS[name])
    drift = settings.pop("drift", NO_DRIFT)
    settings.pop("degree", None)
    look = replace(LOOK, **settings)
    field = smooth_field(BALL, degree)
    center = BALL.vertices[BALL.corner_vertex.reshape(-1, 3)].mean(axis=1)
    vectors = np.where((center[:, :1] > 0.2) | (center[:, 2:] > 0.6), 0.0, field.vectors)
    field = RosyField(degree, vectors, family_count=2 if degree == 4 else 3)
    camera = view(supersampling=look.supersampling)
    assert_parity(card, [MeshInstance(BALL, np.eye(4), field)], camera, look, drift=drift)


def test_a_field_that_is_undefined_everywhere(card):
    field = RosyField(4, np.zeros((BALL.face_count, 3)))
    items = card.upload([MeshInstance(BALL, np.eye(4), field)], "smooth")
    for look in (
        LOOK,
        replace(LOOK, hue="magnitude", magnitude_length=True),
        replace(LOOK, hue="families"),
    ):
        rgba = card.read(render_texture(card, items, view(), look), *SIZE)
        assert np.isfinite(rgba).all()
        assert rgba[..., 3].any()


LINEAR_PARTS = {
    "sheared": SHEAR,
    "mirrored": MIRROR,
    "stretched": np.diag([1.0, 0.5, 1.4]),
    "rotated": 1.1 * rotation(0.4, 2.0, -1.0),
    "small": 1e-3 * rotation(1.0, 0.2, 0.4),
    "large": 1e4 * rotation(1.0, 0.2, 0.4),
}


@pytest.mark.parametrize("name", LINEAR_PARTS)
@pytest.mark.parametrize("degree", [3, 4])
def test_matrices(card, name, degree):
    linear = LINEAR_PARTS[name]
    scale = np.cbrt(abs(np.linalg.det(linear)))
    eye = 4.5 * scale * np.array([0.4, -0.9, 0.5])
    camera = perspective_camera(
        look_at(eye, (0, 0, 0)), *SIZE, fov=0.75, clip=(0.1 * scale, 100 * scale)
    )
    assert_parity(card, [ball(degree, placed(linear))], camera)


@pytest.mark.parametrize("degree", [1, 3, 4])
@pytest.mark.parametrize("distortion", [np.eye(3), MIRROR])
def test_the_back_of_an_open_surface(card, degree, distortion):
    surface = plane(8, 8)
    field = axis_field(surface, degree, (1.0, 0.4, 0.0))
    for height in (3.0, -3.0):
        camera = perspective_camera(look_at((0.4, -1.0, height), (0, 0, 0)), *SIZE, fov=0.7)
        assert_parity(card, [MeshInstance(surface, placed(distortion), field)], camera)
    tube = cylinder(64, 16)
    field = axis_field(tube, degree, (0.2, 0.4, 1.0))
    camera = perspective_camera(look_at((0.5, -2.0, 3.0), (0, 0, 0)), *SIZE, fov=0.8)
    assert_parity(card, [MeshInstance(tube, placed(distortion), field)], camera)


EVEN_LINES = replace(LOOK, ink="even", shading=0.9, line_width=3.0, line_distance=6.0)


def partly_undefined():
    field = smooth_field(BALL, 4)
    center = BALL.vertices[BALL.corner_vertex.reshape(-1, 3)].mean(axis=1)
    return RosyField(4, np.where(center[:, :1] > 0.2, 0.0, field.vectors))


EVEN_LINE_SCENES = {
    **{
        name: lambda linear=linear: [ball(4, placed(linear))]
        for name, linear in LINEAR_PARTS.items()
        if name not in ("small", "large")
    },
    **{
        f"free directions, {name}": lambda make=make: [MeshInstance(BALL, np.eye(4), make(BALL))]
        for name, make in FREE.items()
        if name in ("two", "three", "four", "two lines")
    },
    "partly undefined": lambda: [MeshInstance(BALL, np.eye(4), partly_undefined())],
    "the back of a tube": lambda: [
        MeshInstance(
            cylinder(64, 16), placed(MIRROR), axis_field(cylinder(64, 16), 3, (0.2, 0.4, 1.0))
        )
    ],
    "several meshes": lambda: [
        ball(degree, placed((0.3 + 0.05 * index) * rotation(index, 0, 1), grid_position(index)))
        for index, degree in enumerate((1, 4, 3, 4))
    ],
    "triangles that need no bisection": lambda: [ball(4, surface=icosphere(5))],
}


@pytest.mark.parametrize("name", EVEN_LINE_SCENES)
def test_even_lines(card, name):
    instances = EVEN_LINE_SCENES[name]()
    assert_parity(card, instances, view(), EVEN_LINES)


def test_even_lines_grow_in_perspective(card):
    surface = plane(2, 2, 40.0)
    instance = MeshInstance(surface, np.eye(4), axis_field(surface, 2, (0, 1, 0)))
    camera = perspective_camera(look_at((0, -18.5, 1.0), (0, 0, 0), (0, 0, 1)), *SIZE, fov=1.0)
    assert_parity(card, [instance], camera, replace(EVEN_LINES, line_distance=4.0))


def test_even_lines_stay_on_the_card(device):
    """Only a few distances are kept for each mesh, each with that of the lines for slanted parts."""
    card, instance = GpuRenderer(device), ball()
    for distance in (4.0, 4.0, 4.5, 5.0, 6.0, 7.0):
        items = card.upload([instance], "smooth")
        render_texture(card, items, view(distance=distance), EVEN_LINES)
    (mesh,) = card.resources._meshes.values()
    assert len(mesh.line_textures) == 2 * 3
    textures = list(mesh.line_textures.values())
    render_texture(card, items, view(distance=7.0, azimuth=1.0), EVEN_LINES)
    assert list(mesh.line_textures.values()) == textures


def test_far_from_the_origin(card):
    """A mesh far from its own origin, moved back; and one far from the origin of the world."""
    far = np.array([3e5, -2e5, 1e5])
    far_surface = from_triangles(BALL.vertices + far, BALL.corner_vertex.reshape(-1, 3))
    assert_parity(
        card,
        [MeshInstance(far_surface, placed(shift=-far), axis_field(far_surface, 4, AXIS))],
        view(),
    )
    eye = far + 4 * np.array([0.4, -0.9, 0.5])
    camera = perspective_camera(look_at(eye, far), *SIZE, fov=0.65)
    assert_parity(card, [ball(4, placed(shift=far))], camera)


def test_close_to_a_wide_plane(card):
    """Two triangles that reach behind the camera and far away."""
    corners = 500.0 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    wide = from_triangles(corners, [(0, 1, 2), (0, 2, 3)])
    camera = perspective_camera(look_at((0, 0, 1), (0, 2, 0)), *SIZE, fov=0.9)
    assert_parity(card, [MeshInstance(wide, np.eye(4), axis_field(wide, 4, (1, 0.3, 0)))], camera)


def test_triangles_without_area(card):
    points = np.concatenate([BALL.vertices, [(0, 0, 1.5), (0, 0, 1.6), (0, 0, 1.7)]])
    triangles = BALL.corner_vertex.reshape(-1, 3)
    count = len(BALL.vertices)
    degenerate = [(count, count + 1, count + 2), (count, count, count), (0, 0, 1)]
    surface = from_triangles(points, np.concatenate([triangles, degenerate]))
    assert_parity(card, [MeshInstance(surface, np.eye(4), axis_field(surface, 3, AXIS))], view())


def test_meshes_out_of_view_change_nothing(card):
    away = [ball(3, placed(shift=shift)) for shift in ((90, 0, 0), (0, -90, 40), (0, 90, 90))]
    items = card.upload([*away, ball(4)], "smooth")
    rgba = card.read(render_texture(card, items, view(), LOOK), *SIZE).copy()
    alone = card.read(render_texture(card, card.upload([ball(4)], "smooth"), view(), LOOK), *SIZE)
    np.testing.assert_array_equal(rgba, alone)


@pytest.mark.parametrize("instances", ["out of view", "occluder", "none"])
def test_the_picture_is_empty_if_there_is_nothing_to_draw(card, instances):
    card.read(render_texture(card, card.upload([ball(4)], "smooth"), view(), LOOK), *SIZE)
    instance_lists = {
        "out of view": [ball(3, placed(shift=(90, 0, 0))), ball(4, placed(shift=(0, -90, -40)))],
        "occluder": [MeshInstance(BALL, np.eye(4), None)],
        "none": [],
    }[instances]
    rgba = card.read(
        render_texture(card, card.upload(instance_lists, "smooth"), view(), LOOK), *SIZE
    )
    assert not rgba.any()


def test_nothing_is_left_of_the_previous_picture(card):
    """The previous one has another position, degree and size of the screen box."""
    camera, small = view(), ball(3, placed(0.37 * rotation(1, 1, 0), (0.31, 0, 0.23)))
    fresh = GpuRenderer(card.device)
    expected = fresh.read(
        render_texture(fresh, fresh.upload([small], "smooth"), camera, LOOK), *SIZE
    )
    render_texture(card, card.upload([ball(4)], "smooth"), camera, LOOK)
    rgba = card.read(render_texture(card, card.upload([small], "smooth"), camera, LOOK), *SIZE)
    np.testing.assert_array_equal(rgba, expected)


@pytest.mark.parametrize("max_steps", [1, 200_000, 300_000, 450_000])
def test_bands_leave_no_seam(card, monkeypatch, max_steps):
    camera, small = view(), ball(3, placed(0.37 * rotation(1, 1, 0), (0.31, 0, 0.23)))
    fresh = GpuRenderer(card.device)
    expected = fresh.read(
        render_texture(fresh, fresh.upload([small], "smooth"), camera, LOOK), *SIZE
    )
    monkeypatch.setattr(lic_stage, "MAX_DISPATCH_STEPS", max_steps)
    render_texture(card, card.upload([ball(3)], "smooth"), camera, LOOK)
    rgba = card.read(render_texture(card, card.upload([small], "smooth"), camera, LOOK), *SIZE)
    np.testing.assert_array_equal(rgba, expected)


def test_clip_planes(card):
    camera, planes = view(), uniforms.NO_CLIP_PLANES.copy()
    planes[3] = (1.0, 0.0, 0.0, 0.2)
    items = card.upload([ball(4, placed(rotation(0, 0, 1)))], "smooth")
    unclipped = card.read(render_texture(card, items, camera, LOOK), *SIZE).copy()
    clipped = card.read(render_texture(card, items, camera, LOOK, clip_planes=planes), *SIZE)
    gbuffer = read_gbuffer(card, *SIZE)
    visible = gbuffer["field_values"][..., 3] > 0
    assert 0.2 < visible.sum() / (unclipped[..., 3] > 0).sum() < 1.0
    assert (clipped[..., 3] > 0).sum() == visible.sum()


@pytest.mark.parametrize(
    "degree, settings", [(4, {"singularity_dots": "all"}), (3, {"arrows": 32.0})]
)
def test_singularities_and_arrowheads_are_drawn_over_the_picture(card, degree, settings):
    """At the same pixels as numpy's."""
    changed = []
    for renderer in (card, None):
        marked, plain = (
            draw(renderer, ViewInput((ball(degree),), view(), replace(LOOK, **shown))).rgba
            for shown in (settings, {})
        )
        changed.append((marked != plain).any(axis=2))
    assert changed[0].sum() > 100
    assert (changed[0] != changed[1]).sum() <= 2


def test_the_same_input_gives_the_same_bytes(card):
    pictures = [
        card.read(
            render_texture(card, card.upload([ball(5)], "smooth"), view(), LOOK), *SIZE
        ).tobytes()
        for _ in range(2)
    ]
    assert pictures[0] == pictures[1]


def test_sizes_beyond_the_device_are_refused(device, error_of, monkeypatch):
    card = GpuRenderer(device)
    monkeypatch.setattr(device, "max_texture_size", 128)
    items = card.upload([ball(4)], "smooth")
    message = error_of(render_texture, card, items, view(), LOOK)
    assert "160 x 144" in message and "128" in message
    monkeypatch.setattr(device, "max_texture_size", 1)
    monkeypatch.setattr(mesh_buffers, "ROW_TEXELS", 64)
    message = error_of(card.upload, [ball(4, surface=icosphere(4))], "smooth")
    assert "sphere" in message and str(20 * 4**4) in message


def test_meshes_stay_on_the_card(device):
    card = GpuRenderer(device)
    instance = ball(4)
    (first,) = card.upload([instance], "smooth")
    moved = MeshInstance(instance.surface, placed(2 * rotation(1, 2, 3), (4, 5, 6)), instance.field)
    (second,) = card.upload([moved], "smooth")
    assert second.mesh is first.mesh
    (sheared,) = card.upload(
        [MeshInstance(instance.surface, placed(SHEAR), instance.field)], "smooth"
    )
    assert sheared.mesh is not first.mesh
    for _ in range(resources.MESH_LIFETIME_UPLOADS + 1):
        card.upload([moved], "smooth")
    assert [mesh.buffers for mesh in card.resources._meshes.values()] == [first.mesh.buffers]
    card.release()
    held = card.resources
    assert not (held._meshes or held._images or held._lookup_textures)


def test_nothing_is_compiled_or_sent_after_the_preparation(device):
    card = GpuRenderer(device)
    instance = ball(4)
    labels = [step.label for step in card.prepare_steps([instance], "smooth")]
    assert any("preparing the mesh" in label for label in labels)
    (mesh,) = card.resources._meshes.values()
    prepared = {shader for shader in passes.all_passes() if not shader.switches}
    assert set(device._programs) >= prepared
    items = card.upload([instance], "smooth")
    render_texture(card, items, view(), LOOK)
    programs = dict(device._programs)  # now with the switches of this look
    render_texture(card, items, view(), replace(LOOK, gain=2.0))
    assert items[0].mesh is mesh and device._programs == programs
    assert not list(card.prepare_steps([instance], "smooth"))


def test_what_takes_long_is_left_to_others(device, monkeypatch):
    """Meshes, outlines, features and lines are calls that a helper can make; the picture is the same."""
    look = replace(load_preset("engraving").look, anchor="surface", detail=0.5, outline=2.0)
    view_input = ViewInput((ball(4),), view(), look)
    expected = draw(GpuRenderer(device), view_input).rgba
    monkeypatch.setattr(preparation, "IN_PLACE_SECONDS", 0.0)
    steps, calls, answer = GpuRenderer(device).picture_steps(view_input), [], None
    while True:
        try:
            step = steps.send(answer)
        except StopIteration as end:
            picture = end.value
            break
        answer = None
        if isinstance(step, Call):
            sent = pickle.loads(pickle.dumps(step, 5))
            calls.append(sent.function.__name__)
            answer = sent()
        else:
            assert isinstance(step, Step)
    assert set(calls) == {"mesh_buffers", "outline_records", "feature_records", "line_records"}
    assert picture.rgba.tobytes() == expected.tobytes()


def test_cameras_of_odd_sizes(card):
    for size in ((1, 1), (3, 200), (200, 3), (257, 129)):
        camera = view(size)
        picture = render_texture(card, card.upload([ball(4)], "smooth"), camera, LOOK)
        rgba = card.read(picture, *size)
        expected = ROSY.compose(ROSY.project([ball(4)], camera), replace(LOOK, method="brute"))
        assert rgba.shape == expected.rgba.shape
        assert ((rgba[..., 3] > 0) != (expected.rgba[..., 3] > 0)).mean() < 0.01


def test_a_skewed_projection(card):
    camera = view()
    projection = camera.projection.copy()
    projection[0, 1], projection[1, 0] = 0.3, -0.2
    assert_parity(card, [ball(4)], Camera(camera.view, projection, *SIZE))


@pytest.mark.parametrize("supersampling", [1, 2])
@pytest.mark.parametrize("top", [0.0, 0.7])
def test_the_range_of_the_colors(card, supersampling, top):
    """It is numpy's, and a look with this range gives the same picture."""
    look = replace(LOOK, hue="magnitude", color_range=(0.0, top), supersampling=supersampling)
    instances = [ball(4), MeshInstance(BALL, placed(shift=(0, 0, -9)), axis_field(BALL, 2))]
    drawn, expected = (
        draw(renderer, ViewInput(tuple(instances), view(), look)) for renderer in (card, None)
    )
    # Numpy finds the field of several samples at the centers of pixels.
    tolerance = 1e-4 if supersampling == 1 else 5e-3
    assert drawn.color_range == pytest.approx(expected.color_range, rel=tolerance)
    assert (drawn.color_range == (0.0, 0.7)) == bool(top)
    fixed = replace(look, color_range=drawn.color_range)
    again = draw(card, ViewInput(tuple(instances), view(), fixed))
    np.testing.assert_allclose(again.rgba, drawn.rgba, atol=1e-6)


def test_no_common_range_of_the_colors(card):
    """Fields of several degrees have ranges of their own."""
    look = replace(LOOK, hue="magnitude")
    instances = ball(4), MeshInstance(BALL, placed(shift=(0.7, 0, 0)), axis_field(BALL, 2))
    for renderer in (card, None):
        picture = draw(renderer, ViewInput(instances, view(), look))
        assert picture.color_range is None
    look = replace(look, hue="one", magnitude_length=True)
    picture = draw(card, ViewInput(instances[:1], view(), look))
    assert picture.color_range is None

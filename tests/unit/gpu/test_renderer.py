"""The graphics card's part: what goes to it and, where there is an OpenGL context, what comes back.

Every picture is compared with numpy's, of the same pixels, by brute force. Without moderngl or
without a context (EGL; software OpenGL will do) those tests are skipped.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from awkward import moebius
from conftest import long, mainly
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapes import cube, cylinder, from_triangles, icosphere, plane, torus

from bench.parity import draw_pair, rooms
from rosy_addon.compositor.contrast import supersampling_gain
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import supersampled_look
from rosy_addon.compositor.pixel_field import surface_pixel_field
from rosy_addon.compositor.shading import Light
from rosy_addon.compositor.target_tone import ReferenceRender
from rosy_addon.field.directional_field import field_from_directions, tensor_field
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.representation import face_frames
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import build_surface
from rosy_addon.gpu import lic_stage, mesh_buffers, passes, resources, uniforms
from rosy_addon.gpu.device import UNIFORM_WORDS, _pack_uniforms, _std140_order
from rosy_addon.gpu.field_kind import field_kinds
from rosy_addon.gpu.mesh_buffers import ROW_TEXELS, build_mesh_buffers, field_channels, split_matrix
from rosy_addon.gpu.renderer import GpuRenderer
from rosy_addon.gpu.screen_box import is_empty, screen_box, union_box
from rosy_addon.progress import run_to_completion
from rosy_addon.projection.camera import Camera, look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.surface_tone import SurfaceTone
from rosy_addon.render.view_input import ViewInput

AXIS = (0.3, 0.2, 1.0)

# --- what goes to the card -----------------------------------------------------------------------


def rotation(x, y, z):
    """About the three axes, one after the other."""
    turns = []
    for axis, angle in enumerate((x, y, z)):
        one = np.eye(3)
        a, b = [(1, 2), (2, 0), (0, 1)][axis]
        one[[a, a, b, b], [a, b, a, b]] = (
            np.cos(angle),
            -np.sin(angle),
            np.sin(angle),
            np.cos(angle),
        )
        turns.append(one)
    return turns[2] @ turns[1] @ turns[0]


def smooth_field(surface, degree, families=1):
    """One of index 1 / N around each singularity, and of a magnitude that changes.

    Not that of an axis, which all N members run into at its ends: brute force keeps to the N
    directions there, the covering to the lines through a pixel, and beyond no two streamlines that
    differ in their last digit stay together.
    """
    field = generate(surface, "smoothest", degree)
    centre = surface.vertices[surface.corner_vertex[surface.face_start[:-1]]]
    size = 0.8 + 0.4 * np.sin(3 * centre @ np.array(AXIS) + 1)
    return RosyField(degree, field.vectors * size[:, None], family_count=families)


def placed(linear=None, shift=(0, 0, 0)):
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) if linear is None else linear
    matrix[:3, 3] = shift
    return matrix


ANGLES = st.floats(-3.2, 3.2)
SHEAR = np.array([[1.0, 0.4, 0.0], [0.0, 0.8, 0.3], [0.0, 0.0, 1.2]])
MIRROR = np.diag([-1.0, 1.0, 1.0])


@given(ANGLES, ANGLES, ANGLES, st.floats(1e-3, 1e3), st.tuples(*[st.floats(-1e4, 1e4)] * 3))
def test_what_merely_turns_scales_and_shifts_keeps_the_shape(x, y, z, scale, shift):
    matrix = placed(scale * rotation(x, y, z), shift)
    linear, moving = split_matrix(matrix)
    np.testing.assert_array_equal(linear, np.eye(3))
    np.testing.assert_array_equal(moving, matrix)


@given(ANGLES, ANGLES, ANGLES, st.floats(1e-3, 1e3), st.tuples(*[st.floats(-1e4, 1e4)] * 3))
@pytest.mark.parametrize("bent", [SHEAR, MIRROR, np.diag([1.0, 1.0, 2.0]), np.diag([1.0, 1.0, 0])])
def test_what_does_more_is_in_the_shape(bent, x, y, z, scale, shift):
    matrix = placed(scale * rotation(x, y, z) @ bent, shift)
    linear, moving = split_matrix(matrix)
    np.testing.assert_array_equal(linear, matrix[:3, :3])
    np.testing.assert_allclose(moving @ placed(linear), matrix)
    # What is left may only shift: the shaders take vectors through it, and normals.
    np.testing.assert_array_equal(moving[:3, :3], np.eye(3))


def test_matrices_of_single_precision_are_similar():
    matrix = placed(7.3 * rotation(0.3, -1.2, 2.9), (1, 2, 3)).astype(np.float32)
    np.testing.assert_array_equal(split_matrix(matrix)[0], np.eye(3))


@st.composite
def surfaces(draw):
    """A few triangles anywhere, with vertices that none uses, far away."""
    seed, count = draw(st.integers(0, 10**6)), draw(st.integers(1, 12))
    random = np.random.default_rng(seed)
    points = random.normal(size=(count + 2, 3)) * draw(st.sampled_from([0.01, 1.0, 100.0]))
    points += draw(st.sampled_from([0.0, 1e5])) * random.normal(size=3)
    triangles = [random.permutation(count + 2)[:3] for _ in range(count)]
    points = np.concatenate([points, [[1e9, 0, 0]]])
    return from_triangles(points, triangles, name="some")


def wavering(surface, degree, lengths=None, seed=0):
    """N directions a face, each up to 0.3 from those of a RoSy."""
    x, y = face_frames(surface)
    base = axis_field(surface, degree, AXIS).vectors
    start = np.arctan2((base * y).sum(axis=1), (base * x).sum(axis=1))[:, None]
    step = np.arange(degree) * 2 * np.pi / degree
    off = 0.3 * np.sin(np.arange(degree) * 2.1 + seed)
    angles = (start + step + off)[..., None]
    lengths = np.ones(degree) if lengths is None else np.asarray(lengths)
    return field_from_directions(
        surface, lengths[:, None] * (np.cos(angles) * x[:, None] + np.sin(angles) * y[:, None])
    )


def conjugate_field(surface):
    """Four directions of which opposite ones are on one line, at 1.2 radians to the other."""
    x, y = face_frames(surface)
    base = axis_field(surface, 4, AXIS).vectors
    start = np.arctan2((base * y).sum(axis=1), (base * x).sum(axis=1))[:, None]
    angles = (start + np.array([0, 1.2, np.pi, np.pi + 1.2]))[..., None]
    return field_from_directions(surface, np.cos(angles) * x[:, None] + np.sin(angles) * y[:, None])


@given(surfaces(), st.sampled_from([1, 2, 5]), st.sampled_from(["smooth", "flat"]))
@settings(max_examples=60)
def test_records_are_what_numpy_has_at_the_corners(surface, degree, display):
    field = axis_field(surface, degree, AXIS)
    assume(np.abs(surface.vertices[:-1]).max() < 1e7)
    shape = build_mesh_buffers(surface, np.eye(3), field, display)
    count = len(surface.triangles)
    assert shape.corners.shape == (3 * count, 4)
    assert shape.triangle_records.shape[1:] == (ROW_TEXELS, 4)
    assert shape.texels_per_record == 9 and shape.channel_count == 0
    corners = shape.corners.reshape(count, 3, 4)
    np.testing.assert_array_equal(corners[..., 3], np.arange(count)[:, None] + np.zeros(3))
    where = surface.vertices[surface.triangle_vertex]
    size = np.ptp(where.reshape(-1, 3), axis=0).max()
    np.testing.assert_allclose(corners[..., :3] + shape.center, where, atol=1e-6 * size, rtol=1e-12)
    # The vertex that nobody uses has no say.
    np.testing.assert_allclose(
        shape.bounds.max(axis=0), -shape.bounds.min(axis=0), atol=1e-9 * size
    )
    assert np.abs(shape.bounds).max() <= size
    records = shape.triangle_records.reshape(-1, 4)[: 9 * count].reshape(count, 9, 4)
    assert not shape.triangle_records.reshape(-1, 4)[9 * count :].any()
    at_rest = [records[:, 0:3, 3], records[:, 3:6, 3], records[:, 8, :3]]
    np.testing.assert_allclose(np.stack(at_rest, axis=2), where, rtol=1e-6)
    np.testing.assert_array_equal(records[:, :3, :3], corners[..., :3])
    np.testing.assert_allclose(np.linalg.norm(records[:, 3:6, :3], axis=2), 1, atol=1e-5)
    z = records[:, 6:8].reshape(count, 4, 2)[:, :3]
    rho = np.linalg.norm(z, axis=2)
    if display == "flat":
        wanted = field.magnitude[surface.triangle_face]
        np.testing.assert_allclose(rho, wanted[:, None] + np.zeros(3), atol=1e-5)
    assert (records[:, 7, 2] == degree).all() and (records[:, 7, 3] == 0).all()


def test_records_of_traits_are_in_their_layers():
    surface = icosphere(1)
    field = wavering(surface, 3, (1.0, 1.3, 0.8))
    kind = field_kinds([field])[3]
    assert kind.channels == (("deviation", -1), ("deviation", 0), ("deviation", 1), ("family", 3))
    shape = build_mesh_buffers(surface, np.eye(3), field, "smooth", kind.channels)
    assert shape.texels_per_record == 9 + 2 * 4 and shape.channel_count == 4
    count = len(surface.triangles)
    records = shape.triangle_records.reshape(-1, 4)[: 17 * count].reshape(count, 17, 4)
    np.testing.assert_array_equal(records[0, 7:16:2, 2], [3, 1, 0, -1, 1])
    np.testing.assert_array_equal(records[0, 7:16:2, 3], [0, 0, 1, 2, 3])
    # Beside such a field a RoSy deviates from itself by the factor 1, and knows no families.
    plain = build_mesh_buffers(surface, np.eye(3), axis_field(surface, 3), "smooth", kind.channels)
    records = plain.triangle_records.reshape(-1, 4)[: 17 * count].reshape(count, 17, 4)
    np.testing.assert_array_equal(records[:, 8], np.tile([0, 0, 0, 0], (count, 1)))
    np.testing.assert_array_equal(records[:, 10], np.tile([1, 0, 1, 0], (count, 1)))
    np.testing.assert_array_equal(records[:, 14], np.tile([0, 0, 0, 0], (count, 1)))


def test_what_only_hides_has_no_records(error_of, monkeypatch):
    monkeypatch.setattr(mesh_buffers, "MAX_TRIANGLES", 79)
    surface = icosphere(1)
    shape = build_mesh_buffers(surface, np.eye(3), None, "smooth")
    assert shape.triangle_records is None and shape.texels_per_record == 0
    said = error_of(build_mesh_buffers, surface, np.eye(3), axis_field(surface, 2), "smooth")
    assert "sphere" in said and "80" in said


def test_numbers_of_triangles_are_whole_in_single_precision():
    most = np.float32(mesh_buffers.MAX_TRIANGLES)
    assert int(most) == mesh_buffers.MAX_TRIANGLES
    assert int(most - np.float32(1)) == mesh_buffers.MAX_TRIANGLES - 1


def test_kinds_say_what_the_flow_of_numpy_says():
    surface = icosphere(2)
    camera = perspective_camera(look_at((0, -4, 1), (0, 0, 0)), 40, 40)
    for field in (
        *(axis_field(surface, degree) for degree in (1, 2, 3, 4, 5, 6)),
        wavering(surface, 2),
        wavering(surface, 3),
        wavering(surface, 4),
        wavering(surface, 5),
        wavering(surface, 6),
        conjugate_field(surface),
        tensors(surface),
    ):
        gbuffer = rooms().project([MeshInstance(surface, np.eye(4), field)], camera)
        flow = surface_pixel_field(gbuffer, field.degree, 0.7, False)
        (kind,) = field_kinds([field]).values()
        assert (kind.line_count, kind.sheets_per_turn) == (
            flow.line_count,
            flow.symmetry.sheets_per_turn,
        )
        assert set(flow.channels) == set(field_channels(field)) <= set(kind.channels)
        orders = kind.harmonic_orders
        assert orders == list(range(orders[0], orders[-1] + 1)) if orders else True


def test_kinds_of_several_fields():
    surface = icosphere(1)
    two, free, other = axis_field(surface, 2), wavering(surface, 3), axis_field(surface, 3)
    kinds = field_kinds([other, two, free])
    assert list(kinds) == [2, 3]
    assert kinds[2].channels == () and kinds[2].family_count == 1
    assert kinds[3].channels == field_kinds([free])[3].channels


def tensors(surface):
    """Symmetric ones, of one sign here and another there."""
    x, y, z = surface.vertices[surface.corner_vertex[surface.face_start[:-1]]].T
    one = np.zeros((surface.face_count, 3, 3))
    one[:, 0, 0], one[:, 1, 1], one[:, 2, 2] = 1 + x, 0.3 - y, 2 * z
    one[:, 0, 2] = one[:, 2, 0] = 0.5
    return tensor_field(surface, one)


# --- constants and sources -----------------------------------------------------------------------


@pytest.mark.parametrize("shader", passes.ALL_PASSES, ids=lambda shader: shader.name)
def test_constants_lie_as_std140_wants(shader):
    """Each at a multiple of its own size, one after the other, and whole rows of 16 bytes."""
    aligned = _std140_order(shader.uniforms)
    assert sorted(aligned) == sorted(shader.uniforms)
    at, places = 0, {}
    for name, kind in aligned:
        assert at % UNIFORM_WORDS[kind] == 0
        places[name] = slice(at, at + UNIFORM_WORDS[kind])
        at += UNIFORM_WORDS[kind]
    values = {
        name: tuple(range(100 * number, 100 * number + UNIFORM_WORDS[kind]))
        for number, (name, kind) in enumerate(shader.uniforms)
    }
    packed = _pack_uniforms(shader.uniforms, values)
    assert len(packed) % 4 == 0 and 0 <= len(packed) - at < 4
    for name, kind in shader.uniforms:
        words = packed[places[name]]
        words = words.view(np.int32) if kind in ("int", "ivec2") else words
        np.testing.assert_array_equal(words, values[name])


def code_of(source):
    """GLSL without comments."""
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", source, flags=re.S)


def words_of(source):
    """Names, but for those after a dot: parts of others."""
    return set(re.findall(r"(?<![.\w])[A-Za-z_]\w*", code_of(source)))


def own_source(shader):
    """Without what is common to all."""
    return "".join(passes.read_source(name) for name in shader.files if name != "common.glsl")


def plain(names):
    return {name.removesuffix("[]") for name in names}


@pytest.mark.parametrize("shader", passes.ALL_PASSES, ids=lambda shader: shader.name)
def test_sources_use_what_is_listed(shader):
    words = words_of(own_source(shader))
    listed = plain(shader.textures) | {name for name, _ in shader.uniforms}
    if isinstance(shader, passes.ComputePass):
        listed |= plain(name for name, _ in shader.images)
    else:
        listed |= {shader.output, *(name for name, _ in shader.varyings)}
    assert listed <= words, f"not used: {sorted(listed - words)}"


@pytest.mark.parametrize("shader", passes.ALL_PASSES, ids=lambda shader: shader.name)
def test_sources_use_nothing_else_of_other_passes(shader):
    """A constant, texture or image of some pass that this one uses has to be listed here."""
    known = set()
    for other in passes.ALL_PASSES:
        known |= plain(other.textures) | {name for name, _ in other.uniforms}
        if isinstance(other, passes.ComputePass):
            known |= plain(name for name, _ in other.images)
    code = code_of(own_source(shader))
    listed = plain(shader.textures) | {name for name, _ in shader.uniforms}
    if isinstance(shader, passes.ComputePass):
        listed |= plain(name for name, _ in shader.images)
    else:
        # "vertex_data" is what a vertex is given there.
        listed |= {shader.output, "vertex_data"}
    # What is declared in the source is its own: parameters and variables may have any name.
    kinds = r"(?:float|int|uint|bool|[iu]?vec[234])"
    declared = set(re.findall(rf"\b{kinds}\s+([A-Za-z_]\w*)", code))
    declared |= {
        name for line in re.findall(rf"\b{kinds}\s+[^;()]*;", code) for name in words_of(line)
    }
    used = (words_of(own_source(shader)) & known) - declared
    assert used <= listed, f"not listed: {sorted(used - listed)}"


@pytest.mark.parametrize("shader", passes.ALL_PASSES, ids=lambda shader: shader.name)
def test_arrays_are_read_and_written_as_arrays(shader):
    code = code_of(own_source(shader))
    names = list(shader.textures)
    if isinstance(shader, passes.ComputePass):
        names += [name for name, _ in shader.images]
    for name in names:
        own = name.removesuffix("[]")
        for call in re.findall(rf"(?:texelFetch|imageStore)\({own},\s*(\w+)\(", code):
            if call in ("ivec2", "ivec3"):
                assert (call == "ivec3") == name.endswith("[]"), (name, call)


def test_common_code_is_told_nothing():
    """It is part of every pass: it may use no pass's constants but by parameters."""
    known = {name for shader in passes.ALL_PASSES for name, _ in shader.uniforms}
    known |= {name for shader in passes.ALL_PASSES for name in plain(shader.textures)}
    assert not words_of(passes.read_source("common.glsl")) & known


@pytest.mark.parametrize("shader", passes.ALL_PASSES, ids=lambda shader: shader.name)
def test_nothing_else_has_the_name_of_a_constant(shader):
    """In Blender constants are macros, which know no scope: neither variables nor members may."""
    source = code_of(own_source(shader))
    kinds = "float|int|bool|vec[234]|ivec[234]|mat[34]"
    declared = set(re.findall(rf"\b(?:{kinds})\s+(\w+)", source))
    declared |= set(re.findall(rf"\b(?:{kinds})\s[^;(]*?,\s*(\w+)\s*[=;,]", source))
    declared |= set(re.findall(r"(?<=[A-Za-z_\])])\.([A-Za-z_]\w*)", source))
    assert not declared & {name for name, _ in shader.uniforms}


# --- windows -------------------------------------------------------------------------------------


def entry_of(surface, matrix=None):
    matrix = np.eye(4) if matrix is None else matrix
    shape = build_mesh_buffers(surface, np.eye(3), None, "smooth")
    on_card = resources.GpuMesh(shape, None, None, ())
    return resources.DrawItem(
        on_card, None, matrix @ mesh_buffers.translation_matrix(shape.center), 1.0, None
    )


def camera_at(eye=(0, -5, 0), size=(64, 48), perspective=True, clip=(0.1, 100.0)):
    view = look_at(eye, np.add(eye, (0, 5, 0)), (0, 0, 1))
    if perspective:
        return perspective_camera(view, *size, clip=clip)
    return orthographic_camera(view, *size, clip=clip)


@pytest.mark.parametrize("perspective", [True, False])
def test_windows_hold_the_pixels_of_a_body(perspective):
    surface = icosphere(3)
    camera = camera_at(perspective=perspective)
    field = axis_field(surface, 2)
    for shift in ((0, 0, 0), (1.5, 0, -0.5), (0, -4.5, 0.2), (0.3, -5, 0)):
        matrix = placed(shift=shift)
        left, bottom, right, top = screen_box(entry_of(surface, matrix), camera)
        row, column = np.divmod(
            rooms().project([MeshInstance(surface, matrix, field)], camera).pixel, camera.width
        )
        assert left <= column.min() and column.max() < right <= camera.width
        assert bottom <= row.min() and row.max() < top <= camera.height


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("shift", [(40, 0, 0), (-40, 0, 0), (0, 0, 40), (0, -40, 0)])
def test_windows_of_what_is_not_seen_are_empty(perspective, shift):
    """Beside the frame, above it, and behind the camera."""
    box = screen_box(
        entry_of(icosphere(1), placed(shift=shift)), camera_at(perspective=perspective)
    )
    assert is_empty(box)


def test_the_window_around_some():
    assert union_box([(1, 2, 5, 6), (0, 0, 0, 0), (9, 3, 9, 8), (3, 1, 8, 4)]) == (1, 1, 8, 6)
    assert is_empty(union_box([]))
    assert is_empty(union_box([(0, 0, 0, 0)]))


# --- parity --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def device():
    """A plain OpenGL context."""
    pytest.importorskip("moderngl", reason="no moderngl")
    from bench.egl import EglDevice

    try:
        return EglDevice()
    except Exception as error:
        pytest.skip(f"no OpenGL context through EGL: {error}")


@pytest.fixture(scope="module")
def card(device):
    return GpuRenderer(device)


ROSY = rooms()
SIZE = 160, 144
LOOK = Look(shading=0.0, length=30)
BALL = icosphere(3)


def view(size=SIZE, azimuth=0.4, perspective=True, distance=4.0, supersampling=1):
    """A camera that looks at the origin, its lens shifted."""
    eye = distance * np.array([np.sin(azimuth), -np.cos(azimuth), 0.5])
    size = [side * supersampling for side in size]
    at = look_at(eye, (0, 0, 0), (0, 0, 1))
    if perspective:
        return perspective_camera(at, *size, fov=0.65, shift=(0.06, -0.04))
    return orthographic_camera(at, *size, scale=2.6, shift=(0.06, -0.04))


def alike(
    card, instances, camera, look=LOOK, lights=(), agreement=0.998, likeness=0.98, rendered=None
):
    """Compare with numpy; the pictures."""
    pair = draw_pair(ROSY, card, instances, camera, look, lights, rendered)
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


def texture_of(card, items, camera, look, lights=(), clip_planes=None):
    """The picture, on the card."""
    view_input = ViewInput((), camera, look, tuple(lights), None, clip_planes)
    return run_to_completion(card.render_texture_task(items, view_input))


@lru_cache(maxsize=64)
def field_of(surface, degree):
    return smooth_field(surface, degree)


def ball(degree=4, matrix=None, surface=BALL):
    return MeshInstance(surface, np.eye(4) if matrix is None else matrix, field_of(surface, degree))


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("degree", [1, 3, 4, 12, *long(2, 5, 6, 7)])
def test_all_degrees(card, degree, perspective):
    alike(card, [ball(degree)], view(perspective=perspective))


LOOKS = {
    "as it comes": {},
    "colour noise": {"noise": "colour"},
    "colour noise, three directions": {"noise": "colour", "degree": 3},
    "magnitude in colour": {"magnitude": "colour"},
    "magnitude in colour, its range": {"magnitude": "colour", "magnitude_range": 0.8},
    "magnitude in grey": {"magnitude": "colour", "colour_map": "grey"},
    "magnitude in length": {"magnitude": "length"},
    "magnitude in length, its range": {"magnitude": "length", "magnitude_range": 1.5},
    "magnitude in both": {"magnitude": "both", "colour_map": "magma"},
    "magnitude in both, its range": {"magnitude": "both", "magnitude_range": 0.9, "degree": 2},
    "families that are not told apart": {"hue": "families"},
    "foreshortened": {"foreshorten": True},
    "foreshortened, three directions": {"foreshorten": True, "degree": 3},
    "supersampled": {"supersampling": 2},
    "supersampled colours": {"supersampling": 2, "noise": "colour", "degree": 3},
    "guided": {"guiding_angle": 0.7},
    "guided, five directions": {"guiding_angle": -2.5, "degree": 5},
    "flat": {"display": "flat"},
    "flat, across creases": {"display": "flat", "cross_creases": True},
    "shaded": {"shading": 0.7},
    "short steps": {"step": 0.4, "length": 60},
    "white noise": {"density": 0.5, "high_pass": 0.0, "gain": 1.0},
    "coarse noise": {"grain": 5.0, "seed": 7},
    "long": {"length": 200},
    "on the surface": {"anchor": "surface"},
    "on the surface, colours": {"anchor": "surface", "noise": "colour", "high_pass": 0.0},
    "on the surface, supersampled": {"anchor": "surface", "supersampling": 2, "seed": 3},
    "hatched": {"ink": "hatch", "shading": 1.0, "grain": 3.0},
    "hatched, three directions": {"ink": "hatch", "shading": 0.8, "degree": 3, "layers": 2},
    "hatched in colour, guided": {
        "ink": "hatch",
        "ink_colour": "#203080",
        "paper_colour": "#f0e8d0",
        "guiding_angle": 0.4,
        "crispness": 0.2,
        "shading": 1.0,
    },
    "hatched, light on dark": {
        "ink": "hatch",
        "ink_colour": "#fff0d0",
        "paper_colour": "#101020",
        "shading": 0.9,
    },
    "hatched, broken": {"ink": "hatch", "breaks": 1.0, "shading": 1.0, "grain": 2.5, "length": 60},
    "hatched, broken and as long as the magnitude": {
        "ink": "hatch",
        "breaks": 0.8,
        "shading": 0.9,
        "magnitude": "both",
        "degree": 3,
    },
    "hatched, by a hand that wavers": {"ink": "hatch", "wobble": 1.0, "shading": 0.9, "grain": 2.5},
    "hatched, by a hand that wavers with the surface": {
        "ink": "hatch",
        "wobble": 1.0,
        "anchor": "surface",
        "shading": 0.9,
        "grain": 2.5,
        "supersampling": 2,
        "degree": 3,
    },
    "hatched on paper with a tooth": {"ink": "hatch", "paper_grain": 1.0, "shading": 1.0},
    "hatched on paper with a tooth, supersampled": {
        "ink": "hatch",
        "paper_grain": 0.6,
        "supersampling": 2,
        "grain": 4.0,
        "crispness": 0.3,
        "seed": 5,
        "shading": 0.9,
    },
    "hatched, an ink each": {
        "ink": "hatch",
        "hue": "families",
        "degree": 6,
        "layering": 0.1,
        "shading": 1.0,
    },
    "hatched, an ink each, light on dark": {
        "ink": "hatch",
        "hue": "families",
        "ink_colour": "#ffd060",
        "paper_colour": "#101020",
        "degree": 4,
        "shading": 0.9,
        "ink_ramp": True,
        "ink_colour_light": "#fff0f0",
    },
    "hatched, from one ink to another": {
        "ink": "hatch",
        "ink_ramp": True,
        "ink_colour": "#101848",
        "ink_colour_light": "#e08050",
        "shading": 1.0,
    },
    "hatched, through a third ink": {
        "ink": "hatch",
        "hue": "families",
        "ink_ramp": True,
        "ink_middle": 0.3,
        "shading": 1.0,
    },
    "in Blender units": {"anchor": "surface", "unit": "world", "unit_size": 0.007},
    "in Blender units, of the picture": {"unit": "world", "unit_size": 0.03, "supersampling": 2},
    "hatched in Blender units, by hand": {
        "anchor": "surface",
        "unit": "world",
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
        "ink_colour": "#ffe0b0",
        "paper_colour": "#102030",
    },
    "hatched, running on": {
        "ink": "hatch",
        "light": "lamp",
        "shadows": True,
        "shading": 1.0,
        "overshoot": 9.0,
        "length": 7,
    },
    "hatched light, running on by magnitude": {
        "ink": "hatch",
        "ink_colour": "#ffd060",
        "paper_colour": "#101020",
        "shading": 1.0,
        "overshoot": 20.0,
        "magnitude": "length",
    },
    "hatched, all at once": {
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
    "hatched, six directions": {"ink": "hatch", "degree": 6, "layering": 0.1, "shading": 1.0},
    "the method members": {"method": "members", "weights": "none", "view_plane": False},
    "the method brute": {"method": "brute"},
}


@pytest.mark.parametrize("name", mainly(list(LOOKS)[1::2], LOOKS))
def test_looks(card, name):
    chosen = {"degree": 4, **LOOKS[name]}
    degree = chosen.pop("degree")
    look = LOOK.with_settings(chosen)
    alike(card, [ball(degree)], view(supersampling=look.supersampling), look)


@pytest.mark.parametrize("side", [2, 3])
def test_subpixels(card, side):
    """Borders have the colour of what is covered there; streaks the contrast of those drawn once."""
    look = replace(LOOK, supersampling=side, grain=3.0)
    pair = alike(card, [ball(2)], view(supersampling=side), look)
    border = (pair.numpy[..., 3] > 0) & (pair.numpy[..., 3] < 1) & (pair.card[..., 3] > 0)
    assert border.sum() > 100
    np.testing.assert_allclose(
        pair.card[border][:, :3].mean(), pair.numpy[border][:, :3].mean(), atol=0.01
    )
    constants = uniforms.look_uniforms(field_kinds([ball(2).field])[2], look)
    wanted = look.gain * supersampling_gain(supersampled_look(look))
    assert constants["gain"] == pytest.approx(wanted)


def test_triangles_smaller_than_pixels(card):
    """OpenGL rounds corners: it may see a triangle that the pixel's centre is just beside."""
    fine = icosphere(6)
    instance = MeshInstance(fine, np.eye(4), axis_field(fine, 4, AXIS))
    alike(card, [instance], view(), agreement=0.9995)


def test_streamlines_end_where_another_body_begins(card):
    """Even if it lies beside this one in one plane, and runs the same way."""
    surface = plane(2, 2)
    field = RosyField(2, np.tile([1.0, 0.2, 0.0], (surface.face_count, 1)))
    instances = [
        MeshInstance(surface, placed(0.5 * np.eye(3), (0.5 * way, 0, 0)), field) for way in (-1, 1)
    ]
    camera = perspective_camera(look_at((0.2, -1.0, 3.0), (0, 0, 0)), *SIZE, fov=0.6)
    alike(card, instances, camera, likeness=0.99)


@pytest.mark.parametrize("perspective", [True, False])
def test_a_surface_of_one_side(card, perspective):
    """Front and back go over into each other where the picture shows no border."""
    points, triangles = moebius(96)
    surface = from_triangles(points, triangles)
    instance = MeshInstance(surface, placed(rotation(0.9, 0.2, 0)), axis_field(surface, 4, AXIS))
    alike(card, [instance], view(perspective=perspective))


SUN = Light("sun", np.array([0.6, 0.0, 0.8]), np.array([1.0, 0.6, 0.3]), 0.9)
POINT = Light("point", np.array([-1.0, 0.5, -2.0]), np.array([0.2, 0.5, 1.0]), 3.0)


@pytest.mark.parametrize("lights", [[], [SUN], [POINT], [SUN, POINT]])
@pytest.mark.parametrize("perspective", [True, False])
def test_lights_of_the_scene(card, lights, perspective):
    look = replace(LOOK, shading=0.8, light="scene")
    alike(card, [ball()], view(perspective=perspective), look, lights)


def test_lights_do_not_count_for_a_headlight(card):
    look, camera = replace(LOOK, shading=0.8), view()
    drawn = card.upload([ball()], "smooth")
    dark, lit = (
        card.read(texture_of(card, drawn, camera, look, lights), *SIZE).copy()
        for lights in ((), [SUN])
    )
    np.testing.assert_array_equal(dark, lit)


# --- tones -----------------------------------------------------------------------------------------

TONED = {
    "as it is": {},
    "lit": {"tone_lit": True, "light": "lamp", "shading": 0.8},
    "bent": {"tone_black": 0.2, "tone_white": 0.7, "tone_gamma": 1.8},
    "turned over": {"tone_black": 1.0, "tone_white": 0.0},
    "hatched": {"ink": "hatch", "grain": 3.0},
}


def toned(tone, surface=BALL, matrix=None):
    """A ball with a tone of its own."""
    return MeshInstance(
        surface, np.eye(4) if matrix is None else matrix, field_of(surface, 4), tone
    )


def waves(surface=BALL):
    """Numbers at corners."""
    values = 0.5 + 0.4 * np.sin(3 * surface.vertices[surface.corner_vertex] @ (1.0, 0.3, 0.5))
    return SurfaceTone(values[:, None].astype(np.float32))


def chequered(side=200, repeat=2.0):
    """An image on a map of the ball that is not continuous everywhere; some of it is very fine."""
    x, y, z = BALL.vertices[BALL.corner_vertex].T
    uv = np.stack([0.5 + 0.5 * x + 0.1 * z, 0.5 + 0.5 * z - 0.1 * y], axis=1) * repeat
    row, column = np.indices((side, side + 30))
    board = 0.2 + 0.6 * ((row // 11 + column // 13) % 2)
    return SurfaceTone(uv.astype(np.float32), board.astype(np.float32))


@pytest.mark.parametrize("name", TONED)
@pytest.mark.parametrize("perspective", [True, False])
def test_tones_of_attributes(card, name, perspective):
    look = replace(LOOK, tone="attribute", **TONED[name])
    alike(card, [toned(waves())], view(perspective=perspective), look)


@pytest.mark.parametrize("name", TONED)
@pytest.mark.parametrize("repeat", [0.5, 3.0])
def test_tones_of_images(card, name, repeat):
    look = replace(LOOK, tone="image", **TONED[name])
    alike(card, [toned(chequered(repeat=repeat))], view(), look)


@pytest.mark.parametrize("name", TONED)
@pytest.mark.parametrize("finer", [1, 3])
def test_tones_of_pictures(card, name, finer):
    look = replace(LOOK, tone="picture", **TONED[name])
    taken = view(azimuth=0.5)
    shown = np.random.default_rng(1).random((18 * finer, 20 * finer)).astype(np.float32)
    alike(card, [ball()], view(), look, rendered=ReferenceRender(shown, taken))


def test_bodies_without_a_tone_have_the_light(card):
    instances = [toned(waves(), matrix=placed(0.5 * np.eye(3), (-0.6, 0, 0)))]
    instances.append(ball(4, placed(0.5 * np.eye(3), (0.6, 0, 0))))
    look = replace(LOOK, tone="attribute", tone_gamma=1.5, shading=0.8)
    alike(card, instances, view(), look)


def test_tones_beside_traits(card):
    """Of free directions: records have more in them."""
    surface = icosphere(3)
    thing = MeshInstance(surface, np.eye(4), conjugate_field(surface), waves(surface))
    look = replace(LOOK, tone="attribute", anchor="surface")
    alike(card, [thing], view(), look)


@pytest.mark.parametrize(
    "lights",
    [[SUN, POINT], *long([SUN], [POINT], [replace(POINT, vector=np.array([0.1, 1.3, -4.0]))])],
)
@pytest.mark.parametrize("ink", ["soft", "hatch"])
def test_shadows(card, lights, ink):
    """On the ground, on each other, and of what has no field; from one view of a light and from six."""
    ground = plane(4, 4)
    instances = [
        MeshInstance(ground, placed(2 * np.eye(3), (0, 0, -0.6)), field_of(ground, 4)),
        ball(4, placed(0.5 * np.eye(3), (-0.5, 0.2, 0))),
        MeshInstance(BALL, placed(0.3 * np.eye(3), (0.6, -0.3, 0.1)), None),
    ]
    look = replace(LOOK, light="scene", shading=0.9, shadows=True, ink=ink)
    shaded = alike(card, instances, view(), look, lights, agreement=0.995)
    bare = draw_pair(ROSY, card, instances, view(), replace(look, shadows=False), lights)
    assert shaded.card[..., :3].mean() < 0.98 * bare.card[..., :3].mean()


@pytest.mark.parametrize(
    ("crossing", "degree"), [(True, 4), (False, 3), (False, 4), *long((False, 1), (False, 2))]
)
@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_creases_of_a_cube(card, crossing, degree, display):
    """Axis-aligned walls, whose normals have zeros of either sign.

    Few directions are not asked to cross: those of one wall lie between those of the next.
    """
    soft = cube()
    surface = build_surface(soft.vertices, soft.corner_vertex, soft.face_start, sharp_angle=1.0)
    field = axis_field(surface, degree, (0.9, 0.4, 0.1))
    instance = MeshInstance(surface, placed(2 * np.eye(3), (-1, -1, -1)), field)
    look = replace(LOOK, cross_creases=crossing, display=display)
    for perspective in (True, False):
        alike(card, [instance], view(perspective=perspective, distance=8.0), look)
        outlined = replace(look, ink="hatch", outline=3.0)
        alike(card, [instance], view(perspective=perspective, distance=8.0), outlined)


@pytest.mark.parametrize("degree", [1, 3, 4])
def test_walls_whose_normals_have_zeros_of_either_sign(card, degree):
    """The frame of a normal depends on the sign of its z, that of 0 as well."""
    for turn in range(4):
        surface = cylinder(24, 8)
        matrix = placed(rotation(0, 0, turn * np.pi / 2))
        field = axis_field(surface, degree, (0.4, 0.5, 0.6))
        alike(card, [MeshInstance(surface, matrix, field)], view(distance=6.0, perspective=False))
        walls = from_triangles(
            np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]) * (1.0, -0.0, 1.0),
            [(0, 1, 2), (0, 2, 3)] if turn % 2 else [(0, 2, 1), (0, 3, 2)],
        )
        field = axis_field(walls, degree, (0.4, 0.5, 0.6))
        alike(
            card, [MeshInstance(walls, np.eye(4), field)], view(distance=6.0, perspective=turn < 2)
        )


FREE = {
    "two": lambda surface: wavering(surface, 2),
    "three": lambda surface: wavering(surface, 3, (1.0, 1.5, 0.7)),
    "four": lambda surface: wavering(surface, 4),
    "five": lambda surface: wavering(surface, 5, seed=3),
    "six": lambda surface: wavering(surface, 6),
    "two lines": conjugate_field,
    "tensors": tensors,
}


@pytest.mark.parametrize("hue", ["one", "families"])
@pytest.mark.parametrize("name", FREE)
def test_free_directions(card, name, hue):
    field = FREE[name](BALL)
    assert field.direction_ratios is not None
    if hue == "families":
        assert field.family_count > 1
    look = replace(LOOK, hue=hue)
    alike(card, [MeshInstance(BALL, np.eye(4), field)], view(), look)
    alike(
        card,
        [MeshInstance(BALL, np.eye(4), field)],
        view(azimuth=2.0),
        replace(look, guiding_angle=1.1),
    )


@pytest.mark.parametrize("degree", [2, 3, 4, 5, 6])
def test_families_of_rosys(card, degree):
    lines = degree if degree % 2 else degree // 2
    field = smooth_field(BALL, degree, lines)
    # A pixel whose streamlines part beside a singularity differs in hue as well as in brightness.
    # Of degree 5, which has the most singularities in view, the pictures correlate by 0.9785.
    likeness = 0.975 if degree == 5 else 0.98
    for guide in (0.0, 0.9):
        look = replace(LOOK, hue="families", guiding_angle=guide)
        alike(card, [MeshInstance(BALL, np.eye(4), field)], view(), look, likeness=likeness)


@pytest.mark.parametrize("name", ["three", "two lines", "tensors"])
def test_free_directions_by_hand(card, name):
    """Each family in its ink, lines that waver together, whatever the angles between them."""
    look = replace(
        LOOK, ink="hatch", shading=0.9, grain=2.5, hue="families", wobble=1.0, breaks=0.5
    )
    alike(card, [MeshInstance(BALL, np.eye(4), FREE[name](BALL))], view(), look)


@pytest.mark.parametrize("hue", ["one", "families"])
def test_ink_on_clear_paper(card, hue):
    look = replace(LOOK, ink="hatch", shading=1.0, clear_paper=True, hue=hue, grain=3.0)
    pair = draw_pair(ROSY, card, [ball(4)], view(), look)
    laid, wanted = (picture[..., 3] for picture in (pair.card, pair.numpy))
    assert 0.2 < wanted[wanted > 0].mean() < 0.8
    assert np.corrcoef(laid.ravel(), wanted.ravel())[0, 1] > 0.98
    both = (laid > 0.2) & (wanted > 0.2)
    np.testing.assert_allclose(
        np.median(pair.card[both], axis=0), np.median(pair.numpy[both], axis=0), atol=0.01
    )


def test_families_beside_a_field_without(card):
    """Of one degree: what knows no families has the hue of the first."""
    told = smooth_field(BALL, 4, 2)
    instances = [
        MeshInstance(BALL, placed(0.6 * np.eye(3), (0.5, 0, 0.5)), told),
        ball(4, placed(0.6 * np.eye(3), (-0.5, 0, -0.5))),
    ]
    for order in (instances, instances[::-1]):
        alike(card, order, view(), replace(LOOK, hue="families"))


def apart(number):
    """Places side by side."""
    return (0.75 * (number % 2) - 0.4, 0.2 * number, 0.9 * (number // 2) - 0.45)


@pytest.mark.parametrize("magnitude", ["none", "both"])
def test_several_bodies_of_several_degrees(card, magnitude):
    """One behind another, too, and instances."""
    instances = [
        ball(degree, placed((0.3 + 0.05 * number) * rotation(number, 0, 1), apart(number)))
        for number, degree in enumerate((1, 4, 3, 4))
    ]
    instances.append(ball(6, placed(0.9 * np.eye(3), (0, 2, 0))))
    alike(card, instances, view(), replace(LOOK, magnitude=magnitude))


def test_free_directions_beside_rosys_of_one_degree(card):
    instances = [
        MeshInstance(BALL, placed(0.5 * np.eye(3), (0.4, 0, 0.4)), wavering(BALL, 4)),
        ball(4, placed(0.5 * np.eye(3), (-0.4, 0, -0.4))),
    ]
    alike(card, instances, view())


MIXED = {
    "families": lambda: (smooth_field(BALL, 4, 2), smooth_field(BALL, 3, 3)),
    "families and none": lambda: (smooth_field(BALL, 6, 3), smooth_field(BALL, 5)),
    "free directions and a RoSy": lambda: (wavering(BALL, 3), smooth_field(BALL, 4)),
    "free directions, both": lambda: (wavering(BALL, 3), conjugate_field(BALL)),
}


@pytest.mark.parametrize("hue", ["one", "families"])
@pytest.mark.parametrize("name", MIXED)
def test_fields_of_one_degree_have_no_say_in_those_of_another(card, name, hue):
    instances = [
        MeshInstance(BALL, placed(0.5 * np.eye(3), (shift, 0, shift)), field)
        for field, shift in zip(MIXED[name](), (0.4, -0.4), strict=True)
    ]
    alike(card, instances, view(), replace(LOOK, hue=hue, length=15))


def test_what_has_no_field_hides(card):
    hiding = MeshInstance(BALL, placed(0.4 * np.eye(3), (0.3, -0.9, 0.2)), None)
    ring = torus(48, 24)
    through = MeshInstance(ring, placed(rotation(1, 0.3, 0)), None)
    whole = alike(card, [ball()], view())
    pair = alike(card, [hiding, ball(), through], view())
    assert (pair.card[..., 3] > 0).sum() < 0.8 * (whole.card[..., 3] > 0).sum()


@pytest.mark.parametrize("look", [{}, {"hue": "families"}, {"magnitude": "both"}])
@pytest.mark.parametrize("degree", [3, 4])
def test_where_the_field_is_undefined(card, degree, look):
    field = smooth_field(BALL, degree)
    centre = BALL.vertices[BALL.corner_vertex.reshape(-1, 3)].mean(axis=1)
    vectors = np.where((centre[:, :1] > 0.2) | (centre[:, 2:] > 0.6), 0.0, field.vectors)
    field = RosyField(degree, vectors, family_count=2 if degree == 4 else 3)
    alike(card, [MeshInstance(BALL, np.eye(4), field)], view(), replace(LOOK, **look))


def test_a_field_that_is_undefined_all_over(card):
    field = RosyField(4, np.zeros((BALL.face_count, 3)))
    drawn = card.upload([MeshInstance(BALL, np.eye(4), field)], "smooth")
    for look in (LOOK, replace(LOOK, magnitude="both"), replace(LOOK, hue="families")):
        found = card.read(texture_of(card, drawn, view(), look), *SIZE)
        assert np.isfinite(found).all()
        assert found[..., 3].any()


BENT = {
    "sheared": SHEAR,
    "mirrored": MIRROR,
    "stretched": np.diag([1.0, 0.5, 1.4]),
    "turned": 1.1 * rotation(0.4, 2.0, -1.0),
    "small": 1e-3 * rotation(1.0, 0.2, 0.4),
    "large": 1e4 * rotation(1.0, 0.2, 0.4),
}


@pytest.mark.parametrize("name", BENT)
@pytest.mark.parametrize("degree", [3, 4])
def test_matrices(card, name, degree):
    linear = BENT[name]
    scale = np.cbrt(abs(np.linalg.det(linear)))
    eye = 4.5 * scale * np.array([0.4, -0.9, 0.5])
    camera = perspective_camera(
        look_at(eye, (0, 0, 0)), *SIZE, fov=0.75, clip=(0.1 * scale, 100 * scale)
    )
    alike(card, [ball(degree, placed(linear))], camera)


@pytest.mark.parametrize("degree", [1, 3, 4])
@pytest.mark.parametrize("bent", [np.eye(3), MIRROR])
def test_the_back_of_an_open_surface(card, degree, bent):
    surface = plane(8, 8)
    field = axis_field(surface, degree, (1.0, 0.4, 0.0))
    for height in (3.0, -3.0):
        camera = perspective_camera(look_at((0.4, -1.0, height), (0, 0, 0)), *SIZE, fov=0.7)
        alike(card, [MeshInstance(surface, placed(bent), field)], camera)
    tube = cylinder(64, 16)
    field = axis_field(tube, degree, (0.2, 0.4, 1.0))
    camera = perspective_camera(look_at((0.5, -2.0, 3.0), (0, 0, 0)), *SIZE, fov=0.8)
    alike(card, [MeshInstance(tube, placed(bent), field)], camera)


def test_far_from_the_origin(card):
    """A surface far from its own origin, brought back; and one far from the world's."""
    far = np.array([3e5, -2e5, 1e5])
    away = from_triangles(BALL.vertices + far, BALL.corner_vertex.reshape(-1, 3))
    alike(card, [MeshInstance(away, placed(shift=-far), axis_field(away, 4, AXIS))], view())
    eye = far + 4 * np.array([0.4, -0.9, 0.5])
    camera = perspective_camera(look_at(eye, far), *SIZE, fov=0.65)
    alike(card, [ball(4, placed(shift=far))], camera)


def test_close_to_a_wide_plane(card):
    """Two triangles that reach behind the camera and far away."""
    corners = 500.0 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    wide = from_triangles(corners, [(0, 1, 2), (0, 2, 3)])
    camera = perspective_camera(look_at((0, 0, 1), (0, 2, 0)), *SIZE, fov=0.9)
    alike(card, [MeshInstance(wide, np.eye(4), axis_field(wide, 4, (1, 0.3, 0)))], camera)


def test_triangles_without_area(card):
    points = np.concatenate([BALL.vertices, [(0, 0, 1.5), (0, 0, 1.6), (0, 0, 1.7)]])
    triangles = BALL.corner_vertex.reshape(-1, 3)
    count = len(BALL.vertices)
    more = [(count, count + 1, count + 2), (count, count, count), (0, 0, 1)]
    surface = from_triangles(points, np.concatenate([triangles, more]))
    alike(card, [MeshInstance(surface, np.eye(4), axis_field(surface, 3, AXIS))], view())


def test_what_is_out_of_view_does_not_hurt(card):
    away = [ball(3, placed(shift=shift)) for shift in ((90, 0, 0), (0, -90, 40), (0, 90, 90))]
    drawn = card.upload([*away, ball(4)], "smooth")
    found = card.read(texture_of(card, drawn, view(), LOOK), *SIZE).copy()
    alone = card.read(texture_of(card, card.upload([ball(4)], "smooth"), view(), LOOK), *SIZE)
    np.testing.assert_array_equal(found, alone)


@pytest.mark.parametrize("instances", ["out of view", "hiding", "none"])
def test_where_there_is_nothing_to_draw_the_picture_is_empty(card, instances):
    card.read(texture_of(card, card.upload([ball(4)], "smooth"), view(), LOOK), *SIZE)
    chosen = {
        "out of view": [ball(3, placed(shift=(90, 0, 0))), ball(4, placed(shift=(0, -90, -40)))],
        "hiding": [MeshInstance(BALL, np.eye(4), None)],
        "none": [],
    }[instances]
    found = card.read(texture_of(card, card.upload(chosen, "smooth"), view(), LOOK), *SIZE)
    assert not found.any()


def test_nothing_is_left_of_the_picture_before(card):
    """Of another place, degree and size of window; the walk in bands of any height."""
    camera, small = view(), ball(3, placed(0.37 * rotation(1, 1, 0), (0.31, 0, 0.23)))
    fresh = GpuRenderer(card.device)
    expected = fresh.read(texture_of(fresh, fresh.upload([small], "smooth"), camera, LOOK), *SIZE)
    texture_of(card, card.upload([ball(4)], "smooth"), camera, LOOK)
    found = card.read(texture_of(card, card.upload([small], "smooth"), camera, LOOK), *SIZE)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("most", [1, 200_000, 300_000, 450_000])
def test_bands_leave_no_seam_and_nothing_from_before(card, monkeypatch, most):
    camera, small = view(), ball(3, placed(0.37 * rotation(1, 1, 0), (0.31, 0, 0.23)))
    fresh = GpuRenderer(card.device)
    expected = fresh.read(texture_of(fresh, fresh.upload([small], "smooth"), camera, LOOK), *SIZE)
    monkeypatch.setattr(lic_stage, "MAX_DISPATCH_STEPS", most)
    texture_of(card, card.upload([ball(3)], "smooth"), camera, LOOK)
    found = card.read(texture_of(card, card.upload([small], "smooth"), camera, LOOK), *SIZE)
    np.testing.assert_array_equal(found, expected)


def test_planes_cut_away(card):
    camera, planes = view(), uniforms.NO_CLIP_PLANES.copy()
    planes[3] = (1.0, 0.0, 0.0, 0.2)
    drawn = card.upload([ball(4, placed(rotation(0, 0, 1)))], "smooth")
    whole = card.read(texture_of(card, drawn, camera, LOOK), *SIZE).copy()
    cut = card.read(texture_of(card, drawn, camera, LOOK, clip_planes=planes), *SIZE)
    position = card.read_gbuffer(camera)
    seen = position["field_values"][..., 3] > 0
    assert 0.2 < seen.sum() / (whole[..., 3] > 0).sum() < 1.0
    assert (cut[..., 3] > 0).sum() == seen.sum()


def test_the_same_input_gives_the_same_bytes(card):
    found = [
        card.read(texture_of(card, card.upload([ball(5)], "smooth"), view(), LOOK), *SIZE).tobytes()
        for _ in range(2)
    ]
    assert found[0] == found[1]


def test_what_is_too_large_is_said(device, error_of, monkeypatch):
    card = GpuRenderer(device)
    monkeypatch.setattr(device, "max_texture_size", 128)
    drawn = card.upload([ball(4)], "smooth")
    said = error_of(texture_of, card, drawn, view(), LOOK)
    assert "160 x 144" in said and "128" in said
    monkeypatch.setattr(device, "max_texture_size", 1)
    monkeypatch.setattr(mesh_buffers, "ROW_TEXELS", 64)
    said = error_of(card.upload, [ball(4, surface=icosphere(4))], "smooth")
    assert "sphere" in said and str(20 * 4**4) in said


def test_shapes_stay_on_the_card(device):
    card = GpuRenderer(device)
    instance = ball(4)
    (first,) = card.upload([instance], "smooth")
    moved = MeshInstance(instance.surface, placed(2 * rotation(1, 2, 3), (4, 5, 6)), instance.field)
    (second,) = card.upload([moved], "smooth")
    assert second.mesh is first.mesh
    (bent,) = card.upload([MeshInstance(instance.surface, placed(SHEAR), instance.field)], "smooth")
    assert bent.mesh is not first.mesh
    for _ in range(resources.MESH_LIFETIME_UPLOADS + 1):
        card.upload([moved], "smooth")
    assert [mesh.buffers for mesh in card.resources.meshes] == [first.mesh.buffers]
    card.release()
    assert not card.resources.texture_count


def test_cameras_of_odd_sizes(card):
    for size in ((1, 1), (3, 200), (200, 3), (257, 129)):
        camera = view(size)
        picture = texture_of(card, card.upload([ball(4)], "smooth"), camera, LOOK)
        found = card.read(picture, *size)
        expected = ROSY.compose(ROSY.project([ball(4)], camera), replace(LOOK, method="brute"))
        assert found.shape == expected.rgba.shape
        assert ((found[..., 3] > 0) != (expected.rgba[..., 3] > 0)).mean() < 0.01


def test_a_projection_that_is_askew(card):
    camera = view()
    projection = camera.projection.copy()
    projection[0, 1], projection[1, 0] = 0.3, -0.2
    alike(card, [ball(4)], Camera(camera.view, projection, *SIZE))

"""Meshes, fields, matrices and cameras: pictures of the card and of numpy, of the same pixels."""

from dataclasses import replace

import numpy as np
import pytest
from awkward import moebius
from harness.gpu_scenes import (
    AXIS,
    BALL,
    EVEN_LINES,
    FREE,
    LOOK,
    MIRROR,
    SHEAR,
    SIZE,
    assert_parity,
    ball,
    boxes,
    card_rgba,
    conjugate_field,
    draw,
    field_of,
    perturbed_field,
    rotation,
    shown,
    smooth_field,
    view,
)
from shapes import cylinder, from_triangles, icosphere, plane, rebuilt, sharp_cube, torus

from rosy_addon.compositor.flow import Drift
from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import axis_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.camera import Camera, look_at, perspective_camera

FAMILIES = replace(LOOK, hue="families")


def with_axis_field(surface, degree=4, axis=AXIS, linear=1.0, shift=(0, 0, 0)):
    return shown(surface, axis_field(surface, degree, axis), linear, shift)


def camera_from(eye, target=(0, 0, 0), fov=0.7, scale=1.0):
    clip = 0.1 * scale, 1000 * scale
    return perspective_camera(look_at(eye, target), *SIZE, fov=fov, clip=clip)


def grid(degrees):
    """Return balls side by side: some are occluded, and some are instances of one mesh."""
    numbers = range(len(degrees))
    turns = [(0.3 + 0.05 * k) * rotation(k, 0, 1) for k in numbers]
    places = [(0.75 * (k % 2) - 0.4, 0.2 * k, 0.9 * (k // 2) - 0.45) for k in numbers]
    return list(map(ball, degrees, turns, places))


def pair_of(first, second):
    """Return balls with two fields side by side."""
    return [shown(BALL, first, 0.5, (0.4, 0, 0.4)), shown(BALL, second, 0.5, (-0.4, 0, -0.4))]


# --- meshes --------------------------------------------------------------------------------------


def same_plane():
    surface = plane(2, 2)
    field = RosyField(2, np.tile([1.0, 0.2, 0.0], (surface.face_count, 1)))
    return [shown(surface, field, 0.5, (0.5 * side, 0, 0)) for side in (-1, 1)]


def moved_back():
    """A mesh far from its own origin, moved back."""
    surface = from_triangles(BALL.vertices + FAR, BALL.corner_vertex.reshape(-1, 3))
    return with_axis_field(surface, shift=-FAR)


def wide_plane():
    """A square that reaches behind the camera and far away."""
    return with_axis_field(plane(1, 1, 1000.0), 4, (1, 0.3, 0))


def with_degenerate_triangles():
    points = np.concatenate([BALL.vertices, [(0, 0, 1.5), (0, 0, 1.6), (0, 0, 1.7)]])
    count = len(BALL.vertices)
    degenerate = [(count, count + 1, count + 2), (count, count, count), (0, 0, 1)]
    triangles = np.concatenate([BALL.corner_vertex.reshape(-1, 3), degenerate])
    return with_axis_field(from_triangles(points, triangles), 3)


FAR = np.array([3e5, -2e5, 1e5])
SKEWED = view().projection + np.pad([[0, 0.3], [-0.2, 0]], ((0, 2), (0, 2)))

#: Instances and a camera.
SCENES = {
    # The streamlines end there, even if the other mesh continues the first one with the same field.
    "two meshes in one plane": lambda: (same_plane(), camera_from((0.2, -1.0, 3.0), fov=0.6)),
    "several degrees": lambda: ([*grid((1, 4, 3, 4)), ball(6, 0.9, (0, 2, 0))], view()),
    "far from its own origin": lambda: ([moved_back()], view()),
    "far away": lambda: ([ball(shift=FAR)], camera_from(FAR + (1.6, -3.6, 2.0), FAR, fov=0.65)),
    "close to a wide plane": lambda: ([wide_plane()], camera_from((0, 0, 1), (0, 2, 0), fov=0.9)),
    "triangles without area": lambda: ([with_degenerate_triangles()], view()),
    "a skewed projection": lambda: ([ball()], Camera(view().view, SKEWED, *SIZE)),
}


@pytest.mark.parametrize("name", SCENES)
def test_scenes(card, name):
    assert_parity(card, *SCENES[name]())


@pytest.mark.parametrize("perspective", [True, False])
def test_a_one_sided_surface(card, perspective):
    """On a Möbius strip, front and back meet where the picture shows no border."""
    strip = with_axis_field(from_triangles(*moebius(96)), linear=rotation(0.9, 0.2, 0))
    assert_parity(card, [strip], view(perspective=perspective))


@pytest.mark.parametrize("samples", [1, 2])
def test_triangles_smaller_than_pixels(card, samples):
    """OpenGL rounds corners: it may see a triangle just beside the center of a pixel."""
    look = replace(LOOK, supersampling=samples)
    assert_parity(card, [with_axis_field(icosphere(6))], look=look, agreement=0.9995)


@pytest.mark.parametrize("ink", ["soft", "hatch"])
def test_samples_of_neighbors(card, ink):
    """Samples at edges have the colors of the surfaces that they show, and their outlines."""
    instances = [with_axis_field(boxes(), 2, linear=1.5), ball(2, 0.5, (0.4, -0.8, 0.3))]
    look = replace(LOOK, ink=ink, shading=1.0, supersampling=2, line_width=3.0, outline=1.0)
    pair = assert_parity(card, instances, look=replace(look, breaks=0.5), likeness=0.998)
    assert (pair.card[..., 3] != pair.numpy[..., 3]).sum() < 5


@pytest.mark.parametrize("samples", [1, 2])
def test_meshes_without_a_field_occlude(card, samples):
    look = replace(LOOK, supersampling=samples)
    small = shown(BALL, None, 0.4, (0.3, -0.9, 0.2))
    ring = shown(torus(48, 24), None, rotation(1, 0.3, 0))
    unoccluded = assert_parity(card, [ball()], look=look)
    pair = assert_parity(card, [small, ball(), ring], look=look)
    assert (pair.card[..., 3] != pair.numpy[..., 3]).sum() < 5
    assert (pair.card[..., 3] > 0).sum() < 0.8 * (unoccluded.card[..., 3] > 0).sum()


LINEAR_PARTS = {
    "sheared": SHEAR,
    "mirrored": MIRROR,
    "stretched": np.diag([1.0, 0.5, 1.4]),
    "small": 1e-3 * rotation(1.0, 0.2, 0.4),
    "large": 1e4 * rotation(1.0, 0.2, 0.4),
}


@pytest.mark.parametrize("name", LINEAR_PARTS)
def test_matrices(card, name):
    linear = LINEAR_PARTS[name]
    scale = np.cbrt(abs(np.linalg.det(linear)))
    eye = 4.5 * scale * np.array([0.4, -0.9, 0.5])
    assert_parity(card, [ball(3, linear)], camera_from(eye, fov=0.75, scale=scale))


@pytest.mark.parametrize("degree", [3, 4])
@pytest.mark.parametrize("distortion", [np.eye(3), MIRROR])
def test_the_back_of_an_open_surface(card, degree, distortion):
    sheet = with_axis_field(plane(8, 8), degree, (1.0, 0.4, 0.0), distortion)
    for height in (3.0, -3.0):
        assert_parity(card, [sheet], camera_from((0.4, -1.0, height)))
    tube = with_axis_field(cylinder(64, 16), degree, (0.2, 0.4, 1.0), distortion)
    assert_parity(card, [tube], camera_from((0.5, -2.0, 3.0), fov=0.8))


@pytest.mark.parametrize("turn", range(4))
def test_normals_with_zeros_of_either_sign(card, turn):
    """The frame of a normal depends on the sign of its z, also if z is 0."""
    degree, axis = 3, (0.4, 0.5, 0.6)
    tube = with_axis_field(cylinder(24, 8), degree, axis, rotation(0, 0, turn * np.pi / 2))
    assert_parity(card, [tube], view(distance=6.0, perspective=False))
    corners = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]) * (1.0, -0.0, 1.0)
    triangles = [(0, 1, 2), (0, 2, 3)] if turn % 2 else [(0, 2, 1), (0, 3, 2)]
    wall = with_axis_field(from_triangles(corners, triangles), degree, axis)
    assert_parity(card, [wall], view(distance=6.0, perspective=turn < 2))


# --- creases and outlines ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("crossing", "degree", "perspective"), [(True, 4, True), (False, 3, True), (False, 4, False)]
)
@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_creases_of_a_cube(card, crossing, degree, display, perspective):
    """Axis-aligned walls. Low degrees are not tested across creases: the directions on one wall lie
    between the directions on the next.
    """
    instance = with_axis_field(sharp_cube(), degree, (0.9, 0.4, 0.1), 2.0, (-1, -1, -1))
    look = replace(LOOK, crease_angle=np.pi if crossing else 0.7, display=display)
    for shown_look in (look, replace(look, ink="hatch", outline=3.0)):
        assert_parity(card, [instance], view(perspective=perspective, distance=8.0), shown_look)


def noisy_ball():
    """A dense ball with bumps, which hide each other at grazing angles."""
    surface = icosphere(4)
    noise = 1 + 0.012 * np.random.default_rng(2).standard_normal((len(surface.vertices), 1))
    return rebuilt(surface, surface.vertices * noise)


OUTLINED = {
    "noise": lambda: [with_axis_field(noisy_ball())],
    # The second instance has another degree, and a matrix that changes its shape.
    "degrees": lambda: [
        with_axis_field(boxes(), linear=1.5),
        with_axis_field(boxes(), 2, AXIS, SHEAR, (0.4, 0, 0.4)),
    ],
}


@pytest.mark.parametrize(("samples", "perspective"), [(1, True), (2, False)])
@pytest.mark.parametrize("name", OUTLINED)
def test_outlines_alone(card, name, samples, perspective):
    """Creases, parts and short marks on white paper: nearly all pixels of the lines agree."""
    camera = view(perspective=perspective, distance=5.0, supersampling=samples)
    look = Look(ink="hatch", light="scene", shading=0.0, length=4, outline=1.5)
    pair = assert_parity(card, OUTLINED[name](), camera, replace(look, supersampling=samples))
    both = (pair.card[..., 3] == 1) & (pair.numpy[..., 3] == 1)
    lines = both & (pair.numpy[..., 0] < 0.5)
    differs = both & (np.abs(pair.card - pair.numpy).max(axis=2) > 0.1)
    assert lines.sum() > 200 and differs.sum() < 0.03 * lines.sum()


# --- free directions and families ----------------------------------------------------------------


@pytest.mark.parametrize("name", FREE)
def test_free_directions(card, name):
    field = FREE[name](BALL)
    assert field.direction_ratios is not None and field.family_count > 1
    assert_parity(card, [shown(BALL, field)], look=FAMILIES)
    guided = replace(FAMILIES, guiding_angle=1.1)
    assert_parity(card, [shown(BALL, field)], view(azimuth=2.0), guided)


FREE_LOOKS = {
    # Along the directions; those of lines toward the guiding angle.
    "drifting": replace(FAMILIES, guiding_angle=0.6, flow=2.0),
    # Each family has its ink, and all lines wobble together, whatever the angles between them.
    "uneven": replace(FAMILIES, ink="hatch", shading=0.9, line_width=2.5, wobble=1.0, breaks=0.5),
}


@pytest.mark.parametrize("look", FREE_LOOKS)
@pytest.mark.parametrize("name", ["three", "two lines"])
def test_looks_of_free_directions(card, name, look):
    assert_parity(card, [shown(BALL, FREE[name](BALL))], look=FREE_LOOKS[look], drift=Drift(0.2))


@pytest.mark.parametrize("angle", [0.0, 0.9])
@pytest.mark.parametrize("degree", [3, 4])
def test_families_of_rosys(card, degree, angle):
    field = smooth_field(BALL, degree, degree if degree % 2 else degree // 2)
    assert_parity(card, [shown(BALL, field)], look=replace(FAMILIES, guiding_angle=angle))


MIXED = {
    # A field without families has the hue of the first family.
    "one degree, with families and without": lambda: (smooth_field(BALL, 4, 2), field_of(BALL, 4)),
    "one degree, free directions and a RoSy": lambda: (perturbed_field(BALL, 4), field_of(BALL, 4)),
    "families": lambda: (smooth_field(BALL, 4, 2), smooth_field(BALL, 3, 3)),
    "families and none": lambda: (smooth_field(BALL, 6, 3), field_of(BALL, 5)),
    "free directions and a RoSy": lambda: (perturbed_field(BALL, 3), field_of(BALL, 4)),
    "free directions, both": lambda: (perturbed_field(BALL, 3), conjugate_field(BALL)),
}


@pytest.mark.parametrize("name", MIXED)
def test_fields_of_two_kinds_are_independent(card, name):
    assert_parity(card, pair_of(*MIXED[name]()), look=replace(FAMILIES, length=15))


# --- even lines ----------------------------------------------------------------------------------


EVEN_LINE_SCENES = {
    **{name: lambda name=name: [ball(4, LINEAR_PARTS[name])] for name in list(LINEAR_PARTS)[:3]},
    **{
        f"free directions, {name}": lambda name=name: [shown(BALL, FREE[name](BALL))]
        for name in ("two", "three", "four", "two lines")
    },
    "the back of a tube": lambda: [with_axis_field(cylinder(64, 16), 3, (0.2, 0.4, 1.0), MIRROR)],
    "several meshes": lambda: grid((1, 4, 3, 4)),
    "triangles that need no bisection": lambda: [ball(surface=icosphere(5))],
}


@pytest.mark.parametrize("name", EVEN_LINE_SCENES)
def test_even_lines(card, name):
    assert_parity(card, EVEN_LINE_SCENES[name](), look=EVEN_LINES)


def test_even_lines_grow_in_perspective(card):
    sheet = with_axis_field(plane(2, 2, 40.0), 2, (0, 1, 0))
    camera = camera_from((0, -18.5, 1.0), fov=1.0)
    assert_parity(card, [sheet], camera, replace(EVEN_LINES, line_distance=4.0))


# --- what is not in the picture ------------------------------------------------------------------

AWAY = [ball(3, shift=shift) for shift in ((90, 0, 0), (0, -90, 40), (0, 90, 90))]


def test_meshes_out_of_view_change_nothing(card):
    pictures = [card_rgba(card, instances) for instances in ([*AWAY, ball()], [ball()])]
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize("instances", [AWAY, [shown(BALL)], []], ids=["away", "occluder", "none"])
def test_the_picture_is_empty_if_there_is_nothing_to_draw(card, instances):
    card_rgba(card, [ball()])
    assert not card_rgba(card, instances).any()


@pytest.mark.parametrize("size", [(1, 1), (3, 200), (200, 3), (257, 129)])
def test_odd_sizes(card, size):
    rgba = card_rgba(card, [ball()], camera=view(size))
    expected = draw(None, [ball()], camera=view(size)).rgba
    assert rgba.shape == expected.shape
    assert ((rgba[..., 3] > 0) != (expected[..., 3] > 0)).mean() < 0.01

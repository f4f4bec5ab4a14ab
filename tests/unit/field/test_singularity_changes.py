"""Change singularities near them: cancel pairs, and bend fields to guides with the same singularities."""

import numpy as np
import pytest
from field_helpers import angle_differences, random_field
from shapes import cylinder, globe, icosphere, plane, rebuilt, torus

from rosy_addon.field import singularity_changes
from rosy_addon.field.convert import Conversion, convert
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.prescribed import TurningError, change_singularities, prescribed_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.singularity_changes import (
    OUTSIDE,
    cancel_pairs,
    cluster_singularities,
    move_index,
    opposite_pairs,
)

#: Many faces meet at its poles, so that they can have large indices.
BALL = globe(32, 64)
POLES = NORTH, SOUTH = 0, len(BALL.vertices) - 1


def turned_by(surface, field, other):
    """(F,) angles in degrees between the nearest members of two fields."""
    return np.degrees(angle_differences(surface, field.vectors, other.vectors, field.degree))


def nearest_vertex(point):
    point = np.array(point) / np.linalg.norm(point)
    return int(np.linalg.norm(BALL.vertices - point, axis=1).argmin())


def pole_field(degree, pairs):
    """A field on the ball with singularities at the poles, and with further pairs."""
    vertex = [*POLES, *(nearest_vertex(point) for pair in pairs for point in pair)]
    return prescribed_field(BALL, degree, vertex, [degree, degree, *([1, -1] * len(pairs))])


def test_near_pairs_are_cancelled_and_nothing_else():
    pairs = [((1, 0, 0), (1, 0.2, 0)), ((0, 1, 0.3), (0, 1, -0.3)), ((0, -1, 0), (-1, 0, 0))]
    field = pole_field(4, pairs)
    assert len(find_singularities(BALL, field)[0]) == 8
    for reach, left in ((0.05, 8), (0.15, 6), (0.4, 4), (1.0, 2)):
        clean = convert(BALL, field, Conversion(pair_distance=reach))
        vertex, _ = find_singularities(BALL, clean)
        assert len(vertex) == left and set(POLES) <= set(vertex)
    assert indices(BALL, clean) == dict.fromkeys(POLES, 4)


def test_far_from_a_pair_nothing_turns():
    field = pole_field(4, [((1, 0, 0), (1, 0.2, 0))])
    turned = turned_by(BALL, field, convert(BALL, field, Conversion(pair_distance=0.15)))
    distance = np.linalg.norm(BALL.face_center - (1, 0.1, 0), axis=1)
    assert turned[distance > 1].max() < 0.5 and turned[distance < 0.1].max() > 20
    assert convert(BALL, field, Conversion(pair_distance=0.01)) is field


def test_magnitudes_and_undefined_faces_stay():
    field = pole_field(2, [((1, 0, 0), (1, 0.2, 0))])
    vectors = field.vectors * np.linspace(1, 3, BALL.face_count)[:, None]
    vectors[BALL.face_center[:, 2] < -0.5] = 0
    clean = convert(BALL, RosyField(2, vectors), Conversion(pair_distance=0.15))
    np.testing.assert_allclose(clean.magnitude, np.linalg.norm(vectors, axis=1), atol=1e-12)
    assert len(find_singularities(BALL, clean)[0]) == 1  # the other pole is undefined


@pytest.mark.parametrize(
    "degree, subdivisions, noise",
    [(2, 4, 0.01), (4, 4, 0.01), (4, 2, 0.35)],
    ids=["2", "4", "coarse"],
)
def test_curvature_is_cleaned(degree, subdivisions, noise):
    """All remaining singularities were there, and their indices have the same sum.

    With large faces, some pairs have to stay.
    """
    surface = icosphere(subdivisions)
    noise = noise * np.random.default_rng(degree).standard_normal((len(surface.vertices), 3))
    surface = rebuilt(surface, surface.vertices * (1, 1.3, 0.7) + noise)
    field = generate(surface, GeneratorSettings("curvature"), degree)
    clean = convert(surface, field, Conversion(pair_distance=0.4 / subdivisions))
    before, left = indices(surface, field), indices(surface, clean)
    assert left.items() <= before.items() and 0 < len(left) < len(before)
    assert sum(left.values()) == sum(before.values()) == 2 * degree


def test_a_singularity_moves_around_a_handle():
    """Its way closes, so the field turns by no more than before around the handle."""
    surface = torus(32, 16)
    field = prescribed_field(surface, 4, [40, 200], [1, -1])
    moved = change_singularities(surface, field, [40, 300], [-1, 1], 0.5)
    assert find_singularities(surface, moved)[0].tolist() == [200, 300]
    back = change_singularities(surface, moved, [40, 300], [1, -1], 0.5)
    assert find_singularities(surface, back)[0].tolist() == [40, 200]


def test_pairs_are_the_nearest_along_edges():
    """On a grid, the length of a path is the sum of its steps."""
    surface, step = plane(20, 20), 0.1
    points = np.array([(2, 2), (2, 5), (4, 5), (10, 10), (15, 12), (15, 15)])
    vertex, index = points @ (21, 1), np.array([1, -1, 1, 1, -1, 1])
    near, far = [1, 2], [4, 5]
    for steps, expected in ((1.9, []), (2, [near]), (3, [near, far]), (30, [near, far])):
        pairs = opposite_pairs(surface, vertex, index, (steps + 0.01) * step)
        assert sorted(pairs.tolist()) == expected


def test_clusters_are_joined_along_edges():
    """A chain of steps of two edges is one cluster. A sum of 0 vanishes, and no sum gets lost."""
    surface, step = plane(20, 20), 0.1
    points = np.array([(2, 2), (2, 4), (4, 4), (10, 10), (10, 12), (15, 15)])
    vertex, index = points @ (21, 1), np.array([1, 1, -3, 1, -1, 2])
    for steps, expected in (
        (1.9, dict(zip(vertex.tolist(), index.tolist(), strict=True))),
        (2, {vertex[1]: -1, vertex[5]: 2}),
        (9, {vertex[1]: -1, vertex[4]: 2}),
        (30, {vertex[3]: 1}),
    ):
        found = cluster_singularities(surface, vertex, index, (steps + 0.01) * step)
        assert dict(zip(*found, strict=True)) == expected


def test_a_pole_that_noise_divides_is_one_cluster():
    """Five of +1/4 around one of -1/4 are a pole of index 1, with the singularity in the middle as its place."""
    around = 0.2 * np.stack([f(2 * np.pi * np.arange(5) / 5) for f in (np.cos, np.sin)], axis=1)
    middle, *ring = (nearest_vertex((1, y, z)) for y, z in ((0, 0), *around))
    field = prescribed_field(BALL, 4, [SOUTH, middle, *ring], [4, -1, *[1] * 5])
    found = find_singularities(BALL, field)
    assert len(found[0]) == 7 and found[1].sum() == 4 * BALL.euler_characteristic
    clusters = cluster_singularities(BALL, *found, 0.4)
    assert dict(zip(*clusters, strict=True)) == {middle: 4, SOUTH: 4}


def test_a_cluster_that_sums_to_zero_is_cancelled():
    """+2/4 between two of -1/4 has no opposite, but the three together have no index."""
    middle, *sides = (nearest_vertex((1, y, 0)) for y in (0, -0.4, 0.4))
    field = prescribed_field(BALL, 4, [*POLES, middle, *sides], [4, 4, 2, -1, -1])
    assert len(find_singularities(BALL, field)[0]) == 5
    assert convert(BALL, field, Conversion(pair_distance=0.05)) is field
    clean = convert(BALL, field, Conversion(pair_distance=0.4))
    assert indices(BALL, clean) == dict.fromkeys(POLES, 4)


@pytest.mark.parametrize("degree", [1, 4])
def test_guides_bend_a_field_with_the_same_singularities(degree):
    """Near the guides the field follows them, and no singularity comes or goes."""
    guides = np.zeros((BALL.face_count, 3))
    directions = {(1, 0, 0): (0, 1, 1), (-1, 0.3, 0): (0, 1, 0.2), (0, 1, 0): (1, 0, 0)}
    for center, direction in directions.items():
        center = np.divide(center, np.linalg.norm(center))
        distance = np.linalg.norm(BALL.face_center - center, axis=1)
        guides[distance < 0.15] = direction
    whole = prescribed_field(BALL, degree, POLES, [degree, degree], guides)
    bent = prescribed_field(BALL, degree, POLES, [degree, degree], guides, 0.02)
    assert indices(BALL, bent) == dict.fromkeys(POLES, degree)
    turned = (turned_by(BALL, RosyField(degree, guides), field) for field in (bent, whole))
    error, error_of_whole = (each[guides.any(axis=1)] for each in turned)
    assert np.median(error) < 3 and error.max() < 10 and error_of_whole.max() > 15


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_a_field_bends_by_several_members(degree):
    """From one end of a tube to the other, guides turn by a whole turn."""
    surface = cylinder(48, 48)
    height = surface.face_center[:, 2]
    angle = 2 * np.pi * (height - height.min()) / np.ptp(height)
    x, y = surface.face_frames
    start = np.arctan2(y[:, 2], x[:, 2])
    guides = np.cos(start + angle)[:, None] * x + np.sin(start + angle)[:, None] * y
    field = prescribed_field(surface, degree, [], [], guides, 0.05 * np.ptp(height))
    assert not len(find_singularities(surface, field)[0])
    inner = np.abs(height - height.mean()) < 0.3 * np.ptp(height)
    assert turned_by(surface, field, RosyField(degree, guides))[inner].max() < 1


# --- by hand ---------------------------------------------------------------------------------

#: Vertices on three parallels of one meridian.
NEAR_NORTH, EQUATOR, NEAR_SOUTH = (1 + row * 64 for row in (4, 15, 27))


def indices(surface, field):
    return dict(zip(*map(np.ndarray.tolist, find_singularities(surface, field)), strict=True))


@pytest.fixture(scope="module")
def field():
    vertex = [NORTH, SOUTH, EQUATOR, NEAR_SOUTH]
    return prescribed_field(BALL, 4, vertex, [4, 4, 1, -1])


@pytest.mark.parametrize(
    "source, target, index, changed",
    [
        (EQUATOR, NEAR_NORTH, 0, {EQUATOR: 0, NEAR_NORTH: 1}),
        (NEAR_SOUTH, SOUTH, 0, {NEAR_SOUTH: 0, SOUTH: 3}),
        (NORTH, NEAR_NORTH, 1, {NORTH: 3, NEAR_NORTH: 1}),
        (NEAR_NORTH, EQUATOR + 6, 1, {NEAR_NORTH: -1, EQUATOR + 6: 1}),
    ],
    ids=["moved", "merged", "split", "pair"],
)
def test_only_the_two_vertices_change(field, source, target, index, changed):
    found = indices(BALL, move_index(BALL, field, source, target, index, 0.3))
    before = dict.fromkeys(changed, 0) | indices(BALL, field)
    assert dict.fromkeys(before, 0) | found == before | changed


def test_a_singularity_leaves_over_a_border():
    tube = cylinder(24, 12)
    field = prescribed_field(tube, 4, [150, 200], [1, 1])
    assert indices(tube, move_index(tube, field, 150, OUTSIDE)) == {200: 1}
    assert indices(tube, move_index(tube, field, OUTSIDE, 100, -1)) == {100: -1, 150: 1, 200: 1}


@pytest.mark.parametrize(
    "source, target, index, message",
    [
        (NORTH, NORTH, 0, "both source and target"),
        (EQUATOR + 1, NORTH, 0, "is not singular"),
        (EQUATOR, OUTSIDE, 0, "this closed surface needs 0/4"),
        (EQUATOR, 10**6, 0, "has no vertex 1000000"),
        (OUTSIDE, NORTH, 0, "is not singular"),
    ],
)
def test_moves_that_cannot_be_are_refused(field, source, target, index, message, error_of):
    assert message in error_of(move_index, BALL, field, source, target, index)


def test_attempts_to_cancel_are_few(monkeypatch):
    """Even if no pair can be cancelled, each attempt leaves out twice as many as the one before."""
    surface, calls = icosphere(3), []
    field = random_field(surface, 2)

    def fail(_surface, _field, vertex, *_):
        calls.append(len(vertex))
        raise TurningError(vertex[:1], "too large")

    monkeypatch.setattr(singularity_changes, "change_singularities", fail)
    assert cancel_pairs(surface, field, 10.0) is field
    assert calls[0] > 100 and len(calls) <= np.log2(calls[0]) + 1, calls

"""Singularities moved by hand: one way, merged, split, in new pairs, and over a border."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import cylinder, globe

from rosy_addon.core.errors import RosyError
from rosy_addon.field.prescribed import prescribed_field
from rosy_addon.field.representation import face_representation
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.singularity_changes import OUTSIDE, move_index

BALL = globe(24, 48)
NORTH, SOUTH = 0, len(BALL.vertices) - 1

#: Vertices on three parallels, all on one meridian.
NEAR_NORTH, EQUATOR, NEAR_SOUTH = 1 + 3 * 48, 1 + 11 * 48, 1 + 20 * 48


def indices(surface, field):
    return dict(zip(*map(np.ndarray.tolist, find_singularities(surface, field)), strict=True))


@pytest.fixture(scope="module")
def field():
    vertex = [NORTH, SOUTH, EQUATOR, NEAR_SOUTH]
    return prescribed_field(BALL, 4, vertex, [4, 4, 1, -1])


@pytest.mark.parametrize(
    "source, target, index, expected",
    [
        (EQUATOR, NEAR_NORTH, 0, {NORTH: 4, NEAR_NORTH: 1, SOUTH: 4, NEAR_SOUTH: -1}),
        (NEAR_SOUTH, SOUTH, 0, {NORTH: 4, EQUATOR: 1, SOUTH: 3}),
        (NORTH, NEAR_NORTH, 1, {NORTH: 3, NEAR_NORTH: 1, EQUATOR: 1, SOUTH: 4, NEAR_SOUTH: -1}),
        (
            NEAR_NORTH,
            EQUATOR + 5,
            1,
            {NORTH: 4, NEAR_NORTH: -1, EQUATOR: 1, EQUATOR + 5: 1, SOUTH: 4, NEAR_SOUTH: -1},
        ),
    ],
    ids=["moved", "merged", "split", "pair"],
)
def test_only_the_two_vertices_change(field, source, target, index, expected):
    assert indices(BALL, move_index(BALL, field, source, target, index, 0.3)) == expected


def test_far_away_nothing_turns(field):
    moved = move_index(BALL, field, EQUATOR, EQUATOR + 2)
    relative = face_representation(BALL, moved) * face_representation(BALL, field).conj()
    turned = np.degrees(np.abs(np.angle(relative))) / 4
    distance = np.linalg.norm(BALL.face_center - BALL.vertices[EQUATOR], axis=1)
    assert turned[distance > 1.5].max() < 1 < 20 < turned[distance < 0.2].max()


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
def test_moves_that_cannot_be_are_refused(field, source, target, index, message):
    with pytest.raises(RosyError, match=message):
        move_index(BALL, field, source, target, index)

"""Ties: edges at which a field turns to either side alike."""

import numpy as np
from command_helpers import facts_of, finished, write_obj
from shapes import plane

from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import count_ties, find_singularities

SURFACE = plane(6, 6)


def turned_field(noise, seed=0):
    """Crosses, of which every second one is turned by 45 degrees and all by random angles up to `noise`."""
    column = np.arange(SURFACE.face_count) // 6
    row = np.arange(SURFACE.face_count) % 6
    random = np.random.default_rng(seed)
    angle = np.radians(45) * ((column * row) % 2)
    angle += noise * random.uniform(-1, 1, SURFACE.face_count)
    return RosyField(4, np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))


def test_rounding_errors_change_no_singularity():
    """Nine of 36 faces are turned, with four edges each; five of them are at the border, where six edges end."""
    expected = [part.tolist() for part in find_singularities(SURFACE, turned_field(0))]
    ties = count_ties(SURFACE, turned_field(0))
    faces = SURFACE.corner_face[SURFACE.edges.halfedges]
    is_turned = (faces // 6 % 2) * (faces % 6 % 2) == 1
    assert ties == np.count_nonzero(is_turned.any(axis=1)) == 30
    for seed in range(5):
        field = turned_field(1e-7, seed)
        assert [part.tolist() for part in find_singularities(SURFACE, field)] == expected
        assert count_ties(SURFACE, field) == ties


def test_a_smaller_turn_is_no_tie():
    assert count_ties(SURFACE, turned_field(1e-2)) == 0


def test_info_counts_ties(tmp_path):
    mesh, out = write_obj(tmp_path / "a.obj", SURFACE.vertices, SURFACE.faces), tmp_path / "a.txt"
    np.savetxt(out, turned_field(0).vectors)
    printed = finished("info", mesh, out, "--degree", 4).stdout
    assert "30 edges where the field turns by 45 degrees" in printed
    assert facts_of(mesh, out, "--degree", 4)["ties"] == 30

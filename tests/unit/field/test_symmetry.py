"""The number of lines and of sheets of a field."""

import pytest

from rosy_addon.field.symmetry import FieldSymmetry


@pytest.mark.parametrize(
    ("degree", "orders", "has_opposites", "line_count", "sheets_per_turn"),
    [
        (1, (), False, 1, 2),
        (2, (), True, 1, 2),
        (3, (), False, 3, 6),
        (4, (), True, 2, 4),
        (4, (0, 2, -2), True, 2, 4),
        (4, (0, 1), False, 4, 4),
        (5, (0, 2), False, 5, 5),
    ],
)
def test_symmetry(degree, orders, has_opposites, line_count, sheets_per_turn):
    symmetry = FieldSymmetry(degree, orders)
    assert symmetry.has_opposites == has_opposites and symmetry.line_count == line_count
    assert symmetry.sheets_per_turn == sheets_per_turn

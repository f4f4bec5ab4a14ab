"""Labels beside dots cover nothing."""

from __future__ import annotations

import numpy as np

from rosy_addon.annotation.index_labels import place_labels


def test_a_label_is_above_and_to_the_right_of_its_dot():
    assert place_labels([(10, 20)], [(30, 12)], 5, (90, 90)).tolist() == [[15, 25]]


def test_labels_cover_neither_each_other_nor_dots():
    random = np.random.default_rng(1)
    dots, sizes = random.uniform(0, 400, (120, 2)), random.uniform((20, 10), (30, 12), (120, 2))
    corners = place_labels(dots, sizes, 4, (400, 400))
    has_place = ~np.isnan(corners[:, 0])
    assert 40 < has_place.sum() < 120
    low, high = corners[has_place], (corners + sizes)[has_place]
    assert low.min() >= 0 and high.max() <= 400
    overlaps = ((low[:, None] < high) & (high[:, None] > low)).all(axis=2)
    assert overlaps.sum() == len(low)
    assert not ((dots[:, None] + 4 > low) & (dots[:, None] - 4 < high)).all(axis=2).any()

"""Statistics of streaks in a sample of noise."""

from __future__ import annotations

import pytest

from rosy_addon.compositor.streak_statistics import (
    MAX_SAMPLE_GRAIN,
    StreakSettings,
    streak_statistics,
)


@pytest.mark.parametrize("factor", [0.5, 8.0, 200.0])
def test_statistics_do_not_depend_on_the_scale(factor):
    def stds(grain):
        settings = StreakSettings(
            length=20 * grain, grain=grain, density=0.1, high_pass=8 * grain, crispness=0.5
        )
        statistics = streak_statistics(settings)
        return statistics.std, statistics.disc_std, statistics.break_std

    assert stds(factor * MAX_SAMPLE_GRAIN) == pytest.approx(stds(MAX_SAMPLE_GRAIN), rel=0.05)

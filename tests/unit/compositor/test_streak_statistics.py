"""Statistics of streaks in a sample of noise."""

from dataclasses import replace

import pytest

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.streak_statistics import MAX_SAMPLE_WIDTH, look_streak_statistics


@pytest.mark.parametrize("factor", [0.5, 8.0, 200.0])
def test_statistics_do_not_depend_on_the_scale(factor):
    def stds(line_width):
        look = pixel_look(Look(density=0.1, crispness=0.5, line_width=1.0, length=10, high_pass=8))
        length = round(line_width * look.length)
        statistics = look_streak_statistics(replace(look, scale=line_width, length=length))
        return statistics.std, statistics.disc_std, statistics.break_std

    assert stds(factor * MAX_SAMPLE_WIDTH) == pytest.approx(stds(MAX_SAMPLE_WIDTH), rel=0.05)

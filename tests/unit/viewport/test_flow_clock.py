"""The clock of streaks that drift in live views."""

import pytest

from rosy_addon.viewport.flow_clock import MAX_FRAMES_PER_PICTURE, FlowClock


def test_it_counts_frames_only_while_it_runs():
    clock = FlowClock()
    assert not clock.advance(10.0, 24.0) and clock.frames == 0.0
    clock.play(20.0)
    assert clock.advance(20.05, 24.0) and clock.frames == pytest.approx(0.05 * 24)
    clock.pause()
    assert not clock.advance(30.0, 24.0)
    clock.play(40.0)
    clock.advance(40.05, 24.0)
    assert clock.frames == pytest.approx(0.1 * 24)


def test_it_does_not_jump():
    """Pictures that take long show the next streaks; skipped time has no frames."""
    clock = FlowClock()
    clock.play(0.0)
    clock.advance(5.0, 24.0)
    assert clock.frames == MAX_FRAMES_PER_PICTURE
    clock.play(6.0)
    assert not clock.advance(6.0, 24.0)

"""The clock by which streaks drift in live views, in addition to Blender's timeline.

It is not saved: it starts and ends with the session of the live views.
"""

from __future__ import annotations

#: Frames that pass between two pictures, at most. If pictures take longer, streaks drift more slowly:
#: from one picture to the next they would have gone too far to be followed.
MAX_FRAMES_PER_PICTURE = 2.0


class FlowClock:
    """A clock that counts frames in real time while it runs.

    Attributes
    ----------
    is_playing : bool
    frames : float
        Frames that have passed since the start, without those in which the clock stood still.
    """

    def __init__(self) -> None:
        self.is_playing = False
        self.frames = 0.0
        #: Seconds: when the frames were counted last.
        self._time = 0.0

    def play(self, now: float) -> None:
        """Run from now on, in seconds of a monotonic clock."""
        self.is_playing, self._time = True, now

    def pause(self) -> None:
        """Stop. The frames are kept."""
        self.is_playing = False

    def skip(self, now: float) -> None:
        """Let the time until now pass without frames."""
        self._time = now

    def advance(self, now: float, rate: float) -> bool:
        """Count the frames until now, at a rate in frames per second. Return whether there are any."""
        passed = min((now - self._time) * rate, MAX_FRAMES_PER_PICTURE)
        if not self.is_playing or passed <= 0:
            return False
        self.frames += passed
        self._time = now
        return True

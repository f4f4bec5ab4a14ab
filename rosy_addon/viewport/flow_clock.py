"""The clock by which streaks drift in live views, in addition to Blender's timeline.

It is not saved: it starts and ends with the session of the live views.
"""

#: Largest number of frames that pass between two pictures. If pictures take longer, the clock slows down:
#: otherwise the eye could not follow the streaks from one picture to the next.
MAX_FRAMES_PER_PICTURE = 2.0


class FlowClock:
    """A clock that counts frames in real time while it runs.

    Attributes
    ----------
    is_playing : bool
    frames : float
        Number of frames that have passed while the clock was running.
    """

    def __init__(self) -> None:
        self.is_playing = False
        self.frames = 0.0
        #: When the frames were counted last, in seconds of a monotonic clock.
        self._time = 0.0

    def play(self, now: float) -> None:
        """Start the clock, or let it count on from now.

        `now` is the current time, in seconds of a monotonic clock. Frames before it that have not been counted
        are left out.
        """
        self.is_playing, self._time = True, now

    def pause(self) -> None:
        """Stop the clock. The number of frames is kept."""
        self.is_playing = False

    def advance(self, now: float, rate: float) -> bool:
        """Count the frames until now, at a rate in frames per second. Return whether time has passed."""
        passed = min((now - self._time) * rate, MAX_FRAMES_PER_PICTURE)
        if not self.is_playing or passed <= 0:
            return False
        self.frames += passed
        self._time = now
        return True

"""Previews and final pictures of views, within a time budget."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from ..compositor.look_units import preview_look
from ..core.errors import RosyError, error_text
from ..gpu.preparation import prepare_steps
from ..rendering.renderer import ViewportRenderer
from ..rendering.view_input import ViewInput
from ..worker.helper import Helper
from ..worker.job import Step, Steps
from ..worker.step_runner import StepRunner

#: Time in seconds that a picture may take that is rendered within one redraw, and that one time slice of the
#: work on any other picture takes.
FRAME_BUDGET_SECONDS, SLICE_SECONDS = 0.06, 0.08

#: Seconds of work in one time slice for a picture in which only streaks have drifted. It is longer, because
#: redraws between slices would slow the streaks down.
DRIFT_SLICE_SECONDS = 0.25

#: Seconds without a change after which a view is at rest.
IDLE_SECONDS = 0.12

#: Seconds without a redraw after which the refinement of a view is abandoned.
ABANDON_SECONDS = 1.0

#: Cost of a preview relative to the final picture. Its width, its height and its streaks are half as long.
PREVIEW_COST_RATIO = 0.2

#: Minimum size of a picture in estimates of the cost, in megapixels. The cost of smaller pictures is
#: not proportional to their size.
_MIN_MEGAPIXELS = 0.02


class Request(NamedTuple):
    """A request for a picture of a view.

    Attributes
    ----------
    key : hashable
        Key of everything that the picture depends on. It changes whenever the picture would change.
    still_key : hashable
        Key of everything but the drift of the streaks: it is equal for pictures in which only the streaks
        have drifted.
    view_input : ViewInput
        Input of the picture. Its camera has the size of the region.
    lookups : sequence of callable
        Functions that look up data that must be prepared besides the meshes; see `prepare_steps`.
    """

    key: Hashable
    still_key: Hashable
    view_input: ViewInput
    lookups: Sequence[Callable[[], Any]] = ()


@dataclass(eq=False)
class Work:
    """A picture of a view, or its preparation, on which the renderer works from redraw to redraw.

    Attributes
    ----------
    view : ViewState
    request : Request
    runner : StepRunner
    is_at_once : bool
        Whether all work of Blender's process is done in one redraw, not in time slices.
    downscale : int
        Width of a pixel of the picture, in pixels of the view.
    buffer : int
        For a final picture, which of the two images of the view it is rendered into.
    seconds : float
        Seconds of work so far, without the work of the helper process.
    time : float
        When it was worked on last, in seconds of a monotonic clock.
    texture : texture or None
        The finished picture. None if no field is visible.
    """

    view: ViewState
    request: Request
    runner: StepRunner
    is_at_once: bool
    downscale: int = 1
    buffer: int = 0
    seconds: float = 0.0
    time: float = 0.0
    texture: Any = None


@dataclass(eq=False)
class ViewState:
    """The picture that one region of a 3D view shows, and the work on its next picture.

    Attributes
    ----------
    shown : Work or None
        The picture that is shown. None if there is no picture yet.
    items : list
        Draw items of the meshes that are prepared.
    requested : Request or None
        The request that was made last.
    requested_time : float
        When a request with its still key was made first, in seconds of a monotonic clock.
    picture : Work or None
        The picture that is being rendered.
    progress : Step or None
        The step that is done next. Only set while there is no picture yet.
    failed : (hashable, str) or None
        The still key of a picture that could not be rendered, and the reason.
    """

    shown: Work | None = None
    items: list[Any] = field(default_factory=list)
    requested: Request | None = None
    requested_time: float = 0.0
    picture: Work | None = None
    progress: Step | None = None
    failed: tuple[Hashable, str] | None = None

    @property
    def texture(self) -> Any:
        """The texture of the picture that is shown. None if there is none, or no field is visible."""
        return None if self.shown is None else self.shown.texture

    @property
    def is_rendering(self) -> bool:
        """Whether a picture is being rendered.

        A picture does not count if it has not been worked on for `ABANDON_SECONDS` and does not wait for the
        helper process: then its view is no longer on screen.
        """
        picture = self.picture
        return picture is not None and (
            not picture.runner.poll() or time.monotonic() < picture.time + ABANDON_SECONDS
        )

    def stop_rendering(self) -> None:
        """Abandon the picture that is being rendered."""
        if self.picture is not None:
            self.picture.runner.close()
        self.picture = self.progress = None


class ProgressiveRenderer:
    """The pictures of all live views, which it keeps up to date within the time budget of a redraw.

    Before a picture is rendered, its shaders are compiled and its meshes prepared and uploaded. Until
    the first picture of a view this is done in steps, so that the view can name each step before it
    begins. A picture that fits into the budget is rendered within one redraw. Otherwise a preview is
    rendered while the view changes, and the final picture is rendered in slices of time once the view is at
    rest. A picture that could not be rendered is not tried again.

    A helper process makes the calls of numeric functions; meanwhile the views show their last pictures. If
    the view changes in the meantime, a final picture is abandoned. A preview that was begun is finished and
    shown, although it is outdated, and a preparation is finished.

    If only streaks drift, no previews are rendered, because they would flicker between the final pictures.
    The final pictures are rendered one after the other, and none is abandoned.

    Parameters
    ----------
    renderer : ViewportRenderer
    helper : Helper
        The helper process. The caller closes it.
    schedule_redraw : callable
        Called with a number of seconds, after which the views must be redrawn.
    schedule_poll : callable
        Called when the helper process has begun to work. From then on `poll` must be called repeatedly
        until it returns True. Then the views must be redrawn.

    Attributes
    ----------
    views : dict of (int, int) to ViewState
        The state of each view, by the pointers of its space and its region.
    is_prepared : bool
        Whether the shaders are compiled, and the meshes of a first picture uploaded.
    """

    def __init__(
        self,
        renderer: ViewportRenderer,
        helper: Helper,
        schedule_redraw: Callable[[float], None],
        schedule_poll: Callable[[], None],
    ) -> None:
        self.renderer = renderer
        self.views: dict[tuple[int, int], ViewState] = {}
        self.is_prepared = False
        self._helper = helper
        self._schedule_redraw, self._schedule_poll = schedule_redraw, schedule_poll
        #: The preparation that is in work, or None. Pictures wait until it is done.
        self._preparation: Work | None = None
        #: A view that waits for the picture of another view, and the time when it began to wait, in seconds.
        self._waiting_view: ViewState | None = None
        self._waiting_time = 0.0
        #: Estimated cost of a final picture; 0 until a picture has been measured.
        self._seconds_per_megapixel = 0.0

    @property
    def is_rendering(self) -> bool:
        """Whether the picture of any view is being rendered."""
        return any(view.is_rendering for view in self.views.values())

    def poll(self) -> bool:
        """Ask the helper process how far it is, and return whether the views must be redrawn.

        They must be redrawn if a result has arrived, if no work waits for the helper process any more, or if
        the helper process has begun a call with another label than a view shows.
        """
        works = [self._preparation, *(view.picture for view in self.views.values())]
        waiting = [work for work in works if work is not None and not work.runner.poll()]
        if not waiting or any(work is not None and work.runner.has_answer for work in works):
            return True
        labels = [work.runner.step.label for work in waiting if work.runner.step is not None]
        return any(
            view.progress is not None and view.progress.label not in labels
            for view in self.views.values()
        )

    def remove_space(self, space_pointer: int) -> None:
        """Drop the pictures of all regions of one 3D view, given its pointer."""
        for key in [key for key in self.views if key[0] == space_pointer]:
            self.views.pop(key).stop_rendering()

    def release(self) -> None:
        """Stop all work, and free the pictures and the resources of the renderer."""
        for view in self.views.values():
            view.stop_rendering()
        self.views.clear()
        if self._preparation is not None:
            self._preparation.runner.close()
            self._preparation = None
        self.renderer.release()

    def update(self, view_pointers: tuple[int, int], request: Request) -> ViewState:
        """Bring the picture of a view up to date, as far as the time budget allows, and return its state.

        Parameters
        ----------
        view_pointers : (int, int)
            Pointers of the space and the region.
        request : Request

        Raises
        ------
        Exception
            If this picture cannot be rendered. Later calls for it raise a RosyError with the same message.
        """
        view = self.views.setdefault(view_pointers, ViewState())
        if view.requested is None or view.requested.still_key != request.still_key:
            view.requested_time = time.monotonic()
        view.requested = request
        if view.failed is not None and view.failed[0] == request.still_key:
            raise RosyError(view.failed[1])
        view.failed = None
        try:
            prepared = self._prepared(view, request)
            if prepared is not None:
                self._update_picture(view, prepared)
        except Exception as error:
            view.failed = request.still_key, error_text(error)
            view.stop_rendering()
            view.shown = None
            raise
        return view

    def _prepared(self, view: ViewState, request: Request) -> Request | None:
        """Continue the preparation of a picture. Return the prepared request, or None if it is not done.

        If the view has changed in the meantime, an older request of it is returned: meshes may change
        faster than they are prepared.
        """
        while True:
            work = self._preparation
            if work is None:
                runner = StepRunner(self._preparation_steps(request), self._helper)
                work = self._preparation = Work(view, request, runner, view.texture is not None)
            try:
                if self._continue(view, work, SLICE_SECONDS) is None:
                    return None
                self.is_prepared = True
            except Exception:
                if work.view is view:  # otherwise the other view will raise the error
                    raise
            finally:
                if work.runner.is_done:
                    self._preparation = None
            if work.view is view:
                return work.request

    def _preparation_steps(self, request: Request) -> Steps[None]:
        """Compile the shaders of a picture, prepare its meshes, and look up its other data."""
        view_input = request.view_input
        yield from self.renderer.prepare_steps(view_input.instances, view_input.look.display)
        yield from prepare_steps(request.lookups)

    def _update_picture(self, view: ViewState, request: Request) -> None:
        """Bring the picture of a view up to date. Its meshes must have been prepared."""
        view_input = request.view_input
        preview_downscale, full_downscale = self.renderer.downscale_factors
        view.items = self.renderer.upload(view_input.instances, view_input.look.display)
        shown, shows_final = view.shown, self._shows_final(view)
        if shows_final and shown.request.key == request.key:
            return
        picture = view.picture
        if picture is not None:
            is_outdated = picture.request.still_key != request.still_key
            # The first picture is completed even if the view has changed: its cost must be known.
            if picture.is_at_once or view.texture is None or not is_outdated:
                self._render(view)
                return
            view.stop_rendering()
        seconds = self._seconds_per_megapixel * self._megapixels(view, request)
        is_at_rest = time.monotonic() - view.requested_time >= IDLE_SECONDS
        if not self._seconds_per_megapixel:
            self._start(view, request, full_downscale)
        elif seconds <= FRAME_BUDGET_SECONDS:
            self._start(view, request, full_downscale, is_at_once=True)
        elif shown is None or shown.request.still_key != request.still_key:
            self._start(view, request, preview_downscale, is_at_once=True)
            self._schedule_redraw(IDLE_SECONDS)
        elif not shows_final and not is_at_rest:
            self._schedule_redraw(IDLE_SECONDS)
        else:
            self._start(view, request, full_downscale)

    def _megapixels(self, view: ViewState, request: Request) -> float:
        """Return the number of samples of the final picture that surfaces may cover, in millions."""
        pixels = self.renderer.covered_pixels(view.items, request.view_input.camera)
        samples = request.view_input.look.supersampling**2
        return pixels * samples / (1e6 * self.renderer.downscale_factors[1] ** 2)

    def _start(
        self, view: ViewState, request: Request, downscale: int, *, is_at_once: bool = False
    ) -> None:
        """Begin a picture of a view, or schedule a redraw if another view goes first.

        Pictures are rendered one at a time, because they share the renderer's images. Pictures that are
        rendered within one redraw (`is_at_once`) go before others, which are rendered in slices of time.
        `downscale` is the width of a pixel of the picture, in pixels of the view.
        """
        others = [other for other in self.views.values() if other is not view]
        for other in others:
            if other.is_rendering and (other.picture.is_at_once or not is_at_once):
                self._schedule(other.picture)
                if not is_at_once:
                    self._waiting_view, self._waiting_time = view, time.monotonic()
                return
        if not is_at_once:
            if self._must_wait(view):
                self._schedule_redraw(0.0)
                return
            self._waiting_view = None
        for other in others:
            other.stop_rendering()
        is_final = downscale == self.renderer.downscale_factors[1]
        buffer = 0 if view.shown is None else view.shown.buffer
        if self._shows_final(view) and not is_at_once:
            buffer = 1 - buffer  # the final picture that is shown must not be overwritten
        view_input = downscaled(request.view_input, downscale)
        target = id(view), downscale, buffer if is_final else 0
        steps = self.renderer.texture_steps(view.items, view_input, target)
        runner = StepRunner(steps, self._helper)
        view.picture = Work(view, request, runner, is_at_once, downscale, buffer)
        self._render(view)

    def _shows_final(self, view: ViewState) -> bool:
        """Return whether a view shows a final picture, which may be outdated."""
        return view.shown is not None and view.shown.downscale == self.renderer.downscale_factors[1]

    def _must_wait(self, view: ViewState) -> bool:
        """Return whether a view must wait, because another view is already waiting to be rendered."""
        return (
            self._waiting_view in self.views.values()
            and self._waiting_view is not view
            and time.monotonic() < self._waiting_time + ABANDON_SECONDS
        )

    def _render(self, view: ViewState) -> None:
        """Continue the picture of a view, and show it once it is done."""
        picture, full_downscale = view.picture, self.renderer.downscale_factors[1]
        seconds = DRIFT_SLICE_SECONDS if self._shows_final(view) else SLICE_SECONDS
        end = self._continue(view, picture, seconds)
        if end is None:
            return
        if picture.is_at_once or not self._seconds_per_megapixel:
            ratio = 1.0 if picture.downscale == full_downscale else PREVIEW_COST_RATIO
            megapixels = ratio * self._megapixels(view, picture.request)
            self._update_estimate(picture.seconds + picture.runner.helper_seconds, megapixels)
        picture.texture = end.value
        view.shown, view.picture = picture, None
        if picture.request.key != view.requested.key:
            self._schedule_redraw(0.0)

    def _update_estimate(self, seconds: float, megapixels: float) -> None:
        """Update the estimated cost of pictures, given the time and the size of a finished picture."""
        # The minimum keeps the cost of single compilations and uploads out of the estimate.
        cost = seconds / max(megapixels, _MIN_MEGAPIXELS)
        old_cost = self._seconds_per_megapixel or cost
        self._seconds_per_megapixel = min(cost, 0.5 * (old_cost + cost))

    def _continue(self, view: ViewState, work: Work, seconds: float) -> StopIteration | None:
        """Continue work for a view. Return the StopIteration with its result if it is done, otherwise None.

        Work that must be done at once goes on until it is done. Other work stops after `seconds`, or
        before a step whose label the view has not shown yet. Both stop when the helper process has to make
        a call.
        """
        start_time = time.monotonic()
        try:
            while work.runner.poll():
                step = work.runner.advance()
                if work.is_at_once:
                    continue
                self.renderer.finish()
                if view.texture is None:
                    is_named = view.progress is not None and view.progress.label == step.label
                    view.progress = step
                    if not is_named:
                        break
                if time.monotonic() - start_time >= seconds:
                    break
        except StopIteration as end:
            if work is not self._preparation:
                self.renderer.finish()
            view.progress = None
            return end
        finally:
            work.time = time.monotonic()
            work.seconds += work.time - start_time
        if view.texture is None:
            view.progress = work.runner.step
        self._schedule(work)
        return None

    def _schedule(self, work: Work) -> None:
        """Schedule a redraw of the views for the time when work can go on."""
        if work.runner.poll():
            self._schedule_redraw(0.0)
        else:
            self._schedule_poll()


def downscaled(view_input: ViewInput, downscale: int) -> ViewInput:
    """Return the input of a smaller picture whose streaks have about the same size in the view.

    Parameters
    ----------
    view_input : ViewInput
    downscale : int
        Width of a pixel of the picture, in pixels of the view.
    """
    if downscale == 1:
        return view_input
    camera = view_input.camera
    width, height = camera.width // downscale, camera.height // downscale
    return replace(
        view_input,
        camera=camera.resized(max(width, 1), max(height, 1)),
        look=preview_look(view_input.look, downscale),
    )

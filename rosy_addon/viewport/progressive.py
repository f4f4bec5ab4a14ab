"""Previews and final pictures of views, within a time budget."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from ..compositor.look_units import preview_look
from ..errors import RosyError, error_text
from ..progress import Progress, Task, run_to_completion
from ..rendering.renderer import ViewportRenderer
from ..rendering.view_input import ViewInput

#: Seconds that a redraw may take to render a picture at once, and seconds of one slice of refinement.
FRAME_BUDGET_SECONDS, SLICE_SECONDS = 0.06, 0.08

#: Seconds of one slice of a picture in which only streaks have drifted: redraws between slices would
#: slow the streaks down.
DRIFT_SLICE_SECONDS = 0.25

#: Seconds without a change after which a view is at rest.
IDLE_SECONDS = 0.12

#: Seconds without a redraw after which the refinement of a view is abandoned.
ABANDON_SECONDS = 1.0

#: Cost of a preview relative to the final picture: half the size each way, streaks half as long.
PREVIEW_COST_RATIO = 0.2

#: Minimum size of a picture in estimates of the cost, in megapixels. The cost of smaller pictures is
#: not proportional to their size.
_MIN_MEGAPIXELS = 0.02


@dataclass(eq=False)
class ViewState:
    """The picture of one region of a 3D view, and the work on its next one.

    A key identifies everything that a picture depends on. A still key leaves out how far streaks have
    drifted.

    Attributes
    ----------
    texture : texture or None
        The picture that is shown; None also if no field is visible.
    texture_key : hashable
        The key of the picture that is shown.
    texture_still_key : hashable
        Its still key.
    downscale : int
        View pixels per picture pixel, each way, of the picture that is shown.
    buffer : int
        Which of the two images for final pictures is shown, or was shown last.
    requested_key, requested_still_key : hashable
        The keys of the picture that was requested last.
    requested_time : float
        Seconds, monotonic: when its still key was requested first.
    items : list
        Draw items of the picture that is shown.
    task : generator or None
        The final picture, being rendered.
    task_key, task_still_key : hashable
        The keys of the picture that is being rendered.
    task_buffer : int
        Its image.
    task_time : float
        Seconds, monotonic: when it was worked on last.
    task_seconds : float
        Seconds of work on it so far.
    progress : Progress or None
        The next step, while there is no picture yet.
    error : str or None
        Why the picture of `error_key` could not be rendered.
    error_key : hashable
        Its still key.
    """

    texture: Any = None
    texture_key: Hashable = None
    texture_still_key: Hashable = None
    downscale: int = 1
    buffer: int = 0
    requested_key: Hashable = None
    requested_still_key: Hashable = None
    requested_time: float = 0.0
    items: list[Any] = field(default_factory=list)
    task: Task[Any] | None = None
    task_key: Hashable = None
    task_still_key: Hashable = None
    task_buffer: int = 0
    task_time: float = 0.0
    task_seconds: float = 0.0
    progress: Progress | None = None
    error: str | None = None
    error_key: Hashable = None

    @property
    def is_rendering(self) -> bool:
        """Whether a picture is being rendered. Views that left the screen have stopped."""
        return self.task is not None and time.monotonic() < self.task_time + ABANDON_SECONDS


class ProgressiveRenderer:
    """Keeps the pictures of views up to date, as far as the time budget of a redraw allows.

    The first picture of a session is prepared and rendered in steps, so that the view can name each
    step before it begins. After that, a picture that fits into the budget is rendered at once.
    Otherwise a preview is rendered while the view changes, and the final picture in slices of time
    once it is at rest. A picture that could not be rendered is not tried again.

    If only streaks drift, there are no previews, which would flicker between the final pictures. These
    are rendered one after the other, and none is abandoned for the next one.

    Parameters
    ----------
    renderer : ViewportRenderer
    schedule_redraw : callable
        Called with a number of seconds, after which the views must be redrawn.

    Attributes
    ----------
    views : dict of (int, int) to ViewState
        By the pointers of space and region.
    """

    def __init__(
        self, renderer: ViewportRenderer, schedule_redraw: Callable[[float], None]
    ) -> None:
        self.renderer = renderer
        self.views: dict[tuple[int, int], ViewState] = {}
        self._schedule_redraw = schedule_redraw
        #: What must be done before the first picture; None if it is done, or not begun.
        self._preparation: Task[None] | None = None
        self._is_prepared = False
        #: The view whose final picture is being rendered.
        self._refining_view: ViewState | None = None
        #: A view that waits until that of another view is done, and since when (seconds, monotonic).
        self._waiting_view: ViewState | None = None
        self._waiting_time = 0.0
        #: Estimated cost of a final picture; 0 until one is known.
        self._seconds_per_megapixel = 0.0

    @property
    def is_prepared(self) -> bool:
        """Whether the shaders are compiled and the meshes uploaded."""
        return self._is_prepared

    @property
    def is_rendering(self) -> bool:
        """Whether the picture of a view is being rendered."""
        return any(view.is_rendering for view in self.views.values())

    def remove_space(self, space_pointer: int) -> None:
        """Drop the pictures of one 3D view."""
        for key in [key for key in self.views if key[0] == space_pointer]:
            del self.views[key]

    def release(self) -> None:
        """Free all resources."""
        self.views.clear()
        self._preparation = None
        self.renderer.release()

    def update(
        self,
        view_pointers: tuple[int, int],
        requested_key: Hashable,
        view_input: ViewInput,
        still_key: Hashable = None,
    ) -> ViewState:
        """Bring the picture of a view up to date, as far as there is time for it.

        Parameters
        ----------
        view_pointers : (int, int)
            Of space and region.
        requested_key : hashable
            Changes whenever the picture would change.
        view_input : ViewInput
            Its camera has the size of the region.
        still_key : hashable, optional
            The key without how far streaks have drifted.

        Raises
        ------
        Exception
            If this picture cannot be rendered. In later calls, a RosyError with the same message.
        """
        view = self.views.setdefault(view_pointers, ViewState())
        still_key = requested_key if still_key is None else still_key
        view.requested_key = requested_key
        if still_key != view.requested_still_key:
            view.requested_still_key, view.requested_time = still_key, time.monotonic()
        if view.error is not None and view.error_key == still_key:
            raise RosyError(view.error)
        view.error = None
        try:
            if self._is_prepared or self._prepare(view, view_input):
                view.items = self.renderer.upload(view_input.instances, view_input.look.display)
                self._update_picture(view, view_input)
        except Exception as error:
            view.error, view.error_key = error_text(error), still_key
            view.task = view.progress = view.texture = None
            view.texture_key = view.texture_still_key = None
            raise
        return view

    def _prepare(self, view: ViewState, view_input: ViewInput) -> bool:
        """Continue to prepare the first picture for one step. Return whether it is prepared."""
        if self._preparation is None:
            self._preparation = self.renderer.prepare_task(
                view_input.instances, view_input.look.display
            )
        try:
            view.progress = next(self._preparation)
        except StopIteration:
            self._preparation, self._is_prepared, view.progress = None, True, None
            return True
        except Exception:
            self._preparation = None
            raise
        self._schedule_redraw(0.0)
        return False

    def _update_picture(self, view: ViewState, view_input: ViewInput) -> None:
        """Bring the picture of a view up to date, with its items uploaded."""
        preview_downscale, full_downscale = self.renderer.downscale_factors
        if view.texture_key == view.requested_key and view.downscale == full_downscale:
            return
        items = view.items
        megapixels = (
            self.renderer.covered_pixels(items, view_input.camera)
            * view_input.look.supersampling**2
            / (1e6 * full_downscale**2)
        )

        def render_at(downscale: int, buffer: int) -> Task[Any]:
            return self.renderer.render_texture_task(
                items, downscaled(view_input, downscale), (id(view), downscale, buffer)
            )

        is_first = not self._seconds_per_megapixel
        if is_first:
            self._refine(view, partial(render_at, full_downscale), megapixels)
        elif self._seconds_per_megapixel * megapixels <= FRAME_BUDGET_SECONDS:
            self._render_now(
                view, render_at(full_downscale, view.buffer), full_downscale, megapixels
            )
        elif view.texture_still_key != view.requested_still_key:
            self._render_now(
                view,
                render_at(preview_downscale, 0),
                preview_downscale,
                megapixels * PREVIEW_COST_RATIO,
            )
            self._schedule_redraw(IDLE_SECONDS)
        elif (
            view.downscale != full_downscale
            and time.monotonic() - view.requested_time < IDLE_SECONDS
        ):
            self._schedule_redraw(IDLE_SECONDS)
        else:
            self._refine(view, partial(render_at, full_downscale), megapixels)

    def _render_now(
        self, view: ViewState, task: Task[Any], downscale: int, megapixels: float
    ) -> None:
        """Render a picture at once, and update the estimate of the cost."""
        self._refining_view = None
        start_time = time.monotonic()
        view.texture = run_to_completion(task)
        self.renderer.finish()
        self._update_estimate(time.monotonic() - start_time, megapixels)
        view.texture_key, view.downscale = view.requested_key, downscale
        view.texture_still_key = view.requested_still_key
        view.task = view.progress = None

    def _update_estimate(self, seconds: float, megapixels: float) -> None:
        """Update the estimate of the cost after a picture."""
        # The minimum keeps the cost of single compilations and uploads out of the estimate.
        cost = seconds / max(megapixels, _MIN_MEGAPIXELS)
        self._seconds_per_megapixel = (
            cost
            if not self._seconds_per_megapixel
            else min(cost, 0.5 * (self._seconds_per_megapixel + cost))
        )

    def _refine(
        self, view: ViewState, start_task: Callable[[int], Task[Any]], megapixels: float
    ) -> None:
        """Continue the final picture of a view, in one of its two images, for one slice of time.

        The first picture is completed even if the view has changed: its cost must be known.
        """
        other, full_downscale = self._refining_view, self.renderer.downscale_factors[1]
        shows_final = view.texture is not None and view.downscale == full_downscale
        if other in self.views.values() and other is not view and other.is_rendering:
            self._schedule_redraw(0.0)  # one at a time: they share the renderer's images
            self._waiting_view, self._waiting_time = view, time.monotonic()
            return
        is_outdated = view.task_still_key != view.requested_still_key and view.texture is not None
        if other is not view or view.task is None or is_outdated:
            if self._must_wait(view):
                self._schedule_redraw(0.0)
                return
            # The picture that is shown stays as it is.
            view.task_buffer = 1 - view.buffer if shows_final else view.buffer
            view.task, view.task_seconds = start_task(view.task_buffer), 0.0
            view.task_key, view.task_still_key = view.requested_key, view.requested_still_key
            self._refining_view, self._waiting_view = view, None
        start_time = time.monotonic()
        try:
            seconds = DRIFT_SLICE_SECONDS if shows_final else SLICE_SECONDS
            self._run_slice(view, start_time + seconds)
        except StopIteration as done:
            if not self._seconds_per_megapixel:
                total_seconds = view.task_seconds + time.monotonic() - start_time
                self._update_estimate(total_seconds, megapixels)
            view.texture, view.texture_key = done.value, view.task_key
            view.texture_still_key, view.buffer = view.task_still_key, view.task_buffer
            view.downscale = full_downscale
            view.task = view.progress = self._refining_view = None
            if view.texture_key != view.requested_key:
                self._schedule_redraw(0.0)
            return
        view.task_time = time.monotonic()
        view.task_seconds += view.task_time - start_time
        self._schedule_redraw(0.0)

    def _must_wait(self, view: ViewState) -> bool:
        """Whether another view has waited for the picture of this one, whose turn it then is."""
        return (
            self._waiting_view in self.views.values()
            and self._waiting_view is not view
            and time.monotonic() < self._waiting_time + ABANDON_SECONDS
        )

    def _run_slice(self, view: ViewState, deadline: float) -> None:
        """Continue the task of a view until a deadline, or a step that the view has not named yet.

        Raises
        ------
        StopIteration
            If the task is done.
        """
        while time.monotonic() < deadline:
            progress = next(view.task)
            self.renderer.finish()
            if view.texture is None:
                named = view.progress is not None and view.progress.label == progress.label
                view.progress = progress
                if not named:
                    return


def downscaled(view_input: ViewInput, downscale: int) -> ViewInput:
    """Return the input of a smaller picture with streaks of about the same size on the view.

    Parameters
    ----------
    view_input : ViewInput
    downscale : int
        View pixels per picture pixel, each way.
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

"""Previews and final pictures of views, within a time budget."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import Any

from ..compositor.look_units import preview_look
from ..progress import Task, run_to_completion
from ..render.renderer import ViewportRenderer
from ..render.view_input import ViewInput

#: Seconds that a redraw may take to render a picture at once, and seconds of one slice of refinement.
FRAME_BUDGET_SECONDS, SLICE_SECONDS = 0.06, 0.08

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

    A key identifies everything that a picture depends on.

    Attributes
    ----------
    texture : texture or None
        The picture that is shown; None also if no field is visible.
    texture_key : hashable
        The key of the picture that is shown.
    downscale : int
        View pixels per picture pixel, each way, of the picture that is shown.
    requested_key : hashable
        The key of the picture that was requested last.
    requested_time : float
        Seconds, monotonic: when it was requested first.
    task : generator or None
        The final picture, being rendered.
    task_key : hashable
        The key of the picture that is being rendered.
    task_time : float
        Seconds, monotonic: when it was worked on last.
    """

    texture: Any = None
    texture_key: Hashable = None
    downscale: int = 1
    requested_key: Hashable = None
    requested_time: float = 0.0
    task: Task[Any] | None = None
    task_key: Hashable = None
    task_time: float = 0.0

    @property
    def is_rendering(self) -> bool:
        """Whether the requested picture is being rendered. Views that left the screen have stopped."""
        return (
            self.task_key == self.requested_key
            and time.monotonic() < self.task_time + ABANDON_SECONDS
        )


class ProgressiveRenderer:
    """Keeps the pictures of views up to date, as far as the time budget of a redraw allows.

    A picture that fits into the budget is rendered at once. Otherwise a preview is rendered while
    the view changes, and the final picture in slices of time once it is at rest.

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
        #: The view whose final picture is being rendered.
        self._refining_view: ViewState | None = None
        #: Estimated cost of a final picture; 0 until one is known.
        self._seconds_per_megapixel = 0.0

    def remove_space(self, space_pointer: int) -> None:
        """Drop the pictures of one 3D view."""
        for key in [key for key in self.views if key[0] == space_pointer]:
            del self.views[key]

    def release(self) -> None:
        """Free all resources."""
        self.views.clear()
        self.renderer.release()

    def update(
        self,
        view_pointers: tuple[int, int],
        requested_key: Hashable,
        draw_items: list[Any],
        view_input: ViewInput,
    ) -> ViewState:
        """Bring the picture of a view up to date, as far as there is time for it.

        Parameters
        ----------
        view_pointers : (int, int)
            Of space and region.
        requested_key : hashable
            Changes whenever the picture would change.
        draw_items : list
            Of the renderer, for the instances of the view.
        view_input : ViewInput
            Its camera has the size of the region.
        """
        view = self.views.setdefault(view_pointers, ViewState())
        now = time.monotonic()
        if requested_key != view.requested_key:
            view.requested_key, view.requested_time = requested_key, now
        preview_downscale, full_downscale = self.renderer.downscale_factors
        if view.texture_key == requested_key and view.downscale == full_downscale:
            return view
        megapixels = (
            self.renderer.covered_pixels(draw_items, view_input.camera)
            * view_input.look.supersampling**2
            / (1e6 * full_downscale**2)
        )

        def render_at(downscale: int) -> Task[Any]:
            return self.renderer.render_texture_task(
                draw_items, downscaled(view_input, downscale), (id(view), downscale)
            )

        if self._seconds_per_megapixel * megapixels <= FRAME_BUDGET_SECONDS:
            self._render_now(view, render_at(full_downscale), full_downscale, megapixels)
        elif view.texture_key != requested_key:
            self._render_now(
                view,
                render_at(preview_downscale),
                preview_downscale,
                megapixels * PREVIEW_COST_RATIO,
            )
            self._schedule_redraw(IDLE_SECONDS)
        elif now - view.requested_time < IDLE_SECONDS:
            self._schedule_redraw(IDLE_SECONDS)
        else:
            self._refine(view, lambda: render_at(full_downscale))
        return view

    def _render_now(
        self, view: ViewState, task: Task[Any], downscale: int, megapixels: float
    ) -> None:
        """Render a picture at once, and update the estimate of the cost."""
        self._refining_view = None
        start_time = time.monotonic()
        view.texture = run_to_completion(task)
        self.renderer.finish()
        elapsed = time.monotonic() - start_time
        # The minimum keeps the cost of single compilations and uploads out of the estimate.
        cost = elapsed / max(megapixels, _MIN_MEGAPIXELS)
        self._seconds_per_megapixel = (
            cost
            if not self._seconds_per_megapixel
            else min(cost, 0.5 * (self._seconds_per_megapixel + cost))
        )
        view.texture_key, view.downscale, view.task = view.requested_key, downscale, None

    def _refine(self, view: ViewState, start_task: Callable[[], Task[Any]]) -> None:
        """Continue the final picture of a view for one slice of time."""
        other = self._refining_view
        if other in self.views.values() and other is not view and other.is_rendering:
            self._schedule_redraw(0.0)  # one at a time: they share the renderer's images
            return
        if other is not view or view.task_key != view.requested_key or view.task is None:
            view.task, view.task_key = start_task(), view.requested_key
            self._refining_view = view
        deadline = time.monotonic() + SLICE_SECONDS
        try:
            while time.monotonic() < deadline:
                next(view.task)
                self.renderer.finish()
        except StopIteration as done:
            view.texture, view.texture_key = done.value, view.requested_key
            view.downscale = self.renderer.downscale_factors[1]
            view.task = self._refining_view = None
            return
        view.task_time = time.monotonic()
        self._schedule_redraw(0.0)


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

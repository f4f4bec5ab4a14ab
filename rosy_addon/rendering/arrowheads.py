"""Arrowheads along the lines of the fields in a view, drawn over its finished picture."""

from __future__ import annotations

from dataclasses import replace

from ..annotation.arrow_marks import ArrowMarks, arrow_marks
from ..annotation.draw_arrows import draw_arrows
from ..cache import Cache
from ..compositor.look_units import look_in_pixels
from ..compositor.picture import Picture
from ..progress import progress
from .view_input import ViewInput

#: Least length of an arrowhead, pixels.
MIN_SIZE = 3.0


def with_arrowheads(picture: Picture, view: ViewInput, cache: Cache | None = None) -> Picture:
    """Draw arrowheads over the picture of a view, if the look has them.

    Parameters
    ----------
    picture : Picture
    view : ViewInput
        The view that it was drawn for.
    cache : Cache, optional
        Stores corner fields.

    Returns
    -------
    Picture
        The same if there is nothing to draw, or the picture has thresholds.
    """
    if not view.look.arrows or view.draws_thresholds:
        return picture
    with progress(0.0, 0.8):
        marks = view_arrows(view, cache)
    if not len(marks):
        return picture
    with progress(0.8, 1.0):
        rgba = draw_arrows(picture.rgba, marks)
    return replace(picture, rgba=rgba)


def view_arrows(
    view: ViewInput, cache: Cache | None = None, *, is_exact: bool = True
) -> ArrowMarks:
    """Find the arrowheads of a view whose look has them; see `arrow_marks`."""
    look = look_in_pixels(view.look, view.sample_camera, view.instances)
    return arrow_marks(
        view.instances,
        view.camera,
        look.arrows,
        max(look.arrow_size, MIN_SIZE),
        display=look.display,
        clip_planes=view.clip_planes,
        cache=cache,
        is_exact=is_exact,
    )

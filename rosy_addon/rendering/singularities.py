"""The singularities of the fields in a view, drawn over its finished picture."""

from __future__ import annotations

from dataclasses import replace

from ..annotation.draw_marks import draw_marks_task
from ..annotation.singularity_marks import singularity_marks_task
from ..annotation.singularity_settings import shows_singularities
from ..cache import Cache
from ..compositor.picture import Picture
from ..progress import Task, subtask
from .view_input import ViewInput


def with_singularities_task(
    picture: Picture, view: ViewInput, cache: Cache | None = None
) -> Task[Picture]:
    """Draw the singularities of a view over its picture, if the look shows them.

    Parameters
    ----------
    picture : Picture
    view : ViewInput
        The view that it was drawn for.
    cache : Cache, optional
        Stores the singularities of fields.

    Yields
    ------
    Progress

    Returns
    -------
    Picture
        The same if there is nothing to draw, or the picture has thresholds.
    """
    if not shows_singularities(view.look) or view.draws_thresholds:
        return picture
    task = singularity_marks_task(view.instances, view.camera, view.look, view.clip_planes, cache)
    marks = yield from subtask(task, 0.0, 0.8)
    rgba = yield from subtask(draw_marks_task(picture.rgba, marks), 0.8, 1.0)
    return replace(picture, rgba=rgba, marks=marks)

"""Draw marks over the finished picture of a view: arrowheads, then singularities."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..annotation.arrow_marks import ArrowMarks, arrow_marks
from ..annotation.draw_marks import draw_arrows, draw_marks
from ..annotation.key_contents import PictureKey, sorted_indices
from ..annotation.singularity_marks import shown_singularities, singularity_marks
from ..annotation.singularity_settings import shows_singularities
from ..compositor.look import Look
from ..compositor.look_units import pixel_look
from ..compositor.picture import Picture
from ..compositor.picture_key import color_scale_of, fixed_color_range
from ..core.cache import BAKE_CACHE, Cache
from ..core.progress import progress
from ..projection.gbuffer import MeshInstance, with_field
from .view_input import ViewInput

#: Length of an arrowhead, relative to the least distance between positions with arrowheads. At a position
#: there is one arrowhead per direction. With up to five directions, they and their outlines reach 1.75
#: lengths from it. So half a length stays free between the arrowheads of neighboring positions.
ARROW_LENGTH = 0.25

#: Least length of an arrowhead in pixels. In a smaller one, the outline would cover the whole fill.
MIN_ARROW_LENGTH = 3.0


def has_marks(look: Look) -> bool:
    """Return whether a look draws arrowheads or singularities over the picture."""
    return bool(look.arrows) or shows_singularities(look)


def with_marks(picture: Picture, view: ViewInput, cache: Cache | None = BAKE_CACHE) -> Picture:
    """Draw arrowheads and singularities over the picture of a view, if the look has them.

    Parameters
    ----------
    picture : Picture
    view : ViewInput
        The view from which the picture was drawn.
    cache : Cache, optional
        Keeps the fields at corners, and the singularities of fields. By default the cache of this process,
        `BAKE_CACHE`. None: nothing is kept.

    Returns
    -------
    Picture
        The same picture if there is nothing to draw, or if it has thresholds of ink instead of colors.
    """
    look = view.look
    if view.draws_thresholds:
        return picture
    if look.arrows:
        with progress(0.0, 0.5):
            arrows = view_arrows(view, cache)
        if len(arrows):
            with progress(0.5, 0.6):
                picture = replace(picture, rgba=draw_arrows(picture.rgba, arrows))
    if shows_singularities(look):
        with progress(0.6, 0.9):
            marks = singularity_marks(view.instances, view.camera, look, view.clip_planes, cache)
        with progress(0.9, 1.0):
            picture = replace(picture, rgba=draw_marks(picture.rgba, marks), marks=marks)
    if cache is BAKE_CACHE:  # the owners of other caches evict their entries
        cache.evict_over_limit()
    return picture


def view_arrows(view: ViewInput, cache: Cache | None, *, is_exact: bool = True) -> ArrowMarks:
    """Return the arrowheads of a view. Its look must draw them (`Look.arrows` above 0); see `arrow_marks`.

    `is_exact` says whether all hidden arrowheads are removed, or only most of them, which is faster.
    """
    look = pixel_look(view.look, view.camera, view.instances)
    return arrow_marks(
        view.instances,
        view.camera,
        look.arrows,
        max(ARROW_LENGTH * look.arrows, MIN_ARROW_LENGTH),
        display=look.display,
        clip_planes=view.clip_planes,
        cache=cache,
        is_exact=is_exact,
    )


def sequence_key(instances: Sequence[MeshInstance], look: Look) -> PictureKey:
    """Return the contents of the key (legend) of an animation.

    It must be right for all frames. So the key has a range of colors only if the look sets it, and it lists
    the kinds of all singularities, including hidden ones.

    Parameters
    ----------
    instances : sequence of MeshInstance
        The mesh instances of one of the frames.
    look : Look

    Returns
    -------
    PictureKey
    """
    kinds, cache = [np.empty((0, 2), dtype=np.int64)], Cache()
    fields = with_field(instances)
    if shows_singularities(look):
        for number, instance in enumerate(fields):
            with progress(number / len(fields), (number + 1) / len(fields)):
                _, index = shown_singularities(instance, look, cache)
            kinds.append(np.stack([index, np.full(len(index), instance.field.degree)], axis=1))
    return PictureKey(
        color_scale_of(look, fixed_color_range(look)),
        sorted_indices(np.concatenate(kinds), has_counts=False),
        look.singularity_size,
    )

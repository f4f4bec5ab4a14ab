"""What is drawn over the finished picture of a view: arrowheads, then singularities."""

from __future__ import annotations

from ..annotation.singularity_settings import shows_singularities
from ..cache import BAKE_CACHE
from ..compositor.look import Look
from ..compositor.picture import Picture
from .arrowheads import with_arrowheads
from .singularities import with_singularities
from .view_input import ViewInput


def has_marks(look: Look) -> bool:
    """Return whether a look has arrowheads or shows singularities."""
    return bool(look.arrows) or shows_singularities(look)


def with_marks(picture: Picture, view: ViewInput) -> Picture:
    """Draw the marks of a view over its picture, with the cache of bakes in the process that calls it."""
    picture = with_arrowheads(picture, view, BAKE_CACHE)
    picture = with_singularities(picture, view, BAKE_CACHE)
    BAKE_CACHE.evict_over_limit()
    return picture

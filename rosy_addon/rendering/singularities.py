"""The singularities of the fields in a view, drawn over its finished picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..annotation.draw_marks import draw_marks
from ..annotation.key_contents import PictureKey, sorted_indices
from ..annotation.singularity_marks import cached_singularities, singularity_marks
from ..annotation.singularity_settings import shows_singularities
from ..cache import Cache
from ..compositor.look import Look
from ..compositor.picture import Picture
from ..compositor.picture_key import color_scale_of, fixed_color_range
from ..progress import progress
from ..projection.gbuffer import MeshInstance
from .view_input import ViewInput


def with_singularities(picture: Picture, view: ViewInput, cache: Cache | None = None) -> Picture:
    """Draw the singularities of a view over its picture, if the look shows them.

    Parameters
    ----------
    picture : Picture
    view : ViewInput
        The view that it was drawn for.
    cache : Cache, optional
        Stores the singularities of fields.

    Returns
    -------
    Picture
        The same if there is nothing to draw, or the picture has thresholds.
    """
    if not shows_singularities(view.look) or view.draws_thresholds:
        return picture
    with progress(0.0, 0.8):
        marks = singularity_marks(view.instances, view.camera, view.look, view.clip_planes, cache)
    with progress(0.8, 1.0):
        rgba = draw_marks(picture.rgba, marks)
    return replace(picture, rgba=rgba, marks=marks)


def sequence_key(
    instances: Sequence[MeshInstance], look: Look, cache: Cache | None = None
) -> PictureKey:
    """Find what the key of an animation says.

    It is true of all frames: the range of the colors is known only if the look sets it, and the
    singularities are those of the fields, visible or not.

    Parameters
    ----------
    instances : sequence of MeshInstance
        Of one of the frames.
    look : Look
    cache : Cache, optional
        Stores the singularities of fields.

    Returns
    -------
    PictureKey
    """
    kinds = [np.empty((0, 2), dtype=np.int64)]
    if shows_singularities(look):
        cache = Cache() if cache is None else cache
        for number, instance in enumerate(instances):
            if instance.field is not None:
                start, stop = number / len(instances), (number + 1) / len(instances)
                with progress(start, stop):
                    _, index = cached_singularities(instance, cache)
                kinds.append(np.stack([index, np.full(len(index), instance.field.degree)], axis=1))
    return PictureKey(
        color_scale_of(look, fixed_color_range(look)),
        sorted_indices(np.concatenate(kinds), has_counts=False),
        look.singularity_size,
    )

"""The contents of the key of a picture: what its colors and dots mean."""

from __future__ import annotations

from collections.abc import Sequence

from ..annotation.key_contents import ColorScale, PictureKey, count_indices
from ..annotation.singularity_settings import shows_singularities
from ..projection.gbuffer import MeshInstance
from .color_values import value_ends, value_ranges
from .lic_images import distinct_ends
from .look import Look, colors_magnitude, colors_values, magnitude_range
from .picture import Picture


def color_scale_of(look: Look, color_range: tuple[float, float] | None) -> ColorScale | None:
    """Return what the color map of a look shows; None if it uses none.

    Parameters
    ----------
    look : Look
    color_range : (float, float) or None
        Values of the first and the last color: `Picture.color_range`. None if they are not known.
    """
    if colors_magnitude(look):
        return ColorScale("Magnitude", look.color_map, *(color_range or (0.0, None)))
    if not colors_values(look):
        return None
    return ColorScale("", look.color_map, *(color_range or (None, None)))


def fixed_color_range(
    look: Look, instances: Sequence[MeshInstance] = ()
) -> tuple[float, float] | None:
    """Return the values of the first and the last color, if they do not depend on what is visible.

    Parameters
    ----------
    look : Look
    instances : sequence of MeshInstance
        Their numbers are the range of a look that colors numbers and sets none. Without, such a range is
        not known.
    """
    if colors_magnitude(look):
        ends = magnitude_range(look)
        return None if ends is None else distinct_ends(*ends)
    if not colors_values(look):
        return None
    if not any(look.color_range) and not instances:
        return None
    return value_ends(look, value_ranges(instances))


def picture_key(look: Look, picture: Picture) -> PictureKey:
    """Return what the key of a picture says, given the look that it was drawn with.

    Pictures with thresholds have neither a color map nor dots.
    """
    if picture.spread is not None:
        return PictureKey()
    return PictureKey(
        color_scale_of(look, picture.color_range),
        () if picture.marks is None else count_indices(picture.marks),
        look.singularity_size if shows_singularities(look) else 0.0,
    )

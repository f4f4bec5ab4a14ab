"""The contents of the key of a picture: what its colors and dots mean."""

from __future__ import annotations

from ..annotation.key_contents import ColorScale, PictureKey, count_indices
from ..annotation.singularity_settings import shows_singularities
from .lic_images import fixed_magnitude_range
from .look import Look, colors_magnitude
from .picture import Picture


def color_scale_of(look: Look, color_range: tuple[float, float] | None) -> ColorScale | None:
    """Return what the color map of a look shows; None if it uses none.

    Parameters
    ----------
    look : Look
    color_range : (float, float) or None
        Values of the first and the last color: `Picture.color_range`. None if they are not known.
    """
    if not colors_magnitude(look):
        return None
    return ColorScale(
        "Magnitude", look.colour_map, 0.0, None if color_range is None else color_range[1]
    )


def fixed_color_range(look: Look) -> tuple[float, float] | None:
    """Return the values of the first and the last color of a look that sets them; otherwise None."""
    if not colors_magnitude(look) or not look.magnitude_range:
        return None
    return 0.0, fixed_magnitude_range(look.magnitude_range)


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

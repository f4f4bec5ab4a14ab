"""The contents of the key (legend) of a picture, which explains its colors and dots."""

from collections.abc import Sequence

from ..annotation.key_contents import ColorScale, PictureKey, count_indices
from ..annotation.singularity_settings import shows_singularities
from ..projection.gbuffer import MeshInstance
from .color_values import value_ends, value_ranges
from .lic_images import distinct_ends
from .look import Look, colors_magnitude, colors_values, magnitude_range
from .picture import Picture


def color_scale_of(look: Look, color_range: tuple[float, float] | None) -> ColorScale | None:
    """Return the scale of the color map for the key of a picture; None if the look has no color map.

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
    """Return the values of the first and the last color of the color map, if they are known before drawing.

    None if they depend on the visible part of a field.

    Parameters
    ----------
    look : Look
    instances : sequence of MeshInstance
        Mesh instances of the picture. If the look shows color values and sets no range, the result is
        the range of their color values. In that case the result is None if no instances are given.
    """
    if colors_magnitude(look):
        ends = magnitude_range(look)
        return None if ends is None else distinct_ends(*ends)
    if not colors_values(look) or not (any(look.color_range) or instances):
        return None
    return value_ends(look, value_ranges(instances))


def picture_key(look: Look, picture: Picture) -> PictureKey:
    """Return the contents of the key (legend) of a picture, given the look that it was drawn with.

    Pictures with thresholds have neither a color map nor dots.
    """
    if picture.spread is not None:
        return PictureKey()
    counts = () if picture.marks is None else count_indices(picture.marks)
    size = look.singularity_size if shows_singularities(look) else 0.0
    return PictureKey(color_scale_of(look, picture.color_range), counts, size)

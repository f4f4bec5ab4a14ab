"""Derive settings of strokes from a look: spacing, widths, light, outline, ends, colors and marks."""

from dataclasses import replace
from typing import Any

from ..core.color import alpha_from_hex
from .style import StrokeStyle
from .svg import Pen

#: Distance of even strokes in widths of the pen. Where it is darkest, they leave a third of the paper.
EVEN_DISTANCE = 1.5

#: Distance of other strokes in widths of the pen: lines and gaps are equally wide, as the cells of noise.
HATCH_DISTANCE = 2.0


#: The settings of strokes that a look sets. Soft streaks set neither the first three nor the pen.
SETTINGS_OF_LOOK = (
    *("unit", "spacing", "distance", "light", "layering", "swell", "overshoot"),
    *("outline", "arrows", "singularity_dots", "singularity_size"),
)


def strokes_of_look(look: Any, style: StrokeStyle, pen: Pen) -> tuple[StrokeStyle, Pen]:
    """Return a style and a pen with which strokes resemble the lines that a look draws on pixels.

    Parameters
    ----------
    look : PixelLook
        The look, whose lengths are in pixels of the picture. If its ink is "soft", spacing and pen do not change.
    style : StrokeStyle
        The style to change. Settings that are not in `SETTINGS_OF_LOOK`, such as the taper, are kept.
    pen : Pen
        The pen to change. Its page is kept. If it has several colors, one for each family, they are kept, too.

    Returns
    -------
    style : StrokeStyle
    pen : Pen
    """
    is_even, is_hatched = look.ink == "even", look.ink != "soft"
    spacing, width, paper = style.spacing, pen.width, pen.paper
    if is_hatched:
        spacing = look.line_distance if is_even else HATCH_DISTANCE * look.line_width
        width = spacing / (EVEN_DISTANCE if is_even else HATCH_DISTANCE)
        is_clear = alpha_from_hex(look.paper_color) == 0
        paper = None if paper is None or is_clear else look.paper_color[:7]
    pen = replace(pen, width=width, paper=paper)
    if is_hatched and len(pen.colors) == 1:
        pen = replace(pen, colors=[look.ink_color[:7]], outline=look.ink_color[:7])
    settings = {
        "spacing": min(spacing, 1e4),
        "light": look.light if look.shading > 0 else "none",
        "layering": look.layering,
        "swell": float(is_even),
        "overshoot": look.overshoot,
        "outline": look.outline / width if is_hatched else 1.0,
        "arrows": look.arrows / spacing,
        "singularity_dots": look.singularity_dots,
        "singularity_size": look.singularity_size,
    }
    if is_hatched and look.pixel_size:
        settings |= {"unit": "world", "distance": spacing * look.pixel_size}
    return replace(style, **settings), pen

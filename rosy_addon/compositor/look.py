"""`Look`: all settings that determine how a field is drawn."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..annotation.singularity_settings import singularity_dots_choice, singularity_size_number
from ..core.color import alpha_from_hex
from ..core.settings import (
    Stage,
    check_settings,
    choice,
    color,
    fraction,
    number,
    numbers,
    pixel_length,
    shading_arguments,
    switch,
    with_settings,
)


def colors_magnitude(look: Any) -> bool:
    """Return whether the hue of the lines shows the magnitude of the field."""
    return look.hue == "magnitude"


def uses_magnitude(look: Any) -> bool:
    """Return whether the magnitude of the field drives the color or the length of the lines."""
    return colors_magnitude(look) or look.magnitude_length


def colors_values(look: Any) -> bool:
    """Return whether the hue of the lines shows color values, which are numbers on the surface."""
    return look.hue == "values"


def magnitude_range(look: Any) -> tuple[float, float] | None:
    """Return the range of magnitudes that a look sets; None if it sets none, and the fields determine it."""
    is_set = uses_magnitude(look) and not colors_values(look) and any(look.color_range)
    return look.color_range if is_set else None


def undefined_drawing(look: Any) -> str:
    """Return what is drawn where the field is undefined: "hidden", "paper" or "texture"."""
    automatic = "hidden" if colors_magnitude(look) else "texture"
    return automatic if look.undefined == "auto" else look.undefined


def crease_angle_of(look: Any) -> float | None:
    """Return the smallest angle between normals at a crease, in radians. None if edges are never creases."""
    return look.crease_angle if look.crease_angle < math.pi else None


def is_hatched(look: Any) -> bool:
    """Return whether lines are drawn with ink on paper."""
    return look.ink != "soft"


def has_clear_paper(look: Any) -> bool:
    """Return whether what is behind the ink shows through the paper."""
    return is_hatched(look) and alpha_from_hex(look.paper_color) < 1


def is_even(look: Any) -> bool:
    """Return whether lines of ink are drawn at even distances."""
    return look.ink == "even"


def has_colored_noise(look: Any) -> bool:
    """Return whether streaks are made of three channels of noise."""
    return look.hue == "noise" and not is_hatched(look)


def _has_streaks(look: Any) -> bool:
    """Return whether LIC noise is needed: to draw streaks, or to break even lines into pieces."""
    return not is_even(look) or bool(look.breaks or look.wobble)


def has_flow(look: Any) -> bool:
    """Return whether streaks drift along the field; see `flow`."""
    return look.flow > 0 and _can_flow(look)


def _can_flow(look: Any) -> bool:
    return _has_streaks(look) and look.method in ("sheets", "ibfv") and not has_colored_noise(look)


def _is_lit(look: Any) -> bool:
    return look.shading > 0 and (look.tone == "light" or look.tone_lit)


def has_tone_inks(look: Any) -> bool:
    """Return whether the color of the ink depends on the tone."""
    return is_hatched(look) and look.hue == "tone"


def _ink(applies: Callable[[Any], bool] = is_hatched) -> dict[str, Any]:
    """Return the arguments that settings of the panel "Ink" share; `applies` tells when they have an effect."""
    return shading_arguments("ink", applies)


@dataclass(frozen=True)
class Look:
    """All settings that determine how a field is drawn, as in presets and panels.

    Lengths are in pixels of the finished picture, or in another `unit`.

    To add a setting that both renderers draw with, edit three files: add a field here, use it in
    this package, and declare and use the uniform of that name in the shader. All other code (panels, files,
    command line) reads the fields of this class; see `rosy_addon.core.settings`.

    Raises
    ------
    RosyError
        If a value is not allowed.
    """

    method: str = choice(
        "sheets",
        "How the N directions become one picture",
        {
            "sheets": "Trace each streamline of all directions once: fast, and without lines at which "
            "streaks break",
            "members": "Decompose the field into member vector fields with an image of each, as in "
            "the paper",
            "brute": "Follow the best of the N directions at every step: slow, for reference",
            "ibfv": "Carry noise along the sheets of the covering surface and blend it, as in image based "
            "flow visualization: soft streaks that fade, whose drift takes little time per frame",
        },
        option_labels={"brute": "Brute Force", "ibfv": "IBFV"},
    )
    weights: str = choice(
        "cosine",
        "How the method Members blends its two sets of images to hide the breaking points",
        {
            "cosine": "Smoothly, by the distance of the directions from the breaking points",
            "binary": "Take each pixel from one of the two sets",
            "none": "Use only the first set, which shows the breaking points",
        },
        applies=lambda look: look.method == "members",
    )
    view_plane: bool = switch(
        True,
        "Rotate the field into the view plane before the method Members decomposes it. Off: as in "
        "Figure 8 of the paper",
        applies=lambda look: look.method == "members",
    )
    display: str = choice(
        "smooth",
        "How face values become pixel values",
        {
            "smooth": "Average the face values at the corners and interpolate",
            "flat": "Use the value of the face",
        },
        panel_before="method",
        stage=Stage.GBUFFER,
    )
    line_width: float = pixel_length(
        1.5,
        256.0,
        "Width of the streaks in pixels, which is the size of a cell of the noise",
        low=0.5,
        preview_low=0.75,
    )
    line_distance: float = pixel_length(
        3.0,
        512.0,
        "Distance between even lines in pixels. At half coverage, lines are half as wide",
        low=1.0,
        preview_low=1.5,
        applies=is_even,
    )
    unit: str = choice(
        "pixels",
        "Unit of the lengths of this look",
        {
            "pixels": "Pixels of the picture, whatever its size and the distance of the meshes",
            "percent": "Percent of the width of the picture: the drawing is the same at all sizes",
            "millimeters": "Millimeters on paper, at the resolution of the print",
            "scene": "Blender units: lines belong to the object, as if engraved, and are wider when near",
        },
        option_labels={"percent": "Percent of Width", "scene": "Scene Units"},
        panel="streaks",
    )
    unit_size: float = number(
        0.0,
        0.0,
        1e6,
        "What a length of 1 stands for, in percent, millimeters or Blender units. 0: the size of a pixel in a "
        "picture that is 1920 pixels wide, in a print of 300 dpi, or in a picture where the meshes are 1024 "
        "pixels wide",
        panel="streaks",
        applies=lambda look: look.unit != "pixels",
    )
    dpi: float = number(
        300.0,
        1.0,
        1e5,
        "Pixels of the picture per inch of paper",
        label="DPI",
        panel="streaks",
        applies=lambda look: look.unit == "millimeters",
    )
    length: int = pixel_length(
        40,
        8000,
        "Length of the streaks in pixels, in each direction",
        low=1,
        applies=_has_streaks,
    )
    fade: str = choice(
        "none",
        "Where streaks fade",
        {
            "none": "Nowhere: streaks have the same strength from end to end",
            "ends": "Toward both ends. Lines end in points and change less when the view zooms",
            "tail": "From head to tail, so that they show which way they point. For fields of odd degree; "
            "sparse streaks, of low density, show it best",
        },
        option_labels={"none": "Nowhere", "ends": "At Both Ends", "tail": "At the Tail"},
        panel="streaks",
        applies=_has_streaks,
    )
    arrows: float = pixel_length(
        0.0,
        65536.0,
        "Least distance in pixels between the arrowheads that show which way lines point. An arrowhead is a "
        "quarter of this distance long. For fields of odd degree. 0: none",
        label="Arrowheads",
        **shading_arguments("streaks"),
    )
    flow: float = pixel_length(
        0.0,
        256.0,
        "Pixels that streaks drift along the field per frame, in animations and live views. Lines of fields "
        "of even degree drift toward the guiding angle, or both ways if they are perpendicular to it. 0: no "
        "drift",
        applies=_can_flow,
    )
    density: float = number(
        0.1,
        0.001,
        0.999,
        "Fraction of noise cells that are bright. Low values give separate streaks, which make "
        "several directions easier to tell apart",
        panel="streaks",
    )
    high_pass: float = pixel_length(
        16.0,
        1024.0,
        "Remove noise variations wider than this many pixels, so that crossing streaks do not form "
        "clouds. 0: keep them, as in the paper",
        panel="",
    )
    detail: float = number(
        0.0,
        0.0,
        0.9,
        "Draw narrower lines on small features, by up to this fraction",
        applies=lambda look: look.anchor == "surface",
    )
    anchor: str = choice(
        "picture",
        "What the noise stays attached to when something moves",
        {
            "picture": "The picture: for still pictures, as in the paper",
            "surface": "The surface: streaks move and bend with it and keep their width, for "
            "hatching and animations",
        },
        panel="quality",
    )
    hue: str = choice(
        "one",
        "What the hue of the lines shows",
        {
            "one": "Same hue for all",
            "noise": "Random hues of soft streaks: three channels of noise, each convolved separately, "
            "which cross like the threads of a plaid",
            "families": "One hue for each line that the field distinguishes: major and minor of "
            "tensors, or dir0, dir1 and so on, if each is the same line on the whole mesh. In "
            "hatching, lines of other fields get inks by their distance to the guiding angle",
            "values": "Numbers on the surface, such as the angle between two fields, through the "
            "color map",
            "magnitude": "Magnitude of the field, through the color map",
            "tone": "Tone of hatching: the ink blends from its color in the shadows to the highlight "
            "color in the lights",
        },
        option_labels={"one": "Single"},
        **shading_arguments("color"),
    )
    seed: int = number(0, 0, 2**31 - 1, "Random seed of the noise", panel="quality")
    gain: float = number(
        2.5,
        0.0,
        16.0,
        "Contrast of the streaks. 1: as with a single direction",
        panel_before="high_pass",
        **shading_arguments("", lambda look: not is_hatched(look)),
    )
    guiding_angle: float = number(
        0.0,
        -3.1416,
        3.1416,
        "Angle in the picture of the first family of lines: at each pixel, the direction nearest to it",
        unit="angle",
        panel="ink",
        panel_before="layers",
    )
    crease_angle: float = number(
        0.7,
        0.0,
        3.1416,
        "Minimum angle between the normals on both sides of a sharp crease, where streaks end and outlines are "
        "drawn. 180 degrees (3.1416): no creases",
        unit="angle",
        panel="streaks",
    )
    magnitude_length: bool = switch(
        False,
        "Draw streaks whose length is proportional to the magnitude of the field",
        label="Length by Magnitude",
        panel="streaks",
        applies=_has_streaks,
    )
    color_range: tuple[float, float] = numbers(
        (0.0, 0.0),
        "Magnitudes or numbers at the bottom and at the top of the color map; streaks whose length shows the "
        "magnitude have no length at the first and full length at the second. If the bottom value is above the top value, the map is inverted. Both 0: from 0 to "
        "the largest visible magnitude, or the range of the numbers",
        {"Bottom Value": (-1e30, 1e30), "Top Value": (-1e30, 1e30)},
        **shading_arguments("color", lambda look: uses_magnitude(look) or colors_values(look)),
    )
    color_map: str = choice(
        "viridis",
        "Perceptually uniform color map of the magnitude, or of numbers on the surface",
        {
            "viridis": "Dark blue through green to yellow",
            "magma": "Black through red to pale yellow",
            "gray": "Black to white",
        },
        **shading_arguments("color", lambda look: colors_magnitude(look) or colors_values(look)),
    )
    undefined: str = choice(
        "auto",
        "What is drawn where the field is undefined, such as regions without data",
        {
            "auto": "Nothing where the color shows the magnitude, otherwise the texture",
            "hidden": "Nothing: the picture is transparent there, and a material that shows it is gray",
            "paper": "The surface without lines",
            "texture": "Noise or spots without a direction",
        },
        option_labels={"auto": "Automatic"},
        **shading_arguments("color"),
    )
    shading: float = fraction(
        0.7, "Strength of the diffuse shading in the picture", **shading_arguments("light")
    )
    light: str = choice(
        "scene",
        "Light source of the shading",
        {
            "headlight": "A light at the camera",
            "lamp": "A lamp above and to the left of the camera",
            "scene": "The lights of the scene, with their shadows. If there are none, the lamp for ink, and the "
            "headlight for soft streaks",
        },
        label="Light Source",
        panel_label="Source",
        **shading_arguments("light", _is_lit),
    )
    shadows: bool = switch(
        False,
        "Cast shadows of the lamp. Lights of the scene cast theirs, and the headlight casts none",
        **shading_arguments("light", lambda look: _is_lit(look) and look.light == "lamp"),
    )
    tone: str = choice(
        "light",
        "Source of the tone, which is how light or dark the picture is at each point",
        {
            "light": "The light on the surface",
            "attribute": "An attribute of the mesh, a number or a color",
            "image": "An image on the mesh, through its UV map",
            "picture": "A picture of the scene through its camera, such as a render",
        },
        label="Tone Source",
        panel_label="Source",
        **shading_arguments("tone"),
    )
    tone_lit: bool = switch(
        False,
        "Multiply the tone by the light",
        label="Multiply by Light",
        **shading_arguments("tone", lambda look: look.tone != "light"),
    )
    tone_levels: tuple[float, float, float] = numbers(
        (0.0, 1.0, 1.0),
        "Input values that become black and white, and the gamma of the tones between, as the levels of "
        "image programs. White below black inverts the tone. A gamma above 1 lightens, one below 1 darkens",
        {"Black": (-1e6, 1e6), "White": (-1e6, 1e6), "Gamma": (0.05, 20.0)},
        **shading_arguments("tone"),
    )
    ink: str = choice(
        "soft",
        "Style of the lines",
        {
            "soft": "Lighter and darker streaks around the mean, on the shaded surface",
            "hatch": "Streaks of ink on paper, broken and uneven as by hand, whose number and width "
            "follow the tone",
            "even": "Long lines of ink at even distances on the surface, which swell and thin with the "
            "tone, as in engravings",
        },
        label="Ink Style",
        panel_label="Style",
        option_labels={"even": "Evenly Spaced"},
        **shading_arguments("ink"),
    )
    ink_color: str = color(
        "#08080d",
        "Color of the ink",
        **_ink(lambda look: is_hatched(look) and not colors_magnitude(look)),
    )
    ink_color_light: str = color(
        "#b06a3c", "Color of the ink in the lights", label="Highlight Color", **_ink(has_tone_inks)
    )
    paper_color: str = color(
        "#ffffff",
        "Color of the paper, and its opacity. Without opacity, only the ink is drawn",
        has_alpha=True,
        **_ink(),
    )
    crispness: float = fraction(
        0.7, "Edges of lines, from soft gray streaks to sharp lines", **_ink()
    )
    layers: int = number(
        3, 1, 12, "Maximum number of line families that cross in the darkest tones", **_ink()
    )
    layering: float = fraction(
        0.3, "Difference in darkness between the tones at which successive families begin", **_ink()
    )
    breaks: float = fraction(
        0.0, "Amount by which lines are broken into pieces, in light tones first", **_ink()
    )
    overshoot: float = pixel_length(
        0.0,
        256.0,
        "Maximum distance in pixels by which lines continue past the borders of tones, getting thinner",
        **_ink(),
    )
    wobble: float = fraction(
        0.0,
        "Amount by which lines vary in direction and width, as if drawn by hand",
        panel="ink",
        applies=is_hatched,
    )
    paper_grain: float = fraction(
        0.0,
        "Amount by which the grain of the paper breaks up the ink, as with pencil and charcoal",
        **_ink(),
    )
    outline: float = pixel_length(
        0.0,
        64.0,
        "Width in pixels of ink lines along silhouettes, borders and sharp creases. 0: none",
        **_ink(),
    )
    singularity_dots: str = singularity_dots_choice(panel="singularities", stage=Stage.SHADING)
    singularity_size: float = singularity_size_number(panel="singularities", stage=Stage.SHADING)
    supersampling: int = number(
        1,
        1,
        4,
        "Samples per pixel along each axis",
        panel="quality",
        panel_before="anchor",
        stage=Stage.GBUFFER,
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def with_settings(self, settings: dict[str, Any]) -> Look:
        """Return the look with some settings changed. Tuples of numbers may be given as lists (from JSON).

        Raises
        ------
        RosyError
            If there is no such setting, or its value is not allowed.
        """
        return with_settings(self, settings)

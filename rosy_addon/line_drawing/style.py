"""`StrokeStyle`: the settings of strokes, such as spacing, tone, ends and outline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..annotation.singularity_settings import singularity_dots_choice, singularity_size_number
from ..core.settings import check_settings, choice, fraction, number, switch, with_settings


@dataclass(frozen=True)
class StrokeStyle:
    """The settings of strokes, as shown in the panel and accepted on the command line.

    To add a setting, add a dataclass field here. `rosy_addon.core.settings` describes what is derived from
    it.

    Raises
    ------
    RosyError
        If a value is not allowed.
    """

    unit: str = choice(
        "pixels",
        "Unit of the spacing",
        {"pixels": "Pixels of the picture", "world": "Blender units on the surface"},
    )
    spacing: float = number(
        8.0,
        0.5,
        1e4,
        "Distance between adjacent strokes of a family in pixels",
        unit="pixels",
        applies=lambda style: style.unit == "pixels",
    )
    distance: float = number(
        0.1,
        1e-6,
        1e6,
        "Distance between adjacent strokes of a family in Blender units",
        unit="length",
        applies=lambda style: style.unit == "world",
    )
    light: str = choice(
        "none",
        "Light by which strokes are placed: closer together where it is weak, and left out where it is "
        "strong",
        {
            "none": "Even strokes, without a light",
            "headlight": "A light at the camera",
            "lamp": "A lamp above and to the left of the camera",
            "scene": "The lights of the scene. If there are none, the lamp",
        },
        panel="density",
    )
    layering: float = fraction(
        0.3,
        "Difference in darkness between the tones at which successive families begin",
        panel="density",
        applies=lambda style: style.light != "none",
    )
    swell: float = fraction(
        0.0,
        "Amount by which the light changes the width of strokes instead of their distance. 1: evenly "
        "spaced strokes, as in an engraving",
        panel="density",
        applies=lambda style: style.light != "none",
    )
    curvature: float = fraction(
        0.0,
        "Amount by which strokes are closer together where the surface is more curved",
        panel="density",
    )
    gaps: float = fraction(
        0.0,
        "Gap in the lower of two crossing strokes, as a multiple of the spacing",
        unit="spacings",
        panel="ends",
    )
    taper: float = number(
        0.8,
        0.0,
        1e3,
        "Length over which strokes get thinner toward their ends, as a multiple of the spacing. "
        "Ends that meet head on are not tapered",
        unit="spacings",
        panel="ends",
        panel_before="gaps",
    )
    overshoot: float = number(
        0.0,
        0.0,
        1e3,
        "Maximum distance in pixels by which strokes continue past the end of the surface or of "
        "the shade, or an occluding edge",
        unit="pixels",
        panel="ends",
        panel_before="gaps",
    )
    arrows: float = number(
        0.0,
        0.0,
        1e3,
        "Distance between arrowheads along strokes, as a multiple of the spacing; 0: none. Only strokes of "
        "fields of odd degree have a direction",
        unit="spacings",
        label="Arrowheads",
        panel="ends",
        panel_before="gaps",
    )
    outline: float = number(
        0.0,
        0.0,
        100.0,
        "Width of silhouettes, creases and borders, as a multiple of the width of strokes. 0: none",
        unit="widths",
    )
    hidden: bool = switch(False, "Keep strokes that the camera does not see", label="Keep Hidden")
    singularity_dots: str = singularity_dots_choice(panel="singularities")
    singularity_size: float = singularity_size_number(panel="singularities")
    cross_creases: bool = switch(False, "Continue strokes across sharp creases", panel="ends")

    def __post_init__(self) -> None:
        check_settings(self)

    def with_settings(self, settings: dict[str, Any]) -> StrokeStyle:
        """Return the style with some settings changed.

        If `distance` is changed, the setting `unit` becomes "world". If only `spacing` is changed, it becomes
        "pixels". A value of `unit` in `settings` takes precedence.

        Raises
        ------
        RosyError
            If there is no such setting, or its value is not allowed.
        """
        if settings.keys() & {"spacing", "distance"}:
            settings = {"unit": "world" if "distance" in settings else "pixels"} | settings
        return with_settings(self, settings)

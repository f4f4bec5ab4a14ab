"""Draw the settings of operators on fields, in panels and in the dialogs of the operators."""

from typing import Any

from bpy.types import UILayout

from ..field.generate import options_of
from .sidebar import use_property_columns

_CONVERT_SETTINGS = ("new_degree", "angle", "smooth", "pair_distance", "magnitude")

#: Inputs of the generators, by the kind of field. Panels show them above the other options.
_INPUTS_BY_KIND = {
    "features": ("edges",),
    "guided": ("guides", "guide", "edges", "uv_map", "vectors"),
    "prescribed": ("singularities", "vectors"),
    "uv": ("uv_map",),
}

#: For each input of a guided field, the kind of guides for which it is used.
_GUIDE_OF_INPUT = {"guide": "OBJECTS", "edges": "EDGES", "uv_map": "UV", "vectors": "ATTRIBUTE"}

#: Texts that empty settings of the generator show.
PLACEHOLDERS = {"guide": "Selected", "uv_map": "Active", "vectors": "Attribute"}


def draw_settings(layout: UILayout, settings: Any, *names: str, **placeholders: str) -> None:
    """Draw properties in two columns.

    Parameters
    ----------
    layout : bpy.types.UILayout
    settings : bpy.types.OperatorProperties or operator
    *names : str
        Names of the properties.
    **placeholders : str
        Texts that empty properties show.
    """
    use_property_columns(layout)
    for name in names:
        layout.prop(settings, name, placeholder=placeholders.get(name, ""))


def draw_convert_settings(layout: UILayout, settings: Any) -> None:
    """Draw the settings of ``rosy.field_convert``."""
    draw_settings(layout, settings, *_CONVERT_SETTINGS)
    if settings.magnitude == "values":
        draw_settings(layout, settings, "values")


def draw_generator_settings(layout: UILayout, settings: Any) -> None:
    """Draw the settings of ``rosy.field_generate`` that apply to the chosen generator, guides and edges."""
    inputs = _INPUTS_BY_KIND.get(settings.kind, ())
    if settings.kind == "guided":
        kept = {"", *settings.guides}
        inputs = tuple(name for name in inputs if _GUIDE_OF_INPUT.get(name, "") in kept)
    options = options_of(settings.kind)
    # The angle is used only for edges that are found by their angle, also if these edges are guides.
    if "edges" in inputs and settings.edges == "FEATURES":
        options = ["sharp_angle", *(name for name in options if name != "sharp_angle")]
    elif "sharp_angle" in options:
        options.remove("sharp_angle")
    draw_settings(layout, settings, "kind", "degree", *inputs, *options, **PLACEHOLDERS)

"""The settings of operators on fields, for the panels and for the operators themselves."""

from __future__ import annotations

from typing import Any

import bpy

from .sidebar import use_property_columns

_CONVERT_SETTINGS = ("new_degree", "angle", "smooth", "pair_distance", "magnitude")

_SETTINGS_BY_KIND = {
    "axis": ("axis",),
    "curvature": ("reach",),
    "features": ("edges", "sharp_angle"),
    "guided": ("guides", "guide", "edges", "sharp_angle", "uv_map", "vectors", "reach"),
    "prescribed": ("singularities", "add_missing", "vectors", "reach"),
    "uv": ("uv_map",),
}

#: The guide that a setting of a guided field belongs to.
_GUIDE_OF_SETTING = {
    "guide": "OBJECTS",
    "edges": "EDGES",
    "sharp_angle": "EDGES",
    "uv_map": "UV",
    "vectors": "ATTRIBUTE",
}

#: Placeholder texts of empty settings of the generator.
_PLACEHOLDERS = {"guide": "Selected", "uv_map": "Active", "vectors": "Attribute"}


def draw_settings(
    layout: bpy.types.UILayout, settings: Any, *names: str, **placeholders: str
) -> None:
    """Draw properties in two columns.

    Parameters
    ----------
    layout : bpy.types.UILayout
    settings : bpy.types.OperatorProperties or operator
    *names : str
        The properties.
    **placeholders : str
        Texts that empty properties show.
    """
    use_property_columns(layout)
    for name in names:
        layout.prop(settings, name, placeholder=placeholders.get(name, ""))


def draw_convert_settings(layout: bpy.types.UILayout, settings: Any) -> None:
    """Draw the settings of ``rosy.field_convert``."""
    draw_settings(layout, settings, *_CONVERT_SETTINGS)
    if settings.magnitude == "values":
        draw_settings(layout, settings, "values")


def draw_generator_settings(layout: bpy.types.UILayout, settings: Any) -> None:
    """Draw the settings of ``rosy.field_generate`` that apply to the chosen kind, guides and edges."""
    names = _SETTINGS_BY_KIND.get(settings.kind, ())
    if settings.kind == "guided":
        names = tuple(
            name for name in names if _GUIDE_OF_SETTING.get(name, "") in {"", *settings.guides}
        )
    if "edges" in names and settings.edges != "FEATURES":
        names = tuple(name for name in names if name != "sharp_angle")
    draw_settings(layout, settings, "kind", "degree", *names, **_PLACEHOLDERS)

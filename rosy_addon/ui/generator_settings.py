"""Names of the settings that apply to each kind of generated field."""

from __future__ import annotations

from typing import Any

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


def generator_setting_names(settings: Any) -> tuple[str, ...]:
    """Return the names of the settings that apply to the chosen kind, guides and edges.

    Parameters
    ----------
    settings : bpy.types.OperatorProperties or operator
        Of ``rosy.field_generate``.
    """
    names = _SETTINGS_BY_KIND.get(settings.kind, ())
    if settings.kind == "guided":
        names = tuple(
            name for name in names if _GUIDE_OF_SETTING.get(name, "") in {"", *settings.guides}
        )
    if "edges" in names and settings.edges != "FEATURES":
        names = tuple(name for name in names if name != "sharp_angle")
    return names

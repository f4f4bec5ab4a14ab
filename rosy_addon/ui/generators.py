"""Which settings of the generator go with which kind of field."""

from __future__ import annotations

from typing import Any

_SETTINGS = {
    "axis": ("axis",),
    "curvature": ("reach",),
    "features": ("edges", "sharp_angle"),
    "guided": ("guides", "guide", "edges", "sharp_angle", "uv_map", "vectors", "reach"),
    "uv": ("uv_map",),
}

#: Which guides a setting of a guided field belongs to.
_OF_GUIDES = {
    "guide": "OBJECTS",
    "edges": "EDGES",
    "sharp_angle": "EDGES",
    "uv_map": "UV",
    "vectors": "ATTRIBUTE",
}


def settings_of_generator(chosen: Any) -> tuple[str, ...]:
    """Names of the settings that what has been chosen depends on.

    Parameters
    ----------
    chosen : bpy.types.OperatorProperties or operator
        Of ``rosy.field_generate``.
    """
    names = _SETTINGS.get(chosen.kind, ())
    if chosen.kind == "guided":
        names = tuple(name for name in names if _OF_GUIDES.get(name, "") in {"", *chosen.guides})
    if "edges" in names and chosen.edges != "FEATURES":
        names = tuple(name for name in names if name != "sharp_angle")
    return names

"""Which settings of the generator go with which kind of field."""

from __future__ import annotations

from typing import Any

_SETTINGS = {"axis": ("axis",), "curvature": ("reach",), "features": ("edges", "sharp_angle")}


def settings_of_generator(chosen: Any) -> tuple[str, ...]:
    """Names of the settings that what has been chosen depends on.

    Parameters
    ----------
    chosen : bpy.types.OperatorProperties or operator
        Of ``rosy.field_generate``.
    """
    names = _SETTINGS.get(chosen.kind, ())
    if "edges" in names and chosen.edges != "FEATURES":
        return ("edges",)
    return names

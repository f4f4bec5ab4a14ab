"""Which settings of the generator go with which kind of field."""

from __future__ import annotations

_SETTINGS = {
    "axis": ("axis",),
    "curvature": ("reach",),
    "features": ("edges", "sharp_angle"),
}


def settings_of_kind(kind: str) -> tuple[str, ...]:
    """Names of the operator's properties that a kind of field depends on."""
    return _SETTINGS.get(kind, ())

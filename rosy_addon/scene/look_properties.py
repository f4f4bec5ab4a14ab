"""Conversion between a `Look` and Blender's properties."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ..compositor.flow import Drift, drift_at
from ..compositor.look import Look
from ..core.color import alpha_from_hex, from_hex, to_hex
from ..core.settings import Color, Number, Numbers, Setting, settings_of

if TYPE_CHECKING:
    import bpy


def read_look(settings: Any) -> Look:
    """Return the look that properties hold.

    Parameters
    ----------
    settings : PropertyGroup
        ``scene.rosy``, or its ``look``.
    """
    return Look(**read_settings(getattr(settings, "look", settings), Look))


def apply_look(settings: Any, look: Look) -> None:
    """Write a look to the properties of ``scene.rosy``, or of its ``look``."""
    group = getattr(settings, "look", settings)
    for name, setting in settings_of(Look).items():
        value = getattr(look, name)
        setattr(
            group, name, color_components(value, setting) if isinstance(setting, Color) else value
        )


def color_components(code: str, setting: Color) -> list[float]:
    """Return a color as the components of its property: three, or four with the opacity."""
    color = from_hex(code).tolist()
    return [*color, alpha_from_hex(code)] if setting.has_alpha else color


def drift_in_scene(scene: bpy.types.Scene, look: Look, frame: float) -> Drift:
    """Return how far streaks have drifted at a frame. The frame range of the scene is a loop."""
    return drift_at(look, frame - scene.frame_start, scene.frame_end - scene.frame_start + 1)


def matches_look(settings: Any, look: Look) -> bool:
    """Return whether the properties hold a look, to the precision of Blender's numbers."""
    current = read_look(settings)
    return all(_is_equal(getattr(current, name), getattr(look, name)) for name in settings_of(Look))


def _is_equal(one: Any, other: Any) -> bool:
    """Return whether two values of a setting are equal: text in any case, numbers in single precision."""
    if isinstance(one, str):
        return one == other.lower()
    if isinstance(one, tuple):
        return all(map(_is_equal, one, other))
    return math.isclose(one, other, rel_tol=1e-6)


def read_settings(group: Any, cls: type) -> dict[str, Any]:
    """Return the values that a property group holds for the fields of a settings class."""
    return {
        name: _from_rna(getattr(group, name), setting) for name, setting in settings_of(cls).items()
    }


def _from_rna(value: Any, setting: Setting) -> Any:
    """Convert a property value: a color to hex, floats to 7 digits within the setting's range."""
    if isinstance(setting, Color):
        return to_hex(value)
    if isinstance(setting, Numbers):
        return tuple(map(_rounded, value, *zip(*setting.parts.values(), strict=True)))
    if not (isinstance(setting, Number) and isinstance(value, float)):
        return value
    return _rounded(value, setting.low, setting.high)


def _rounded(value: float, low: float, high: float) -> float:
    """Return a number with 7 digits, within a range."""
    return min(max(float(f"{value:.7g}"), low), high)

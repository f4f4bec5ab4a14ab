"""Conversion between a `Look` and Blender's properties."""

import math
from dataclasses import replace
from typing import Any

import bpy
import numpy as np

from ..compositor.flow import Drift, drift_at
from ..compositor.look import Look, has_clear_paper, is_hatched
from ..core.color import alpha_from_hex, from_hex, to_hex, to_linear
from ..core.settings import Color, Number, Numbers, Setting, settings_of


def read_look(settings: Any) -> Look:
    """Return the look (settings of a drawing) that Blender properties hold.

    Parameters
    ----------
    settings : PropertyGroup
        ``scene.rosy``, or ``scene.rosy.look``. The paper is clear in ``scene.rosy`` if ink is drawn over materials.
    """
    look = Look(**read_settings(getattr(settings, "look", settings), Look))
    if getattr(settings, "over_material", False) and is_hatched(look):
        return replace(look, paper_color=to_hex((*from_hex(look.paper_color), 0.0)))
    return look


def backdrop_color(scene: bpy.types.Scene, look: Look) -> np.ndarray | None:
    """Return the linear RGB color of the paper behind all objects of a scene; None if there is no backdrop."""
    is_opaque = is_hatched(look) and not has_clear_paper(look)
    if not (scene.rosy.backdrop and is_opaque) or scene.render.film_transparent:
        return None
    return to_linear(from_hex(look.paper_color))


def apply_look(settings: Any, look: Look) -> None:
    """Write a look to Blender properties: ``scene.rosy`` or ``scene.rosy.look``."""
    group = getattr(settings, "look", settings)
    for name, setting in settings_of(Look).items():
        value = getattr(look, name)
        is_color = isinstance(setting, Color)
        setattr(group, name, color_components(value, setting) if is_color else value)


def color_components(code: str, setting: Color) -> list[float]:
    """Convert a hex color to the components of its property, from 0 to 1.

    They are red, green and blue as sRGB display values, and the opacity if the setting has one.
    """
    color = from_hex(code).tolist()
    return [*color, alpha_from_hex(code)] if setting.has_alpha else color


def drift_in_scene(scene: bpy.types.Scene, look: Look, frame: float) -> Drift:
    """Return how far moving streaks have drifted at a frame. They loop over the frame range of the scene."""
    return drift_at(look, frame - scene.frame_start, scene.frame_end - scene.frame_start + 1)


def matches_look(settings: Any, look: Look) -> bool:
    """Return whether Blender properties hold a look, up to the single precision of the properties."""
    current = read_look(getattr(settings, "look", settings))
    return all(_is_equal(getattr(current, name), getattr(look, name)) for name in settings_of(Look))


def _is_equal(one: Any, other: Any) -> bool:
    """Return whether two values of a setting are equal.

    Case of text, and small rounding errors, are ignored.
    """
    if isinstance(one, str):
        return one == other.lower()
    if isinstance(one, tuple):
        return all(map(_is_equal, one, other))
    return math.isclose(one, other, rel_tol=1e-6)


def read_settings(group: Any, cls: type) -> dict[str, Any]:
    """Return the values that a property group holds for the fields of a settings class."""
    settings = settings_of(cls).items()
    return {name: _from_rna(getattr(group, name), setting) for name, setting in settings}


def _from_rna(value: Any, setting: Setting) -> Any:
    """Convert a property value to a setting: colors to hex; floats rounded to 7 digits, within the range."""
    if isinstance(setting, Color):
        return to_hex(value)
    if isinstance(setting, Numbers):
        return tuple(map(_rounded, value, *zip(*setting.parts.values(), strict=True)))
    if not (isinstance(setting, Number) and isinstance(value, float)):
        return value
    return _rounded(value, setting.low, setting.high)


def _rounded(value: float, low: float, high: float) -> float:
    """Return a number rounded to 7 significant digits and clamped to a range."""
    return min(max(float(f"{value:.7g}"), low), high)

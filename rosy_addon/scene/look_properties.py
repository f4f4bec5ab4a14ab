"""Conversion between a `Look` and Blender's properties."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
from bpy.types import Collection, Object

from ..compositor.flow import Drift, drift_at
from ..compositor.look import Look, colors_values, has_clear_paper, is_hatched
from ..core.color import alpha_from_hex, from_hex, to_hex, to_linear
from ..core.errors import RosyError
from ..core.settings import Color, Number, Numbers, Setting, settings_of
from ..preset_files.store import load_preset
from .files import user_presets_folder


def read_look(settings: Any) -> Look:
    """Return the look (settings of a drawing) that Blender properties hold.

    Parameters
    ----------
    settings : PropertyGroup
        ``scene.rosy``, or ``scene.rosy.look``. If it is ``scene.rosy`` and its property `over_material` is set, the
        paper of hatching is made transparent.
    """
    look = Look(**read_settings(getattr(settings, "look", settings), Look))
    if getattr(settings, "over_material", False) and is_hatched(look):
        return replace(look, paper_color=to_hex((*from_hex(look.paper_color), 0.0)))
    return look


def object_looks(scene: bpy.types.Scene, objects: Sequence[Object], look: Look) -> list[Look]:
    """Return the look of each object: from the object's preset, from the preset of a collection, or `look`.

    Of the collections that contain the object, the innermost one with a preset counts. All looks have the light, the
    tone, the paper and the unit of `look`, the look of the scene.

    Raises
    ------
    RosyError
        If a preset cannot be read.
    """
    looks, keys = {"": look}, own_presets(scene, objects)
    for obj, key in zip(objects, keys, strict=True):
        if key not in looks:
            try:
                looks[key] = _in_light_of(load_preset(key, user_presets_folder()).look, look)
            except RosyError as error:
                raise RosyError(f"look of object '{obj.name}': {error}") from None
    return [looks[key] for key in keys]


def own_presets(scene: bpy.types.Scene, objects: Sequence[Object]) -> list[str]:
    """Return the key of the preset of each object; empty if it has the look of the scene."""
    collections: dict[Object, str] = {}
    _collect_presets(scene.collection, "", collections)
    return [obj.rosy.preset or collections.get(obj, "") for obj in objects]


def _collect_presets(collection: Collection, preset: str, found: dict[Object, str]) -> None:
    """Add to `found` the preset of each object in a collection and its children, given the parent's preset.

    Inner collections are visited last, so that their presets replace the presets of outer ones.
    """
    preset = collection.rosy.preset or preset
    if preset:
        found |= dict.fromkeys(collection.objects, preset)
    for child in collection.children:
        _collect_presets(child, preset, found)


def _in_light_of(look: Look, scene_look: Look) -> Look:
    """Return a look with the light, the tone, the paper and the unit of the look of a scene.

    Raises
    ------
    RosyError
        If `look` colors lines by values, but the look of the scene does not, so that no values are read.
    """
    if colors_values(look) and not colors_values(scene_look):
        raise RosyError("its colors show values: let the look of the scene show them, too")
    names = ["light", "shadows", "tone", "tone_lit"]
    if look.unit == "pixels":
        names += ["unit", "unit_size", "dpi"]
    if is_hatched(scene_look):
        names.append("paper_color")
    return replace(look, **{name: getattr(scene_look, name) for name in names})


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

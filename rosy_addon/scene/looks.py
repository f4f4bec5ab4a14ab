"""A look as Blender's properties, and back."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

from ..compositor.colour import from_hex, to_hex
from ..compositor.look import Look


def look_of(settings: Any) -> Look:
    """The look that properties hold.

    Parameters
    ----------
    settings : PropertyGroup
        ``scene.rosy``, or its ``look``.
    """
    group = getattr(settings, "look", settings)
    return Look(**{entry.name: exact(getattr(group, entry.name), entry) for entry in fields(Look)})


def apply_look(settings: Any, look: Look) -> None:
    """Give the properties of ``scene.rosy``, or its ``look``, the values of a look."""
    group = getattr(settings, "look", settings)
    for entry in fields(Look):
        value = getattr(look, entry.name)
        setattr(group, entry.name, from_hex(value) if "colour" in entry.metadata else value)


def is_look_of(settings: Any, look: Look) -> bool:
    """Whether the properties hold a look, as far as Blender can tell numbers and colours apart."""
    held = look_of(settings)
    return all(_alike(getattr(held, each.name), getattr(look, each.name)) for each in fields(Look))


def _alike(one: Any, other: Any) -> bool:
    if isinstance(one, str):
        return one == other.lower()
    return math.isclose(one, other, rel_tol=1e-6)


def exact(value: Any, entry: Any) -> Any:
    """What was meant by what Blender keeps: the decimal number by one in single precision."""
    if "colour" in entry.metadata:
        return to_hex(value)
    if not isinstance(value, float):
        return value
    value = float(f"{value:.7g}")
    return min(max(value, entry.metadata["low"]), entry.metadata["high"])
